//! `plan` and `trade`: their keys and figures, and plots that another program can read.

use std::path::Path;

use bench_dragon::certify::plan::{greatest_speed, least_pitch};
use bench_dragon::messages::state::EventKind;
use bench_dragon::motion::event::unreported;
use serde_json::Value;

use crate::cli::events::time_of;
use crate::cli::scenes::{SceneFile, assert_keys, numbers, same_bits, scenes};
use crate::harness::{Process, aloud, can_run, long, python, python_modules, text};

const REACH: f64 = 2.0;
const LIMIT: f64 = 2.0;
const PLAN_PITCH: [&str; 4] = ["plan", "pitch", "--reach-radius", "2"];
const PLAN_SPEED: [&str; 4] = ["plan", "speed", "--max-handle-speed", "2"];

/// Returns the scenes, without those that have the same tables as an earlier one.
fn different(tables: &[&str]) -> Vec<SceneFile> {
    let mut seen = Vec::new();
    let is_new = |scene: &SceneFile| {
        let content: Vec<_> = tables.iter().map(|table| scene.content[*table].clone()).collect();
        let new = !seen.contains(&content);
        seen.push(content);
        new
    };
    scenes().into_iter().filter(is_new).collect()
}

/// The answer depends on the team alone.
#[test]
fn plan_pitch_has_its_keys_for_every_team_and_the_bits_of_the_library() {
    let teams = different(&["team"]);
    assert!(teams.len() >= 4, "only {} teams", teams.len());
    for scene in teams {
        let line = scene.answer(&[&["--json"], &PLAN_PITCH[..]].concat());
        let plan: Value = serde_json::from_str(&line).unwrap();
        let keys = ["plan", "status", "value", "from", "value_lo", "value_hi", "bench_a", "bench_b", "head_radius"];
        // A clearance that the scene requires is stated.
        let clearance = scene.load().require.and_then(|require| require.clearance).map(|_| "clearance");
        assert_keys(&plan, &keys.into_iter().chain(clearance).collect::<Vec<_>>());
        assert_eq!((&plan["plan"], &plan["status"]), (&"pitch".into(), &"proved".into()), "{}", scene.name);
        let [a, b] = ["bench_a", "bench_b"].map(|key| plan[key].as_u64().unwrap() as usize);
        assert!(a + 1 < b && b < scene.benches(), "{}: {plan}", scene.name);
        let [value, from, value_lo, value_hi, _, _, radius, ..] = numbers(&line)[..] else { panic!("{line}") };
        assert!(same_bits(value, value_hi) && value_lo < value_hi && value_hi - value_lo <= 1e-9, "{plan}");
        assert!(radius >= REACH && from < value_lo, "{}: {plan}", scene.name);
        if scene.name == "school" {
            let known = least_pitch(scene.load().ensemble.only().unwrap().team(), REACH, &mut unreported).unwrap();
            let overlap = known.overlap.unwrap();
            let bounds =
                [(value_lo, known.value_lo), (value_hi, known.value_hi.unwrap()), (radius, overlap.head_radius)];
            assert!(bounds.into_iter().all(|(printed, known)| same_bits(printed, known)), "{line} {known:?}");
            let printed = scene.answer(&PLAN_PITCH);
            assert!(
                printed.contains("reaches 2 m,") && printed.contains(&format!("a pitch of {value} m")),
                "{printed}"
            );
            assert!(printed.contains(&format!("bench {}", b + 1)) && printed.contains("counting from 1"), "{printed}");
            assert!(printed.contains(&format!("from {value_lo} to {value_hi} m")), "{printed}");
            assert!(printed.contains("Proved"), "{printed}");
        }
    }
}

#[test]
fn plan_speed_has_its_keys_or_names_what_forbids_it() {
    let mut planned = 0;
    for scene in different(&["team", "path", "motion"]) {
        if scene.benches() > 1000 && !long() {
            aloud(&format!("plan speed: not on {} without BENCH_DRAGON_LONG=1", scene.name));
            continue;
        }
        let output = scene.run(&[&["--json"], &PLAN_SPEED[..]].concat());
        let printed = text(&output.stderr);
        if output.status.code() == Some(2) {
            // Near a lock a handle is faster than any limit.
            assert!(output.stdout.is_empty() && printed.lines().count() == 1, "{}: {printed}", scene.name);
            let lock = time_of(&scene, EventKind::Lock).unwrap();
            let runs_into_it = printed.contains("lock") && printed.contains(&format!("{lock:.9}"));
            assert!(runs_into_it, "{}: {printed}", scene.name);
            continue;
        }
        assert_eq!((output.status.code(), printed.as_str()), (Some(0), ""), "{}", scene.name);
        let line = text(&output.stdout);
        let plan: Value = serde_json::from_str(&line).unwrap();
        assert_keys(&plan, &["plan", "status", "value", "value_lo", "value_hi", "time", "handle", "ratio"]);
        assert_eq!((&plan["plan"], &plan["status"]), (&"speed".into(), &"proved".into()), "{}", scene.name);
        let [value, value_lo, value_hi, time, handle, ratio] = numbers(&line)[..] else { panic!("{line}") };
        assert!(same_bits(value, value_lo) && value_hi - value_lo <= 1e-9, "{}: {plan}", scene.name);
        assert!((value_lo..=value_hi).contains(&(LIMIT / ratio)) && ratio >= 1.0, "{}: {plan}", scene.name);
        assert!((handle as usize) < scene.handles() && time >= 0.0, "{}: {plan}", scene.name);
        planned += 1;
        if scene.benches() <= 60 {
            let loaded = scene.load();
            let timeline = loaded.ensemble.timeline(&mut unreported);
            let known = greatest_speed(&loaded, &timeline, LIMIT, &mut unreported).unwrap();
            let bounds = [(value_lo, known.value_lo), (value_hi, known.value_hi)];
            for (printed, known) in bounds.into_iter().chain([(time, known.time), (ratio, known.ratio)]) {
                assert!(same_bits(printed, known), "{}: {plan}", scene.name);
            }
            let printed = scene.answer(&PLAN_SPEED);
            assert!(printed.contains(&format!("{value} m/s")), "{printed}");
            assert!(printed.contains(&format!("handle {} (counting from 1)", handle + 1.0)), "{printed}");
            assert!(printed.contains(&format!("from {value_lo} to {value_hi} m/s")), "{printed}");
            assert!(printed.contains("Proved"), "{printed}");
        }
    }
    assert!(planned >= 4, "only {planned} scenes have a greatest speed");
}

/// Returns the content of SVG files as another program reads it: for each file, the number of elements of each name,
/// and all texts.
fn read_svg(files: &[&Path]) -> Vec<Value> {
    let code = "import collections, json, sys, xml.etree.ElementTree as tree\n\
                svg = '{http://www.w3.org/2000/svg}'\n\
                for file in sys.argv[1:]:\n\
                \x20   root = tree.parse(file).getroot()\n\
                \x20   assert root.tag == svg + 'svg', root.tag\n\
                \x20   names = collections.Counter(element.tag.removeprefix(svg) for element in root.iter())\n\
                \x20   texts = [''.join(element.itertext()).strip() for element in root.iter(svg + 'text')]\n\
                \x20   print(json.dumps({'names': names, 'texts': texts}))\n";
    let output = Process::start(python().args(["-c", code]).args(files)).output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    text(&output.stdout).lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

const MEASUREMENT: [&str; 15] = [
    "accuracy",
    "bytes_per_handle",
    "contact_time_error",
    "frame_ns",
    "frame_ns_p99",
    "frames_timed",
    "make_s",
    "max_link_error",
    "max_position_error",
    "max_speed_error",
    "meets",
    "memory_bytes",
    "noise",
    "on_front",
    "solver",
];

/// `trade` measures for seconds, and for minutes on long teams. Its figures are of this machine, so nothing here
/// compares them with another machine's.
#[test]
fn trade_has_its_keys_for_every_solver() {
    let folder = tempfile::tempdir().unwrap();
    let plot = folder.path().join("plot.svg");
    let mut measured = 0;
    for scene in scenes() {
        if scene.benches() > 60 && !long() {
            aloud(&format!("trade: not on {} without BENCH_DRAGON_LONG=1", scene.name));
            continue;
        }
        measured += 1;
        let arguments = ["--json", "trade", "--plot", plot.to_str().unwrap()];
        let output = Process::start(&mut scene.command(&arguments)).output();
        // If no progress bar can be drawn, a sentence comes first: half a minute without output is too long.
        let began =
            format!("measuring every solver on scene {} ({} benches), which takes ", scene.name, scene.benches());
        let said = text(&output.stderr);
        assert!(
            output.status.success() && said.starts_with(&began) && said.lines().count() == 1,
            "{}: {said}",
            scene.name
        );
        let lines: Vec<Value> = text(&output.stdout).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        let lines: Vec<Value> = lines.into_iter().filter(|line| line["type"] != "display").collect();
        let has_contact = time_of(&scene, EventKind::Contact).is_some();
        for (index, line) in lines.iter().enumerate() {
            let collision = (index == 0).then_some("collision");
            assert_keys(line, &MEASUREMENT.into_iter().chain(collision).collect::<Vec<_>>());
            assert_eq!(line["contact_time_error"].is_number(), has_contact, "{line}");
            assert!(line["frame_ns"].as_f64().unwrap() > 0.0, "{line}");
            assert!(line["frame_ns_p99"].as_f64() >= line["frame_ns"].as_f64(), "{line}");
            assert!(line["frames_timed"].as_u64().unwrap() > 0, "{line}");
            let error = |key: &str| line[key].as_f64().unwrap();
            if line["solver"].as_str().unwrap().starts_with("paper") {
                assert!(error("max_position_error") > 1e-3, "the paper's head is too fast: {line}");
            } else {
                let promised = line["accuracy"].as_f64().unwrap_or(0.0).max(1e-9);
                assert!(error("max_position_error") < promised && error("max_link_error") < 2.0 * promised, "{line}");
                assert_ne!(line["meets"], false, "{line}");
            }
        }
        for way in lines[0]["collision"].as_array().unwrap() {
            assert_keys(way, &["method", "frame_ns", "search_s", "contact_time_error"]);
            assert!(way["frame_ns"].is_null() != way["search_s"].is_null(), "{way}");
        }
        // A solver is on the front if no other solver is both faster and more exact; errors below the noise are equal.
        let [cost, error, noise] = ["frame_ns", "max_position_error", "noise"]
            .map(|key| lines.iter().map(|line| line[key].as_f64().unwrap()).collect::<Vec<_>>());
        let error: Vec<f64> = error.iter().zip(&noise).map(|(error, noise)| error.max(*noise)).collect();
        for (i, line) in lines.iter().enumerate() {
            let beaten = (0..lines.len()).any(|j| cost[j] < cost[i] && error[j] < error[i]);
            assert!(!(beaten && line["on_front"] == true), "{line} is on the front: {lines:?}");
        }
        assert!(lines.iter().any(|line| line["on_front"] == true), "{lines:?}");
        assert!(lines.iter().any(|line| line["solver"] == "newton"), "{lines:?}");
        if can_run(python_modules(&["xml.etree"])) {
            let svg = &read_svg(&[&plot])[0];
            let texts = svg["texts"].as_array().unwrap();
            // The notes above the plot explain what a table is.
            let label =
                |solver: &Value| solver.as_str().unwrap().replace("follower_table", "table").replace(" precision", "");
            assert!(lines.iter().all(|line| texts.contains(&label(&line["solver"]).into())), "{svg}");
        }
    }
    assert!(measured >= 2, "only {measured} scenes are small");
}
