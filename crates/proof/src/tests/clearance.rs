//! The rules of a certificate of the least clearance. Three benches go straight on: boards 0 and 2 are a link less two
//! insets apart, 1.5 m, at every moment.

use serde_json::{Value, json};

use super::rules::{BACK, assert_refused, certificate, check, place};
use crate::Until;

/// Returns the places of the head and all handles, the head `metres` from the start.
fn at(metres: f64) -> Value {
    let handles = BACK.iter().map(|(back, _)| place(metres - back));
    std::iter::once(place(metres)).chain(handles).collect()
}

/// Returns the line that benches 0 and 2 are no further apart than `most`, the head `metres` from the start.
fn near(metres: f64, most: f64) -> Value {
    let spans: Vec<_> = (BACK.iter().enumerate())
        .map(|(handle, (back, _))| (back, 1e-10 * (handle + 1) as f64))
        .map(|(back, more)| json!([place(metres - back - more), place(metres - back + more)]))
        .collect();
    json!({"type": "witness", "benches": [0, 2], "heads": [[place(metres), place(metres)]], "spans": [spans],
        "at": [at(metres)], "most": most})
}

/// Returns the step from `from` to `to`, in which boards are further apart than `apart`.
fn step(from: f64, to: f64, apart: f64) -> Value {
    let spans: Vec<_> = (BACK.iter().enumerate())
        .map(|(handle, (back, _))| (back, 1e-3 * (handle + 1) as f64))
        .map(|(back, more)| json!([place(from - back - more), place(to - back + more)]))
        .collect();
    json!({"type": "step", "links": "all", "from": place(from), "to": place(to), "moving": false, "clear": false,
        "spans": spans, "apart": apart, "at": at((from + to) / 2.0 + 1e-3)})
}

/// Numbers of lines, from 1: of the last step, the near place, the path's end, and the result.
const LAST: usize = 102;
const NEAR: usize = 103;
const END: usize = 104;
const RESULT: usize = 105;

/// Returns a certificate that boards are further than `apart` apart, and at one place no further than `most`.
fn clearance(apart: f64, most: f64) -> Vec<Value> {
    let mut lines = vec![certificate()[0].clone()];
    lines[0]["about"] = json!("least_clearance");
    let end = |step: usize| (0.1 * step as f64 - 0.05).min(10.0);
    lines.extend((0..101).map(|number| step(end(number), end(number + 1), apart)));
    lines.push(near(3.1, most));
    lines.push(json!({"type": "path_end"}));
    lines.push(
        json!({"type": "result", "of": "least_clearance", "lo": apart, "hi": most, "until": "path_end", "bench_a": 0,
            "bench_b": 2}),
    );
    lines
}

#[test]
fn the_clearance_of_a_straight_team_is_accepted() {
    let proved = check(&clearance(1.5 - 1e-4, 1.5 + 1e-9)).unwrap();
    let claim = proved.least_clearance.unwrap();
    assert_eq!((claim.lo, claim.hi, claim.until), (Some(1.5 - 1e-4), Some(1.5 + 1e-9), Until::PathEnd));
    assert_eq!((proved.steps, proved.results.len()), (101, 0));
    // A time before the path's end, 5 s; and nothing about an upper bound.
    let mut lines = clearance(1.4, 1.6);
    lines[RESULT - 1] =
        json!({"type": "result", "of": "least_clearance", "lo": 1.3, "until": "time", "time_until": 4.99});
    check(&lines).unwrap();
}

/// An upper bound is about the stretch that the result states, not about a later moment.
#[test]
fn a_near_place_after_the_stated_time_is_refused() {
    let until = |time: f64| {
        let mut lines = clearance(1.4, 1.6);
        lines[RESULT - 1] = json!({"type": "result", "of": "least_clearance", "lo": 1.4, "hi": 1.6, "until": "time",
            "time_until": time, "bench_a": 0, "bench_b": 2});
        lines
    };
    // The head goes 2 m/s: it comes to the near place at 1.55 s.
    assert_refused(&until(1.0), RESULT as u64, "hi, or its benches, do not follow");
    assert_refused(&until(0.0), RESULT as u64, "hi, or its benches, do not follow");
    check(&until(1.56)).unwrap();
}

#[test]
fn a_clearance_that_does_not_follow_is_refused() {
    assert_refused(&clearance(1.5 + 1e-12, 1.6), 2, "nearer than it says");
    assert_refused(&clearance(1.4, 1.5 - 1e-9), NEAR as u64, "further apart than it says");
    let refused = |line: usize, says: &str, change: &dyn Fn(&mut Vec<Value>)| {
        let mut lines = clearance(1.4, 1.6);
        change(&mut lines);
        assert_refused(&lines, line as u64, says);
    };
    refused(RESULT, "lo does not follow", &|lines| lines[RESULT - 1]["lo"] = json!(1.45));
    refused(RESULT, "hi does not follow", &|lines| lines[RESULT - 1]["hi"] = json!(1.59));
    refused(RESULT, "benches", &|lines| lines[RESULT - 1]["bench_a"] = json!(1));
    refused(RESULT, "benches", &|lines| lines[RESULT - 1]["hi"] = json!(null));
    refused(RESULT, "time_until is of another end", &|lines| lines[RESULT - 1]["time_until"] = json!(1.0));
    refused(RESULT, "time_until does not follow", &|lines| lines[RESULT - 1]["until"] = json!("time"));
    refused(RESULT, "time_until does not follow", &|lines| {
        (lines[RESULT - 1]["until"], lines[RESULT - 1]["time_until"]) = (json!("time"), json!(5.001));
    });
    refused(RESULT, "first contact does not follow", &|lines| lines[RESULT - 1]["until"] = json!("contact"));
    refused(RESULT - 1, "before the path", &|lines| drop(lines.remove(END - 1)));
    // The least of all steps counts, and every step must state it.
    refused(RESULT, "lo does not follow", &|lines| lines[7]["apart"] = json!(1.3));
    refused(9, "after a step that does not", &|lines| drop(lines[7].as_object_mut().unwrap().remove("apart")));
    refused(RESULT, "before the path", &|lines| {
        for line in &mut lines[60..LAST] {
            line.as_object_mut().unwrap().remove("apart");
        }
    });
    // Places.
    refused(6, "places in `at`", &|lines| lines[5]["at"] = json!([]));
    refused(6, "not in the handle's span", &|lines| lines[5]["at"][2] = place(-4.0));
    refused(6, "not inside a segment", &|lines| lines[5]["at"][2] = json!([0, 1.0]));
    refused(3, "no step has come there", &|lines| drop(lines.drain(2..LAST)));
    refused(NEAR, "before the start", &|lines| lines[NEAR - 1] = near(-0.1, 1.6));
    refused(NEAR, "share a handle", &|lines| lines[NEAR - 1]["benches"] = json!([0, 1]));
    refused(NEAR, "share a handle", &|lines| lines[NEAR - 1]["benches"] = json!([u64::MAX, 2]));
    refused(NEAR + 1, "a second line", &|lines| lines.insert(NEAR, near(3.1, 1.6)));
    // Results of another question.
    refused(RESULT, "another question", &|lines| lines[0]["about"] = json!("events"));
    refused(RESULT, "another question", &|lines| lines[RESULT - 1] = certificate()[13].clone());
    refused(RESULT + 1, "nothing can follow", &|lines| lines.push(lines[RESULT - 1].clone()));
    refused(1, "ends before its result", &|lines| lines.truncate(END));
    refused(1, "unknown variant", &|lines| lines[0]["about"] = json!("nothing"));
}
