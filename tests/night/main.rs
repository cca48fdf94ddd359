//! Bad nights of the loop, the show, the command queues, the statistics and a transport's queue. They run on simulated
//! time and under a simulated scheduler, from one seed. The nights have late wake-ups, stalls, a wall clock that is
//! set, slow and dying subscribers, floods of commands, a full shared memory. The promises of the design must hold
//! nevertheless.
//!
//! `BENCH_DRAGON_NIGHT_HOURS=hours` simulates that number of hours, `BENCH_DRAGON_NIGHT=seed` one night, with its last
//! events.

mod actors;
mod collected;
mod command_queues;
mod levels;
mod night;
mod oracle;
mod pace;
mod plan;
mod port;
mod random;
mod tally;
mod world;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::rc::Rc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use plan::{Plan, Stage};
use random::Random;
use tally::Tally;
use world::Trace;

/// Seeds of nights that once failed.
const KEPT: &str = include_str!("seeds.txt");
const HOURS: f64 = 10_000.0;
const FEW_HOURS: f64 = 1_000.0;
const LONG_HOURS: f64 = 1_000_000.0;
/// First seed of the long run, so that it repeats no night of the short run.
const LONG_SEEDS: u64 = 1 << 32;

/// True once a night has failed: no thread begins another.
static HAS_FAILED: AtomicBool = AtomicBool::new(false);

/// Plays the night of a seed; if it fails, prints the command that plays it again.
fn play(seed: u64, stages: &[Stage]) -> Tally {
    let trace = Rc::new(Trace::default());
    let played = catch_unwind(AssertUnwindSafe(|| night::play(seed, stages, &trace)));
    played.unwrap_or_else(|failure| {
        HAS_FAILED.store(true, Ordering::Relaxed);
        let plan = Plan::draw(&mut Random::new(seed), stages);
        eprintln!("the night of seed {seed} failed: {plan:?}; its last events:");
        trace.print();
        eprintln!(
            "again: BENCH_DRAGON_NIGHT={seed} cargo test --release --test night; keep it in tests/night/seeds.txt"
        );
        resume_unwind(failure)
    })
}

fn number<T: std::str::FromStr>(variable: &str) -> Option<T> {
    let text = std::env::var(variable).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{variable} is no number: {text}")))
}

#[test]
fn the_promises_hold_in_every_night() {
    let stages = Stage::all();
    if let Some(seed) = number("BENCH_DRAGON_NIGHT") {
        println!("{}", play(seed, &stages));
        return;
    }
    for seed in KEPT.lines().filter(|line| !line.starts_with('#')) {
        let seed = seed.split_whitespace().next().and_then(|seed| seed.parse().ok()).expect("a seed a line");
        play(seed, &stages);
    }
    let is = |name: &str, value: &str| std::env::var(name).is_ok_and(|given| given == value);
    let hours = match number("BENCH_DRAGON_NIGHT_HOURS") {
        Some(hours) => hours,
        None if is("BENCH_DRAGON_LONG", "1") => LONG_HOURS,
        None if is("BENCH_DRAGON_ALL", "1") => HOURS,
        None => FEW_HOURS,
    };
    let first = if hours > HOURS { LONG_SEEDS } else { 0 };
    let total = play_for(hours, first);
    println!("{total}");
    if hours >= HOURS {
        assert!(total.has_everything(), "something never happened in all these nights: {total:?}");
    }
}

/// Completed nights, counted in the order of their seeds, so that the sum is the same on every machine.
struct Played {
    /// The sum of all nights before `counted`.
    total: Tally,
    counted: u64,
    /// Later nights that were completed sooner.
    waiting: BTreeMap<u64, Tally>,
    printed: Instant,
}

impl Played {
    /// Counts a night, and the nights that waited for it, until there are `hours`.
    fn count(&mut self, seed: u64, night: Tally, hours: f64) {
        self.waiting.insert(seed, night);
        while self.total.hours() < hours
            && let Some(night) = self.waiting.remove(&self.counted)
        {
            self.total.add(&night);
            self.counted += 1;
        }
    }
}

/// Plays nights on every core until `hours` hours are simulated.
fn play_for(hours: f64, first: u64) -> Tally {
    let (next, began) = (AtomicU64::new(first), Instant::now());
    let played =
        Mutex::new(Played { total: Tally::default(), counted: first, waiting: BTreeMap::new(), printed: began });
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..cores {
            scope.spawn(|| {
                let stages = Stage::all();
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    let night = play(seed, &stages);
                    let mut played = played.lock().expect("no night failed");
                    played.count(seed, night, hours);
                    if played.printed.elapsed().as_secs() >= 60 {
                        played.printed = Instant::now();
                        let Played { counted, total, .. } = &*played;
                        eprintln!("{:.0} s, before seed {counted}: {total}", began.elapsed().as_secs_f64());
                    }
                    if played.total.hours() >= hours || HAS_FAILED.load(Ordering::Relaxed) {
                        return;
                    }
                }
            });
        }
    });
    played.into_inner().expect("no night failed").total
}

/// A night depends on its seed alone.
#[test]
fn a_seed_is_a_night() {
    let stages = Stage::all();
    for seed in 0..6 {
        let [first, again] = [(); 2].map(|()| format!("{:?}", play(seed, &stages)));
        assert_eq!(first, again);
    }
}
