//! The fuzz targets as tests that run everywhere: the corpus, the inputs to begin with, and a fixed number of seeded changes
//! of them.
//!
//! Each target has a share of seconds; `BENCH_DRAGON_LONG=1` runs a hundred times as many cases, and `BENCH_DRAGON_FUZZ_CASES`
//! and `BENCH_DRAGON_FUZZ_SEED` choose how many, and others. An input that fails is written to the folder for temporary
//! files, and belongs into `tests/fuzz/corpus` once what it found is mended.

#[path = "../processes/mod.rs"]
mod processes;
mod targets;

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Once, mpsc};
use std::time::Duration;

use fastrand::Rng;
use targets::{TARGETS, Target};

/// After so long a case has hung. A search for events may take all of its limit of work, on a machine that is busy.
const HUNG: Duration = Duration::from_secs(1200);

/// The name of the threads that run cases.
const CASES: &str = "cases";

/// Panics so far of threads that a target has started, such as a server's.
static PANICS: AtomicU64 = AtomicU64::new(0);

fn count_panics() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            let thread = std::thread::current();
            let is_own =
                thread.name().is_some_and(|name| name == CASES || TARGETS.iter().any(|target| name == target.name));
            PANICS.fetch_add(u64::from(!is_own), Ordering::SeqCst);
            before(info);
        }));
    });
}

/// The inputs that are kept for a target: scenes that were once answered wrongly are, too.
fn kept(name: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let folders = [tests.join("fuzz/corpus").join(name), tests.join(format!("{name}s"))];
    let files = folders.iter().filter_map(|folder| std::fs::read_dir(folder).ok());
    let files = files.flatten().map(|file| file.unwrap().path());
    let mut files: Vec<_> = files.map(|file| (file.clone(), std::fs::read(file).unwrap())).collect();
    files.sort();
    files
}

fn setting(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|value| value.parse().unwrap_or_else(|_| panic!("{name} is {value}")))
}

/// Runs an input; what went wrong, where something did.
fn failure(target: &Target, input: &[u8]) -> Option<String> {
    let before = PANICS.load(Ordering::SeqCst);
    let said = |panic: Box<dyn Any + Send>| match panic.downcast::<String>() {
        Ok(text) => *text,
        Err(panic) => panic.downcast_ref::<&str>().copied().unwrap_or("a panic").to_owned(),
    };
    let run = catch_unwind(AssertUnwindSafe(|| (target.run)(input)));
    let elsewhere = || (PANICS.load(Ordering::SeqCst) != before).then(|| "another thread panicked".to_owned());
    run.err().map(said).or_else(elsewhere)
}

/// Where an input that fails is left.
fn written(target: &Target, input: &[u8]) -> PathBuf {
    let hash = blake3::hash(input).to_hex();
    let file = std::env::temp_dir().join(format!("fuzz-{}-{}", target.name, &hash[..12]));
    std::fs::write(&file, input).unwrap();
    file
}

fn fuzz(name: &str) {
    count_panics();
    let target = TARGETS.iter().find(|target| target.name == name).unwrap();
    let times = if processes::long() { 100 } else { 1 };
    let cases = setting("BENCH_DRAGON_FUZZ_CASES").unwrap_or(times * target.cases);
    let mut random = Rng::with_seed(setting("BENCH_DRAGON_FUZZ_SEED").unwrap_or(1));
    let corpus = kept(name);
    let mut inputs: Vec<Vec<u8>> = corpus.iter().map(|(_, input)| input.clone()).chain((target.seeds)()).collect();
    assert!(!inputs.is_empty(), "nothing to begin with");
    let began_with = inputs.len();
    let (next, cases_to_run) = mpsc::sync_channel::<Vec<u8>>(0);
    let (done, results) = mpsc::channel();
    let worker = std::thread::Builder::new().name(CASES.to_owned()).spawn(move || {
        for input in cases_to_run {
            let _ = done.send(failure(target, &input));
        }
    });
    let worker = worker.unwrap();
    let run = |input: Vec<u8>| {
        next.send(input.clone()).unwrap();
        let failed = match results.recv_timeout(HUNG) {
            Ok(failed) => failed,
            Err(_) => Some(format!("no end within {HUNG:?}")),
        };
        if let Some(why) = failed {
            panic!("{name}: {} fails: {why}", written(target, &input).display());
        }
    };
    for input in inputs.clone() {
        run(input);
    }
    for _ in 0..cases {
        let from = &inputs[random.usize(..inputs.len())];
        let input = (target.mutate)(from, &mut random);
        run(input.clone());
        // Changes of changes, too: a tenth stands in for what there was.
        if random.u8(..10) == 0 {
            if inputs.len() < 4 * began_with {
                inputs.push(input);
            } else {
                let at = random.usize(began_with..inputs.len());
                inputs[at] = input;
            }
        }
    }
    drop(next);
    worker.join().unwrap();
    println!("{name}: {} files of the corpus, {began_with} inputs to begin with, {cases} changed ones", corpus.len());
}

#[test]
fn scene() {
    fuzz("scene");
}

#[test]
fn control() {
    fuzz("control");
}

#[test]
fn page() {
    fuzz("page");
}

#[test]
fn recording() {
    fuzz("recording");
}

#[test]
fn log() {
    fuzz("log");
}

#[test]
fn certificate() {
    fuzz("certificate");
}

#[test]
fn environment() {
    fuzz("environment");
}

#[test]
fn command_line() {
    fuzz("command_line");
}

/// Each target has a file for libFuzzer, and each folder of the corpus a target.
#[test]
fn every_target_is_built_for_libfuzzer_and_every_kept_input_belongs_to_one() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for Target { name, .. } in &TARGETS {
        // The package does not hold them.
        if root.join("fuzz").exists() {
            assert!(root.join(format!("fuzz/fuzz_targets/{name}.rs")).exists(), "{name}");
        }
    }
    for folder in std::fs::read_dir(root.join("tests/fuzz/corpus")).unwrap() {
        let name = folder.unwrap().file_name();
        assert!(TARGETS.iter().any(|target| name == target.name), "{name:?}");
    }
}
