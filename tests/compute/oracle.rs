//! An independent check of a scene's events: its own paths, followers, boards and searches, and random scenes on which
//! the program must agree with it. The check shares no code with the library; only [`program_events`] calls the
//! library.
//!
//! `BENCH_DRAGON_ORACLE_SEED` and `BENCH_DRAGON_ORACLE_SCENES` select other scenes and their number.
//! `BENCH_DRAGON_LONG` runs 10,000 scenes; `BENCH_DRAGON_ORACLE_FILE` checks the scene in a file.

pub mod chain;
mod comparison;
mod contact;
pub mod geometry;
pub mod links;
pub mod scenes;

use bench_dragon::motion::event::unreported;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, mpsc};
use std::time::{Duration, Instant};

use crate::harness;
use chain::Chain;
use comparison::{CheckerResult, Comparison, verdict};
use scenes::{FAMILIES, Random, random_scene, read, with_ends};

/// One event as the program reports it.
#[derive(Clone, Debug)]
struct Event {
    kind: &'static str,
    time: f64,
    bench_a: Option<usize>,
    bench_b: Option<usize>,
    x: Option<f64>,
    y: Option<f64>,
}

/// Returns the events of a scene by the program, or the sentence that refuses the scene.
fn program_events(scene_toml: &str) -> Result<Vec<Event>, String> {
    use bench_dragon::motion::timeline::TimedEvent;
    use bench_dragon::show::scene::Scene;
    let scene = Scene::parse(scene_toml, "oracle", "oracle").map_err(|error| error.to_string())?;
    let timeline = scene.ensemble.timeline(&mut unreported);
    assert_eq!(timeline.searched_until(), None, "the program's search gave up");
    let event = |timed: &TimedEvent| Event {
        kind: timed.event.kind.name(),
        time: timed.time,
        bench_a: timed.event.bench_a.map(|bench| bench as usize),
        bench_b: timed.event.bench_b.map(|bench| bench as usize),
        x: timed.event.place.map(|place| place.x),
        y: timed.event.place.map(|place| place.y),
    };
    Ok(timeline.events().iter().map(event).collect())
}

/// Time after which a scene is given up. The program's searches take a few seconds at most, on a processor of their own.
/// `tests/run` gives these tests only the time that all others leave.
const PATIENCE: Duration = Duration::from_secs(1800);

/// Runs [`program_events`] with a watchdog; returns `None` if the search hangs or panics.
fn program_answers(scene_toml: &str) -> Option<Result<Vec<Event>, String>> {
    let (sender, receiver) = mpsc::channel();
    let text = scene_toml.to_owned();
    std::thread::spawn(move || sender.send(program_events(&text)));
    receiver.recv_timeout(PATIENCE).ok()
}

/// Counts and failures of all scenes, by family.
#[derive(Default)]
struct Tally {
    counts: BTreeMap<(usize, &'static str), usize>,
    failures: Vec<String>,
    ambiguous: Vec<String>,
}

impl Tally {
    fn count(&mut self, family: usize, what: &'static str) {
        *self.counts.entry((family, what)).or_default() += 1;
    }

    fn total(&self, what: &str) -> usize {
        self.counts.iter().filter(|((_, kind), _)| *kind == what).map(|(_, count)| count).sum()
    }

    fn add(&mut self, family: usize, name: &str, text: &str, found: Option<Comparison>) {
        self.count(family, "scenes");
        let Some(found) = found else { return self.count(family, "refused") };
        for kind in found.compared {
            self.count(family, kind);
        }
        if !found.ambiguous.is_empty() {
            self.count(family, "ambiguous");
            self.ambiguous.push(format!("{name}: {:?}", found.ambiguous));
        }
        // A scene in doubt is not counted as a failure.
        if !found.failures.is_empty() && found.ambiguous.is_empty() {
            self.count(family, "failed");
            self.failures.push(format!("==== {name}\n{}\n{text}", found.failures.join("\n")));
        }
    }

    fn print(&self) {
        for (family, name) in FAMILIES.iter().enumerate() {
            let counts = self.counts.iter().filter(|((of, _), _)| *of == family);
            let counts: Vec<_> = counts.map(|((_, what), count)| format!("{what} {count}")).collect();
            println!("{name}: {}", counts.join(", "));
        }
        println!("ambiguous: {:#?}", self.ambiguous);
    }
}

/// Compares one scene; returns `None` if the program refuses it.
fn compare(text: &str) -> Option<Comparison> {
    let events = match program_answers(text) {
        Some(Err(_)) => return None,
        Some(Ok(events)) => events,
        None => return Some(Comparison::failed(format!("no answer in {PATIENCE:?}, or a panic"))),
    };
    let (team, path) = read(text);
    Some(Comparison::of(&team, &path, &events))
}

fn number_from(variable: &str) -> Option<u64> {
    std::env::var(variable).ok().map(|value| value.parse().expect("a whole number"))
}

/// Compares `count` scenes with brute force. Each scene has its own seed, so that it can be reproduced without the
/// others.
fn compared(
    count: usize,
    seed: u64,
    text_of: impl Fn(usize, u64) -> String + Sync,
    family_of: impl Fn(usize) -> usize + Sync,
) -> Tally {
    let (next, tally) = (AtomicUsize::new(0), Mutex::new(Tally::default()));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= count {
                        return;
                    }
                    let family = family_of(index);
                    let text = text_of(family, index as u64);
                    let started = Instant::now();
                    let found = compare(&text);
                    let name = format!("{} scene {index} of seed {seed}", FAMILIES[family]);
                    if started.elapsed() > Duration::from_secs(2) {
                        println!("{name}: {:.1?}", started.elapsed());
                    }
                    tally.lock().unwrap().add(family, &name, &text, found);
                }
            });
        }
    });
    let tally = tally.into_inner().unwrap();
    tally.print();
    assert!(tally.failures.is_empty(), "{} scenes\n{}", tally.failures.len(), tally.failures.join("\n"));
    tally
}

/// Teams whose head and tail have other widths, and whose tail has another length.
#[test]
fn the_program_agrees_with_brute_force_on_heads_and_tails_of_their_own_size() {
    let seed = number_from("BENCH_DRAGON_ORACLE_SEED").unwrap_or(2);
    let scenes = harness::cases(14, 100, 2_000);
    let text_of = |family, index| {
        let mut random = Random(seed << 32 | index);
        let text = random_scene(family, &mut random);
        with_ends(&text, &mut random)
    };
    let tally = compared(scenes, seed, text_of, |index| index % FAMILIES.len());
    for (kind, share) in [("contact", 0.2), ("stall", 0.3), ("lock", 0.3)] {
        let least = (share * scenes as f64) as usize;
        assert!(tally.total(kind) >= least, "only {} of {kind}, expected {least}", tally.total(kind));
    }
}

#[test]
fn the_program_agrees_with_brute_force() {
    if let Ok(file) = std::env::var("BENCH_DRAGON_ORACLE_FILE") {
        let found = compare(&std::fs::read_to_string(file).unwrap()).expect("the program refuses the scene");
        println!("ambiguous: {:?}", found.ambiguous);
        assert!(found.failures.is_empty(), "{}", found.failures.join("\n"));
        return;
    }
    let seed = number_from("BENCH_DRAGON_ORACLE_SEED").unwrap_or(1);
    let given = number_from("BENCH_DRAGON_ORACLE_SCENES").map(|scenes| scenes as usize);
    let scenes = given.unwrap_or_else(|| harness::cases(10, 200, 10_000));
    let text_of = |family, index| random_scene(family, &mut Random(seed << 32 | index));
    let tally = compared(scenes + scenes / 4, seed, text_of, |index| {
        if index < scenes { index % (FAMILIES.len() - 1) } else { FAMILIES.len() - 1 }
    });
    // Shares a little below those observed: a comparison without events proves nothing.
    for (kind, share) in
        [("contact", 0.12), ("no contact", 0.3), ("stall", 0.4), ("no stall", 0.1), ("lock", 0.4), ("path_end", 0.2)]
    {
        let least = (share * scenes as f64) as usize;
        assert!(tally.total(kind) >= least, "only {} of {kind}, expected {least}", tally.total(kind));
    }
    assert!(tally.total("ambiguous") * 50 <= scenes, "{} scenes are ambiguous", tally.total("ambiguous"));
}

fn verdict_of(text: &str) -> CheckerResult {
    let (team, path) = read(text);
    verdict(&Chain::new(&path, &team))
}

fn team(benches: usize, head: f64, body: f64, width: f64, inset: f64) -> String {
    format!(
        "[team]\nbenches = {benches}\nhead_length = {head:?}\nbody_length = {body:?}\nwidth = {width:?}\n\
         hole_inset = {inset:?}\n[path]\nkind = \"pieces\"\n"
    )
}

/// Returns segments as TOML: `line(metres)` and `arc(radius, turns)`, negative turns to the right.
fn route(segments: &[[f64; 2]]) -> String {
    segments
        .iter()
        .map(
            |&[size, turns]| {
                if turns == 0.0 { scenes::line(size) } else { scenes::arc(size, turns.abs(), turns > 0.0) }
            },
        )
        .collect()
}

fn assert_near(found: f64, known: f64, tolerance: f64) {
    println!("{found:.15}, known {known:.15}");
    assert!((found - known).abs() <= tolerance, "{found:.15}, known {known:.15}");
}

/// Figures of the paper's scene, computed with 50 digits.
#[test]
#[ignore = "tests/run --all"]
fn the_oracle_knows_the_paper_scene() {
    let scene = team(223, 3.41, 2.2, 0.3, 0.275).replace("\"pieces\"", "\"spiral\"\npitch = 0.55\nstart_turn = 16");
    let verdict = verdict_of(&scene);
    let contact = verdict.contact.unwrap().unwrap();
    assert_near(contact.head, 412.473837682115, 1e-10);
    let ((stall, stalled), (lock, locked)) = (verdict.stall.unwrap(), verdict.lock.unwrap());
    assert_near(stall, 432.758134083656, 1e-10);
    assert_near(lock, 432.917924228383, 1e-10);
    assert_eq!((contact.benches, stalled, locked), ((0, 8), 0, 0));
}

/// Figures that another brute force found with 113 bits.
#[test]
fn the_oracle_finds_what_another_oracle_found() {
    let stall_of = |scene: String| verdict_of(&scene).stall.unwrap().0;
    let missed = team(20, 3.41, 2.2, 0.3, 0.275) + &route(&[[5.0, 0.0], [0.03, 0.5], [20.0, 0.0]]);
    assert_near(stall_of(missed), 5.047441916962, 1e-11);
    let segments = [
        [20.73, 0.0],
        [0.021277099139995617, -0.2415370362213321],
        [0.02770720113482116, 0.11516399630650424],
        [0.010232884755659723, -0.3446585013052239],
        [0.06698729339347953, 0.0],
        [1.4814300271320127, 0.3],
        [0.45003651420582474, 0.3],
        [0.2124983195012388, 0.4388383685251883],
        [0.023210627810562143, 0.0],
        [0.3271720035995628, 0.0],
    ];
    assert_near(stall_of(team(14, 2.63, 1.9, 0.4, 0.45) + &route(&segments)), 20.79056, 1e-5);
    let segments = [
        [15.73, 0.0],
        [0.010077025143215441, -0.25955572291751955],
        [0.507347784935104, 0.4493062280894443],
        [0.038008853957396976, 0.0],
        [0.013335265373781048, 1.0],
    ];
    assert_near(stall_of(team(9, 2.63, 1.9, 0.05, 0.45) + &route(&segments)), 15.74589, 1e-5);
    let segments = [
        [19.994074807700006, 0.0],
        [3.0, -0.75],
        [2.1, 0.0],
        [0.3, 0.25],
        [0.36, 0.0],
        [0.01, 1.0],
        [0.039788735772973836, 4.0],
    ];
    let scene = team(12, 1.7, 3.7, 0.05, 0.6) + "start = [0.0, 0.0]\nheading_turns = 0.25\n" + &route(&segments);
    let contact = verdict_of(&scene).contact.unwrap().unwrap();
    assert_near(contact.head, 37.145313188924, 1e-11);
    assert_eq!(contact.benches, (1, 8));
    // Followers that once jumped, on a turnaround and on a route with spirals.
    let scene = |name: &str| std::fs::read_to_string(format!("tests/scenes/{name}.toml")).unwrap();
    let pushed_back = verdict_of(&scene("lk_25"));
    assert_near(pushed_back.stall.unwrap().0, 7.663892664, 1e-8);
    assert!(pushed_back.lock.is_none() && pushed_back.doubts.is_empty());
    assert_near(verdict_of(&scene("jump_nostall_361")).lock.unwrap().0, 51.55012, 1e-5);
}
