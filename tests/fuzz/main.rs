//! The fuzz targets as tests that run everywhere: the corpus, the initial inputs, and a fixed number of seeded changes
//! of both.
//!
//! Each target takes some seconds. `BENCH_DRAGON_LONG=1` runs a hundred times as many cases; `BENCH_DRAGON_FUZZ_CASES`
//! and `BENCH_DRAGON_FUZZ_SEED` set their number and select other cases. An input that fails is written to the folder
//! for temporary files. It belongs in `tests/fuzz/corpus` once the fault is fixed.

#[path = "../harness/mod.rs"]
mod harness;
mod targets;

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, Once, PoisonError, mpsc};
use std::time::Duration;

use fastrand::Rng;
// The program's macros name its module by its path from the root.
#[allow(unused_imports, reason = "the macros use it")]
use targets::command_line::program::commands;
use targets::{TARGETS, Target};

/// One case in this many begins with a kept input: those are larger, and slow.
const KEPT: u32 = 64;
/// Changed inputs per initial input that are kept as starts of later cases.
const CHANGES_KEPT: usize = 3;

/// The time after which a case counts as hung. The slowest case takes a second, and a busy machine may leave a case no
/// time for long.
const HUNG: Duration = Duration::from_secs(300);

/// The name of the threads that run cases.
const CASES: &str = "cases";
/// The name of the test of files, whose panics are of no target.
const FILES: &str = "every_target_is_built_for_libfuzzer_and_every_kept_input_belongs_to_one";

/// Panics so far in threads that a target has started, such as a server's. No one knows which target: several run at
/// the same time. The place in the sentence shows it.
static PANICS: Mutex<Vec<String>> = Mutex::new(Vec::new());

fn panics() -> MutexGuard<'static, Vec<String>> {
    PANICS.lock().unwrap_or_else(PoisonError::into_inner)
}

fn count_panics() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            let thread = std::thread::current();
            let is_own = thread
                .name()
                .is_some_and(|name| [CASES, FILES].contains(&name) || TARGETS.iter().any(|target| name == target.name));
            if !is_own {
                panics().push(info.to_string());
            }
            before(info);
        }));
    });
}

/// Returns the kept inputs of a target, including scenes that were once answered wrongly.
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

/// Runs an input: returns true if it was accepted, or the error.
fn outcome(target: &Target, input: &[u8]) -> Result<bool, String> {
    let before = panics().len();
    let said = |panic: Box<dyn Any + Send>| match panic.downcast::<String>() {
        Ok(text) => *text,
        Err(panic) => panic.downcast_ref::<&str>().copied().unwrap_or("a panic").to_owned(),
    };
    let run = catch_unwind(AssertUnwindSafe(|| (target.run)(input)));
    match run {
        Ok(_) if panics().len() > before => Err(format!(
            "a thread of this target, or of one that runs at the same time, {}",
            panics()[before..].join("; and then ")
        )),
        run => run.map_err(said),
    }
}

/// Writes an input that fails to a file and returns its path.
fn written(target: &Target, input: &[u8]) -> PathBuf {
    let hash = blake3::hash(input).to_hex();
    let file = std::env::temp_dir().join(format!("fuzz-{}-{}", target.name, &hash[..12]));
    std::fs::write(&file, input).unwrap();
    file
}

/// Returns an input at random. Each is as likely as it is short: long ones take as much time together as short ones.
fn chosen<'i>(inputs: &'i [Vec<u8>], random: &mut Rng) -> &'i Vec<u8> {
    let weight = |input: &Vec<u8>| 1.0 / (64 + input.len()) as f64;
    let mut left = random.f64() * inputs.iter().map(weight).sum::<f64>();
    let at = inputs.iter().position(|input| {
        left -= weight(input);
        left < 0.0
    });
    &inputs[at.unwrap_or(0)]
}

fn fuzz(name: &str) {
    count_panics();
    let target = TARGETS.iter().find(|target| target.name == name).unwrap();
    let times = if harness::long() { 100 } else { 1 };
    let cases = setting("BENCH_DRAGON_FUZZ_CASES").unwrap_or(times * target.cases);
    let mut random = Rng::with_seed(setting("BENCH_DRAGON_FUZZ_SEED").unwrap_or(1));
    let corpus: Vec<Vec<u8>> = kept(name).into_iter().map(|(_, input)| input).collect();
    let seeds = (target.seeds)();
    let (next, cases_to_run) = mpsc::sync_channel::<Vec<u8>>(0);
    let (done, results) = mpsc::channel();
    let worker = std::thread::Builder::new().name(CASES.to_owned()).spawn(move || {
        for input in cases_to_run {
            let _ = done.send(outcome(target, &input));
        }
    });
    let worker = worker.unwrap();
    let run = |input: &[u8]| {
        next.send(input.to_vec()).unwrap();
        match results.recv_timeout(HUNG) {
            Ok(Ok(got_in)) => got_in,
            Ok(Err(why)) => panic!("{name}: {} fails: {why}", written(target, input).display()),
            Err(_) => panic!("{name}: {} fails: no end within {:?}", written(target, input).display(), HUNG),
        }
    };
    for input in corpus.iter().chain(&seeds) {
        run(input);
    }
    let mut got_in = 0;
    let mut inputs = seeds.clone();
    for _ in 0..cases {
        let from_kept = inputs.is_empty() || !corpus.is_empty() && random.u32(..KEPT) == 0;
        let from = if from_kept { &corpus[random.usize(..corpus.len())] } else { chosen(&inputs, &mut random) };
        let input = (target.mutate)(from, &mut random);
        let is_in = run(&input);
        got_in += u64::from(is_in);
        // Accepted inputs are changed again; changes of refused inputs reach no further code.
        if is_in && !from_kept && random.u8(..10) == 0 {
            if inputs.len() < CHANGES_KEPT * seeds.len() {
                inputs.push(input);
            } else {
                let at = random.usize(seeds.len()..inputs.len());
                inputs[at] = input;
            }
        }
    }
    drop(next);
    worker.join().unwrap();
    let (kept, seeds) = (corpus.len(), seeds.len());
    println!(
        "{name}: {kept} files of the corpus, {seeds} inputs to begin with, {cases} changed ones, of which {got_in} got in"
    );
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
fn timecode() {
    fuzz("timecode");
}

#[test]
fn design_page() {
    fuzz("design_page");
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
        // The package does not contain this folder.
        if root.join("fuzz").exists() {
            assert!(root.join(format!("fuzz/fuzz_targets/{name}.rs")).exists(), "{name}");
        }
    }
    // The target `command_line` compiles the program's sources.
    if let Ok(manifest) = std::fs::read_to_string(root.join("fuzz/Cargo.toml")) {
        let ours: toml::Table = std::fs::read_to_string(root.join("Cargo.toml")).unwrap().parse().unwrap();
        let manifest: toml::Table = manifest.parse().unwrap();
        let commands = ours["features"]["commands"].as_array().unwrap().iter().map(|feature| feature.as_str().unwrap());
        for needed in commands.filter_map(|feature| feature.strip_prefix("dep:")) {
            assert!(manifest["dependencies"].get(needed).is_some(), "fuzz/Cargo.toml does not have {needed}");
        }
    }
    for folder in std::fs::read_dir(root.join("tests/fuzz/corpus")).unwrap() {
        let name = folder.unwrap().file_name();
        assert!(TARGETS.iter().any(|target| name == target.name), "{name:?}");
    }
}
