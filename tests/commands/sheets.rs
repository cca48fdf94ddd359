//! `sheets`: its rows against `solve` and `check`, and bad input. `tests/browser/sheets.rs` has its pages on paper.

use std::process::{Command, Output};

use crate::harness::{json_lines, text};
use serde_json::Value;

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bench-dragon")).args(arguments).output().unwrap()
}

/// A row of the CSV.
struct Row {
    bench: usize,
    numbers: [f64; 5],
    what: String,
}

fn rows(scene: &str) -> Vec<Row> {
    let folder = tempfile::tempdir().unwrap();
    let [csv, html] = ["rows.csv", "pages.html"].map(|name| folder.path().join(name).to_str().unwrap().to_owned());
    let output = run(&["sheets", scene, "-o", &html, "--csv", &csv]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let written = std::fs::read_to_string(csv).unwrap();
    let (head, lines) = written.split_once('\n').unwrap();
    assert_eq!(head, "bench,t,x,y,heading,speed,what");
    let row = |line: &str| {
        let parts: Vec<&str> = line.splitn(7, ',').collect();
        let numbers = [1, 2, 3, 4, 5].map(|k| parts[k].parse().unwrap());
        Row { bench: parts[0].parse().unwrap(), numbers, what: parts[6].trim_matches('"').to_owned() }
    };
    lines.lines().map(row).collect()
}

fn json(arguments: &[&str]) -> Vec<Value> {
    json_lines(&run(&[arguments, &["--json", "--quiet"]].concat()))
}

#[test]
fn a_row_is_the_middle_of_its_bench_as_solve_has_it() {
    let rows = rows("config/square.toml");
    let mut times: Vec<f64> = rows.iter().map(|row| row.numbers[0]).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    // The end of the show is rounded to a hundredth of a second, which may lie after it.
    times.retain(|time| *time < 121.9);
    let at: Vec<String> = times.iter().map(f64::to_string).collect();
    let solved = json(&["solve", "config/square.toml", "--at", &at.join(",")]);
    let mut compared = 0;
    for row in rows.iter().filter(|row| row.numbers[0] < 121.9) {
        let [time, x, y, heading, speed] = row.numbers;
        let line = solved.iter().find(|line| line["t"] == time).unwrap();
        let handle = |number: usize, k: usize| line["handles"][number][k].as_f64().unwrap();
        let (front, rear) = (row.bench - 1, row.bench);
        let middle = |k| 0.5 * (handle(front, k) + handle(rear, k));
        assert!((x - middle(0)).abs() < 6e-4 && (y - middle(1)).abs() < 6e-4, "bench {} at {time} s", row.bench);
        assert!((heading - handle(front, 2)).abs() < 6e-5 && (speed - handle(front, 5)).abs() < 6e-4);
        compared += 1;
    }
    assert!(compared > 300, "{compared} rows");
    // By hand: the head begins 24 m before the first arc at 1 m/s, which is a quarter of a circle of 6 m.
    let first = rows.iter().find(|row| row.bench == 1 && row.what.starts_with("right")).unwrap();
    assert_eq!((first.numbers[0], first.what.as_str()), (24.0, "right, quarter circle, 9.4 s"));
    // The second bench comes there a head's link later.
    let second = rows.iter().find(|row| row.bench == 2 && row.what.starts_with("right")).unwrap();
    assert!((second.numbers[0] - 26.86).abs() < 0.06, "{:?}", second.numbers);
}

#[test]
fn the_nearest_of_all_is_what_check_says() {
    let rows = rows("config/village.toml");
    let checked = json(&["check", "config/village.toml"]);
    let least = checked.iter().find(|line| line["check"] == "clearance").unwrap();
    let time = (100.0 * least["time"].as_f64().unwrap()).round() / 100.0;
    let centimetres = (100.0 * least["clearance"].as_f64().unwrap()).floor();
    for (own, other) in [("bench_a", "bench_b"), ("bench_b", "bench_a")] {
        let [own, other] = [own, other].map(|bench| least[bench].as_u64().unwrap() + 1);
        let found =
            rows.iter().find(|row| row.bench as u64 == own && row.what.starts_with(&format!("bench {other}, ")));
        let found = found.unwrap_or_else(|| panic!("no row of {own} and {other}"));
        assert_eq!(found.numbers[0], time);
        assert!(found.what.contains(&format!("{centimetres} cm")), "{}", found.what);
    }
    // No bench is said to come nearer than that to another.
    let said = rows.iter().filter(|row| row.what.starts_with("bench "));
    let said: Vec<f64> =
        said.filter_map(|row| row.what.split(", ").nth(2)?.strip_suffix(" cm")?.parse().ok()).collect();
    assert!(said.len() > 80 && said.iter().all(|one| *one >= centimetres), "{said:?}");
}

/// Returns points on the outlines of both boards, the head's sizes and those of the village's other benches.
fn outline(line: &Value, bench: usize) -> Vec<[f64; 2]> {
    let handle = |number: usize, k: usize| line["handles"][number][k].as_f64().unwrap();
    let (front, rear) = ([handle(bench, 0), handle(bench, 1)], [handle(bench + 1, 0), handle(bench + 1, 1)]);
    let long = (front[0] - rear[0]).hypot(front[1] - rear[1]);
    let axis = [(front[0] - rear[0]) / long, (front[1] - rear[1]) / long];
    // The default of `hole_inset` beyond each hole, and half the width to either side.
    let (inset, half) = (0.275, 0.175);
    let point = |along: f64, left: f64| {
        [rear[0] + axis[0] * along - axis[1] * left, rear[1] + axis[1] * along + axis[0] * left]
    };
    let along = |share: f64| -inset + share * (long + 2.0 * inset);
    let shares = || (0..=200).map(|step| f64::from(step) / 200.0);
    let sides = shares().flat_map(|share| [point(along(share), half), point(along(share), -half)]);
    let ends = shares().flat_map(|share| [0.0, 1.0].map(|end| point(along(end), half * (2.0 * share - 1.0))));
    sides.chain(ends).collect()
}

#[test]
fn a_bench_is_near_within_its_span_and_not_before_or_after_it() {
    let rows = rows("config/village.toml");
    let seconds = |time: &str| {
        let (minutes, seconds) = time.split_once(':').unwrap();
        60.0 * minutes.parse::<f64>().unwrap() + seconds.parse::<f64>().unwrap()
    };
    let mut compared = 0;
    for row in rows.iter().filter(|row| row.bench % 17 == 1) {
        let Some((who, rest)) = row.what.split_once(", ") else { continue };
        let (Some(other), Some((_, span))) = (who.strip_prefix("bench "), rest.split_once(" (")) else { continue };
        let other: usize = other.parse().unwrap();
        let (from, until) = span.strip_suffix(')').unwrap().split_once('\u{2013}').unwrap();
        let (from, until) = (seconds(from), seconds(until));
        if from < 1.0 {
            continue;
        }
        assert!((from - 0.5..until + 0.5).contains(&row.numbers[0]), "{}", row.what);
        // Times on sheets are whole seconds.
        let times = [from - 1.0, from + 1.0, until - 1.0, until + 1.0];
        let at: Vec<String> = times.iter().map(f64::to_string).collect();
        let solved = json(&["solve", "config/village.toml", &format!("--at={}", at.join(","))]);
        // Not at the end of the show.
        if solved.len() < times.len() {
            continue;
        }
        for (line, is_near) in solved.iter().zip([false, true, true, false]) {
            let [one, two] = [row.bench - 1, other - 1].map(|bench| outline(line, bench));
            let apart = |a: &[f64; 2]| two.iter().map(|b| (a[0] - b[0]).hypot(a[1] - b[1])).fold(f64::MAX, f64::min);
            let distance = one.iter().map(apart).fold(f64::MAX, f64::min);
            assert_eq!(distance < 1.0, is_near, "{distance} m at {} s: bench {}, {}", line["t"], row.bench, row.what);
        }
        compared += 1;
    }
    assert!(compared >= 4, "{compared} spans");
}

#[test]
fn bad_input_is_refused_in_a_sentence() {
    let refused = |arguments: &[&str], words: &str| {
        let output = run(&[&["sheets", "config/square.toml"], arguments].concat());
        let said = text(&output.stderr);
        assert!(output.status.code() == Some(2) && said.contains(words), "{arguments:?}: {said}");
        assert!(output.stdout.is_empty());
    };
    refused(&["--benches", "1-21"], "expected benches from 1 to 20");
    refused(&["--lang", "de"], "expected en or zh");
    refused(&["--offset", "01:00:00:29"], "is no label at 25 frames per second");
    refused(&["--csv", "/nowhere/rows.csv"], "/nowhere");
}
