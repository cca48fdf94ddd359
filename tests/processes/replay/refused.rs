//! Files that cannot be played, each with its sentence, and files with wrong bytes.

use std::borrow::Cow;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use bench_dragon::publisher::live::{FrameSource, Outgoing, Period};
use bench_dragon::recording::mcap::ReadError;
use bench_dragon::recording::replay::{Pace, Prepared, ReplayOptions};
use bench_dragon::show::convert::Stamps;
use mcap::{Message, MessageStream, Schema};

use crate::harness::{Process, can_run, json_lines, python, python_modules, summary, text};
use crate::replay::files::{is_frame, on_channel, rewrite, with_bytes};
use crate::replay::played::small_recording;
use crate::replay::{replay, scene};

/// Returns the message with another schema.
fn typed<'a>(message: &Message<'a>, change: impl Fn(&mut Schema<'a>)) -> Message<'a> {
    on_channel(message, |channel| {
        let mut schema = (**channel.schema.as_ref().unwrap()).clone();
        change(&mut schema);
        channel.schema = Some(Arc::new(schema));
    })
}

/// Offsets of a frame's layout: its run, its tick, the number of its handles, its state.
const RUN_ID: usize = 0;
const TICK: usize = 16;
const STATE: usize = 76;

type Change = for<'a> fn(Message<'a>) -> Vec<Message<'a>>;

#[test]
fn what_cannot_be_played_is_refused_with_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let file = small_recording("replay_refused", folder.path());
    let scene = scene(folder.path(), "school", 64, "");
    let bytes = std::fs::read(&file).unwrap();
    let at = |name: &str| folder.path().join(name);
    let refusal = |file: &Path, arguments: &[&str]| {
        let output = Process::start(&mut replay("replay_no", file, &scene, arguments)).output();
        let sentence = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{}: {sentence}", file.display());
        assert_eq!(sentence.lines().count(), 1, "{sentence}");
        assert!(!sentence.contains("panicked"), "{sentence}");
        let frames = json_lines(&output).pop().map_or(0, |summary| {
            assert_eq!(summary["end"], "error");
            summary["frames"].as_u64().unwrap()
        });
        (sentence, frames)
    };

    // Files that are not recordings, and options.
    let written: [(&str, &[u8], &str); 4] = [
        ("empty", b"", "this is no MCAP file"),
        ("text", b"a text of some length, which is no recording at all", "this is no MCAP file"),
        ("cut", &bytes[..bytes.len() * 2 / 3], "it has no end, as when its recorder was killed: mend it with"),
        ("cut_at_once", &bytes[..8], "it has no end"),
    ];
    for (name, content, expected) in written {
        std::fs::write(at(name), content).unwrap();
        let (sentence, _) = refusal(&at(name), &[]);
        assert!(sentence.contains(expected) && sentence.contains(name), "{name}: {sentence}");
    }
    assert!(refusal(&at("nowhere"), &[]).0.contains("No such file"));
    let bags = ["bag_of_none", "bag_of_two"].map(at);
    bags.iter().for_each(|bag| std::fs::create_dir(bag).unwrap());
    assert!(refusal(&bags[0], &[]).0.contains("no file of this directory ends in .mcap"));
    for name in ["0.mcap", "1.mcap"] {
        std::fs::copy(&file, bags[1].join(name)).unwrap();
    }
    let (sentence, _) = refusal(&bags[1], &[]);
    // The recorder's first frame may be a later one.
    let expected = ["bag_of_two: 1.mcap: it has a frame of period ", " after that of ", ", expected"];
    assert!(expected.into_iter().all(|words| sentence.contains(words)), "{sentence}");
    let options: [(&[&str], &str); 6] = [
        (&["--start", "1e6"], "--start is 1000000 and the recording reaches 2"),
        (&["--start", "nan"], "--start is NaN"),
        (&["--rate", "0"], "--rate is 0, expected a number from 0.1 to 20000"),
        (&["--rate", "-5"], "--rate is -5"),
        (&["--time-scale", "0"], "--time-scale is 0"),
        (&["--time-scale", "1e5"], "the rate of the replay is 4000000, expected a number from 0.1 to 20000"),
    ];
    for (arguments, expected) in options {
        let (sentence, _) = refusal(&file, arguments);
        assert!(sentence.contains(expected), "{arguments:?}: {sentence}");
    }
    let mut illegal = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    illegal.args(["--name", "no//name", "replay", "--ros2"]).arg(&file);
    let output = Process::start(&mut illegal).output();
    let sentence = text(&output.stderr);
    assert!(output.status.code() == Some(2) && sentence.contains("the name is"), "{sentence}");

    // Recordings with changed messages: the change, the sentence, and true if frames are sent before the sentence.
    let changed: [(&str, Change, &str, bool); 16] = [
        ("no_handles", |it| Vec::from_iter((!is_frame(&it)).then_some(it)), "it has no topic handles", false),
        ("no_frames", |it| vec![with_other_topic(it, "/handles", "/x/y")], "it has no topic handles", false),
        (
            "no_stage",
            |it| Vec::from_iter((!it.channel.topic.ends_with("/stage")).then_some(it)),
            "no topic stage",
            false,
        ),
        (
            "two",
            |it| vec![on_channel(&it, |to| to.topic = format!("/b{}", to.topic)), it],
            "of several publishers",
            false,
        ),
        (
            "json",
            |it| vec![on_channel(&it, |channel| channel.message_encoding = "json".into())],
            "(json, ros2msg)",
            false,
        ),
        ("type", |it| vec![typed(&it, |schema| schema.name += "2")], "HandlePoses2 (cdr, ros2msg), expected", false),
        ("fields", |it| vec![typed(&it, with_other_field)], "does not know, this program reads FrameHeader/2", false),
        (
            "old_frames",
            |it| vec![typed(&it, without_epoch)],
            "has FrameHeader/1, this program reads FrameHeader/2",
            false,
        ),
        ("short", |it| vec![Message { data: Cow::Owned(it.data[..200].to_vec()), ..it }], "that cannot be read", false),
        ("big_endian", |it| vec![Message { data: Cow::Owned([&[0, 0], &it.data[2..]].concat()), ..it }], "read", false),
        ("state", |it| vec![with_bytes(&it, STATE, &[9])], "whose state this version does not know", false),
        (
            "short_later",
            |it| vec![later(it, |it| Message { data: Cow::Owned(it.data[..300].to_vec()), ..it })],
            "cannot",
            true,
        ),
        (
            "other_run",
            |it| vec![later(it, |it| with_bytes(&it, RUN_ID, &[1; 8]))],
            "of another run than the first",
            true,
        ),
        ("back", |it| vec![later(it, |it| with_bytes(&it, TICK, &[0; 8]))], "of period 0 after that of", true),
        ("twice", |it| vec![it.clone(), it], "expected a later one", true),
        ("team", |it| vec![later(it, with_a_handle_less)], "of 20 handles after those of 21", true),
    ];
    for (name, change, expected, plays) in changed {
        let of_frames = !["no_handles", "no_stage"].contains(&name);
        rewrite(&bytes, &at(name), |it| if is_frame(&it) || !of_frames { change(it) } else { vec![it] });
        let (sentence, frames) = refusal(&at(name), &["--time-scale", "4"]);
        assert!(sentence.contains(expected), "{name}: {sentence}");
        assert_eq!(frames > 0, plays, "{name}: {frames} frames");
    }

    // Comments of a definition may differ, and log times go back if a clock was set back.
    let otherwise = |it: Message<'static>| {
        let it = typed(&it, |schema| {
            let text = String::from_utf8(schema.data.to_vec()).unwrap();
            let lines = text.lines().map(|line| line.split('#').next().unwrap().to_owned() + "\n");
            schema.data = Cow::Owned(lines.collect::<String>().into_bytes());
        });
        vec![Message { log_time: u64::MAX - it.log_time, ..it }]
    };
    rewrite(Vec::leak(bytes.clone()), &at("otherwise"), otherwise);
    assert_eq!(contents(&at("otherwise"), None).unwrap(), contents(&file, None).unwrap());
}

fn with_other_topic<'a>(message: Message<'a>, from: &str, to: &str) -> Message<'a> {
    on_channel(&message, |channel| channel.topic = channel.topic.replace(from, to))
}

fn with_other_field(schema: &mut Schema<'_>) {
    let text = String::from_utf8(schema.data.to_vec()).unwrap();
    assert!(text.contains("float64 vx"));
    schema.data = Cow::Owned(text.replace("float64 vx", "float32 vx").into_bytes());
}

fn without_epoch(schema: &mut Schema<'_>) {
    let text = String::from_utf8(schema.data.to_vec()).unwrap();
    assert!(text.contains("\nuint32 epoch\n"));
    schema.data = Cow::Owned(text.replace("\nuint32 epoch\n", "\n").into_bytes());
}

/// Changes the frames, except the first ones.
fn later<'a>(message: Message<'a>, change: impl Fn(Message<'a>) -> Message<'a>) -> Message<'a> {
    if message.sequence > 40 { change(message) } else { message }
}

fn with_a_handle_less(message: Message<'_>) -> Message<'_> {
    // The number of the frame's handles, the length of the list, and the list.
    let mut message = with_bytes(&with_bytes(&message, 72, &[20, 0, 0, 0]), 96, &[20, 0, 0, 0]);
    let shorter = message.data.len() - 40;
    message.data.to_mut().truncate(shorter);
    message
}

/// Returns each frame that the library plays: simulated time, the first handle, and the number of alerts and cues. An
/// early end is an error with its reason, unless the end is expected.
fn contents(file: &Path, expected_failure: Option<&mut bool>) -> Result<Vec<(u64, u64, usize)>, ReadError> {
    let options = ReplayOptions { pace: Pace::Even(100.0), start: None, looping: false };
    let (mut replay, thread) = Prepared::open(file, options)?.begin()?;
    const STAMPS: Stamps = Stamps { run_id: 0, sequence: 0, stamp_ns: 0, deadline_ns: 0 };
    let mut frames = Vec::new();
    for tick in 0.. {
        match replay.frame(tick, STAMPS) {
            Period::Frame(Outgoing { header, chain, alerts, cues, .. }) => {
                frames.push((header.sim_time.to_bits(), chain.x[0].to_bits(), alerts.len() + cues.len()));
            }
            Period::Empty => std::thread::yield_now(),
            Period::Over => break,
        }
    }
    let (_, failure) = thread.finish();
    match (failure, expected_failure) {
        (Some(_), Some(failed)) => *failed = true,
        (Some(error), None) => return Err(error),
        (None, _) => (),
    }
    Ok(frames)
}

#[test]
fn a_bag_of_another_recorder_is_played() {
    if !can_run(python_modules(&["rosbags"])) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = small_recording("replay_bag", folder.path());
    let bag = folder.path().join("bag");
    let written = python().arg("tests/python/bag_writer.py").args([&file, &bag]).output().unwrap();
    assert!(written.status.success(), "{}", text(&written.stderr));
    let frames = contents(&file, None).unwrap();
    assert_eq!(contents(&bag.join("bag.mcap"), None).unwrap(), frames);
    // By its directory, as `ros2 bag play` takes it.
    let scene = scene(folder.path(), "school", 64, "");
    let played = Process::start(&mut replay("replay_bag_folder", &bag, &scene, &["--rate", "400"])).output();
    let played = summary(&played);
    assert_eq!((&played["frames"], &played["end"]), (&frames.len().into(), &"recording".into()), "{played}");
}

/// `ros2 bag record --max-bag-duration` begins a new file at times; the latched stage is in the first. Others repeat
/// the alert that holds in each file.
#[test]
fn a_bag_of_several_files_is_played_as_one_recording() {
    let folder = tempfile::tempdir().unwrap();
    let file = small_recording("replay_split", folder.path());
    let bytes = std::fs::read(&file).unwrap();
    let times: Vec<u64> = MessageStream::new(&bytes).unwrap().map(|message| message.unwrap().log_time).collect();
    let (first, last) = (*times.iter().min().unwrap(), *times.iter().max().unwrap());
    let bag = folder.path().join("bag");
    std::fs::create_dir(&bag).unwrap();
    for (part, name) in ["bag_9.mcap", "bag_10.mcap", "bag_11.mcap"].into_iter().enumerate() {
        let part_of = |message: &Message<'_>| (message.log_time - first) * 3 / (last - first + 1);
        rewrite(&bytes, &bag.join(name), |it| match part_of(&it) == part as u64 {
            true if it.channel.topic.ends_with("/alerts") => vec![it.clone(), it],
            true => vec![it],
            false => vec![],
        });
    }
    let frames = contents(&file, None).unwrap();
    assert!(frames.iter().any(|(_, _, events)| *events > 0));
    // Without metadata.yaml, which a killed recorder does not write.
    assert_eq!(contents(&bag, None).unwrap(), frames);
    let scene = scene(folder.path(), "school", 64, "");
    let played = Process::start(&mut replay("replay_split", &bag, &scene, &["--rate", "400"])).output();
    let played = summary(&played);
    assert_eq!((&played["frames"], &played["end"]), (&frames.len().into(), &"recording".into()), "{played}");

    let list = |names: &[&str]| {
        let lines: String = names.iter().map(|name| format!("    - {name}\n")).collect();
        let text = format!("rosbag2_bagfile_information:\n  version: 9\n  relative_file_paths:\n{lines}  files:\n");
        std::fs::write(bag.join("metadata.yaml"), text).unwrap();
    };
    list(&["bag_9.mcap", "bag_10.mcap"]);
    let some = contents(&bag, None).unwrap();
    assert!(some.len() > 1 && some.len() < frames.len() && frames.starts_with(&some), "{} frames", some.len());
    let refusal = || contents(&bag, None).unwrap_err().to_string();
    list(&["bag_9.mcap", "bag_12.mcap"]);
    assert!(
        refusal().starts_with("its metadata.yaml lists bag_12.mcap, which is not there, expected"),
        "{}",
        refusal()
    );
    list(&["bag_0.db3"]);
    assert!(refusal().starts_with("its recording bag_0.db3 is no .mcap, expected"), "{}", refusal());
    list(&["bag_9.mcap", "bag_10.mcap", "bag_11.mcap"]);
    let whole = std::fs::read(bag.join("bag_11.mcap")).unwrap();
    std::fs::write(bag.join("bag_11.mcap"), &whole[..whole.len() / 2]).unwrap();
    assert!(refusal().starts_with("bag_11.mcap: it has no end"), "{}", refusal());
}

fn length_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
}

#[test]
fn a_wrong_byte_costs_frames_and_invents_none() {
    let folder = tempfile::tempdir().unwrap();
    let file = small_recording("replay_bytes", folder.path());
    let bytes = std::fs::read(&file).unwrap();
    let all = contents(&file, None).unwrap();
    let damaged = folder.path().join("damaged.mcap");
    // An index without one of its chunks: a record of its kind (8) becomes a kind that readers skip.
    let mut chunk_indexes =
        (0..bytes.len() - 9).filter(|at| bytes[*at] == 8 && (60..300).contains(&length_at(&bytes, at + 1)));
    let mut wrong = bytes.clone();
    wrong[chunk_indexes.next_back().unwrap()] = 0x80;
    std::fs::write(&damaged, &wrong).unwrap();
    let refusal = contents(&damaged, None).unwrap_err().to_string();
    assert!(refusal.contains("Summary section CRC failed"), "{refusal}");

    let mut random = fastrand::Rng::with_seed(23);
    let (mut refused, mut ended) = (0, 0);
    for _ in 0..300 {
        let mut wrong = bytes.clone();
        // The index at the end is a tenth of the file, and the most sensitive part.
        let at = if random.bool() { random.usize(0..bytes.len()) } else { bytes.len() - 1 - random.usize(0..6000) };
        wrong[at] ^= 1 << random.u32(0..8);
        std::fs::write(&damaged, &wrong).unwrap();
        let mut failed = false;
        match contents(&damaged, Some(&mut failed)) {
            Err(ReadError::File(error)) => panic!("byte {at}: {error}"),
            Err(_) => refused += 1,
            Ok(frames) => {
                assert!(failed || frames == all, "byte {at}: {} frames of {}", frames.len(), all.len());
                assert!(frames[..] == all[..frames.len()], "byte {at}: frames that were not recorded");
                ended += u64::from(failed);
            }
        }
    }
    // A slow machine records fewer frames, so that more of the file is its index.
    assert!(refused > 30 && ended > 10, "{refused} refused, {ended} ended early");
}
