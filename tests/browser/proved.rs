//! The proved results of a show: found by the hash of its scene's text, which the stage carries, and a certificate of
//! the same text. `tests/python/stage_proofs.py` tests the browser. No test asserts a speed.

use crate::{harness, run_scenario};

use std::path::{Path, PathBuf};
use std::process::Output;
use std::time::Instant;

use harness::{Process, can_run, json_lines, program, python, python_modules, text, unique};
use nix::sys::signal::Signal;
use serde_json::{Value, json};
use tungstenite::Message;
use tungstenite::stream::MaybeTlsStream;

/// Returns the school's scene in a folder, with another first line.
fn scene(folder: &Path, first_line: &str) -> PathBuf {
    let file = folder.join("scene.toml");
    std::fs::write(&file, format!("# {first_line}\n{}", include_str!("../../config/school.toml"))).unwrap();
    file
}

fn done(arguments: &[&str]) -> Output {
    let output = Process::start(program("done").args(arguments)).output();
    assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
    output
}

fn publisher(name: &str, scene: &Path) -> Process {
    let arguments = ["run", "--quiet", "--json", "--duration", "300", "--start", "28", "--time-scale", "0.01"];
    Process::start(program(name).arg("--scene").arg(scene).args(arguments))
}

/// Returns the data that a Python program reads from a publisher's stage, and its hash of the file.
fn hashes(name: &str, scene: &Path) -> Value {
    let mut peer = python();
    peer.args(["tests/python/scene_hash.py", "--name", &unique(name), "--scene"]).arg(scene);
    let output = Process::start(&mut peer).output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    json_lines(&output).pop().unwrap()
}

#[test]
fn the_stage_has_the_hash_that_verify_prints_also_in_a_replay() {
    if !can_run(python_modules(&["iceoryx2", "blake3"])) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path(), "龙");
    let at = |file: &str| folder.path().join(file).to_str().unwrap().to_owned();
    done(&["--scene", scene.to_str().unwrap(), "events", "--certify", &at("proof.jsonl")]);
    let printed = text(&done(&["verify", &at("proof.jsonl")]).stdout);
    let verdict = json_lines(&done(&["verify", "--json", &at("proof.jsonl")])).pop().unwrap();
    let hash = verdict["scene_hash"].as_str().unwrap();
    assert_eq!(hash.len(), 64, "{hash}");
    assert!(printed.starts_with(&format!("BLAKE3 of the scene's text: {hash}\n")), "{printed}");

    let run = publisher("hash", &scene);
    let expected = json!({"published": hash, "computed": hash});
    assert_eq!(hashes("hash", &scene), expected);
    let recorded = at("show.mcap");
    let record = program("hash").args(["record", "--duration", "2", "-o", &recorded]).output().unwrap();
    assert!(record.status.success(), "{}", text(&record.stderr));
    drop(run);
    let arguments = ["replay", &recorded, "--quiet", "--json", "--loop"];
    let _replay = Process::start(program("hash_replay").args(arguments));
    assert_eq!(hashes("hash_replay", &scene), expected);
}

#[test]
fn what_is_no_certificate_is_refused_with_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path(), "");
    let log = folder.path().join("show.jsonl");
    done(&["--scene", scene.to_str().unwrap(), "run", "--duration", "0.1", "--log", log.to_str().unwrap()]);
    let written = |name: &str, content: &str| {
        let file = folder.path().join(name);
        std::fs::write(&file, content).unwrap();
        file
    };
    let first = |format: u32, scene: &str| {
        json!({"type": "certificate", "format": format, "version": "0.1.0", "scene": scene}).to_string() + "\n"
    };
    let text_of_scene = include_str!("../../config/school.toml");
    let at_scene = scene.to_str().unwrap().to_owned();
    let of_speed = folder.path().join("speed.jsonl");
    let plan = ["plan", "speed", "--max-handle-speed", "20", "--certify", of_speed.to_str().unwrap()];
    done(&[&["--scene", &at_scene], &plan[..]].concat());
    let refused = [
        (of_speed, "it is a certificate of another question, expected one of events (events --certify)"),
        (folder.path().join("nowhere"), "No such file or directory"),
        (folder.path().to_owned(), "Is a directory"),
        (scene, "expected a certificate as events --certify writes it"),
        (log, "unknown variant `show`"),
        (written("empty", ""), "expected a certificate"),
        (written("later", &first(5, text_of_scene)), "a certificate of format 5, expected 4"),
        (written("scene", &first(4, "benches = 3")), "the scene: "),
        (written("step", "{\"type\":\"path_end\"}\n"), "the first line is not that of a certificate"),
    ];
    for (file, expected) in refused {
        let arguments = ["view", "--port", "0", "--certificate", file.to_str().unwrap()];
        let output = Process::start(program("refused").args(arguments)).output();
        let sentence = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{}: {sentence}", file.display());
        assert!(sentence.contains(expected) && sentence.contains(file.to_str().unwrap()), "{sentence}");
        assert!(sentence.lines().count() == 1 && output.stdout.is_empty(), "{sentence}");
    }
    // A certificate with a later error: the error is found while pages are served, and the server continues.
    let cut = written("cut", &first(4, text_of_scene));
    let arguments = ["view", "--port", "0", "--json", "--certificate", cut.to_str().unwrap()];
    let mut view = Process::start(program("cut").args(arguments));
    let lines = view.lines();
    let verdict: Value = serde_json::from_str(&lines.until("\"certificate\"")).unwrap();
    assert_eq!(verdict["verdict"], "refused");
    assert!(verdict["problem"].as_str().unwrap().ends_with("the file ends before its results"), "{verdict}");
    view.signal(Signal::SIGTERM);
    let output = view.output();
    let logged = text(&output.stderr);
    assert!(output.status.success(), "{logged}");
    assert!(logged.contains("ERROR") && logged.contains("nothing is proved by this certificate"), "{logged}");
}

#[test]
fn a_program_is_told_what_is_proved() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, proof) = (scene(folder.path(), "a program"), folder.path().join("proof.jsonl"));
    let proof = proof.to_str().unwrap();
    done(&["--scene", scene.to_str().unwrap(), "events", "--certify", proof]);
    let verdict = json_lines(&done(&["verify", "--json", proof])).pop().unwrap();
    let mut view = Process::start(program("told").args(["view", "--port", "0", "--json", "--certificate", proof]));
    let ready: Value = serde_json::from_str(&view.first_line()).unwrap();
    let _run = publisher("told", &scene);
    let address = ready["url"].as_str().unwrap().replace("http", "ws") + "frames";
    let (mut socket, _) = tungstenite::connect(address).unwrap();
    if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
        stream.set_read_timeout(Some(harness::patience())).unwrap();
    }
    let deadline = Instant::now() + harness::patience();
    loop {
        assert!(Instant::now() < deadline, "nothing was proved");
        let Message::Text(message) = socket.read().unwrap() else { continue };
        let message: Value = serde_json::from_str(&message).unwrap();
        if message["type"] != "stage" {
            continue;
        }
        assert_eq!(message["scene_hash"], verdict["scene_hash"]);
        if !message["proved"].is_null() {
            assert_eq!(message["proved"], verdict["results"]);
            break;
        }
    }
}

fn in_a_browser(scenario: &str) {
    run_scenario("stage_proofs.py", scenario, &[]);
}

#[test]
fn checked_while_it_is_seen() {
    in_a_browser("checked_while_it_is_seen");
}

#[test]
#[ignore = "one more way through the page, after those of the short run: tests/run --all"]
fn nothing_of_another_scene() {
    in_a_browser("nothing_of_another_scene");
}

#[test]
#[ignore = "one more way through the page, after those of the short run: tests/run --all"]
fn gone_with_its_scene() {
    in_a_browser("gone_with_its_scene");
}

#[test]
#[ignore = "tests/run --all"]
fn one_of_two_is_proved() {
    in_a_browser("one_of_two_is_proved");
}

#[test]
#[ignore = "tests/run --all"]
fn seen_where_there_is_little_room() {
    in_a_browser("seen_where_there_is_little_room");
}
