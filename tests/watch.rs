//! The monitor as people see it: `watch` in a terminal, what stands there, and its colours.
//!
//! The terminal is a pseudo-terminal and an emulator; what is checked in it stands in
//! `tests/python/watch_terminal.py`. Nothing asserts a speed.

mod processes;

use processes::{Process, python, text, unique};

fn in_a_terminal(scenario: &str) {
    let program = env!("CARGO_BIN_EXE_bench-dragon");
    let name = unique(&scenario[..6]);
    let arguments = ["tests/python/watch_terminal.py", scenario, program, &name];
    let output = Process::start(python().args(arguments)).output_within(120);
    println!("{}", text(&output.stdout));
    assert!(output.status.success(), "{}", text(&output.stderr));
}

#[test]
fn figures_are_redrawn_in_place() {
    in_a_terminal("figures_are_redrawn_in_place");
}

#[test]
fn colour_follows_no_color() {
    in_a_terminal("colour_follows_no_color");
}
