//! Tests of the checker: its intervals against exact integers, its lemmas and its rules on cases made by hand.

/// Returns `all`, or `few` with `BENCH_DRAGON_CASES=few`.
fn cases(all: usize, few: usize) -> usize {
    if std::env::var_os("BENCH_DRAGON_CASES").is_some_and(|cases| cases == "few") { few } else { all }
}

mod clearance;
mod intervals;
mod lemmas;
mod rules;
