//! A newcomer's half hour. Every command that a page prints for copying is read from the page. It is run in a copy of
//! the repository, in the order of the page. The lists of `list.rs` name the commands that are not run, each with its
//! reason.
//!
//! `bench-dragon` and `cargo run --release --` are the program that Cargo has built for this test. Each page has a
//! separate checkout, network and iceoryx2, so that pages do not interfere. Programs that run until they are stopped
//! continue until the section ends, or until the next program of their kind begins. After that, Ctrl-C must end them
//! with code 0.

mod list;
mod pages;
use crate::harness;
mod reader;
mod targets;
mod terminal;

use std::path::Path;
use std::sync::Mutex;

use harness::{aloud, can_run, long, python_modules, root};
use list::{INSTEAD, LONG, LOOKED_UP, NEEDS, NOT_HERE};
use pages::{Printed, Section, sections, without_variables};
use reader::Reader;

/// Number of pages that are read at once: most of a page's time is waiting.
const READERS: usize = 4;

/// The treatment of a command.
enum Treatment {
    Run(String),
    LookedUp,
    NotRun(String),
}

/// Returns the pages of the repository, except the history.
fn pages_of(root: &Path) -> Vec<String> {
    let folders = ["", "docs", "examples", "fuzz", "msgs", "config", "benches"];
    let names = folders.iter().flat_map(|folder| {
        let entries = std::fs::read_dir(root.join(folder)).unwrap();
        entries.map(|entry| Path::new(folder).join(entry.unwrap().file_name()).to_str().unwrap().to_owned())
    });
    let mut pages = Vec::from_iter(names.filter(|name| name.ends_with(".md") && name != "CHANGELOG.md"));
    pages.sort();
    pages
}

/// Returns the line of a list for a command.
fn line_for(command: &str, list: &[list::Line]) -> Option<list::Line> {
    list.iter().find(|(beginning, _)| without_variables(command).starts_with(beginning)).copied()
}

/// Returns true if the text only names a subcommand.
fn is_mention(printed: &Printed) -> bool {
    let words = Vec::from_iter(printed.text.split(' '));
    printed.inline && words.len() == 2 && words[0] == "bench-dragon" && !words[1].starts_with('-')
}

fn is_installed(program: &str) -> bool {
    std::env::split_paths(&reader::programs_path()).any(|folder| folder.join(program).exists())
}

fn verdict(printed: &Printed) -> Treatment {
    let text = &printed.text;
    if is_mention(printed) {
        return Treatment::Run(format!("{text} --help"));
    }
    if let Some((_, reason)) = line_for(text, NOT_HERE) {
        return Treatment::NotRun(reason.to_owned());
    }
    if line_for(text, LOOKED_UP).is_some() {
        return Treatment::LookedUp;
    }
    match line_for(text, NEEDS) {
        Some((_, programs)) if !programs.split(' ').all(is_installed) => {
            return Treatment::NotRun(format!("needs {programs}, which are not all installed"));
        }
        _ => (),
    }
    match line_for(text, LONG) {
        Some((_, reason)) if !long() => return Treatment::NotRun(format!("{reason}: BENCH_DRAGON_LONG=1 runs it")),
        _ => (),
    }
    let replaced = INSTEAD.iter().fold(text.clone(), |text, (from, to, _)| text.replace(from, to));
    Treatment::Run(replaced)
}

/// Runs the commands of a page and returns the errors.
fn read(root: &Path, page: &str, sections: &[Section]) -> Vec<String> {
    let mut reader = None;
    let mut failures = Vec::new();
    for section in sections {
        for printed in &section.commands {
            let outcome = match verdict(printed) {
                Treatment::Run(command) => reader.get_or_insert_with(|| Reader::new(root, page)).run(&command),
                Treatment::LookedUp => targets::look_up(root, &printed.text),
                Treatment::NotRun(_) => Ok(()),
            };
            failures.extend(outcome.err().map(|what| format!("{}: {what}", printed.place)));
        }
        failures.extend(reader.as_mut().and_then(|reader| reader.end_section().err()));
    }
    failures
}

/// Prints the commands that are not run, and those that are run in another form.
fn report(commands: &[&Printed]) {
    let (mut run, mut looked_up, mut not_run) = (0, 0, Vec::new());
    for printed in commands {
        match verdict(printed) {
            Treatment::Run(command) if command == printed.text => run += 1,
            Treatment::Run(command) => {
                run += 1;
                aloud(&format!("run as `{command}`: {}: {}", printed.place, printed.text));
            }
            Treatment::LookedUp => looked_up += 1,
            Treatment::NotRun(reason) => not_run.push((reason, &printed.place, &printed.text)),
        }
    }
    not_run.sort();
    for (reason, place, text) in &not_run {
        aloud(&format!("not run, {reason}: {place}: {text}"));
    }
    let (all, left) = (commands.len(), not_run.len());
    aloud(&format!("{all} commands: {run} run, {looked_up} of tests and benchmarks looked up, {left} not run"));
}

/// Asserts that every line of a list matches a command: an unused line hides a change of a page.
fn assert_lists_are_met(commands: &[&Printed]) {
    let begins =
        |beginning: &str| commands.iter().any(|printed| without_variables(&printed.text).starts_with(beginning));
    let lines = [NOT_HERE, LOOKED_UP, NEEDS, LONG].concat();
    let beginnings = lines.iter().map(|line| line.0).chain(reader::beginnings());
    let mut idle = Vec::from_iter(beginnings.filter(|beginning| !begins(beginning)));
    let parts = INSTEAD.iter().map(|line| line.0);
    idle.extend(parts.filter(|part| !commands.iter().any(|printed| printed.text.contains(part))));
    assert!(idle.is_empty(), "lines of tests/repository/newcomer/list.rs that no page needs: {idle:#?}");
}

#[test]
#[ignore = "tests/run --all"]
fn every_command_of_the_pages_runs() {
    let root_folder = &std::env::current_dir().unwrap();
    let pages = Vec::from_iter(pages_of(root_folder).into_iter().map(|page| {
        let sections = sections(root_folder, &page);
        (page, sections)
    }));
    let sections = pages.iter().flat_map(|(_, sections)| sections);
    let commands = Vec::from_iter(sections.flat_map(|section| &section.commands));
    assert!(commands.len() > 100, "{} commands on {} pages", commands.len(), pages.len());
    assert_lists_are_met(&commands);
    if !can_run(root("give each page a separate network"))
        || !can_run(python_modules(&["iceoryx2", "numpy", "cyclonedds", "websockets", "mcap", "mcap_ros2"]))
    {
        return;
    }
    report(&commands);
    let queue = Mutex::new(pages.iter().rev().collect::<Vec<_>>());
    let failures = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..READERS {
            scope.spawn(|| {
                while let Some((page, sections)) = { queue.lock().unwrap().pop() } {
                    let found = read(root_folder, page, sections);
                    failures.lock().unwrap().extend(found);
                }
            });
        }
    });
    let failures = failures.into_inner().unwrap();
    assert!(failures.is_empty(), "{} failures\n\n{}", failures.len(), failures.join("\n\n"));
}
