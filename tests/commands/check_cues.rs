//! `check` lists the cues of a scene, in the order of their times.

use std::io::Write;
use std::process::Command;

#[test]
fn check_lists_cues_with_their_times() {
    let cues = "[[cues]]\nname = \"coil\"\nat = 300\nthen = \"pause\"\n[[cues]]\nname = \"lamps\"\ntravelled = 150.5\n\
                [[cues]]\nname = \"gong\"\nbefore = \"contact\"\nseconds = 2\n[[cues]]\nname = \"encore\"\nat = 420\n\
                [[cues]]\nname = \"never\"\nbefore = \"path_end\"\n";
    let mut file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    file.write_all(format!("{}\n{cues}", include_str!("../../config/paper.toml")).as_bytes()).unwrap();
    let path = file.path().to_str().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_bench-dragon")).args(["check", "--scene", path]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let printed = String::from_utf8(output.stdout).unwrap();
    let listed: Vec<&str> = printed.lines().map(str::trim).filter(|line| line.starts_with("Cue ")).collect();
    // The paper's contact is at 412.473838 s.
    let expected = [
        "Cue 1, \"lamps\", at 150.5 s.",
        "Cue 2, \"coil\", at 300 s; the show waits there for `go`.",
        "Cue 3, \"gong\", at 410.474 s.",
        "Cue 4, \"encore\", at 420 s, after the end of the show.",
        "Cue \"never\" has no time: its event does not happen, or the time would be before the start.",
    ];
    assert_eq!(listed, expected, "{printed}");
}
