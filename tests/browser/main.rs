//! The stage page in a real browser.

mod conduct;
#[path = "../harness/mod.rs"]
mod harness;
mod looks;
mod proved;
mod several;
mod view;

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use harness::{Process, can_run, chromium, python, python_modules, text, unique};

/// One browser at a time: a second one would leave neither the processor that it needs.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
/// Scenarios started so far: a publisher's name has its number, and is as short as a user's.
static STARTED: AtomicUsize = AtomicUsize::new(0);

/// Runs a scenario of a script in `tests/python`, with the program, a publisher's name and more arguments.
fn run_scenario(script: &str, scenario: &str, more: &[&str]) {
    if !can_run(chromium().and_then(|()| python_modules(&["playwright", "numpy"]))) {
        return;
    }
    let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let name = unique(&format!("{}{}", &scenario[..5], STARTED.fetch_add(1, Ordering::Relaxed)));
    let mut run = python();
    run.arg(format!("tests/python/{script}")).args([scenario, env!("CARGO_BIN_EXE_bench-dragon"), &name]).args(more);
    let output = Process::start(&mut run).output();
    println!("{}", text(&output.stdout));
    assert!(output.status.success(), "{}", text(&output.stderr));
}
