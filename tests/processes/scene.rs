//! The text of a show's scene in shared memory, as another language reads it.

use crate::harness;

use std::process::Command;

use harness::{Process, can_run, json_lines, program, python, python_modules, scene_file, summary, text, unique};
use nix::sys::signal::Signal::SIGINT;

/// Returns a late subscriber of the scene.
fn peer(name: &str) -> Command {
    let mut command = python();
    command.args(["tests/python/scene_peer.py", "--name", &unique(name), "--seconds", "60"]);
    command
}

#[test]
fn a_late_python_subscriber_gets_the_scene_of_each_run() {
    if !can_run(python_modules(&["iceoryx2", "numpy"])) {
        return;
    }
    // The second scene is longer, and not only ASCII.
    let scenes = [("short", ""), ("long", "# 板凳龙\n")].map(|(name, comment)| {
        let file = scene_file(&format!("sent_{name}"), &[]);
        let whole = format!("{}{}", std::fs::read_to_string(&file).unwrap(), comment.repeat(200));
        std::fs::write(&file, &whole).unwrap();
        (file, whole)
    });
    let mut runs = Vec::new();
    for (file, whole) in &scenes {
        let mut watch = Process::start(program("sent_scene").args(["watch", "--json"]));
        let mut run = program("sent_scene");
        let publisher = Process::start(run.arg("--scene").arg(file).args(["run", "--json"]));
        watch.lines().until("\"state\":\"moving\"");
        let output = Process::start(&mut peer("sent_scene")).output();
        let found = json_lines(&output).pop().unwrap_or_else(|| panic!("{}", text(&output.stderr)));
        let hash = blake3::hash(whole.as_bytes()).to_hex();
        assert_eq!(found["text"], whole.as_str());
        assert_eq!((&found["hash"], &found["stage_hash"]), (&hash.as_str().into(), &hash.as_str().into()));
        assert_eq!(found["run_id"], found["stage_run_id"]);
        runs.push(found["run_id"].as_u64().unwrap());
        publisher.signal(SIGINT);
        summary(&publisher.output());
    }
    assert_ne!(runs[0], runs[1], "each start is another run");
}
