//! The scene in a recording: `verify` computes the recorded poses again from it, `replay` sends it along.

use std::path::Path;

use mcap::Summary;
use serde_json::Value;

use super::files::{Bytes, is_frame, read, rewrite, with_bytes};
use super::{conducted_recording, replay};
use crate::harness::{Process, can_run, json_lines, program, python, python_modules, stopped, text, unique};

/// Byte of a frame's first handle, and bytes of a handle: x, y, heading and two velocities.
const HANDLES: usize = 104;
const HANDLE: usize = 40;

/// Returns exit code, line and error of `verify --json`.
fn verify(file: &Path) -> (i32, Value, String) {
    let output = program("verify_recording").args(["--json", "verify"]).arg(file).output().unwrap();
    (output.status.code().unwrap(), json_lines(&output).pop().unwrap_or(Value::Null), text(&output.stderr))
}

/// Returns the scene of a recording, with the crate `mcap` alone.
fn scene_of(file: &[u8]) -> Option<String> {
    let indexes = Summary::read(file).unwrap().unwrap().attachment_indexes;
    let index = indexes.iter().find(|index| index.name == "scene.toml")?;
    Some(String::from_utf8(mcap::read::attachment(file, index).unwrap().data.into_owned()).unwrap())
}

#[test]
fn every_pose_of_a_conducted_show_is_that_of_its_scene_and_a_changed_byte_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let file = conducted_recording("verified", folder.path());
    let bytes = std::fs::read(&file).unwrap();
    let kept = read(&file);
    let scene = scene_of(&bytes).expect("a scene");
    assert!(scene.contains("the coil closes") && scene.contains("queue = 3000"), "{scene}");

    let (code, line, error) = verify(&file);
    assert_eq!((code, &line["verdict"]), (0, &"close".into()), "{line} {error}");
    assert_eq!(line["frames"], kept.frames.len(), "{line}");
    assert_eq!(line["scene_hash"], blake3::hash(scene.as_bytes()).to_hex().as_str());
    assert!(line["max_difference"].as_f64().unwrap() <= line["tolerance"].as_f64().unwrap(), "{line}");

    // One bit of the place or of the heading of one handle, in a frame that plays, that is paused, and in the last one.
    let changed = folder.path().join("changed.mcap");
    let paused = kept.frames.iter().position(|frame| frame.time_scale() == 0.0).expect("a pause");
    let cases = [(7, 0, 0), (paused, 100, 8), (kept.frames.len() - 1, 223, 16)];
    for (index, handle, field) in cases {
        let at = HANDLES + HANDLE * handle + field;
        let sequence = kept.frames[index].sequence();
        let [before, bit] = [kept.frames[index].from(at)[5], 1];
        rewrite(&bytes, &changed, |message| {
            let is_it = is_frame(&message) && Bytes(message.data.to_vec()).sequence() == sequence;
            vec![if is_it { with_bytes(&message, at + 5, &[before ^ bit]) } else { message }]
        });
        let (code, line, error) = verify(&changed);
        let found = (&line["verdict"], &line["difference"]["sequence"]);
        assert_eq!((code, found), (1, (&"differs".into(), &sequence.into())), "{line} {error}");
        assert!(error.contains(&format!("handle {}, counted from 1", handle + 1)), "{error}");
    }

    // The same messages are close again without a change, and another scene is not the show's.
    rewrite(&bytes, &changed, |message| vec![message]);
    assert_eq!(verify(&changed).0, 0);
    let pitch = b"pitch = 0.55";
    let begins = bytes.windows(pitch.len()).position(|text| text == pitch).expect("the scene is not compressed");
    let mut other = bytes.clone();
    other[begins + pitch.len() - 1] = b'6';
    std::fs::write(&changed, &other).unwrap();
    // The attachment has a check of its own.
    let (code, _, error) = verify(&changed);
    assert!(code == 2 && error.contains("damaged"), "{code} {error}");
}

#[test]
fn a_recording_without_a_scene_is_refused_by_verify() {
    let (folder, bare) = (tempfile::tempdir().unwrap(), "bare.mcap");
    let file = super::played::small_recording("verified_bare", folder.path());
    assert_eq!(verify(&file).0, 0);
    let bytes = std::fs::read(&file).unwrap();
    // A recorder of ROS 2 topics keeps no attachment.
    let mut writer = mcap::WriteOptions::new().profile("ros2");
    writer = writer.chunk_size(Some(50_000));
    let bare = folder.path().join(bare);
    let mut writer = writer.create(std::fs::File::create(&bare).unwrap()).unwrap();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        writer.write(&message.unwrap()).unwrap();
    }
    writer.finish().unwrap();
    let (code, _, error) = verify(&bare);
    assert_eq!(code, 2, "{error}");
    assert!(error.contains("bare.mcap") && error.contains("no scene"), "{error}");
}

#[test]
fn a_replay_sends_the_recorded_scene_along() {
    if !can_run(python_modules(&["iceoryx2", "numpy"])) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = super::played::small_recording("replayed_scene_show", folder.path());
    let scene = scene_of(&std::fs::read(&file).unwrap()).expect("a scene");
    let settings = super::scene(folder.path(), "paper", 64, "");
    let name = "replayed_scene";
    let playing = Process::start(&mut replay(name, &file, &settings, &["--loop"]));
    let mut peer = python();
    peer.args(["tests/python/scene_peer.py", "--name", &unique(name), "--seconds", "60"]);
    let output = Process::start(&mut peer).output();
    let found = json_lines(&output).pop().unwrap_or_else(|| panic!("{}", text(&output.stderr)));
    assert_eq!(found["text"], scene.as_str());
    assert_eq!((&found["run_id"], &found["hash"]), (&found["stage_run_id"], &found["stage_hash"]));
    assert_eq!(found["hash"], blake3::hash(scene.as_bytes()).to_hex().as_str());
    stopped(playing);
}
