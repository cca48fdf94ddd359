//! Tests of the checker: its intervals against exact integers, its lemmas and its rules on cases made by hand.

/// Returns `few`, or `all` with `BENCH_DRAGON_ALL=1`.
fn cases(all: usize, few: usize) -> usize {
    if std::env::var_os("BENCH_DRAGON_ALL").is_some_and(|value| value == "1") { all } else { few }
}

mod clearance;
mod intervals;
mod lemmas;
mod rules;
