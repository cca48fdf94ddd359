//! The table of commands, compared with every file that repeats its numbers and names.

use std::collections::BTreeSet;

use bench_dragon::messages::control::{Code, Command, CommandEntry, CommandValue, RATES};

const LAYOUTS: &str = include_str!("../../crates/messages/src/layouts/control.rs");
const PYTHON: &str = include_str!("../../packaging/python/bench_dragon/control.py");
const CONDUCTING: &str = include_str!("../../docs/conducting.md");
const ROS2: &str = include_str!("../../docs/ros2.md");
const BAR: &str = include_str!("../../crates/outputs/src/view/conduct.js");

/// Returns the text of `file` between `begin` and the next `end`.
fn between<'a>(file: &'a str, begin: &str, end: &str) -> &'a str {
    let (_, rest) = file.split_once(begin).unwrap_or_else(|| panic!("no {begin}"));
    rest.split_once(end).unwrap_or_else(|| panic!("no {end} after {begin}")).0
}

fn numbered<'a>(words: impl Iterator<Item = &'a str>) -> String {
    let words: Vec<_> = words.enumerate().map(|(number, word)| format!("{number} {word}")).collect();
    format!("    /// {}.\n", words.join(", "))
}

#[test]
fn the_layouts_list_every_command_and_code() {
    let commands = numbered(Command::TABLE.iter().map(|entry| entry.name));
    assert!(LAYOUTS.contains(&format!("{commands}    pub command: u32,\n")), "expected {commands}");
    let codes = numbered(Code::TABLE.iter().map(|entry| entry.words));
    assert!(LAYOUTS.contains(&format!("{codes}    pub code: u32,\n")), "expected {codes}");
}

#[test]
fn the_python_module_has_every_command_and_code() {
    let tuple = |words: Vec<&str>| words.iter().map(|word| format!("\"{word}\"")).collect::<Vec<_>>().join(", ");
    let commands = tuple(Command::TABLE.iter().map(|entry| entry.name).collect());
    assert_eq!(between(PYTHON, "\nCOMMANDS = (", ")\n"), commands);
    let codes = tuple(Code::TABLE.iter().map(|entry| entry.words).collect());
    assert_eq!(between(PYTHON, "\nCODES = (", ")\n"), codes);
}

/// Returns the least and the greatest rate, as the pages print them.
fn rates() -> String {
    format!("{:e} to {:e}", RATES.start(), RATES.end())
}

#[test]
fn the_pages_print_the_range_of_rates() {
    assert_eq!([CONDUCTING, ROS2].map(|page| page.matches(&rates()).count()), [1, 1]);
}

/// The stage page sends commands by name, in calls of `command`.
#[test]
fn the_stage_page_sends_commands_of_the_table() {
    let calls = BAR.split("command(").skip(1).map(|rest| rest.split([';', '\n']).next().unwrap());
    let names: BTreeSet<&str> = calls.flat_map(|call| call.split('"').skip(1).step_by(2)).collect();
    let unknown: Vec<_> = names.iter().filter(|name| **name != "toggle" && Command::named(name).is_none()).collect();
    assert!(unknown.is_empty() && names.len() > 7, "{unknown:?} of {names:?}");
}

/// Returns the cell of the page's first column that a command stands in.
fn cell(entry: &CommandEntry) -> String {
    let letter = match entry.value {
        CommandValue::None => return format!("`{}`", entry.name),
        CommandValue::Rate => "X",
        CommandValue::Seconds => "T",
        CommandValue::Periods => "N",
    };
    format!("`{} {letter}`", entry.name)
}

#[test]
fn the_page_lists_every_command_and_those_that_a_hold_refuses() {
    let rows = between(CONDUCTING, "| command | does | refused |\n|---|---|---|\n", "\n\n");
    let rows: Vec<Vec<&str>> =
        rows.lines().map(|row| row.trim_matches('|').split('|').map(str::trim).collect()).collect();
    let listed: Vec<&str> = rows.iter().flat_map(|row| row[0].split(", ")).filter(|name| *name != "`toggle`").collect();
    assert_eq!(listed, Command::TABLE.iter().map(cell).collect::<Vec<_>>());
    for entry in &Command::TABLE {
        let row = rows.iter().find(|row| row[0].split(", ").any(|name| name == cell(entry))).unwrap();
        assert_eq!(row[2].contains("while held"), !entry.allowed_while_held, "{row:?}");
    }
}

#[test]
fn the_command_line_has_every_command_with_its_help() {
    let mut control = std::process::Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    let printed = control.args(["control", "--help"]).env("COLUMNS", "1000").output().unwrap();
    let printed = String::from_utf8(printed.stdout).unwrap();
    let rows = between(&printed, "Commands:\n", "\n\n").lines().map(|line| line.trim().split_once(' ').unwrap());
    let rows =
        rows.filter(|(name, _)| !["toggle", "osc", "help"].contains(name)).map(|(name, help)| (name, help.trim()));
    let expected = Command::TABLE.iter().map(|entry| (entry.name, entry.help));
    assert_eq!(rows.collect::<Vec<_>>(), expected.collect::<Vec<_>>());
}
