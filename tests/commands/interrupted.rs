//! Ctrl-C during a search: the command prints what it knows, says that it was stopped, and exits with 1.

use std::ffi::OsStr;
use std::fs::{File, read_to_string};
use std::io::Read;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use nix::pty::{Winsize, openpty};
use nix::sys::signal::Signal::SIGINT;
use nix::sys::signal::kill;
use nix::sys::stat::Mode;
use nix::unistd::Pid;
use serde_json::Value;

use crate::harness::{Process, json_lines, text, wait_until};

/// The bit of SIGINT in a mask of signals (proc(5), SigCgt).
const SIGINT_BIT: u64 = 1 << (SIGINT as u64 - 1);

/// Writes a scene whose events are found soon, and whose table takes long: 300,000 benches on a short spiral.
fn long_table(folder: &Path) -> PathBuf {
    let paper = read_to_string("config/paper.toml").unwrap();
    let file = folder.join("table.toml");
    std::fs::write(&file, paper.replace("benches = 223", "benches = 300_000")).unwrap();
    file
}

/// Interrupts a command as soon as it shows some words on the terminal. Returns its exit code, its standard output and
/// all that it has shown.
fn interrupted_at(words: &str, arguments: &[&OsStr]) -> (Option<i32>, String, String) {
    let window = Winsize { ws_row: 24, ws_col: 200, ws_xpixel: 0, ws_ypixel: 0 };
    let terminal = openpty(Some(&window), None).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    command.args(arguments).env("TERM", "xterm").stdin(Stdio::null()).stdout(Stdio::piped()).stderr(terminal.slave);
    let process = command.spawn().unwrap();
    // With it goes this process's end of the terminal.
    drop(command);
    let (mut terminal, mut shown, mut chunk) = (File::from(terminal.master), Vec::new(), [0; 4096]);
    let mut is_signalled = false;
    // On Linux, a terminal that no process has open any more is an error.
    while let Ok(count @ 1..) = terminal.read(&mut chunk) {
        shown.extend_from_slice(&chunk[..count]);
        if !is_signalled && text(&shown).contains(words) {
            kill(Pid::from_raw(process.id() as i32), SIGINT).unwrap();
            is_signalled = true;
        }
    }
    let output = process.wait_with_output().unwrap();
    (output.status.code(), text(&output.stdout), text(&shown))
}

/// Writes a scene whose searches take long: a team of 100,000 benches.
fn long_scene(folder: &Path) -> String {
    let paper = read_to_string("config/paper.toml").unwrap();
    let long = paper.replace("benches = 223", "benches = 100_000").replace("start_turn = 16", "start_turn = 400");
    let file = folder.join("long.toml");
    std::fs::write(&file, long).unwrap();
    file.to_str().unwrap().to_owned()
}

/// Waits until a process handles the signal.
fn handles_interrupts(process: &Process) {
    let status = format!("/proc/{}/status", process.id());
    wait_until("the command handles SIGINT", || {
        let status = read_to_string(&status).unwrap();
        let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap();
        u64::from_str_radix(caught.trim(), 16).unwrap() & SIGINT_BIT != 0
    });
}

/// Starts a command, and interrupts it as soon as it handles the signal.
fn interrupted(arguments: &[&str]) -> Output {
    let process = Process::start(Command::new(env!("CARGO_BIN_EXE_bench-dragon")).args(arguments));
    handles_interrupts(&process);
    process.signal(SIGINT);
    let output = process.output();
    let told = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {told}");
    assert!(told.contains("stopped by a signal"), "{arguments:?}: {told}");
    output
}

#[test]
fn an_interrupted_search_says_how_far_it_came() {
    let folder = tempfile::tempdir().unwrap();
    let scene = long_scene(folder.path());
    let events = interrupted(&["events", &scene]);
    assert!(text(&events.stderr).contains("the search for events was stopped: searched up to t = "));
    let told = text(&events.stdout);
    assert!(told.contains("There is no contact up to t = ") && told.contains("where the search was stopped"), "{told}");
    assert!(!told.contains("path_end") && !told.contains("least clearance"), "{told}");
    assert_eq!(text(&interrupted(&["events", "--json", &scene]).stdout), "", "no event is known");
    assert!(!text(&interrupted(&["check", &scene]).stdout).contains("path_end"));
    // A table that ends early must not look complete.
    let file = folder.path().join("table.csv");
    interrupted(&["solve", &scene, "--at", "contact", "-o", file.to_str().unwrap()]);
    assert!(!file.exists());
}

#[test]
fn a_check_that_is_interrupted_while_it_makes_a_table_ends_without_one() {
    let folder = tempfile::tempdir().unwrap();
    let scene = long_table(folder.path());
    // A table may be ready before the signal, where this process stands still between the words and the signal.
    let is_given_up = (0..5).any(|_| {
        let (code, told, shown) = interrupted_at("making the table", &["check".as_ref(), scene.as_os_str()]);
        assert_eq!(code, Some(1), "{told}{shown}");
        assert!(shown.contains("stopped by a signal before the end: the results are not complete"), "{shown}");
        told.contains("Solver: not known, because the command was stopped.")
    });
    assert!(is_given_up);
}

#[test]
fn an_interrupted_plan_prints_what_is_proved() {
    let output = interrupted(&["plan", "pitch", "--reach-radius", "4.5", "--json"]);
    let [line] = &json_lines(&output)[..] else { panic!("{}", text(&output.stdout)) };
    assert_eq!((&line["plan"], &line["status"], &line["value_hi"]), (&"pitch".into(), &"stopped".into(), &Value::Null));
    let turn = interrupted(&["plan", "turn", "config/turnaround.toml"]);
    assert!(text(&turn.stdout).contains("the search was stopped"), "{}", text(&turn.stdout));
}

#[test]
fn a_second_signal_ends_the_command_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let scene = long_scene(folder.path());
    let pipe = folder.path().join("pipe");
    nix::unistd::mkfifo(&pipe, Mode::S_IRUSR | Mode::S_IWUSR).unwrap();
    let arguments = ["solve", &scene, "--at", "0", "-o", pipe.to_str().unwrap()];
    let process = Process::start(Command::new(env!("CARGO_BIN_EXE_bench-dragon")).args(arguments));
    // A frame is larger than a pipe: where its first byte is there and no other is read, the command cannot end.
    let mut reader = File::open(&pipe).unwrap();
    reader.read_exact(&mut [0]).unwrap();
    let status = format!("/proc/{}/status", process.id());
    wait_until("two signals end it", || {
        process.signal(SIGINT);
        read_to_string(&status).is_ok_and(|status| status.contains("State:\tZ"))
    });
    assert_eq!(process.output().status.signal(), Some(SIGINT as i32));
}
