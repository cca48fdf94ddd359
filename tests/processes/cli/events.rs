//! `events` and `check`: every event of every scene, in text and as JSON, with the bits of the library's timeline.

use bench_dragon::messages::state::EventKind;
use bench_dragon::motion::event::unreported;
use serde_json::Value;

use crate::cli::scenes::{SceneFile, assert_keys, numbers, program, same_bits, scene, scenes};
use crate::harness::{Process, text};

const KINDS: [&str; 4] = ["contact", "stall", "lock", "path_end"];

#[test]
fn events_as_json_are_the_timeline_bit_for_bit() {
    for scene in scenes() {
        let lines = scene.answer(&["events", "--json"]);
        let timeline = scene.load().ensemble.timeline(&mut unreported);
        assert_eq!(lines.lines().count(), timeline.events().len(), "{}: {lines}", scene.name);
        for (line, timed) in lines.lines().zip(timeline.events()) {
            let event: Value = serde_json::from_str(line).unwrap();
            assert_eq!(event["event"], timed.event.kind.name(), "{}", scene.name);
            assert_eq!(event["bench_a"].as_u64(), timed.event.bench_a.map(u64::from), "{line}");
            assert_eq!(event["bench_b"].as_u64(), timed.event.bench_b.map(u64::from), "{line}");
            let place = timed.event.place.map_or([f64::NAN; 2], |place| [place.x, place.y]);
            let [time, .., x, y] = numbers(line)[..] else { panic!("{line}") };
            for (printed, solved) in [(time, timed.time), (x, place[0]), (y, place[1])] {
                assert!(same_bits(printed, solved), "{}: {printed} is printed of {solved}", scene.name);
            }
        }
    }
}

#[test]
fn events_have_their_keys_in_order_of_time_and_once_a_kind() {
    for scene in scenes() {
        let events = scene.json(&["events"]);
        for event in &events {
            assert_keys(event, &["event", "time", "bench_a", "bench_b", "x", "y"]);
            let present = ["bench_a", "bench_b", "x", "y"].map(|key| !event[key].is_null());
            let expected = match event["event"].as_str().unwrap() {
                "contact" => [true, true, true, true],
                "stall" | "lock" => [true, false, true, true],
                "path_end" => [false, false, false, false],
                other => panic!("{other} is no event"),
            };
            assert_eq!(present, expected, "{event}");
            let benches = [&event["bench_a"], &event["bench_b"]].map(|bench| bench.as_u64().unwrap_or(0) as usize);
            assert!(benches.into_iter().all(|bench| bench < scene.benches()), "{event}");
            if event["event"] == "contact" {
                assert!(benches[0] + 1 < benches[1], "these share a handle: {event}");
            }
        }
        let times: Vec<f64> = events.iter().map(|event| event["time"].as_f64().unwrap()).collect();
        assert!(times.is_sorted() && times[0] >= 0.0, "{}: {times:?}", scene.name);
        let kinds: Vec<&str> = events.iter().map(|event| event["event"].as_str().unwrap()).collect();
        for kind in KINDS {
            assert!(kinds.iter().filter(|other| **other == kind).count() <= 1, "{}: {kinds:?}", scene.name);
        }
        let ends: Vec<_> = kinds.iter().filter(|kind| ["lock", "path_end"].contains(kind)).collect();
        assert_eq!(ends, [kinds.last().unwrap()], "{}: one end, and it is the last: {kinds:?}", scene.name);
    }
}

/// Figures of the design, computed with 50 digits.
#[test]
fn events_of_the_paper_scene_are_the_known_ones() {
    let known = [
        ("contact", 412.473837682115, Some(0), Some(8)),
        ("stall", 432.758134083656, Some(0), None),
        ("lock", 432.917924228383, Some(0), None),
    ];
    for scene in [scene("paper"), scene("ros2")] {
        let events = scene.json(&["events"]);
        assert_eq!(events.len(), known.len());
        for (event, (kind, time, a, b)) in events.iter().zip(known) {
            assert_eq!(event["event"], kind);
            assert!((event["time"].as_f64().unwrap() - time).abs() < 1e-9, "{event}");
            assert_eq!((event["bench_a"].as_u64(), event["bench_b"].as_u64()), (a, b));
        }
    }
    // Without --scene it is the paper's, which is built in.
    let built_in = Process::start(program().args(["events", "--json"]));
    let built_in = text(&built_in.output().stdout);
    assert_eq!(built_in, scene("paper").answer(&["events", "--json"]));
}

/// The times of these scenes differ by the further distance of their heads, since their last turns are the same.
#[test]
fn events_of_scenes_with_the_same_last_turns_differ_by_the_way_there() {
    let metres_per_radian = 0.55 / std::f64::consts::TAU;
    let length = |turn: f64| {
        let theta = std::f64::consts::TAU * turn;
        0.5 * metres_per_radian * (theta * 1f64.hypot(theta) + theta.asinh())
    };
    for (name, turn) in [("school", 6.0), ("long", 60.0)] {
        let further = length(turn) - length(16.0);
        let (events, of_paper) = (scene(name).json(&["events"]), scene("paper").json(&["events"]));
        assert_eq!(events.len(), of_paper.len(), "{name}");
        for (event, paper) in events.iter().zip(of_paper) {
            let (time, expected) = (event["time"].as_f64().unwrap(), paper["time"].as_f64().unwrap() + further);
            assert!((time - expected).abs() < 1e-9, "{name}: {event}, expected {expected}");
            assert_eq!((&event["bench_a"], &event["bench_b"]), (&paper["bench_a"], &paper["bench_b"]));
        }
    }
}

/// Asserts that no number in a sentence for people has sixteen digits, or an exponent that is only rounding.
fn assert_short_numbers(line: &str) {
    let longest = line.split(|c: char| !c.is_ascii_digit()).map(str::len).max().unwrap();
    assert!(longest <= 9 && !line.contains("e-16") && !line.contains("e-17"), "{line}");
}

/// Asserts that a sentence has the event's values, counts benches from 1, and states that.
fn assert_sentence(scene: &SceneFile, event: &Value, line: &str) {
    let kind = event["event"].as_str().unwrap();
    assert!(line.trim_start().starts_with(kind), "{}: {line}", scene.name);
    let time: f64 = line.split_once("t = ").and_then(|(_, rest)| rest.split_once(" s:")).unwrap().0.parse().unwrap();
    // For people, times are printed to a billionth; --json has all digits.
    assert!((time - event["time"].as_f64().unwrap()).abs() <= 0.51e-9, "{line}: {event}");
    assert_short_numbers(line);
    for bench in ["bench_a", "bench_b"].into_iter().filter_map(|key| event[key].as_u64()) {
        let name = format!("bench {}", bench + 1);
        let named = line.match_indices(&name).any(|(at, _)| !line[at + name.len()..].starts_with(char::is_numeric));
        assert!(named && line.contains("counting from 1"), "{line}: {event}");
    }
}

#[test]
fn events_in_text_name_every_event_what_never_happens_and_the_least_clearance() {
    for scene in scenes() {
        let events = scene.json(&["events"]);
        let text = scene.answer(&["events"]);
        let lines: Vec<&str> = text.lines().collect();
        for (event, line) in events.iter().zip(&lines) {
            assert_sentence(&scene, event, line);
        }
        let happens = |kind: &str| events.iter().any(|event| event["event"] == kind);
        let mut rest = lines[events.len()..].iter();
        for kind in ["contact", "stall"].into_iter().filter(|kind| !happens(kind)) {
            assert_eq!(rest.next(), Some(&format!("There is no {kind} before the motion ends.").as_str()));
        }
        let least = rest.next().unwrap();
        assert!(least.contains("least clearance") && least.contains("counting from 1"), "{least}");
        assert_short_numbers(least);
        if happens("contact") && scene.name == "paper" {
            assert!(least.contains("of the whole route is -0.08"), "boards overlap after the contact: {least}");
        }
        assert_eq!(rest.next(), None, "{}: {text}", scene.name);
    }
}

#[test]
fn check_states_what_each_scene_models() {
    for scene in scenes() {
        let text = scene.answer(&["check"]);
        assert!(text.starts_with(&format!("Scene \"{}\" is valid.\n", scene.name)), "{text}");
        let line = |label: &str| {
            let found = text.lines().find_map(|line| line.trim_start().strip_prefix(label));
            found.unwrap_or_else(|| panic!("{}: no {label} in {text}", scene.name))
        };
        let team = line("Team: ");
        assert!(team.contains(&format!("{} benches, {} handles", scene.benches(), scene.handles())), "{team}");
        let path = line("Path: ");
        let word = match scene.content["path"]["kind"].as_str().unwrap() {
            "spiral" => "inward spiral",
            "turnaround" => "outward along a spiral",
            "pieces" => "straight on",
            other => panic!("this test knows no words for a {other}"),
        };
        assert!(path.contains(word), "{path}");
        assert!(line("Solver: ").contains(": "), "the solver and why: {text}");
        assert_eq!(line("Alerts: ").starts_with("none"), !scene.content.contains_key("alerts"), "{text}");
        let rate = scene.number("publish", "rate");
        assert!(line("Publishing: ").starts_with(&format!("{rate} frames per second")), "{text}");
        let topics = scene.content["publish"].get("ros2").map(|ros2| ros2["topics"].as_array().unwrap().len());
        let ros2 = line("ROS 2: ");
        match topics {
            Some(count) => assert_eq!(ros2.split(" at ").next().unwrap().split(", ").count(), count, "{ros2}"),
            None => assert!(ros2.starts_with("nothing"), "{ros2}"),
        }
        for event in scene.answer(&["events"]).lines().filter(|line| line.contains(" t = ") && line.contains(" s: ")) {
            assert!(text.lines().any(|line| line.trim_start() == event.trim_start()), "no {event} in {text}");
        }
        let least = line("The least clearance");
        let figure = |mark: &str| -> f64 {
            least.split(mark).next().and_then(|before| before.split_whitespace().last()).unwrap().parse().unwrap()
        };
        let (metres, time) = (figure(" m, at t ="), figure(" s, between"));
        let contact = scene.json(&["events"]).into_iter().find(|event| event["event"] == "contact");
        let on_contact = scene.content["motion"].get("on_contact").and_then(|value| value.as_str());
        let stops = scene.content.contains_key("alerts") && on_contact != Some("continue");
        // The least clearance is of the whole route, where boards overlap after a contact.
        match &contact {
            Some(contact) => {
                let at = contact["time"].as_f64().unwrap();
                assert!(metres < 0.0 && time > at, "{}: {least}", scene.name);
            }
            None => assert!(metres > 0.0, "{}: {least}", scene.name),
        }
        assert_eq!(text.contains("The show stops at t = "), contact.is_some() && stops, "{text}");
        let at_contact = line("At a contact the show ");
        assert!(at_contact.starts_with(if stops { "freezes" } else { "continues" }), "{at_contact}");
    }
    let noalerts = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/noalerts.toml");
    let text = text(&Process::start(program().args(["check", "--scene", noalerts])).output().stdout);
    assert!(text.contains("At a contact the show continues, unnoticed;"), "{text}");
}

/// Returns the time of the event of that kind in the library's timeline.
pub fn time_of(scene: &SceneFile, kind: EventKind) -> Option<f64> {
    scene.load().ensemble.timeline(&mut unreported).find(kind).map(|timed| timed.time)
}
