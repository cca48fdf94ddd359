//! A show under commands: still while paused, at its place after a seek, its cues.

use super::*;
use crate::scene::AtEnd;
use bench_dragon_messages::state::Level;
use bench_dragon_motion::Method;
use bench_dragon_motion::event::unreported;

const RATE: f64 = 50.0;

fn show(extra: &str, change: impl FnOnce(&mut Playback)) -> Show {
    let text = format!("{}\n{extra}", include_str!("../../../config/paper.toml"));
    let scene = Scene::parse(&text, "test", "test").unwrap();
    // The safe solver needs no table: an unoptimised build would spend seconds on it.
    let ensemble = scene.ensemble.try_map(|motion| motion.with_method(Method::Newton)).unwrap();
    let scene = Scene { ensemble, ..scene };
    let mut playback = Playback { rate: RATE, ..Playback::of(&scene) };
    change(&mut playback);
    let timeline = scene.ensemble.timeline(&mut unreported);
    Show::new(&scene, timeline, playback).unwrap()
}

fn speed(frame: &Frame) -> f64 {
    frame.chain.vx[0].hypot(frame.chain.vy[0])
}

#[test]
fn a_pause_stands_still_and_goes_on_where_it_stood() {
    let mut show = show("", |playback| playback.start = 100.0);
    show.frame(10);
    let outcome = show.command(11, Command::Pause).unwrap();
    assert_eq!((outcome.code, outcome.tick, outcome.playback), (Code::Done, 11, PlaybackState::Paused));
    assert_eq!((outcome.sim_time, outcome.time_scale), (100.22, 0.0));
    let moving = show.frame(11).clone();
    let still = show.frame(400).clone();
    assert_eq!((still.sim_time, still.time_scale, still.playback), (100.22, 0.0, PlaybackState::Paused));
    assert_eq!((speed(&still), still.epoch), (0.0, 0));
    assert!(still.chain.x == moving.chain.x);
    assert_eq!(show.command(401, Command::Resume).unwrap().code, Code::Done);
    let first = show.frame(401).clone();
    assert_eq!((first.sim_time, first.playback), (100.22, PlaybackState::Playing));
    assert!((speed(&first) - 1.0).abs() < 1e-12);
    assert_eq!(show.frame(451).sim_time, 101.22);
}

#[test]
fn after_a_seek_an_alert_reports_where_the_show_stands() {
    let mut show = show("", |playback| playback.start = 300.0);
    assert_eq!(show.frame(0).alerts.iter().map(|alert| alert.level).collect::<Vec<_>>(), [Level::Clear]);
    for (tick, time, level) in [
        (10, 405.0, Level::Approaching),
        (20, 406.0, Level::Approaching),
        (30, 412.473837682115, Level::Contact),
        (40, 20.0, Level::Clear),
    ] {
        let seek = show.command(tick, Command::Seek(time)).unwrap();
        assert_eq!(seek.code, if time > show.freeze_time() { Code::OutOfRange } else { Code::Done }, "{time}");
        let time = if seek.code == Code::Done { time } else { show.freeze_time() };
        if seek.code != Code::Done {
            show.command(tick, Command::Seek(time)).unwrap();
        }
        let frame = show.frame(tick);
        let alerts: Vec<_> = frame.alerts.iter().map(|alert| alert.level).collect();
        assert_eq!(alerts, [level], "at {time}");
        assert_eq!((frame.sim_time, frame.epoch as u64), (time, tick / 10));
    }
}

#[test]
fn a_looping_show_stands_at_its_end_before_it_begins_again() {
    let mut show = show("", |playback| {
        (playback.start, playback.at_end, playback.end_hold) = (412.4, AtEnd::Loop, 2.0);
    });
    // 0.0738 s at 50 Hz: the fourth frame after the first is at the end, and stays for 100 periods.
    let end = show.freeze_time();
    for tick in 4..=104 {
        let frame = show.frame(tick);
        assert_eq!((frame.sim_time, frame.playback, frame.epoch), (end, PlaybackState::Ended, 0), "{tick}");
    }
    let again = show.frame(105);
    assert_eq!((again.sim_time, again.epoch, again.shows_played), (412.4, 1, 1));
}

#[test]
fn nothing_is_counted_down_while_the_show_stands_still() {
    let mut show = show("", |playback| playback.start = 405.0);
    let mut alerts = |ticks: std::ops::Range<u64>, command| {
        show.command(ticks.start, command);
        ticks.map(|tick| show.frame(tick).alerts.len()).sum::<usize>()
    };
    assert_eq!(alerts(0..101, Command::State), 3, "the level, and two seconds counted down");
    assert_eq!(alerts(101..401, Command::Pause), 0);
    assert_eq!(alerts(401..452, Command::Resume), 1);
}

const CUES: &str = "[[cues]]\nname = \"last\"\nbefore = \"contact\"\nseconds = 5.0\n\
                    [[cues]]\nname = \"wait\"\nat = 3.0\nthen = \"pause\"\n\
                    [[cues]]\nname = \"first\"\ntravelled = 1.0\n\
                    [[cues]]\nname = \"never\"\nbefore = \"path_end\"\n";

#[test]
fn cues_are_reached_once_in_the_order_of_their_times() {
    let mut show = show(CUES, |_| ());
    let names: Vec<_> = show.cues().iter().map(|cue| (cue.number, &*cue.name, cue.pauses)).collect();
    assert_eq!(names, [(1, "first", false), (2, "wait", true), (3, "last", false)]);
    assert_eq!(show.missing_cues(), ["never"]);
    let reached = |frame: &Frame| frame.cues.iter().map(|cue| cue.number).collect::<Vec<_>>();
    assert_eq!((reached(show.frame(49)), show.frame(49).cue), (vec![], 0));
    assert_eq!((reached(show.frame(50)), show.frame(50).cue), (vec![1], 1));
    // One step over the pausing cue and far beyond: the show waits at the cue.
    let frame = show.frame(100_000).clone();
    assert_eq!((frame.sim_time, frame.playback, reached(&frame)), (3.0, PlaybackState::Paused, vec![2]));
    assert_eq!(show.command(100_001, Command::Go).unwrap().code, Code::Done);
    assert_eq!(show.command(100_002, Command::Go).unwrap().code, Code::Refused);
    let frame = show.frame(100_001 + 50).clone();
    assert_eq!((frame.sim_time, reached(&frame)), (4.0, vec![]));
    // A seek over the last cue announces none; back before the cue, it is reached again.
    show.command(100_100, Command::Seek(410.0)).unwrap();
    assert_eq!((reached(show.frame(100_100)), show.frame(100_100).cue), (vec![], 3));
    show.command(100_101, Command::Seek(407.0)).unwrap();
    assert_eq!((reached(show.frame(100_101)), show.frame(100_101).cue), (vec![], 2));
    let frame = show.frame(100_101 + 50).clone();
    assert_eq!((reached(&frame), frame.cue), (vec![3], 3));
}
