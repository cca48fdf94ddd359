//! The number of random cases of a test. In: the environment that `tests/run` sets. Out: the number.

/// Returns an eighth of the random cases, all of them with `BENCH_DRAGON_ALL=1`, and ten times as many if the tests that
/// take hours are requested.
pub fn cases(all: u32) -> u32 {
    let is_set = |variable| std::env::var_os(variable).is_some_and(|value| value == "1");
    match () {
        () if is_set("BENCH_DRAGON_LONG") => 10 * all,
        () if is_set("BENCH_DRAGON_ALL") => all,
        () => all / 8,
    }
}
