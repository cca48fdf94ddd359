//! The recorder itself, given frames that a publisher does not send.

use std::path::Path;

use bench_dragon::messages::{CollisionAlert, FrameHeader, HandlePose, List, Stage, StageDragon, StageMessage};
use bench_dragon::recording::mcap::recorder::{Recorder, RecorderConfig};
use bench_dragon::ros2_messages::settings::Topic;

use super::{entries, frame_times};

/// Returns a recorder of the publisher `p`.
fn library_recorder(file: &Path, topics: &[Topic], replace: bool) -> Recorder {
    let (name, file, topics) = ("p".to_owned(), file.to_owned(), topics.to_vec());
    Recorder::new(RecorderConfig { name, file, replace, topics, split: None }).unwrap()
}

/// Returns a frame of a run of 100 frames a second.
fn frame(run_id: u64, tick: u64, stamp_ns: u64) -> FrameHeader {
    FrameHeader {
        run_id,
        sequence: tick,
        tick,
        stamp_ns,
        deadline_ns: tick * 10_000_000,
        handles: 2,
        ..Default::default()
    }
}

#[test]
fn a_clock_that_is_set_back_is_recorded_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("clock.mcap");
    let mut recorder = library_recorder(&file, &[Topic::Handles, Topic::Alerts], false);
    let handles = [HandlePose::default(); 2];
    let alert = |tick, stamp_ns| CollisionAlert { run_id: 1, tick, stamp_ns, ..Default::default() };
    let stamp = |tick: u64| 1_000_000_000_000 + tick * 10_000_000 - if tick >= 60 { 100_000_000_000 } else { 0 };
    // A message sent before the recorder subscribed comes after the first frame.
    recorder.frame(&frame(1, 50, stamp(50)), &handles, 0).unwrap();
    recorder.alert(&alert(10, stamp(10))).unwrap();
    (51..70).for_each(|tick| recorder.frame(&frame(1, tick, stamp(tick)), &handles, 0).unwrap());
    recorder.alert(&alert(65, stamp(65))).unwrap();
    recorder.finish().unwrap();
    let entries = entries(&std::fs::read(&file).unwrap());
    let times = |topic| entries.iter().filter(move |entry| entry.0 == topic).map(|entry| entry.2).collect::<Vec<_>>();
    assert_eq!(times("/p/handles"), (50..70).map(stamp).collect::<Vec<_>>());
    assert_eq!(times("/p/alerts"), [stamp(50), stamp(65)]);
}

#[test]
fn every_file_that_is_replaced_is_emptied() {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["again.mcap", "again-2.mcap"].map(|name| folder.path().join(name));
    paths.iter().for_each(|path| std::fs::write(path, vec![7; 1_000_000]).unwrap());
    let mut recorder = library_recorder(&paths[0], &[Topic::Handles], true);
    let handles = [HandlePose::default(); 2];
    for (run_id, path) in (1..).zip(&paths) {
        (0..5).for_each(|tick| recorder.frame(&frame(run_id, tick, tick), &handles, 0).unwrap());
        // Before the end: a recorder that is killed here leaves nothing of the old file.
        let bytes = std::fs::metadata(path).unwrap().len();
        assert!(bytes < 500_000, "{}: {bytes} bytes", path.display());
    }
    recorder.finish().unwrap();
    assert_eq!(recorder.recorded().files, paths);
    let sizes = paths.map(|path| {
        assert_eq!(frame_times(&path), [0, 1, 2, 3, 4], "{}", path.display());
        std::fs::metadata(&path).unwrap().len()
    });
    assert_eq!(recorder.recorded().counts.bytes, sizes.iter().sum::<u64>());
}

#[test]
fn what_is_counted_is_in_the_files() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("counts.mcap");
    let mut recorder = library_recorder(&file, &[Topic::Alerts, Topic::Cues], false);
    (0..5).for_each(|tick| recorder.frame(&frame(1, tick, tick), &[HandlePose::default(); 2], 0).unwrap());
    recorder.alert(&CollisionAlert { run_id: 1, tick: 3, stamp_ns: 3, ..Default::default() }).unwrap();
    recorder.finish().unwrap();
    let counts = recorder.recorded().counts;
    assert_eq!((counts.frames, counts.messages, entries(&std::fs::read(&file).unwrap()).len()), (0, 1, 1));
}

#[test]
fn what_needs_the_stage_begins_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("early.mcap");
    let mut recorder = library_recorder(&file, &[Topic::Handles, Topic::Markers, Topic::Tf], false);
    let record = |ticks: std::ops::Range<u64>, recorder: &mut Recorder| {
        ticks.for_each(|tick| recorder.frame(&frame(1, tick, tick), &[HandlePose::default(); 2], 0).unwrap());
    };
    record(0..3, &mut recorder);
    let dragons = List::of([StageDragon { benches: 1, ..Default::default() }]);
    let stage = Stage { run_id: 1, stamp_ns: 3, dragons, ..Default::default() };
    recorder.stage(&StageMessage { stage, segments: Vec::new() }).unwrap();
    record(3..5, &mut recorder);
    recorder.finish().unwrap();
    let entries = entries(&std::fs::read(&file).unwrap());
    let times = |topic| entries.iter().filter(move |entry| entry.0 == topic).map(|entry| entry.2).collect::<Vec<_>>();
    assert_eq!(times("/p/handles"), [0, 1, 2, 3, 4]);
    for topic in ["/p/markers", "/tf"] {
        assert_eq!(times(topic), [3, 4], "{topic}");
    }
}
