//! Requests of the page of `design`, one a line, as its WebSocket passes them on.
//!
//! Each request makes another scene of the text, or is refused with a sentence. The same requests go to a session, which
//! answers each of them.

use std::collections::BTreeMap;
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use bench_dragon::design::change::requested;
use bench_dragon::design::handles::handles;
use bench_dragon::design::request::{Request, Wish};
use bench_dragon::design::scene::{DesignedScene, Fault, Field};
use bench_dragon::design::session::{Answer, Session};
use bench_dragon::design::templates::{TEMPLATES, template};
use fastrand::Rng;
use serde_json::{Value, json};

use super::Target;
use super::bytes::{changed, one, renumbered};

pub const TARGET: Target = Target { name: "design_page", run, seeds, mutate, cases: 1000 };

/// The requests of an input that are read.
const MOST_REQUESTS: usize = 12;
/// The number of the request that ends a session.
const LAST: u64 = u64::MAX - 7;
/// The time after which a session that does not answer has hung.
const HUNG: Duration = Duration::from_secs(240);

fn run(data: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(data) else { return false };
    let requests: Vec<&str> = text.lines().take(MOST_REQUESTS).collect();
    let mut scene = read(TEMPLATES[0].text);
    let mut is_in = false;
    for request in &requests {
        let next = match Request::read(request) {
            Ok((_, Wish::Template(key))) if template(&key).is_some() => Ok(read(template(&key).unwrap().text)),
            _ => requested(&scene, request),
        };
        match next {
            Ok(next) => {
                check_scene(&next);
                check_numbers(&scene, &next, request);
                (scene, is_in) = (next, true);
            }
            Err(fault) => check_fault(&fault),
        }
    }
    check_answers(&requests);
    is_in
}

fn read(text: &str) -> DesignedScene {
    DesignedScene::read(text, "scene").expect("a template is a scene")
}

fn check_fault(fault: &Fault) {
    let Fault { sentence, line, .. } = fault;
    assert!(!sentence.is_empty() && !sentence.contains(char::is_control), "{sentence:?}");
    assert!(line.is_none_or(|line| line >= 1), "{fault:?}");
}

/// Returns the number that stands in the bytes of a field.
fn written(text: &str, field: &Field) -> Option<f64> {
    text[field.span.start..field.span.end].replace('_', "").parse().ok()
}

/// Checks that fields are where they say they are, and that handles are places.
fn check_scene(scene: &DesignedScene) {
    for field in &scene.fields {
        // A whole number may have another base.
        assert!(written(&scene.text, field).is_none_or(|value| value == field.value), "{field:?}");
        assert!((field.min..=field.max).contains(&field.value), "{field:?}");
    }
    for handle in handles(scene) {
        assert!(handle.x.is_finite() && handle.y.is_finite(), "{} at {} {}", handle.name, handle.x, handle.y);
    }
}

/// Checks that numbers which a request sets have their values, and that no other byte has changed.
fn check_numbers(before: &DesignedScene, after: &DesignedScene, request: &str) {
    let Ok(Value::Object(request)) = serde_json::from_str(request) else { return };
    let Some(Value::Object(set)) = request.get("set") else { return };
    let fields = before.fields.iter().filter_map(|field| Some((field, set.get(&field.name)?.as_f64()?)));
    let fields: Vec<(&Field, f64)> = fields.collect();
    if fields.len() != set.len() {
        return;
    }
    let (mut from, mut left) = (0, after.text.as_str());
    for (field, value) in fields {
        let same = &before.text[from..field.span.start];
        let rest = left.strip_prefix(same).expect("the bytes before a number stay");
        let end = rest.find(|letter: char| !letter.is_ascii_alphanumeric() && !"+-._".contains(letter));
        let (number, rest) = rest.split_at(end.unwrap_or(rest.len()));
        assert_eq!(number.parse().ok(), Some(value), "{}", field.name);
        (from, left) = (field.span.end, rest);
    }
    assert_eq!(left, &before.text[from..], "the bytes after a number stay");
}

/// Checks that a session answers each change once.
fn check_answers(requests: &[&str]) {
    let (sender, answers) = channel();
    let sender = Mutex::new(sender);
    let send = move |answer| {
        if let Answer::Json(json) = answer {
            let _ = sender.lock().unwrap_or_else(PoisonError::into_inner).send(json);
        }
    };
    let session = Session::start(None, Arc::new(send)).expect("a thread");
    // The session begins with the text of the first template.
    let (mut expected, mut others) = (BTreeMap::from([(0, 1), (LAST, 1)]), Vec::new());
    let last = json!({"id": LAST, "file": true}).to_string();
    for request in requests.iter().copied().chain([last.as_str()]) {
        match Request::read(request) {
            Ok((LAST, Wish::File)) => {}
            Ok((id, Wish::At(_) | Wish::Cancel | Wish::Plan(..))) => others.push(id),
            Ok((id, _)) => *expected.entry(id).or_insert(0) += 1,
            Err(_) => *expected.entry(0).or_insert(0) += 1,
        }
        session.request(request.to_owned()).expect("room for a request");
    }
    let mut answered = BTreeMap::new();
    while !answered.contains_key(&LAST) {
        let json = answers.recv_timeout(HUNG).expect("the session answers");
        let answer: Value = serde_json::from_str(&json).expect("JSON");
        if ["scene", "error", "replaced"].iter().any(|key| !answer[key].is_null()) {
            *answered.entry(answer["id"].as_u64().expect("a number")).or_insert(0) += 1;
        }
    }
    // A plan is refused with an error, too.
    for id in others {
        expected.remove(&id);
        answered.remove(&id);
    }
    assert_eq!(answered, expected);
}

/// Requests of each kind, for the scenes of the templates.
const REQUESTS: [(&str, &[&str]); 5] = [
    (
        "coil",
        &[
            r#"{"id":1,"set":{"path.pitch":0.56}}"#,
            r#"{"id":2,"drag":{"handle":"path.pitch","to":[1.5,2.5],"free":true,"alt":false}}"#,
            r#"{"id":3,"set":{"motion.on_contact":"continue","team.benches":40}}"#,
            r#"{"id":4,"at":300.0}"#,
            r#"{"id":5,"add":{"what":"cue","time":12.5}}"#,
            r#"{"id":6,"drag":{"handle":"cues[0]","to":[20.0,0]}}"#,
            r#"{"id":7,"plan":"speed"}"#,
            r#"{"id":8,"cancel":true}"#,
        ],
    ),
    (
        "turn",
        &[
            r#"{"id":1,"set":{"path.turn_radius":4.6,"path.arc_ratio":1.5}}"#,
            r#"{"id":2,"drag":{"handle":"placement","to":[3,4],"alt":true}}"#,
            r#"{"id":3,"plan":"fit","vary":["path.pitch"]}"#,
            r#"{"id":4,"set":{"require.clearance":0.3}}"#,
        ],
    ),
    (
        "procession",
        &[
            r#"{"id":1,"drag":{"handle":"path.pieces[0].end","to":[11,-10]}}"#,
            r#"{"id":2,"add":{"what":"piece","kind":"arc"}}"#,
            r#"{"id":3,"remove":"path.pieces[0]"}"#,
            r#"{"id":4,"set":{"path.pieces[0].length":5.5}}"#,
        ],
    ),
    (
        "square",
        &[
            r#"{"id":1,"drag":{"handle":"stage.obstacles[0]","to":[1,1],"free":true}}"#,
            r#"{"id":2,"add":{"what":"obstacle","kind":"polygon","at":[20,20]}}"#,
            r#"{"id":3,"add":{"what":"corner","after":"stage.boundary.polygon[0]","at":[0,-20]}}"#,
            r#"{"id":4,"remove":"stage.boundary.polygon[1]"}"#,
            r#"{"id":5,"geojson":"{\"type\":\"Polygon\",\"coordinates\":[[[20,20],[24,20],[24,23],[20,20]]]}"}"#,
        ],
    ),
    (
        "two",
        &[
            r#"{"id":1,"set":{"dragons[1].path.pitch":0.9,"dragons[0].delay":2}}"#,
            r#"{"id":2,"add":{"what":"dragon"}}"#,
            r#"{"id":3,"remove":"dragons[0]"}"#,
            r#"{"id":4,"text":"pitch = 1\n"}"#,
            r#"{"id":5,"file":true}"#,
        ],
    ),
];

fn seeds() -> Vec<Vec<u8>> {
    let input = |(key, requests): &(&str, &[&str])| {
        format!("{}\n{}\n", json!({"id": 0, "template": key}), requests.join("\n")).into_bytes()
    };
    REQUESTS.iter().map(input).collect()
}

fn mutate(input: &[u8], random: &mut Rng) -> Vec<u8> {
    let Ok(text) = std::str::from_utf8(input) else { return changed(input, random) };
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..1 + random.usize(..3) {
        let at = random.usize(..=lines.len());
        match random.u8(..6) {
            0 | 1 if at < lines.len() => lines[at] = renumbered(&lines[at], random),
            2 if at < lines.len() => drop(lines.remove(at)),
            3 => {
                let (_, requests) = one(&REQUESTS, random);
                lines.insert(at, (*one(requests, random)).to_owned());
            }
            4 => lines.insert(at, request(random).to_string()),
            _ => return changed(lines.join("\n").as_bytes(), random),
        }
    }
    lines.join("\n").into_bytes()
}

/// Returns a request about a field or a handle of a template.
fn request(random: &mut Rng) -> Value {
    let scene = read(one(&TEMPLATES, random).text);
    let (field, found) = (one(&scene.fields, random), handles(&scene));
    let [x, y] = [(); 2].map(|()| 60.0 * random.f64() - 30.0);
    match random.u8(..3) {
        0 => json!({"id": 1, "set": {&field.name: field.value * (0.5 + random.f64())}}),
        1 => json!({"id": 1, "remove": field.name}),
        _ => json!({"id": 1, "drag": {"handle": one(&found, random).name, "to": [x, y], "alt": random.bool()}}),
    }
}
