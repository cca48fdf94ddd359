//! The stage page in a real browser.

mod conduct;
mod design;
#[path = "../harness/mod.rs"]
mod harness;
mod looks;
mod proved;
mod scrub;
mod several;
mod sheets;
mod view;

use std::io::Write;
use std::process::ChildStdin;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use harness::{Lines, Process, can_run, chromium, python, python_modules, unique};
use serde_json::{Value, json};

/// The process that runs the scenarios, one at a time: a second browser would leave neither the processor that it needs.
/// It ends with its input, and so with this program.
static SCENARIOS: Mutex<Option<Scenarios>> = Mutex::new(None);
/// Scenarios started so far: a publisher's name has its number, and is as short as a user's.
static STARTED: AtomicUsize = AtomicUsize::new(0);

/// Runs a scenario of a script in `tests/python`, with the program, a publisher's name and more arguments.
fn run_scenario(script: &str, scenario: &str, more: &[&str]) {
    if !can_run(chromium().and_then(|()| python_modules(&["playwright", "numpy"]))) {
        return;
    }
    let mut kept = SCENARIOS.lock().unwrap_or_else(PoisonError::into_inner);
    let mut scenarios = kept.take().unwrap_or_else(Scenarios::start);
    let name = unique(&format!("{}{}", &scenario[..5], STARTED.fetch_add(1, Ordering::Relaxed)));
    let mut call = vec![script, scenario, env!("CARGO_BIN_EXE_bench-dragon"), &name];
    call.extend(more);
    writeln!(scenarios.input, "{}", json!(call)).unwrap();
    let ended: Value = serde_json::from_str(&scenarios.lines.until("\"failure\":")).unwrap();
    println!("{}", ended["printed"].as_str().unwrap());
    let errors = scenarios.errors.so_far().join("\n");
    assert!(ended["failure"].is_null(), "{}{errors}", ended["failure"].as_str().unwrap_or_default());
    *kept = Some(scenarios);
}

/// `tests/python/scenarios.py`.
struct Scenarios {
    input: ChildStdin,
    lines: Lines,
    errors: Lines,
    _process: Process,
}

impl Scenarios {
    fn start() -> Self {
        let (mut process, input) = Process::start_with_input(python().arg("tests/python/scenarios.py"));
        let (lines, errors) = (process.lines(), process.error_lines());
        Self { input, lines, errors, _process: process }
    }
}
