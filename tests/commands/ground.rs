//! `[stage]`: first touches and least clearances against shapely, and a sentence for each wrong table.

use std::io::Write;
use std::process::{Command, Output};

use tempfile::NamedTempFile;

use crate::harness::{can_run, cases, python, python_modules, text};

/// The scenes with a touch known to 40 digits: the time, s, and the bench.
const TOUCHES: [(&str, &str, u32); 3] = [
    ("coil", "383.16936201406592842594063728981510500011", 0),
    ("route", "20.55331021895302001625255500593221360919", 1),
    ("turn", "132.62813817338586211167436691457905548334", 0),
];

fn scene_of_touch(name: &str) -> String {
    format!("tests/scenes/touch_{name}.toml")
}

/// Judges scenes by the brute force of `tests/python/ground.py`.
fn judge(arguments: &[&str]) {
    let mut peer = python();
    peer.args(["tests/python/ground.py", env!("CARGO_BIN_EXE_bench-dragon")]);
    let output = peer.args(arguments).output().unwrap();
    let printed = text(&output.stdout);
    assert!(output.status.success(), "{arguments:?}: {printed}{}", text(&output.stderr));
    println!("{arguments:?}: {printed}");
}

#[test]
#[ignore = "computes for long: tests/run --all"]
fn obstacles_are_met_where_a_brute_force_meets_them() {
    if !can_run(python_modules(&["numpy", "shapely"])) {
        return;
    }
    judge(&["config/square.toml"]);
    for (name, ..) in TOUCHES {
        judge(&[&scene_of_touch(name)]);
    }
    // One scene of each family, ten with all cases, in three processes side by side.
    let count = cases(3, 30, 600);
    std::thread::scope(|scope| {
        for part in 0..3 {
            scope.spawn(move || judge(&["--random", &format!("{}", 1 + part * count), &format!("{count}")]));
        }
    });
}

#[test]
fn three_touches_are_those_of_forty_digits() {
    for (name, digits, bench) in TOUCHES {
        let file = scene_of_touch(name);
        let mut program = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
        let output = program.args(["--scene", &file, "--json", "events"]).output().unwrap();
        let events = text(&output.stdout);
        let event = events.lines().find(|line| line.contains("\"obstacle\"")).unwrap();
        let event: serde_json::Value = serde_json::from_str(event).unwrap();
        let exact: f64 = digits.parse().unwrap();
        let time = event["time"].as_f64().unwrap();
        assert!((time - exact).abs() < 2e-15 * (1.0 + exact) + 1e-13 && event["bench_a"] == bench, "{name}: {event}");
        if !can_run(python_modules(&["flint"])) {
            continue;
        }
        let peer = python().args(["tests/python/ground_digits.py", &file, &format!("{exact}")]).output().unwrap();
        assert_eq!(text(&peer.stdout).trim_end(), format!("{digits} bench {bench}"), "{}", text(&peer.stderr));
    }
}

/// Returns a scene of the paper's team with this `[stage]`.
fn scene(stage: &str) -> NamedTempFile {
    let mut file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    writeln!(file, "{}\n[stage]\n{stage}", include_str!("../../config/paper.toml")).unwrap();
    file
}

fn run(scene: &NamedTempFile, arguments: &[&str]) -> Output {
    let mut program = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    program.args(arguments).arg("--scene").arg(scene.path()).output().unwrap()
}

/// Returns the sentence that refuses a scene.
fn refusal(scene: &NamedTempFile, arguments: &[&str]) -> String {
    let output = run(scene, arguments);
    let printed = text(&output.stderr);
    assert_eq!((output.status.code(), printed.lines().count()), (Some(2), 1), "{printed}");
    assert!(output.stdout.is_empty() && !printed.contains("panicked"), "{printed}");
    printed
}

#[test]
fn a_wrong_stage_is_refused_in_one_sentence() {
    let obstacle = |rest: &str| format!("[[stage.obstacles]]\nname = \"lamp\"\n{rest}\n");
    let circle = "circle = { center = [1.0, 2.0], radius = 0.5 }";
    let many = |count: usize| -> String {
        (0..count).map(|k| format!("[[stage.obstacles]]\nname = \"lamp {k}\"\n{circle}\n")).collect()
    };
    let corners = |count: usize| -> String { (0..count).map(|k| format!("[{}.0, {}.0],", k, k * k)).collect() };
    let cases = [
        (
            obstacle("circle = { center = [1.0, 2.0], radius = 0.0 }"),
            "circle.radius of obstacle \"lamp\" is 0, expected",
        ),
        (obstacle("circle = { center = [1e300, 2.0], radius = 1.0 }"), "circle.center of obstacle \"lamp\" is 1e300"),
        (obstacle(&format!("{circle}\nkeep_out = -1.0")), "keep_out of obstacle \"lamp\" is -1, expected"),
        (obstacle(&format!("{circle}\nkeep_out = nan")), "keep_out of obstacle \"lamp\" is NaN, expected"),
        (obstacle(""), "one of circle, polygon and line"),
        (obstacle(&format!("{circle}\nline = [[0, 0], [1, 1]]")), "one of circle, polygon and line"),
        (obstacle("polygon = [[0.0, 0.0], [1.0, 0.0]]"), "has 2 corners, expected 3 to 64"),
        (obstacle(&format!("line = [{}]", corners(65))), "has 65 corners, expected 2 to 64"),
        (
            obstacle("line = [[0.0, 0.0], [0.0, 0.0], [1.0, 1.0]]"),
            "corners 1 and 2 of line of obstacle \"lamp\" are equal",
        ),
        (obstacle("polygon = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]]"), "corners 4 and 1 of polygon"),
        (obstacle("polygon = [[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]]"), "sides 1 and 3 of polygon"),
        (obstacle("polygon = [[0.0, 0.0], [2.0, 0.0], [1.0, 0.0], [0.0, 2.0]]"), "sides 1 and 2 of polygon"),
        (
            obstacle("polygon = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 0.0], [0.0, 4.0]]"),
            "meet, expected a polygon",
        ),
        (obstacle("squircle = 1"), "unknown field `squircle`"),
        (format!("{}{}", obstacle(circle), obstacle(circle)), "obstacle \"lamp\" is given twice"),
        (obstacle(circle).replace("lamp", " "), "stage.obstacles.name is empty"),
        (obstacle(circle).replace("lamp", "boundary"), "the name of stage.boundary"),
        (obstacle(circle).replace("lamp", &"x".repeat(65)), "65 bytes, expected at most 64"),
        (many(65), "stage.obstacles has 65 entries, expected at most 64"),
        (
            "boundary = { polygon = [[0, 0], [9, 9], [9, 0], [0, 9]] }".to_owned(),
            "sides 1 and 3 of stage.boundary.polygon",
        ),
        ("boundary = { keep_out = 1.0 }".to_owned(), "missing field `polygon`"),
        ("wall = 1".to_owned(), "unknown field `wall`"),
    ];
    for (stage, expected) in cases {
        let scene = scene(&stage);
        let printed = refusal(&scene, &["check"]);
        assert!(printed.contains(expected) && printed.contains(", line "), "{stage}: {printed}");
    }
    assert!(run(&scene(&many(64)), &["check"]).status.success());
}

#[test]
fn the_least_clearance_of_an_obstacle_is_proved_and_verified() {
    let scene = scene("[[stage.obstacles]]\nname = \"lamp\"\ncircle = { center = [20.0, 2.0], radius = 0.5 }");
    let text = std::fs::read_to_string(&scene).unwrap().replace("start_turn = 16", "start_turn = 5");
    let text = text.replace("benches = 223", "benches = 5");
    std::fs::write(&scene, text).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("certificate");
    let file = file.to_str().unwrap();
    let printed = run(&scene, &["check", "--prove", "--certify", file, "--json"]);
    assert!(printed.status.success(), "{printed:?}");
    let lines = String::from_utf8(printed.stdout).unwrap();
    let line: serde_json::Value = serde_json::from_str(lines.lines().nth(1).unwrap()).unwrap();
    let number = |field: &str| line[field].as_f64().unwrap();
    let (lo, hi) = (number("least_clearance_lo"), number("least_clearance_hi"));
    assert!(line["obstacle"] == "lamp" && line["least_clearance_status"] == "proved", "{lines}");
    assert!(hi - lo <= 1e-9 && lo <= number("least_clearance") && number("least_clearance") <= hi + 1e-12, "{lines}");
    let mut verify = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    let verified = verify.args(["verify", file]).output().unwrap();
    assert!(verified.status.success(), "{verified:?}");
    let text = String::from_utf8(verified.stdout).unwrap();
    assert!(text.contains("least clearance of obstacle 1"), "{text}");
}

#[test]
fn the_first_touch_of_an_obstacle_is_proved_and_verified() {
    let scene = scene("[[stage.obstacles]]\nname = \"lamp\"\ncircle = { center = [20.0, 2.0], radius = 0.5 }");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("certificate");
    let file = file.to_str().unwrap();
    let printed = run(&scene, &["events", "--certify", file]);
    assert!(printed.status.success(), "{printed:?}");
    let mut verify = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    let verified = verify.args(["verify", file]).output().unwrap();
    assert!(verified.status.success(), "{verified:?}");
    let text = String::from_utf8(verified.stdout).unwrap();
    assert!(text.contains("obstacle"), "{text}");
}

/// An obstacle that no board comes near does not change a plan.
#[test]
#[ignore = "computes for long: tests/run --all"]
fn plans_are_those_without_obstacles_that_are_far() {
    let staged = scene("[[stage.obstacles]]\nname = \"lamp\"\ncircle = { center = [20.0, 2.0], radius = 0.5 }");
    let mut plain = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    let arguments = ["plan", "pitch", "--reach-radius=4.5", "--json"];
    let plain = plain.args(arguments).output().unwrap();
    let planned = run(&staged, &arguments);
    assert!(planned.status.success() && planned.stdout == plain.stdout, "{planned:?} {plain:?}");
    assert_eq!(text(&planned.stderr), "", "{planned:?}");
    assert!(run(&staged, &["plan", "speed", "--max-handle-speed=2"]).status.success());
    let mut square = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    let planned = square.args(["plan", "pitch", "--reach-radius=4.5", "config/square.toml"]).output().unwrap();
    let warned = text(&planned.stderr);
    for omission in ["leaves out its route: it is about", "leaves out the obstacles of the scene, whose path is"] {
        assert!(warned.contains(omission), "{warned}");
    }
}

#[test]
fn a_team_that_starts_within_a_keep_out_meets_it_at_once_with_a_warning() {
    let scene =
        scene("[[stage.obstacles]]\nname = \"lamp\"\ncircle = { center = [8.0, 2.0], radius = 0.5 }\nkeep_out = 1.0");
    let output = run(&scene, &["check"]);
    let printed = text(&output.stdout);
    assert!(printed.contains("within the keep-out of an obstacle at the start"), "{printed}");
    let events = text(&run(&scene, &["events"]).stdout);
    assert!(events.starts_with(" obstacle  t = 0 s: bench "), "{events}");
    assert!(events.contains("is at the lamp from the start"), "{events}");
    let lamp = printed.lines().find(|line| line.contains("The greatest overlap with the lamp is "));
    assert!(lamp.is_some_and(|line| line.contains(" m inside the keep-out of 1 m, at t = ")), "{printed}");
}

#[test]
fn a_team_that_starts_on_an_obstacle_or_outside_the_boundary_meets_it_at_once_with_a_warning() {
    let cases = [
        ("[[stage.obstacles]]\nname = \"lamp\"\ncircle = { center = [8.0, 2.0], radius = 2.5 }", "is at the lamp"),
        ("[[stage.obstacles]]\nname = \"lamp\"\nline = [[0.0, 0.0], [9.0, 0.5]]", "is at the lamp"),
        ("[[stage.obstacles]]\nname = \"lamp\"\npolygon = [[0.0, 0.0], [30.0, 0.0], [0.0, 30.0]]", "is at the lamp"),
        ("boundary = { polygon = [[40.0, 0.0], [41.0, 0.0], [40.0, 1.0]] }", "is at the boundary"),
    ];
    for (stage, expected) in cases {
        let scene = scene(stage);
        let events = text(&run(&scene, &["events"]).stdout);
        assert!(events.starts_with(" obstacle  t = 0 s: bench ") && events.contains(expected), "{stage}: {events}");
        let line = run(&scene, &["events", "--json"]).stdout;
        let line: serde_json::Value = serde_json::from_str(text(&line).lines().next().unwrap()).unwrap();
        assert!(line["event"] == "obstacle" && line["time"] == 0.0 && line["bench_b"] == 224, "{stage}: {line}");
        let checked = run(&scene, &["check"]);
        let warned = text(&checked.stdout);
        assert!(checked.status.success(), "{stage}: {warned}");
        assert!(warned.contains("within the keep-out of an obstacle at the start"), "{stage}: {warned}");
    }
}

#[test]
fn a_picture_has_every_obstacle_at_its_place_with_its_keep_out() {
    let mut program = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    let output = program.args(["--scene", "tests/compute/ground.toml", "draw", "--at", "46"]).output().unwrap();
    let svg = text(&output.stdout);
    let picture = roxmltree::Document::parse(&svg).unwrap();
    let group = |id: &str| picture.descendants().find(|node| node.attribute("id") == Some(id)).unwrap();
    let titled = |name: &str| {
        let title = group("obstacles").descendants().find(|node| node.text() == Some(name)).unwrap();
        title.parent_element().unwrap()
    };
    let lamp = titled("stone lamp");
    assert_eq!(["cx", "cy", "r"].map(|key| lamp.attribute(key).unwrap()), ["4", "3.5", "0.4"]);
    let around = group("keep-outs").children().find(|node| node.attribute("r") == Some("0.9")).unwrap();
    assert_eq!(["cx", "cy"].map(|key| around.attribute(key).unwrap()), ["4", "3.5"]);
    let outline = |name: &str| titled(name).attribute("d").unwrap().to_owned();
    assert_eq!(outline("well house"), "M2 8L6 8L6 14L4 12L2 14Z");
    assert_eq!(outline("northern spectators"), "M-4 22L18 22");
    assert_eq!(outline("boundary"), "M-30 -20L30 -20L30 25L-30 25Z");
    let wide: Vec<_> = group("keep-outs").children().filter_map(|node| node.attribute("stroke-width")).collect();
    assert_eq!(wide, ["3", "3", "2", "2"]);
    // Dashes around each side of a keep-out: 1 circle, 2 + 1 sides of the spectators, 5 of the house, 4 of the
    // boundary.
    let rims = group("keep-out-rims");
    assert!(rims.attribute("stroke-dasharray").is_some());
    assert_eq!(rims.children().filter(roxmltree::Node::is_element).count(), 13);
    let of_lamp = rims.children().find(roxmltree::Node::is_element).unwrap().attribute("d").unwrap();
    assert_eq!(of_lamp, "M3.1 3.5A0.9 0.9 0 0 1 4.9 3.5A0.9 0.9 0 0 1 3.1 3.5Z");
    assert!(picture.descendants().any(|node| node.attribute("id") == Some("obstacle-names")));
    let without = Command::new(env!("CARGO_BIN_EXE_bench-dragon")).args(["draw", "--at", "46"]).output().unwrap();
    assert!(!text(&without.stdout).contains("ground\""), "a scene without obstacles has no ground");
}
