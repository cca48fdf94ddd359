//! `plan pitch` and `plan turn` with a clearance that boards keep: against other searches, and with certificates.

use std::io::Write;
use std::process::Command;

use crate::harness::{all, can_run, json_lines, python, python_modules, text};
use bench_dragon::motion::model::path::Path;
use bench_dragon::motion::model::team::{Ends, Team};
use bench_dragon::motion::solve::newton::Newton;
use bench_dragon::motion::solve::{Chain, Velocities};
use bench_dragon::proof::{Proved, Refused, verify};
use serde_json::{Value, json};

/// The least pitch at which the paper's benches reach 4.5 m and keep 0.2 m. It is the root of the clearance of benches 0
/// and 17, with 30 digits. A golden section finds the least clearance over places of the head.
const PITCH: f64 = 0.650_013_396_502_777_8;

const PAPER: Team =
    Team { benches: 223, head_length: 3.41, body_length: 2.20, width: 0.30, hole_inset: 0.275, ends: Ends::NONE };

/// A scene of the paper's benches. With 40 of them, those that come nearest are the same as with 223.
fn coil(rest: &str) -> tempfile::NamedTempFile {
    team_of_40("", rest)
}

/// A scene of 40 benches with sizes of their own.
fn team_of_40(sizes: &str, rest: &str) -> tempfile::NamedTempFile {
    let spiral = "[path]\nkind = \"spiral\"\npitch = 0.55\nstart_turn = 16\n[motion]\nhead_speed = 1.0\n";
    written(&format!("[team]\nbenches = 40\n{sizes}\n{spiral}{rest}"))
}

fn written(scene: &str) -> tempfile::NamedTempFile {
    let mut file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    file.write_all(scene.as_bytes()).unwrap();
    file
}

/// Runs the program with a scene, and returns its exit code, its output and its errors.
fn run(scene: &tempfile::NamedTempFile, arguments: &[&str]) -> (Option<i32>, std::process::Output) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    let output = program.arg("--scene").arg(scene.path()).args(arguments).output().unwrap();
    (output.status.code(), output)
}

/// Returns the line of a plan with `--json`.
fn planned(scene: &tempfile::NamedTempFile, arguments: &[&str]) -> Value {
    let (code, output) = run(scene, &[&["--json"], arguments].concat());
    assert_eq!(code, Some(0), "{}", text(&output.stderr));
    json_lines(&output).remove(0)
}

/// Asserts that a plan is proved, and encloses a number within a nanometre.
fn encloses(line: &Value, expected: f64, digits: f64) {
    let [lo, hi] = ["value_lo", "value_hi"].map(|key| line[key].as_f64().unwrap());
    assert!(lo <= expected + digits && hi >= expected - digits && hi - lo <= 1e-9, "{line}, not {expected}");
    assert_eq!(line["status"], "proved", "{line}");
}

const REACH: [&str; 4] = ["plan", "pitch", "--reach-radius", "4.5"];

#[test]
fn the_least_pitch_with_a_clearance_is_that_of_another_search() {
    let by_option = planned(&coil(""), &[&REACH[..], &["--clearance", "0.2"]].concat());
    encloses(&by_option, PITCH, 1e-15);
    let pair = [&by_option["bench_a"], &by_option["bench_b"], &by_option["clearance"]];
    assert_eq!(pair, [&json!(0), &json!(17), &json!(0.2)], "{by_option}");
    // The clearance that the scene requires counts, unless the option has another.
    let required = coil("[require]\nclearance = 0.2\n");
    assert_eq!(planned(&required, &REACH), by_option);
    let apart = planned(&required, &[&REACH[..], &["--clearance", "0"]].concat());
    encloses(&apart, 0.450_337_393, 5e-10);
    assert_eq!(apart, planned(&coil(""), &REACH));
    let (_, said) = run(&required, &REACH);
    let said = text(&said.stdout);
    assert!(said.contains("come as near as 0.2 m before") && said.contains("are nearer than 0.2 m"), "{said}");
}

/// The expected pitches are of a search as that for [`PITCH`], which finds the two benches by a scan of all pairs.
#[test]
fn other_teams_have_the_pitch_of_another_search() {
    // The sizes of the boards; the radius and the clearance; the pitch and its two benches.
    let paper = "head_length = 3.41\nbody_length = 2.2\nwidth = 0.3\nhole_inset = 0.275";
    let wide_head = &format!("{paper}\nhead_width = 0.9");
    let short = "head_length = 1.2\nbody_length = 1.5\nwidth = 0.4\nhole_inset = 0.1";
    let cases = [
        (paper, ["3.2", "0.35"], 0.839_706_841_505_223, [0, 15]),
        // The second bench decides, not the head, which is shorter.
        (short, ["2.6", "0.05"], 0.533_671_033_585_999_9, [1, 16]),
        // The place where the radius is reached decides.
        (paper, ["6", "0.5"], 0.912_837_810_386_087_6, [0, 23]),
        (wide_head, ["4.5", "0.2"], 0.926_079_753_137_608_7, [0, 18]),
    ];
    for (sizes, [radius, clearance], pitch, benches) in cases {
        let line =
            planned(&team_of_40(sizes, ""), &["plan", "pitch", "--reach-radius", radius, "--clearance", clearance]);
        encloses(&line, pitch, 1e-15);
        assert_eq!([&line["bench_a"], &line["bench_b"]], benches, "{line}");
    }
}

/// The lines of a certificate, each changed by a function.
fn changed(lines: &[Value], change: impl Fn(&mut Value)) -> Vec<u8> {
    let mut lines = lines.to_vec();
    lines.iter_mut().for_each(change);
    lines.iter().flat_map(|line| format!("{line}\n").into_bytes()).collect()
}

fn check(certificate: &[u8]) -> Result<Proved, Refused> {
    verify(certificate, &mut |_| {})
}

#[test]
#[ignore = "computes for long: tests/run --all"]
fn a_certificate_with_another_clearance_is_refused() {
    let (scene, file) = (coil(""), tempfile::NamedTempFile::new().unwrap());
    let name = file.path().to_str().unwrap();
    planned(&scene, &[&REACH[..], &["--clearance", "0.2", "--certify", name]].concat());
    let certificate = std::fs::read_to_string(file.path()).unwrap();
    let lines: Vec<Value> = certificate.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let proved = check(&changed(&lines, |_| ())[..]).unwrap().least_pitch.unwrap();
    assert!(proved.clearance == 0.2 && proved.value_lo.unwrap() < PITCH && proved.value_hi.unwrap() > PITCH);
    let said = Command::new(env!("CARGO_BIN_EXE_bench-dragon")).args(["verify", name]).output().unwrap();
    let said = text(&said.stdout);
    assert!(
        said.contains("two boards are nearer than 0.2 m") && said.contains("come as near as 0.2 m before"),
        "{said}"
    );
    // A larger margin than was kept, a smaller one than the intervals show, and one in the result alone.
    for clearance in [0.200_000_01, 0.199_999_99, 0.0] {
        let both = changed(&lines, |line| {
            if line.get("clearance").is_some() {
                line["clearance"] = json!(clearance);
            }
        });
        assert!(check(&both[..]).is_err(), "{clearance}");
        let result = changed(&lines, |line| {
            if line["of"] == "least_pitch" {
                line["clearance"] = json!(clearance);
            }
        });
        assert!(check(&result[..]).is_err(), "{clearance} in the result");
    }
    // A point that is not in its board, and boards that are said to be nearer than they are.
    let moved = changed(&lines, |line| {
        if line["type"] == "overlap" {
            line["other"] = line["point"].clone();
        }
    });
    assert!(check(&moved[..]).is_err());
    let no_step = changed(&lines, |line| {
        if line["type"] == "step" {
            line["apart"] = json!(0.199);
        }
    });
    assert!(check(&no_step[..]).is_err());
}

/// The other search is `tests/python/least_turn.py 1.7 2.86 2 12 1.65 0.275 1.3 0.1`.
#[test]
fn the_least_turn_with_a_clearance_is_that_of_another_search() {
    const RADIUS: f64 = 4.585_455_281_037;
    let scene = include_str!("../../config/turnaround.toml").replace("benches = 223", "benches = 12");
    let scene = written(&scene.replace("width = 0.30", "width = 1.3"));
    let line = planned(&scene, &["plan", "turn", "--arc-ratio", "2", "--clearance", "0.1"]);
    encloses(&line, RADIUS, 2e-11);
    assert_eq!((&line["limit"], &line["bench_a"], &line["bench_b"]), (&"contact".into(), &0.into(), &11.into()));
    if all() && can_run(python_modules(&["math"])) {
        let arguments = ["tests/python/least_turn.py", "1.7", "2.86", "2", "12", "1.65", "0.275", "1.3", "0.1"];
        let peer = python().args(arguments).output().unwrap();
        let found = text(&peer.stdout).lines().nth(1).and_then(|line| line.split(' ').next()?.parse::<f64>().ok());
        assert!((found.unwrap() - RADIUS).abs() < 5e-11, "{}", text(&peer.stdout));
    }
}

/// Returns the least distance of a point from the boards of a team on a spiral until the head is 4.5 m from the centre,
/// by many places of the head.
fn sampled(pitch: f64, [x, y]: [f64; 2]) -> f64 {
    let (path, team) = (Path::spiral(pitch, 16.0), Team { benches: 40, ..PAPER });
    let newton = Newton::new(path.clone(), team, 1.0, Velocities::Omitted);
    let to = path.length() - Path::spiral(pitch, 4.5 / pitch).length();
    let (mut chain, mut least) = (Chain::new(team.handles()), f64::INFINITY);
    // From one turn before on.
    for k in 0..=150_000 {
        newton.solve_at(to - 30.0 * f64::from(k) / 150_000.0, &mut chain).unwrap();
        for bench in 0..2 {
            let [front, rear] = [bench, bench + 1].map(|handle| [chain.x[handle], chain.y[handle]]);
            let along = [front[0] - rear[0], front[1] - rear[1]];
            let link = along[0].hypot(along[1]);
            let from = [x - 0.5 * (front[0] + rear[0]), y - 0.5 * (front[1] + rear[1])];
            let ahead = (from[0] * along[0] + from[1] * along[1]).abs() / link - 0.5 * link - 0.275;
            let aside = (from[0] * along[1] - from[1] * along[0]).abs() / link - 0.15;
            least = least.min(ahead.max(0.0).hypot(aside.max(0.0)));
        }
    }
    least
}

#[test]
#[ignore = "computes for long: tests/run --all"]
fn a_plan_stays_outside_the_keep_outs_of_the_stage() {
    // Just inside the last turn, where the head's board passes with the least pitch for boards alone.
    let place = [4.0705, 1.3226];
    let lamp = |keep_out: f64| {
        let circle = format!("circle = {{ center = {place:?}, radius = 0.05 }}\nkeep_out = {keep_out}\n");
        coil(&format!("[[stage.obstacles]]\nname = \"lamp\"\n{circle}"))
    };
    let boards = planned(&coil(""), &REACH);
    let line = planned(&lamp(0.0), &REACH);
    let value = line["value"].as_f64().unwrap();
    assert_eq!((&line["status"], &line["obstacle"]), (&json!("given_up"), &json!("lamp")), "{line}");
    assert_eq!((&line["value_lo"], &line["value_hi"]), (&boards["value_lo"], &line["value"]), "{line}");
    assert!(value > boards["value"].as_f64().unwrap() + 1e-4, "{line}");
    assert!((sampled(value, place) - 0.05).abs() < 1e-6, "{}", sampled(value, place));
    assert!(sampled(value - 1e-5, place) < 0.05 - 1e-6);
    let further = planned(&lamp(0.02), &REACH)["value"].as_f64().unwrap();
    assert!((sampled(further, place) - 0.07).abs() < 1e-6, "{further}");
    // An obstacle that no board comes near changes nothing, and that is proved too.
    let aside = coil("[[stage.obstacles]]\nname = \"well\"\ncircle = { center = [0.0, 0.0], radius = 2.0 }\n");
    assert_eq!(planned(&aside, &REACH), boards);
    let (_, said) = run(&lamp(0.0), &REACH);
    let said = text(&said.stdout);
    assert!(said.contains("with a pitch just below, a board is in the keep-out of the lamp"), "{said}");
}

#[test]
fn a_turn_stays_outside_the_keep_outs_of_the_stage() {
    let scene = include_str!("../../config/turnaround.toml").replace("benches = 223", "benches = 12");
    let well = "[[stage.obstacles]]\nname = \"well\"\ncircle = { center = [0.0, 0.0], radius = 0.1 }\nkeep_out = 1.3\n";
    let arguments = ["plan", "turn", "--arc-ratio", "2"];
    let boards = planned(&written(&scene), &arguments);
    let line = planned(&written(&format!("{scene}\n{well}")), &arguments);
    let value = line["value"].as_f64().unwrap();
    assert_eq!((&line["status"], &line["obstacle"]), (&json!("given_up"), &json!("well")), "{line}");
    assert!(value > boards["value"].as_f64().unwrap() && line["value_hi"] == line["value"], "{line}");
    let clearance = |radius: f64| {
        let scene = scene.replace("turn_radius = 4.5", &format!("turn_radius = {radius}"));
        let (_, output) = run(&written(&format!("{scene}\n{well}")), &["check", "--json"]);
        let of_well = json_lines(&output).into_iter().find(|line| line["obstacle"] == "well").unwrap();
        of_well["clearance"].as_f64().unwrap()
    };
    assert!((0.0..1e-7).contains(&clearance(value)), "{}", clearance(value));
    assert!(clearance(value - 1e-5) < 0.0);
}

#[test]
fn a_wrong_clearance_is_refused_in_one_sentence() {
    let cases = [
        ("--clearance=-0.1", "--clearance is -0.1, expected a number from 0 to"),
        ("--clearance=nan", "--clearance is NaN, expected"),
        // 2.20 m long, holes 0.275 m from the ends: the boards before and after are 1.1 m apart on a line.
        ("--clearance=1.2", "no more than 1.2 m apart even on a straight line"),
    ];
    for (argument, expected) in cases {
        let (code, output) = run(&coil(""), &[&REACH[..], &[argument]].concat());
        let said = text(&output.stderr);
        assert!(code == Some(2) && said.lines().count() == 1 && said.contains(expected), "{argument}: {said}");
    }
}
