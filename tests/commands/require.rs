//! `[require]`: what a show must keep over its whole route, and the verdicts of `check`.

use std::io::Write;
use std::process::{Command, Output};

use serde_json::Value;

use crate::harness::{json_lines, text};

const VILLAGE: &str = include_str!("../../config/village.toml");

/// Runs `check` with a scene.
fn check(scene: &str, arguments: &[&str]) -> Output {
    let mut file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    file.write_all(scene.as_bytes()).unwrap();
    let mut program = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    program.arg("check").arg(file.path()).args(arguments).output().unwrap()
}

/// Returns the verdicts of `check --json`: of what, the required and the least distance, and the word.
fn verdicts(output: &Output) -> Vec<(String, f64, f64, String)> {
    let lines = json_lines(output).into_iter().filter(|line| line["check"] == "require");
    let word = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    let verdict = |line: Value| {
        let what = line.get("obstacle").unwrap_or(&line["what"]);
        (word(what), number(&line["required"]), number(&line["clearance"]), word(&line["verdict"]))
    };
    lines.map(verdict).collect()
}

#[test]
fn the_village_keeps_what_it_requires_and_fails_where_it_does_not() {
    for prove in [&[][..], &["--prove"]] {
        let output = check(VILLAGE, &[prove, &["--json"]].concat());
        assert_eq!((output.status.code(), text(&output.stderr).as_str()), (Some(0), ""));
        let passed = verdicts(&output);
        let names = ["boards", "northern spectators", "southern spectators", "flagpole", "boundary"];
        assert_eq!(passed.iter().map(|verdict| verdict.0.as_str()).collect::<Vec<_>>(), names);
        assert!(passed.iter().all(|(_, required, least, word)| least >= required && word == "pass"), "{passed:?}");
        let least = passed[0].2;
        assert!((0.2..0.23).contains(&least) && passed[1].1 == 1.0, "{passed:?}");

        let output = check(&VILLAGE.replace("clearance = 0.20", "clearance = 0.22"), &[prove, &["--json"]].concat());
        let failed = verdicts(&output);
        assert_eq!(output.status.code(), Some(1));
        assert_eq!(failed[0], ("boards".to_owned(), 0.22, least, "fail".to_owned()));
        assert_eq!(failed[1..], passed[1..]);

        // The boards come 1.218 m near to these spectators.
        let output = check(&VILLAGE.replacen("keep_out = 1.0 ", "keep_out = 1.3 ", 1), &[prove, &["--json"]].concat());
        assert_eq!(output.status.code(), Some(1));
        assert_eq!(verdicts(&output)[1].3, "fail");
    }
    let said = text(&check(VILLAGE, &[]).stdout);
    assert!(said.contains("PASS: boards: 0.216") && said.contains("required: 0.2 m."), "{said}");
    assert!(said.contains("m, 0.218135457 m beyond the keep-out of 1 m, at t = "), "{said}");
    let output = check(&VILLAGE.replace("clearance = 0.20", "clearance = 0.22"), &[]);
    assert!(text(&output.stdout).contains("FAIL: boards: 0.216"), "{}", text(&output.stdout));
    assert!(text(&output.stderr).contains("the show does not keep what [require] states"));
}

/// A square of 22 m by 20 m with a tree in its middle, and 50 benches: made by following `docs/your-village.md` only.
#[test]
fn a_second_village_that_follows_the_guide_passes() {
    let output = check(include_str!("../scenes/second_village.toml"), &["--json"]);
    let found = verdicts(&output);
    assert_eq!(output.status.code(), Some(0), "{found:?}");
    assert_eq!(found.iter().map(|verdict| verdict.0.as_str()).collect::<Vec<_>>(), ["boards", "tree", "boundary"]);
}

/// A show that stops has the least clearances of the same show that continues, and says where it stops.
#[test]
fn the_least_clearances_are_of_the_whole_route() {
    let paper = include_str!("../../config/paper.toml");
    let continued = paper.replace("on_contact = \"stop\"", "on_contact = \"continue\"");
    let [stopped, whole] = [paper, &continued].map(|scene| check(scene, &["--json"]));
    assert_eq!(json_lines(&stopped), json_lines(&whole));
    let line = &json_lines(&stopped)[0];
    // The lock that ends the motion, to 15 digits.
    assert!((line["until"].as_f64().unwrap() - 432.917924228383).abs() < 1e-9, "{line}");
    assert!(line["clearance"].as_f64().unwrap() < -0.08, "{line}");
    assert!(text(&check(paper, &[]).stdout).contains("The show stops at t = 412.473837682 s"));
    assert!(!text(&check(&continued, &[]).stdout).contains("The show stops"));
    // The boundary is met at the start, where the show stops.
    let scene = VILLAGE.replace("-210, 14.5], [-210, 12.4]", "-2, 14.5], [-2, 12.4]");
    let output = check(&scene, &["--json"]);
    let found = verdicts(&output);
    assert_eq!((output.status.code(), found[4].3.as_str()), (Some(1), "fail"));
    for (found, expected) in found.iter().zip(verdicts(&check(VILLAGE, &["--json"]))).take(4) {
        assert_eq!((&found.0, &found.3), (&expected.0, &expected.3));
        assert!((found.2 - expected.2).abs() < 1e-12, "{found:?} {expected:?}");
    }
}

#[test]
fn what_is_not_decided_fails_and_says_why() {
    // The overlap of a board and a line is the one thing that no proof decides.
    let scene = "[team]\nbenches = 8\n[path]\nkind = \"pieces\"\npieces = [{ kind = \"line\", length = 8.0 }]\n\
                 [motion]\nhead_speed = 1.0\n[[stage.obstacles]]\nname = \"rope\"\nline = [[5.0, -1.0], [5.0, 1.0]]\n\
                 [require]\nclearance = 0.2\n";
    let searched = check(scene, &["--json"]);
    let words = |output: &Output| verdicts(output).into_iter().map(|verdict| verdict.3).collect::<Vec<_>>();
    assert_eq!((searched.status.code(), words(&searched)), (Some(1), vec!["pass".to_owned(), "fail".to_owned()]));
    let proved = check(scene, &["--prove", "--json"]);
    assert_eq!((proved.status.code(), words(&proved)), (Some(1), vec!["pass".to_owned(), "undecided".to_owned()]));
    let said = text(&check(scene, &["--prove"]).stdout);
    assert!(said.contains("FAIL: the rope: ") && said.contains("not decided, because the proof"), "{said}");
}

#[test]
fn the_table_is_checked() {
    for (clearance, sentence) in [
        ("clearance = -1", "require.clearance is -1, expected"),
        ("clearance = nan", "require.clearance is NaN, expected"),
        ("distance = 1", "require.distance: unknown field"),
    ] {
        let output = check(&VILLAGE.replace("clearance = 0.20 ", &format!("{clearance} ")), &[]);
        let said = text(&output.stderr);
        assert!(output.status.code() == Some(2) && said.contains("line ") && said.contains(sentence), "{said}");
    }
    // Without a clearance the keep-outs alone are required, and a team of two boards cannot meet itself.
    let output = check(&VILLAGE.replace("clearance = 0.20 ", " "), &["--json"]);
    assert!(output.status.success() && verdicts(&output).len() == 4, "{}", text(&output.stderr));
    let two = "[team]\nbenches = 2\n[path]\nkind = \"spiral\"\npitch = 2.0\nstart_turn = 4\n[motion]\nhead_speed = \
               1.0\n[require]\nclearance = 0.2\n";
    let output = check(two, &[]);
    assert!(text(&output.stdout).contains("PASS: boards: no two could meet; required: 0.2 m."));
    assert!(output.status.success());
}

#[test]
fn a_boundary_in_which_no_board_fits_is_named() {
    let scene = "[team]\nbenches = 4\n[path]\nkind = \"pieces\"\npieces = [{ kind = \"line\", length = 10.0 }]\n[motion]\n\
                 head_speed = 1.0\n[stage]\nboundary = { polygon = [[-1, -1], [1, -1], [1, 1], [-1, 1]], keep_out = 0.5 }\n\
                 [require]\n";
    let output = check(scene, &[]);
    let said = text(&output.stdout);
    assert!(said.contains("No board fits inside the boundary: at t = 0 s bench 1 (the head)"), "{said}");
    assert!(
        said.contains("FAIL: the boundary: no board fits inside; required: 0.5 m.") && !said.contains("inf"),
        "{said}"
    );
    assert_eq!(output.status.code(), Some(1));
}
