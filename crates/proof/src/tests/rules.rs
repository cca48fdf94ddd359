//! The rules of the file, on a certificate short enough to be written by hand: three benches go straight on.

use serde_json::{Value, json};

use crate::{Proved, Refused, verify};

pub(super) const SCENE: &str = r#"
[team]
benches = 3
head_length = 3.0
body_length = 2.5
width = 0.5
hole_inset = 0.25

[path]
kind = "pieces"
start = [1.0, 2.0]
heading_turns = 0.125
pieces = [{ kind = "line", length = 4.0 }, { kind = "line", length = 6.0 }]

[motion]
head_speed = 2.0
"#;

/// Returns the place `metres` from the start.
pub(super) fn place(metres: f64) -> Value {
    match metres {
        _ if metres < 0.0 => json!([0, metres]),
        _ if metres < 4.0 => json!([1, metres]),
        _ => json!([2, metres - 4.0]),
    }
}

/// Metres from the head back to handles 1, 2, 3, and the half width of each span.
pub(super) const BACK: [(f64, f64); 3] = [(2.5, 0.01), (4.5, 0.02), (6.5, 0.03)];

/// Returns the step from `from` to `to`.
pub(super) fn step(from: f64, to: f64) -> Value {
    let spans: Vec<_> =
        BACK.iter().map(|(back, more)| json!([place(from - back - more), place(to - back + more)])).collect();
    json!({"type": "step", "links": "all", "from": place(from), "to": place(to), "moving": true, "clear": true,
        "spans": spans})
}

pub(super) fn certificate() -> Vec<Value> {
    let mut lines = vec![json!({"type": "certificate", "format": 4, "version": "0.1.0", "scene": SCENE})];
    let ends = [-0.5, 0.3, 1.3, 2.3, 3.3, 4.3, 5.3, 6.3, 7.3, 8.3, 9.3, 10.0];
    lines.extend(ends.windows(2).map(|ends| step(ends[0], ends[1])));
    lines.push(json!({"type": "path_end"}));
    lines.extend(
        ["contact", "stall", "lock"]
            .map(|event| json!({"type": "result", "of": "event", "event": event, "status": "none"})),
    );
    lines.push(
        json!({"type": "result", "of": "event", "event": "path_end", "status": "proved", "time_lo": 5.0, "time_hi": 5.0,
        "bench_a": null, "bench_b": null}),
    );
    lines
}

pub(super) fn check(lines: &[Value]) -> Result<Proved, Refused> {
    let text: String = lines.iter().map(|line| format!("{line}\n")).collect();
    verify(text.as_bytes(), &mut |_| {})
}

#[track_caller]
pub(super) fn assert_refused(lines: &[Value], line: u64, says: &str) {
    match check(lines) {
        Ok(_) => panic!("accepted, expected: {says}"),
        Err(error) => {
            let sentence = error.to_string();
            assert!(sentence.starts_with(&format!("line {line}: ")) && sentence.contains(says), "{sentence}");
        }
    }
}

/// Returns the certificate with one change.
fn changed(change: impl FnOnce(&mut Vec<Value>)) -> Vec<Value> {
    let mut lines = certificate();
    change(&mut lines);
    lines
}

#[test]
fn what_follows_is_accepted() {
    let proved = check(&certificate()).unwrap();
    assert_eq!((proved.steps, proved.links, proved.pairs, proved.results.len()), (11, 33, 11, 4));
    // A certificate may claim less than it shows.
    check(&changed(|lines| {
        lines[16]["time_lo"] = json!(4.9);
        lines[13] =
            json!({"type": "result", "of": "event", "event": "contact", "status": "undecided", "time_lo": 5.0, "because": "-"});
    }))
    .unwrap();
    // Handles on the line behind the start need not be listed.
    check(&changed(|lines| {
        for line in &mut lines[1..3] {
            line["spans"].as_array_mut().unwrap().truncate(1);
        }
        lines[3]["spans"].as_array_mut().unwrap().truncate(2);
    }))
    .unwrap();
}

#[test]
fn what_does_not_follow_is_refused() {
    let refused = |line: usize, says: &str, change: &dyn Fn(&mut Vec<Value>)| {
        assert_refused(&changed(|lines| change(lines)), line as u64 + 1, says);
    };
    // The chain of steps.
    refused(1, "begins beyond the start", &|lines| lines.drain(1..2).for_each(drop));
    refused(5, "does not begin where", &|lines| lines.drain(5..6).for_each(drop));
    refused(6, "does not begin where", &|lines| lines.insert(6, lines[5].clone()));
    refused(4, "does not begin where", &|lines| lines.swap(4, 5));
    refused(2, "is empty", &|lines| lines.insert(2, step(0.3, 0.3)));
    refused(11, "did not come to the end", &|lines| lines.drain(11..12).for_each(drop));
    refused(3, "the span's ends are not in order", &|lines| lines[3]["to"] = place(1.2));
    // A step longer than its spans.
    refused(3, "too far", &|lines| lines[3]["to"] = place(2.5));
    // Spans.
    for handle in 0..3 {
        let (back, more) = BACK[handle];
        refused(3, "too near", &|lines| lines[3]["spans"][handle][0] = place(1.3 - back - more + 0.02));
        refused(3, "too far", &|lines| lines[3]["spans"][handle][1] = place(2.3 - back + more - 0.02));
        refused(3, "not in order", &|lines| lines[3]["spans"][handle].as_array_mut().unwrap().reverse());
        refused(3, "Lemma 1", &|lines| lines[3]["spans"].as_array_mut().unwrap().swap(handle, (handle + 1) % 3));
    }
    refused(3, "is not behind", &|lines| lines[3]["spans"][0][1] = place(1.4));
    refused(4, "not all links are listed", &|lines| lines[4]["spans"].as_array_mut().unwrap().truncate(1));
    refused(4, "no span", &|lines| lines[4]["spans"] = json!([]));
    refused(4, "only 3 benches", &|lines| {
        lines[4]["spans"].as_array_mut().unwrap().push(json!([place(-9.0), place(-8.0)]))
    });
    // Places.
    for place in [
        json!([0, 0.0]),
        json!([0, 1e-300]),
        json!([1, -1.0]),
        json!([1, 4.0]),
        json!([1, 7]),
        json!([3, 1.0]),
        json!([2, 0.0]),
    ] {
        refused(5, "is not inside a segment", &|lines| lines[5]["spans"][0][1] = place.clone());
    }
    // Flags.
    refused(4, "moving after a step that does not", &|lines| lines[3]["moving"] = json!(false));
    refused(4, "clear after a step that does not", &|lines| lines[3]["clear"] = json!(false));
    refused(13, "none does not follow", &|lines| lines[11]["clear"] = json!(false));
    refused(14, "none does not follow", &|lines| lines[11]["moving"] = json!(false));
    // Front steps: handle 2 comes only later to the start of handle 1.
    refused(3, "handle 2 has not come", &|lines| lines[3]["links"] = json!("front"));
    refused(4, "links 0 and 1", &|lines| {
        lines[4]["links"] = json!("front");
        lines[4]["spans"].as_array_mut().unwrap().truncate(1);
    });
    // Results.
    refused(16, "does not follow", &|lines| lines[16]["time_hi"] = json!(4.999999999999999));
    refused(16, "does not follow", &|lines| lines[16]["time_lo"] = json!(5.000000000000001));
    refused(16, "a time is missing", &|lines| lines[16]["time_lo"] = json!(null));
    refused(16, "benches", &|lines| lines[16]["bench_a"] = json!(0));
    refused(13, "time_lo does not follow", &|lines| {
        lines[13] = json!({"type": "result", "of": "event", "event": "contact", "status": "undecided", "time_lo": 5.000000000000001});
    });
    for line in 13..15 {
        refused(line, "status proved does not follow", &|lines| {
            for (field, value) in [("status", json!("proved")), ("time_lo", json!(0.0)), ("time_hi", json!(9.0))] {
                lines[line][field] = value;
            }
        });
    }
    refused(13, "in this order", &|lines| lines.swap(13, 14));
    refused(17, "too many", &|lines| lines.push(lines[16].clone()));
    refused(13, "nothing but results", &|lines| lines.insert(13, step(10.0, 11.0)));
    refused(0, "ends before its results", &|lines| lines.truncate(16));
    refused(12, "none does not follow", &|lines| drop(lines.remove(12)));
    // Lines.
    refused(1, "unknown field", &|lines| lines[1]["more"] = json!(1));
    refused(1, "missing field", &|lines| drop(lines[1].as_object_mut().unwrap().remove("clear")));
    refused(0, "first line", &|lines| lines.drain(..1).for_each(drop));
    refused(1, "second first line", &|lines| lines.insert(1, lines[0].clone()));
    refused(0, "format 3", &|lines| lines[0]["format"] = json!(3));
    refused(5, "", &|lines| lines[5]["to"] = json!([1, null]));
    refused(5, "", &|lines| lines[5]["to"] = json!([-1, 2.0]));
    refused(5, "", &|lines| lines[5]["to"] = json!([1, 2.0, 3.0]));
}

/// A proof of one scene is no proof of a changed scene.
#[test]
fn another_scene_is_refused() {
    for (from, to) in [
        ("head_length = 3.0", "head_length = 3.1"),
        ("body_length = 2.5", "body_length = 1.9"),
        ("hole_inset = 0.25", "hole_inset = 0.3"),
        ("hole_inset = 0.25", "hole_inset = 0.75"),
        ("benches = 3", "benches = 4"),
        ("benches = 3", "benches = 2"),
        ("benches = 3", "benches = 0"),
        ("width = 0.5", "width = inf"),
        ("width = 0.5", "width = nan"),
        ("width = 0.5", "width = -0.5"),
        ("length = 6.0", "length = 6.1"),
        ("head_speed = 2.0", "head_speed = 1.9"),
        ("head_speed = 2.0", "head_speed = 0"),
        ("start = [1.0, 2.0]", "start = [1.0, nan]"),
        ("kind = \"pieces\"", "kind = \"spiral\""),
        ("kind = \"line\"", "kind = \"line\", radius = 1.0"),
        ("length = 4.0 }", "length = 4.0, turns = 1 }"),
    ] {
        assert!(SCENE.contains(from), "{from}");
        let scene = SCENE.replace(from, to);
        let outcome = check(&changed(|lines| lines[0]["scene"] = json!(scene)));
        assert!(outcome.is_err(), "{to}: {outcome:?}");
    }
}

/// An overlap or a stall before the start or beyond the end is not an event of the scene.
#[test]
fn events_outside_the_motion_are_refused() {
    let contact = |from: f64, to: f64| {
        let spans = &step(from, to)["spans"];
        json!({"type": "witness", "benches": [0, 2], "heads": [[place(from), place(to)]], "spans": [spans],
            "point": [0.0, 0.0]})
    };
    assert_refused(&changed(|lines| lines.insert(1, contact(-0.5, -0.4))), 2, "has not come to the start");
    assert_refused(&changed(|lines| lines.insert(1, contact(0.1, 0.4))), 2, "begins beyond the start");
    assert_refused(&changed(|lines| lines.insert(1, contact(-0.5, 0.4))), 2, "outside bench 0");
    assert_refused(&changed(|lines| lines.insert(3, contact(0.3, 0.4))), 4, "not where the last step ended");
    assert_refused(
        &changed(|lines| {
            lines.insert(12, step(10.0, 10.5));
            lines.insert(13, contact(10.4, 10.5));
        }),
        14,
        "beyond the end",
    );
}

#[test]
fn a_lock_at_no_place_is_refused() {
    for place in [json!([9, 1.0]), json!([1, -1.0])] {
        let mut lines = certificate();
        lines.truncate(4);
        lines.push(
            json!({"type": "lock", "link": 0, "to": place, "spans": [], "last": [], "window": [[1, 0.5], [1, 0.6]]}),
        );
        assert!(matches!(check(&lines), Err(Refused::DoesNotFollow { .. })), "{place}");
    }
}

#[test]
fn a_time_below_zero_is_refused() {
    let mut lines = certificate();
    let last = lines.len() - 1;
    lines[last]["time_lo"] = json!(-1.0);
    assert!(check(&lines).is_err());
}

#[test]
fn a_scene_of_the_papers_rules_is_refused() {
    let mut lines = certificate();
    lines[0]["scene"] = json!(SCENE.replace("head_speed", "solver = \"paper\"\nhead_speed"));
    assert!(check(&lines).is_err());
}

#[test]
fn an_obstacle_needs_its_result() {
    let mut lines = certificate();
    let post = "[stage]\n[[stage.obstacles]]\nname = \"post\"\ncircle = { center = [50.0, 50.0], radius = 0.5 }\n";
    lines[0]["scene"] = json!(format!("{SCENE}{post}"));
    let refused = check(&lines).unwrap_err();
    assert!(refused.to_string().contains("ends before its results"), "{refused:?}");
    assert!(check(&certificate()).is_ok());
}

/// The cost of a step grows with the obstacles, their corners and the pieces: no more than a show accepts.
#[test]
fn a_scene_larger_than_a_show_accepts_is_refused() {
    let refused = |scene: &str, says: &str| {
        let mut lines = certificate();
        lines[0]["scene"] = json!(scene);
        assert_refused(&lines, 1, says);
    };
    let corners: Vec<[f64; 2]> = (0..65).map(|corner| [f64::from(corner), 90.0]).collect();
    refused(&format!("{SCENE}[[stage.obstacles]]\nname = \"a\"\nline = {corners:?}\n"), "65 corners");
    let lamp = "[[stage.obstacles]]\nname = \"a\"\ncircle = { center = [90.0, 0.0], radius = 1.0 }\n";
    refused(&format!("{SCENE}{}", lamp.repeat(65)), "number of obstacles");
    let pieces = "{ kind = \"line\", length = 1.0 }, ".repeat(4096);
    refused(&SCENE.replace("pieces = [", &format!("pieces = [{pieces}")), "4098 pieces");
}
