//! Tests of texts, fields, handles and sessions, over the scenes of `config/`.

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use serde_json::{Value, json};

use crate::handles::{drag, handles};
use crate::request::{Addition, Drag, Setting};
use crate::scene::DesignedScene;
use crate::session::{Answer, Session};
use crate::{additions, edit, geojson};
use bench_dragon_motion::event::unreported;
use bench_dragon_motion::model::Point;
use bench_dragon_show::results::EventLine;

/// The scenes of `config/` with their names.
fn scenes() -> Vec<(String, DesignedScene)> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config");
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let read = |file: std::path::PathBuf| {
        let text = std::fs::read_to_string(&file).unwrap();
        (file.file_name().unwrap().to_str().unwrap().to_owned(), DesignedScene::read(&text, "scene"))
    };
    let scenes: Vec<_> = files.into_iter().map(read).filter_map(|(name, scene)| Some((name, scene.ok()?))).collect();
    // `long.toml` has more benches than a page is shown.
    assert!(scenes.len() >= 11, "{}", scenes.len());
    scenes
}

fn named(name: &str) -> DesignedScene {
    scenes().into_iter().find(|(other, _)| other == name).unwrap().1
}

fn read(text: &str) -> DesignedScene {
    DesignedScene::read(text, "scene").unwrap_or_else(|fault| panic!("{fault}\n{text}"))
}

/// Returns a value of a text as the plain reader of TOML finds it.
fn found(text: &str, name: &str) -> Option<f64> {
    let table: toml::Table = text.parse().unwrap();
    let mut at = &toml::Value::Table(table);
    for part in name.split(['.', '[']) {
        at = match part.strip_suffix(']') {
            Some(index) => at.get(index.parse::<usize>().unwrap())?,
            None => at.get(part)?,
        };
    }
    at.as_float().or_else(|| at.as_integer().map(|whole| whole as f64))
}

#[test]
fn a_number_that_is_set_changes_its_bytes_alone() {
    let mut fields = 0;
    for (name, scene) in scenes() {
        for field in &scene.fields {
            let value = if field.integer { field.value + 1.0 } else { 1.0625 * field.value + 0.3 };
            let values = BTreeMap::from([(field.name.clone(), Setting::Number(value))]);
            let text = edit::set(&scene, &values).unwrap();
            let after = &scene.text[field.span.end..];
            assert!(
                text.starts_with(&scene.text[..field.span.start]) && text.ends_with(after),
                "{name} {}",
                field.name
            );
            let new = &text[field.span.start..text.len() - after.len()];
            assert!(!new.contains(char::is_whitespace), "{name} {}: {new}", field.name);
            assert_eq!(found(&text, &field.name), Some(value), "{name} {}", field.name);
            assert!(field.min <= field.value && field.value <= field.max, "{field:?}");
            fields += 1;
        }
    }
    assert!(fields > 150, "{fields}");
}

#[test]
fn a_number_without_a_place_in_the_text_is_added_to_its_table() {
    let scene = named("paper.toml");
    let values = BTreeMap::from([
        ("motion.end_hold".to_owned(), Setting::Number(2.5)),
        ("placement.rotation_turns".to_owned(), Setting::Number(0.25)),
        ("motion.on_contact".to_owned(), Setting::Word("continue".to_owned())),
    ]);
    let text = edit::set(&scene, &values).unwrap();
    let changed = read(&text);
    assert_eq!(changed.scene.end_hold, 2.5);
    assert_eq!(changed.scene.placement.unwrap().rotation_turns(), 0.25);
    assert!(changed.scene.on_contact == bench_dragon_show::scene::OnContact::Continue, "{text}");
    let comments = |text: &str| text.matches('#').count();
    assert_eq!(comments(&text), comments(&scene.text));
    for (name, value) in [("team.benches", 2.5), ("path.pitch", f64::NAN)] {
        let fault = edit::set(&scene, &BTreeMap::from([(name.to_owned(), Setting::Number(value))])).unwrap_err();
        assert_eq!(fault.field.as_deref(), Some(name), "{fault}");
    }
}

/// Returns the place of a handle.
fn place(scene: &DesignedScene, name: &str) -> Point {
    let handle = handles(scene).into_iter().find(|handle| handle.name == name);
    handle.map(|handle| Point::new(handle.x, handle.y)).unwrap_or_else(|| panic!("no {name} in\n{}", scene.text))
}

fn dragged(scene: &DesignedScene, name: &str, to: Point, free: bool) -> Result<DesignedScene, crate::scene::Fault> {
    let to = Drag { handle: name.to_owned(), to: [to.x, to.y], free, alt: false };
    DesignedScene::read(&drag(scene, &to)?, "scene")
}

/// The rounding of numbers in the text.
const ROUNDED: f64 = 2e-3;

#[test]
fn a_handle_with_one_number_comes_to_lie_where_its_number_puts_it() {
    let mut tried = BTreeMap::<&str, usize>::new();
    for (scene_name, scene) in scenes() {
        for handle in handles(&scene).into_iter().filter(|handle| handle.fields.len() == 1) {
            let [field] = handle.fields.as_slice() else { continue };
            let Some(value) = found(&scene.text, field) else { continue };
            for factor in [0.97, 1.04] {
                let values = BTreeMap::from([(field.clone(), Setting::Number(factor * value))]);
                let Ok(moved) = DesignedScene::read(&edit::set(&scene, &values).unwrap(), "scene") else { continue };
                let to = place(&moved, &handle.name);
                let there = dragged(&scene, &handle.name, to, true).unwrap();
                let off = (place(&there, &handle.name) - to).norm();
                assert!(off < ROUNDED, "{scene_name} {}: {off} m from {to}", handle.name);
                *tried.entry(handle.kind).or_default() += 1;
            }
        }
    }
    for kind in ["end", "middle", "turns", "pitch", "radius", "rim", "keep_out", "heading"] {
        assert!(tried.contains_key(kind), "{kind}: {tried:?}");
    }
}

#[test]
fn a_handle_with_two_numbers_comes_to_lie_where_it_is_dragged() {
    let mut tried = BTreeMap::<&str, usize>::new();
    for (scene_name, scene) in scenes() {
        for handle in handles(&scene).into_iter().filter(|handle| handle.fields.len() == 2) {
            let from = Point::new(handle.x, handle.y);
            let to = from + 0.137 * bench_dragon_motion::model::Vector::new(0.8, 0.6);
            // A boundary may no longer be simple, and an arc may turn away from its end.
            let Ok(there) = dragged(&scene, &handle.name, to, true) else { continue };
            let off = (place(&there, &handle.name) - to).norm();
            assert!(off < ROUNDED, "{scene_name} {}: {off} m", handle.name);
            *tried.entry(handle.kind).or_default() += 1;
            let Ok(snapped) = dragged(&scene, &handle.name, to, false) else { continue };
            let at = place(&snapped, &handle.name).map(|metres| 10.0 * metres);
            assert!((at - at.map(f64::round)).norm() < 10.0 * ROUNDED, "{scene_name} {}: {at}", handle.name);
        }
    }
    for kind in ["end", "placement", "centre", "corner", "boundary"] {
        assert!(tried.contains_key(kind), "{kind}: {tried:?}");
    }
}

#[test]
fn the_lines_beside_an_arc_take_up_its_change() {
    let scene = named("square.toml");
    let name = "path.pieces[1].middle";
    let (from, end) = (place(&scene, name), place(&scene, "path.pieces[9].end"));
    let to = from + bench_dragon_motion::model::Vector::new(0.3, -0.4);
    let moved = dragged(&scene, name, to, true).unwrap();
    let at = place(&moved, name);
    assert!((at - from).norm() > 0.1 && (to - at).dot(&(at - from)).abs() < ROUNDED, "{from} {at}");
    assert!((place(&moved, "path.pieces[9].end") - end).norm() < ROUNDED, "the rest stays");
    assert_eq!(found(&moved.text, "path.pieces[1].turns"), Some(0.25));
}

#[test]
fn an_arc_changes_its_side_only_where_it_may() {
    let scene = named("procession.toml");
    let name = "path.pieces[1].end";
    let other_side = Point::new(16.0, -16.0);
    for (alt, side) in [(false, "left"), (true, "right")] {
        let text = drag(&scene, &Drag { handle: name.to_owned(), to: other_side.into(), free: true, alt }).unwrap();
        let moved = read(&text);
        assert_eq!(moved.values.words("path.pieces[1].side"), Some(side));
        assert_eq!((place(&moved, name) - other_side).norm() < ROUNDED, alt);
    }
}

#[test]
fn a_piece_that_is_removed_leaves_all_other_lines() {
    let scene = named("square.toml");
    let text = additions::remove(&scene, "path.pieces[2]").unwrap();
    let gone = "    { kind = \"line\", length = 18.0 },                             # along the northern spectators\n";
    assert_eq!(text, scene.text.replacen(gone, "", 1));
    let last = "    { kind = \"arc\", radius = 4.0, side = \"right\", turns = 0.75 }, # round the well\n";
    assert_eq!(additions::remove(&scene, "path.pieces[9]").unwrap(), scene.text.replacen(last, "", 1));
    let scene = named("procession.toml");
    let text = additions::remove(&scene, "path.pieces[3]").unwrap();
    let gone = "[[path.pieces]]\nkind = \"arc\"\nradius = 5.0\nside = \"right\"\nturns = 0.5\n\n";
    assert_eq!(text, scene.text.replacen(gone, "", 1));
    assert!(additions::remove(&scene, "path.pieces[99]").is_err() && additions::remove(&scene, "path..x").is_err());
}

fn addition(what: &str, kind: &str, at: [f64; 2]) -> Addition {
    let kind = Some(kind.to_owned());
    Addition { what: what.to_owned(), kind, at: Some(at), to: None, after: None, time: None }
}

#[test]
fn what_is_added_stands_behind_the_rest() {
    for name in ["square.toml", "procession.toml"] {
        let scene = named(name);
        let count = scene.pieces().len();
        for kind in ["line", "arc", "spiral"] {
            let text = additions::add(&scene, &addition("piece", kind, [3.0, 4.0]), 0.0).unwrap();
            let grown = read(&text);
            assert_eq!(grown.pieces().len(), count + 1, "{text}");
            assert_eq!(grown.pieces()[count].kind, kind);
            assert!(scene.text.lines().all(|line| text.contains(line)), "{text}");
        }
        let arc = read(&additions::add(&scene, &addition("piece", "arc", [3.0, 4.0]), 0.0).unwrap());
        let end = place(&arc, &format!("path.pieces[{count}].end"));
        assert!((end - Point::new(3.0, 4.0)).norm() < 0.02, "{end}");
    }
    let paper = named("paper.toml");
    assert!(additions::add(&paper, &addition("piece", "line", [0.0, 0.0]), 0.0).is_err());
    let mut scene = paper;
    for kind in ["circle", "polygon", "line", "circle"] {
        scene = read(&additions::add(&scene, &addition("obstacle", kind, [20.0, 1.0]), 0.0).unwrap());
    }
    let shapes: Vec<String> = scene.obstacles().into_iter().map(|listed| listed.kind).collect();
    assert_eq!(shapes, ["circle", "polygon", "line", "circle"], "{}", scene.text);
    let mut corner = addition("corner", "", [21.5, 0.5]);
    corner.after = Some("stage.obstacles[1].polygon[1]".to_owned());
    let grown = read(&additions::add(&scene, &corner, 0.0).unwrap());
    assert_eq!(grown.values.number("stage.obstacles[1].polygon[2][0]"), Some(21.5));
    let without = additions::remove(&grown, "stage.obstacles[1].polygon[2]").unwrap();
    assert_eq!(read(&without).scene, scene.scene);
    let cue = read(&additions::add(&scene, &addition("cue", "", [0.0, 0.0]), 12.5).unwrap());
    assert_eq!(cue.cues()[0].at, Some(12.5));
    let paper = named("paper.toml");
    let two = read(&additions::add(&paper, &addition("dragon", "", [30.0, 0.0]), 0.0).unwrap());
    let [first, second] = two.scene.ensemble.dragons() else { panic!("{}", two.text) };
    assert_eq!(Some(&first.motion), paper.scene.ensemble.only(), "{}", two.text);
    assert_eq!(second.motion.placement().origin(), Point::new(30.0, 0.0));
    assert_eq!(two.scene.on_contact, paper.scene.on_contact);
    assert!(two.text.matches('#').count() >= paper.text.matches('#').count(), "{}", two.text);
    let two = named("crossing.toml");
    let three = read(&additions::add(&two, &addition("dragon", "", [0.0, 30.0]), 0.0).unwrap());
    assert_eq!(three.scene.ensemble.dragons().len(), 3, "{}", three.text);
    assert!(two.text.lines().all(|line| three.text.contains(line)), "{}", three.text);
}

#[test]
fn polygons_of_geojson_become_obstacles() {
    let polygon = json!({"type": "Polygon", "coordinates": [[[2, 3], [4, 3], [4, 5], [2, 3]]]});
    let feature = json!({"type": "Feature", "properties": {"name": "well"}, "geometry": polygon});
    let text = json!({"type": "FeatureCollection", "features": [feature, feature]}).to_string();
    let scene = named("paper.toml");
    let text = additions::add_polygons(&scene, geojson::polygons(&text).unwrap()).unwrap();
    let names: Vec<_> = read(&text).obstacles().into_iter().filter_map(|listed| listed.title).collect();
    assert_eq!(names, ["well", "well 2"]);
    // A degree of latitude is 111.19 km, one of longitude at 60 degrees half of that.
    let corners = [[10.0, 60.0], [10.001, 60.0], [10.001, 60.001], [10.0, 60.0]];
    let degrees = json!({"type": "Polygon", "coordinates": [corners]}).to_string();
    let found = geojson::polygons(&degrees).unwrap();
    let by = found[0].1[2] - found[0].1[0];
    assert!((by.x - 55.6).abs() < 0.1 && (by.y - 111.2).abs() < 0.1, "{by}");
    assert!(geojson::polygons("{}").is_err() && geojson::polygons("[").is_err());
}

#[test]
fn hostile_texts_get_one_sentence() {
    let paper = named("paper.toml").text;
    let route = |pieces: usize| {
        let pieces = "{ kind = \"line\", length = 1.0 },".repeat(pieces);
        format!("[team]\nbenches = 20\n[path]\nkind = \"pieces\"\npieces = [{pieces}]\n[motion]\nhead_speed = 1\n")
    };
    let texts = [
        format!("{paper}#{}", "x".repeat(256 * 1024)),
        paper.replace("benches = 223", "benches = 1000000"),
        paper.replace("benches = 223", "benches = 99999999999999999999"),
        route(4097),
        format!("a = {}", "[".repeat(100_000)),
        format!("a = {}1{}", "{a=".repeat(1000), "}".repeat(1000)),
        format!("{}a = 1", "a.".repeat(10_000)),
        "\u{0}".to_owned(),
        String::new(),
        paper.replace("pitch = 0.55", "pitch = nan"),
    ];
    for text in texts {
        let fault = DesignedScene::read(&text, "scene").unwrap_err();
        let begin: String = text.chars().take(60).collect();
        assert!(!fault.sentence.contains('\n') && fault.sentence.len() < 400, "{begin}: {fault}");
    }
    let fault = DesignedScene::read(&paper.replace("pitch = 0.55", "pitch = 0"), "scene").unwrap_err();
    assert_eq!((fault.line, fault.field.as_deref()), (Some(13), Some("path.pitch")), "{fault}");
    let most = read(&route(4096));
    assert_eq!(handles(&most).len(), 2 + 2 * 4096);
}

/// A session whose answers are received as JSON, frames and stages as their kinds.
fn session() -> (Session, Receiver<Value>) {
    let (sender, answers) = channel();
    let sender = Mutex::new(sender);
    let send = move |answer| {
        let answer = match answer {
            Answer::Json(json) => serde_json::from_str(&json).unwrap(),
            Answer::Stage(stage, _) => json!({"stage": stage.stage.run_id}),
            Answer::Frame(header, _) => json!({"frame": header.sequence, "run": header.run_id, "t": header.sim_time}),
        };
        let _ = sender.lock().unwrap().send(answer);
    };
    (Session::start(None, Arc::new(send)).unwrap(), answers)
}

/// Waits for the answer of a request that has a key.
fn until(answers: &Receiver<Value>, id: u64, key: &str, state: &str) -> Value {
    loop {
        let answer = answers.recv_timeout(Duration::from_secs(120)).unwrap_or_else(|_| panic!("no {key} of {id}"));
        if answer["id"] == id && (answer[key]["state"] == state || (state.is_empty() && !answer[key].is_null())) {
            return answer[key].clone();
        }
    }
}

#[test]
fn after_a_storm_of_changes_the_last_state_is_exact() {
    let (session, answers) = session();
    let first = until(&answers, 0, "scene", "");
    assert_eq!(first["name"], "paper");
    for id in 1..=300_u32 {
        let pitch = f64::from(5500 + id) / 1e4;
        session.request(json!({"id": id, "set": {"path.pitch": pitch}}).to_string()).unwrap();
    }
    let events = until(&answers, 300, "events", "exact");
    let scene = named("paper.toml").text.replace("pitch = 0.55", "pitch = 0.58");
    let scene = read(&scene).scene;
    let timeline = scene.ensemble.timeline(&mut unreported);
    let list = events["list"].as_array().unwrap();
    let expected = timeline.all();
    assert_eq!(list.len(), expected.len());
    for (found, timed) in list.iter().zip(&expected) {
        for (key, value) in json!(EventLine::new(&scene, timed)).as_object().unwrap() {
            assert_eq!(found[key], *value, "{key} of {found}");
        }
    }
    assert_eq!(until(&answers, 300, "facts", "exact")["list"][0]["check"], "clearance");
}

#[test]
fn a_picture_follows_each_scene_and_each_time() {
    let (session, answers) = session();
    until(&answers, 0, "scene", "");
    session.request(json!({"id": 1, "template": "square"}).to_string()).unwrap();
    until(&answers, 1, "scene", "");
    let stage = answers.recv_timeout(Duration::from_secs(60)).unwrap();
    let frame = answers.recv_timeout(Duration::from_secs(60)).unwrap();
    assert_eq!((&frame["run"], &frame["frame"], &frame["t"]), (&stage["stage"], &json!(1), &json!(0.0)));
    session.request(json!({"id": 2, "at": 1e9}).to_string()).unwrap();
    let frame = loop {
        let answer = answers.recv_timeout(Duration::from_secs(60)).unwrap();
        if answer["frame"] == 2 {
            break answer;
        }
    };
    let end = read(&named("square.toml").text).scene.ensemble.timeline(&mut unreported).end().time;
    assert_eq!(frame["t"], end);
    for (id, request, says) in [
        (3, json!({"id": 3, "text": "pitch ="}), "expected"),
        (4, json!({"id": 4, "set": {"path.pieces[0].length": 3}}), "the text is no scene"),
        (5, json!({"id": 5, "template": "none"}), "no template"),
        (0, json!({"id": 6}), "expected"),
        (0, json!("nonsense"), "expected"),
    ] {
        session.request(request.to_string()).unwrap();
        let error = until(&answers, id, "error", "");
        assert!(error["sentence"].as_str().unwrap().contains(says), "{request}: {error}");
    }
}

/// Requests of all kinds, with names and numbers of the scene and without sense.
#[test]
fn no_request_makes_more_of_a_scene_than_another_scene_or_one_sentence() {
    let mut random = 1_u64;
    let mut next = move |below: usize| {
        // A linear congruential generator is random enough to choose requests.
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 33) as usize % below
    };
    let numbers = [0.0, -1.0, 1e-9, 0.3, 2.0, 16.0, 1e4, 1e9, -1e300, 5e-324];
    let (mut changed, mut refused) = (0, 0);
    for (_, first) in scenes().into_iter().filter(|(name, _)| name != "long.toml") {
        let mut scene = first.clone();
        for _ in 0..60 {
            let found = handles(&scene);
            let handle = &found[next(found.len())].name;
            let field = &scene.fields[next(scene.fields.len())].name;
            let names =
                [field.as_str(), handle, "path", "stage.obstacles", "stage.boundary", "cues[0]", "a[0][1].b", ""];
            let (name, number) = (names[next(names.len())], numbers[next(numbers.len())]);
            let (x, y) = (numbers[next(numbers.len())], numbers[next(numbers.len())]);
            let kinds = ["line", "arc", "spiral", "turn", "circle", "polygon", "none"];
            let whats = ["piece", "obstacle", "corner", "cue", "dragon", "none"];
            let (kind, what) = (kinds[next(kinds.len())], whats[next(whats.len())]);
            let request = match next(6) {
                0 => json!({"id": 1, "set": {name: number}}),
                1 => json!({"id": 1, "set": {name: "word"}}),
                2 => json!({"id": 1, "remove": name}),
                3 => json!({"id": 1, "add": {"what": what, "kind": kind, "at": [x, y], "after": name}}),
                _ => {
                    json!({"id": 1, "drag": {"handle": handle, "to": [x, y], "free": next(2) == 0, "alt": next(2) == 0}})
                }
            };
            match crate::change::requested(&scene, &request.to_string()) {
                Ok(other) => (scene, changed) = (other, changed + 1),
                Err(fault) => {
                    assert!(!fault.sentence.is_empty() && !fault.sentence.contains('\n'), "{request}: {fault}");
                    refused += 1;
                }
            }
        }
    }
    assert!(changed > 50 && refused > 50, "{changed} {refused}");
}
