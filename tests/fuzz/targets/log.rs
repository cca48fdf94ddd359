//! The small log as `verify` reads it: a true verdict, or the line with the error.
//!
//! If `verify` reports the same bits, this file writes the log again from its show and its commands. Its code is its
//! own: lines, checks and hashes by docs/recordings.md.

use std::collections::HashMap;
use std::sync::{Mutex, OnceLock};

use bench_dragon::messages::control::{Command, CommandRecord};
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::publisher::log::arithmetic::Arithmetic;
use bench_dragon::publisher::log::lines::{Line, SecondLine, ShowLine};
use bench_dragon::publisher::log::verify::{Verdict, verify};
use bench_dragon::show::convert::{Stamps, frame_header, handle_poses};
use bench_dragon::show::scene::{Scene, SceneText};
use bench_dragon::show::{Playback, Show};
use fastrand::Rng;
use serde_json::{Map, Value};

use super::Target;
use super::bytes::{changed, one, renumbered};
use super::scene::is_quick;

pub const TARGET: Target = Target { name: "log", run, seeds, mutate, cases: 5000 };

/// Text before a line's check.
const CHECK: &str = ",\"check\":\"";
/// Most lines of a log that is played: each can be a second of the show.
const MOST_LINES: usize = 40;
/// Most frames per second here.
const MOST_FRAMES: f64 = 1000.0;

fn run(data: &[u8]) -> bool {
    let lines = chained_lines(data);
    if data.iter().filter(|byte| **byte == b'\n').count() > MOST_LINES || !is_short(&lines) {
        return false;
    }
    match verify(data, "fuzz.jsonl", &mut |_| ()) {
        Ok(verdict) => {
            assert!(["same", "close", "differs", "nothing"].contains(&verdict.verdict), "{verdict:?}");
            assert_eq!(verdict.difference.is_some(), verdict.verdict == "differs", "{verdict:?}");
            assert!(verdict.same_seconds <= verdict.seconds, "{verdict:?}");
            assert!(verdict.verdict != "nothing" || (verdict.seconds, verdict.last_tick) == (0, None), "{verdict:?}");
            assert!(!(verdict.complete && verdict.cut), "{verdict:?}");
            let differs = verdict.difference.as_ref();
            assert!(differs.is_none_or(|at| at.from <= at.to && at.line >= 2 && at.line <= lines.len() as u64));
            check_accepted(&lines, &verdict);
            true
        }
        Err(error) => {
            let sentence = error.to_string();
            assert!(!sentence.is_empty() && !sentence.contains(char::is_control), "{sentence:?}");
            let place = sentence.strip_prefix("line ").and_then(|rest| rest.split_once(':')?.0.parse::<usize>().ok());
            let is_placed = place.is_some_and(|line| (1..=lines.len() + 1).contains(&line));
            assert!(is_placed || sentence.starts_with("fuzz.jsonl, line 1, the scene"), "{sentence:?}");
            false
        }
    }
}

/// Returns the complete lines, up to the first wrong check.
fn chained_lines(data: &[u8]) -> Vec<Line> {
    let mut hasher = blake3::Hasher::new();
    let mut lines = Vec::new();
    for line in data.split_inclusive(|byte| *byte == b'\n') {
        let text = std::str::from_utf8(line).ok();
        let Some((body, check)) = text.and_then(|text| text.rsplit_once(CHECK)) else { break };
        hasher.update(body.as_bytes());
        let hash = hasher.finalize().to_hex();
        if check != format!("{}\"}}\n", &hash[..16]) {
            break;
        }
        let Ok(read) = serde_json::from_str(&format!("{body}}}")) else { break };
        hasher.update(&line[body.len()..]);
        lines.push(read);
    }
    lines
}

/// Returns true if the show of a log is played within a moment; logs to be refused always are.
fn is_short(lines: &[Line]) -> bool {
    let Some(Line::Show(show)) = lines.first() else { return true };
    !(show.rate > MOST_FRAMES && show.rate <= 20_000.0)
        && show.scene_text("fuzz").parse().map_or(true, |scene| is_quick(&scene))
}

/// Asserts that a log which was not refused can come from a run, and if its bits are the same, from this run.
fn check_accepted(lines: &[Line], verdict: &Verdict) {
    let Some((Line::Show(show), rest)) = lines.split_first() else { panic!("no show, and {verdict:?}") };
    let Playback { rate, time_scale, end_hold, .. } = show.playback().expect("on_contact and at_end");
    assert!(show.format == 2 && (0.1..=20_000.0).contains(&rate), "{show:?}");
    assert!((1e-6..=1e6).contains(&time_scale) && (0.0..=1e6).contains(&end_hold), "{show:?}");
    assert_eq!((&verdict.version, &verdict.instructions), (&show.version, &show.arithmetic.instructions));
    if verdict.difference.is_some() {
        return;
    }
    let end = rest.iter().position(|line| matches!(line, Line::End { .. } | Line::Stopped { .. }));
    assert!(end.is_none_or(|at| at + 1 == rest.len()), "lines follow the end: {rest:?}");
    assert_eq!(verdict.complete, matches!(rest.last(), Some(Line::End { .. })), "{rest:?}");
    // Each tick comes once, in order.
    let (mut next, mut frames, mut skipped, mut lost, mut seconds) = (0, 0, 0, 0, 0);
    // Ticks of commands; and the compared parts: frames and commands before the end of a second that has its hash.
    let (mut commands, mut compared) = (Vec::new(), (0, 0));
    for line in rest {
        match line {
            Line::Command { tick, .. } | Line::StepFinished { tick, .. } => {
                commands.extend(matches!(line, Line::Command { .. }).then_some(*tick));
                assert!(*tick >= next, "{line:?} after tick {next}");
                frames += tick - next;
                next = *tick;
            }
            Line::Skipped { from, to } | Line::Lost { from, to } => {
                assert!(*from >= next && to >= from, "{line:?} after tick {next}");
                frames += from - next;
                let count = if matches!(line, Line::Lost { .. }) { &mut lost } else { &mut skipped };
                *count += to - from + 1;
                next = to + 1;
            }
            Line::Second(SecondLine { to, from, second, .. }) => {
                assert!(to >= from && *second == (*from as f64 / rate) as u64, "{line:?}");
                frames += (to + 1).saturating_sub(next);
                next = next.max(to + 1);
                seconds += 1;
                compared = (frames, commands.iter().filter(|tick| **tick < next).count() as u64);
            }
            Line::End { frames: claimed, skipped: passed, lost: missing, .. } => {
                assert_eq!((*claimed, *passed, *missing), (frames, skipped, lost), "{line:?}");
            }
            Line::Show(_) => panic!("a second show"),
            Line::Stopped { .. } => (),
        }
    }
    assert_eq!((verdict.frames, verdict.commands), compared, "{verdict:?}");
    assert_eq!((verdict.seconds, verdict.skipped, verdict.lost), (seconds, skipped, lost), "{verdict:?}");
    if verdict.verdict == "same" {
        check_same(show, rest);
    }
}

/// Asserts that the seconds of a log are those of its show.
fn check_same(show: &ShowLine, lines: &[Line]) {
    let playback = show.playback().expect("it was played");
    let mut again = Writer::new(show, playback);
    for line in lines {
        match line {
            Line::Command { tick, command, value, .. } => {
                let number = Command::named(command).expect("a command").number;
                let command = Command::of_number(number, value.unwrap_or(f64::NAN)).expect("a command");
                again.command(*tick, command);
            }
            Line::Skipped { from, to } => again.skip(*from, *to),
            Line::Lost { from, to } => {
                again.play_to(*from, true);
                again.play_to(to + 1, false);
            }
            Line::Second(SecondLine { to, .. }) => {
                again.play_to(to + 1, true);
                let own = again.second();
                assert_eq!(serde_json::to_value(&own).ok(), serde_json::to_value(line).ok(), "reported as the same");
            }
            _ => (),
        }
    }
}

/// Writes a log.
struct Writer {
    show: Show,
    rate: f64,
    tick: u64,
    sequence: u64,
    /// The ticks since the latest hash that are part of the next one.
    hashed: Vec<u64>,
    hasher: blake3::Hasher,
    last: (f64, Vec<(u32, f64, f64)>),
    lines: Vec<Line>,
}

impl Writer {
    fn new(show: &ShowLine, playback: Playback) -> Self {
        let scene: Scene = show.scene_text("fuzz").parse().expect("it was played");
        let timeline = timeline(&show.scene, &scene);
        Self {
            show: Show::new(&scene, timeline, playback).expect("it was played"),
            rate: playback.rate,
            tick: 0,
            sequence: 0,
            hashed: Vec::new(),
            hasher: blake3::Hasher::new(),
            last: Default::default(),
            lines: Vec::new(),
        }
    }

    fn command(&mut self, tick: u64, command: Command) {
        self.play_to(tick, true);
        self.show.command(tick, command);
        self.show.finished_step(tick);
    }

    fn skip(&mut self, from: u64, to: u64) {
        self.play_to(from, true);
        self.tick = to + 1;
    }

    /// Plays the frames before a tick.
    fn play_to(&mut self, tick: u64, hashed: bool) {
        for tick in self.tick..tick {
            let frame = self.show.frame(tick);
            let records: Vec<CommandRecord> = frame.commands.clone();
            self.lines.extend(records.into_iter().map(|record| Line::of(tick, record)));
            if hashed {
                let stamps = Stamps { run_id: 0, sequence: self.sequence, stamp_ns: 0, deadline_ns: 0 };
                let header = frame_header(frame, stamps);
                let floats = [header.sim_time, header.time_scale, header.min_clearance];
                let words = [header.handles, header.state, header.playback, header.cue, header.epoch, header.reserved];
                let mut bytes = [header.sequence, header.tick].map(u64::to_le_bytes).concat();
                bytes.extend(floats.iter().flat_map(|float| float.to_le_bytes()));
                bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
                for pose in handle_poses(&frame.chain) {
                    let floats = [pose.x, pose.y, pose.heading, pose.vx, pose.vy];
                    bytes.extend(floats.iter().flat_map(|float| float.to_le_bytes()));
                }
                self.hasher.update(&bytes);
                self.hashed.push(tick);
                let (count, last) = (frame.chain.x.len().min(5), frame.chain.x.len() - 1);
                let sampled = (0..count).map(|k| k * last / (count - 1).max(1));
                let places = sampled.map(|handle| (handle as u32, frame.chain.x[handle], frame.chain.y[handle]));
                self.last = (frame.sim_time, places.collect());
            }
            self.show.finished_step(tick);
            (self.tick, self.sequence) = (tick + 1, self.sequence + 1);
        }
    }

    /// Returns the line of the second that has ended.
    fn second(&mut self) -> Line {
        let ticks = std::mem::take(&mut self.hashed);
        let (from, to) = (ticks.first().copied().unwrap_or(0), ticks.last().copied().unwrap_or(0));
        let (hash, (sim_time, handles)) = (self.hasher.finalize().to_hex().to_string(), self.last.clone());
        self.hasher.reset();
        let second = (from as f64 / self.rate) as u64;
        Line::Second(SecondLine { second, from, to, frames: ticks.len() as u64, hash, sim_time, handles })
    }
}

/// Returns the timeline of a scene, searched once.
fn timeline(text: &str, scene: &Scene) -> Timeline {
    static KNOWN: OnceLock<Mutex<HashMap<String, Timeline>>> = OnceLock::new();
    let mut known = KNOWN.get_or_init(Mutex::default).lock().unwrap_or_else(|error| error.into_inner());
    if known.len() > 1000 {
        known.clear();
    }
    let search = || match scene.alerts {
        Some(_) => scene.ensemble.timeline(&mut unreported),
        None => scene.ensemble.timeline_without_contact(&mut unreported),
    };
    known.entry(text.to_owned()).or_insert_with(search).clone()
}

/// Returns a log of these lines, each with a correct check.
fn chained(bodies: &[String]) -> Vec<u8> {
    let (mut hasher, mut log) = (blake3::Hasher::new(), Vec::new());
    for body in bodies {
        hasher.update(body.as_bytes());
        let end = format!("{CHECK}{}\"}}\n", &hasher.finalize().to_hex()[..16]);
        hasher.update(end.as_bytes());
        log.extend([body.as_bytes(), end.as_bytes()].concat());
    }
    log
}

fn body(line: &Line) -> String {
    let mut text = serde_json::to_string(line).expect("a line");
    text.pop();
    text
}

/// Returns logs of some seconds in this machine's arithmetic, with commands, skipped periods and lost frames.
fn seeds() -> Vec<Vec<u8>> {
    let path = "[path]\nkind = \"pieces\"\n[[path.pieces]]\nkind = \"line\"\nlength = 3.0\n";
    let alerts = "[alerts]\napproach_time = 2.0\n";
    let team = |benches: u32, more: &str| {
        format!(
            "[team]\nbenches = {benches}\nhead_length = 3.41\nbody_length = 2.20\nwidth = 0.30\nhole_inset = 0.275\n\
             {path}[motion]\nhead_speed = 1.0\nsolver = \"newton\"\n{more}"
        )
    };
    let cue = "[[cues]]\nname = \"wait\"\nat = 0.7\nthen = \"pause\"\n";
    let scenes =
        [team(1, ""), team(2, cue), team(4, ""), team(2, "at_end = \"loop\"\nend_hold = 0.5\n"), team(1, alerts)];
    let commands = [
        (3, Command::Pause),
        (4, Command::Step(2)),
        (8, Command::Rate(2.0)),
        (9, Command::Resume),
        (12, Command::Seek(0.5)),
        (13, Command::Hold),
        (14, Command::Release),
        (15, Command::Restart),
        (16, Command::Go),
    ];
    let mut logs = Vec::new();
    for text in scenes {
        for given in [0, 4, 9] {
            let scene = SceneText { text: text.clone(), file: "seed.toml".to_owned(), stem: "seed".to_owned() };
            let parsed: Scene = scene.parse().expect("a scene");
            let playback = Playback { rate: 5.0, ..Playback::of(&parsed) };
            let show = ShowLine::new(&scene, &playback, Arithmetic::of(&parsed), "newton", 1, 2);
            let log = log_of(&show, playback, &commands[..given], given == 4);
            let verdict = verify(log.as_slice(), "seed.jsonl", &mut |_| ()).expect("a log");
            assert!(verdict.verdict == "same" && verdict.complete, "{verdict:?}");
            logs.push(log);
        }
    }
    logs
}

/// Returns the log of four seconds; with `gap`, ticks 6 and 7 are skipped and ticks 12 and 13 lost.
fn log_of(show: &ShowLine, playback: Playback, commands: &[(u64, Command)], gap: bool) -> Vec<u8> {
    let mut writer = Writer::new(show, playback);
    let mut bodies = vec![body(&Line::Show(Box::new(show.clone())))];
    let (mut frames, mut skipped, mut lost) = (0, 0, 0);
    for tick in 0..20 {
        for (_, command) in commands.iter().filter(|(at, _)| *at == tick) {
            writer.command(tick, *command);
        }
        let (skip, lose) = (gap && [6, 7].contains(&tick), gap && [12, 13].contains(&tick));
        if skip {
            writer.skip(tick, tick);
        } else {
            writer.play_to(tick + 1, !lose);
        }
        bodies.extend(std::mem::take(&mut writer.lines).iter().map(body));
        if gap && tick == 7 {
            bodies.push(body(&Line::Skipped { from: 6, to: 7 }));
        }
        if gap && tick == 13 {
            bodies.push(body(&Line::Lost { from: 12, to: 13 }));
        }
        (skipped, lost) = (skipped + u64::from(skip), lost + u64::from(lose));
        frames += u64::from(!skip && !lose);
        if tick % 5 == 4 {
            bodies.push(body(&writer.second()));
        }
    }
    let reason = bench_dragon::publisher::live::End::Duration;
    bodies.push(body(&Line::End { frames, skipped, lost, reason }));
    chained(&bodies)
}

fn mutate(data: &[u8], random: &mut Rng) -> Vec<u8> {
    if random.u8(..16) == 0 {
        return changed(data, random);
    }
    let text = String::from_utf8_lossy(data);
    let mut bodies: Vec<String> = text.lines().filter_map(|line| Some(line.rsplit_once(CHECK)?.0.to_owned())).collect();
    if bodies.is_empty() {
        return changed(data, random);
    }
    for _ in 0..1 + random.usize(..2) {
        let (at, other) = (random.usize(..bodies.len()), random.usize(..bodies.len()));
        match random.u8(..10) {
            0 if at > 0 => drop(bodies.remove(at)),
            1 => bodies.insert(at, bodies[other].clone()),
            2 => bodies.swap(at, other),
            3 => bodies[at] = String::from_utf8_lossy(&changed(bodies[at].as_bytes(), random)).into_owned(),
            4 => {
                let words = ["command", "pause", "second", "skipped", "lost", "stopped", "end", "step", "hold", "stop"];
                let (from, to) = (one(&words, random), one(&words, random));
                bodies[at] = bodies[at].replace(&format!("\"{from}\""), &format!("\"{to}\""));
            }
            5 => {
                let tick = random.u64(..25);
                let (from, to) = (tick, tick + random.u64(..3));
                let line = match random.u8(..5) {
                    0 => Line::Skipped { from, to },
                    1 => Line::Lost { from, to },
                    2 => Line::Stopped { tick },
                    _ => {
                        let command = one(&Command::TABLE, random).name.to_owned();
                        Line::Command { tick, command, value: Some(3.0), code: Some("done".to_owned()) }
                    }
                };
                bodies.insert(at.max(1).min(bodies.len()), body(&line));
            }
            6 => bodies[at] = revalued(&bodies[at], random),
            7 => bodies[0] = revalued(&bodies[0], random),
            _ => bodies[at] = renumbered(&bodies[at], random),
        }
    }
    chained(&bodies)
}

/// Replaces the value of a field by a limit, null, or a text.
fn revalued(body: &str, random: &mut Rng) -> String {
    let Ok(Value::Object(mut fields)) = serde_json::from_str(&format!("{body}}}")) else {
        return body.to_owned();
    };
    let Some(name) = fields.keys().nth(random.usize(..fields.len().max(1))).cloned() else { return body.to_owned() };
    if let Some(Value::Array(list)) = fields.get_mut(&name).filter(|_| random.bool()) {
        // A list that is shorter, longer, reordered, or empty.
        let (at, other) = (random.usize(..list.len().max(1)), random.usize(..list.len().max(1)));
        match random.u8(..4) {
            0 => list.truncate(at),
            1 if at < list.len() => drop(list.remove(at)),
            2 if at < list.len() => list.push(list[at].clone()),
            _ if at < list.len() => list.swap(at, other),
            _ => (),
        }
        return unclosed(fields);
    }
    let old = &fields[&name];
    let borders = [
        "0",
        "-1",
        "1",
        "2",
        "3",
        "0.09",
        "0.1",
        "20000",
        "20001",
        "1e6",
        "1000001",
        "1e-6",
        "9e-7",
        "1e300",
        "1e-300",
        "18446744073709551615",
        "18446744073709551614",
        "null",
        "\"stop\"",
        "\"\\u001b[31m\\n\"",
        "[]",
        "true",
        "false",
    ];
    let near = old.as_u64().map(|number| (number.wrapping_add(random.u64(..3)).wrapping_sub(1)).to_string());
    let new = near.filter(|_| random.bool()).unwrap_or_else(|| (*one(&borders, random)).to_owned());
    fields[&name] = serde_json::from_str(&new).expect("JSON");
    unclosed(fields)
}

/// Returns a line without its end, to which its check is added.
fn unclosed(fields: Map<String, Value>) -> String {
    let mut text = Value::Object(fields).to_string();
    text.pop();
    text
}
