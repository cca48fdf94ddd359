//! Certificates of two dragons, checked by the second judge.

use std::path::PathBuf;

use fastrand::Rng;
use serde_json::{Value, json};

use super::{Changed, certified, lines_of, scene, verdicts, with};
use crate::harness::{aloud, can_run, cases, python_modules};

/// Returns a scene of two dragons: each goes the path of a random scene without obstacles, from a random place.
fn scene_of_two(number: u64) -> String {
    let mut random = Rng::with_seed(number);
    let mut dragon = |name: &str| {
        let kind = [0, 2, 4][random.usize(..3)];
        let own = scene(6 * random.u64(..1000) + kind).replace("on_contact = \"continue\"\n", "");
        let tables = own[own.find("[team]").unwrap()..].replace("[[", "[[dragons.").replace("\n[", "\n[dragons.");
        let tables = tables.replace("[dragons.[dragons.", "[[dragons.").replacen("[team]", "[dragons.team]", 1);
        let [x, y, turns, delay] = [8.0, 8.0, 1.0, 5.0].map(|most| most * random.f64());
        format!(
            "[[dragons]]\nname = \"{name}\"\ndelay = {delay}\n\
             placement = {{ origin = [{x}, {y}], rotation_turns = {turns}, mirror = {} }}\n{tables}",
            random.bool()
        )
    };
    format!(
        "name = \"scene of two {number}\"\n[motion]\non_contact = \"continue\"\n{}{}",
        dragon("gold"),
        dragon("jade")
    )
}

/// Returns the certificates of the files with a claim about two dragons that fits.
fn with_claim(files: &[PathBuf], question: &str, is_fit: &dyn Fn(&Value) -> bool) -> Vec<Value> {
    let of_question = files.iter().filter(|file| file.extension().unwrap() == question);
    let mut read = of_question.map(|file| lines_of(file));
    read.find(|lines| is_fit(lines.last().unwrap())).unwrap_or_else(|| panic!("no {question} of two dragons is fit"))
}

/// Returns changes that make claims about two dragons false.
fn changes_of_two(files: &[PathBuf]) -> Vec<Changed> {
    let events = with_claim(files, "events", &|last| last["time_lo"].as_f64() > Some(1e-3) && last["time_hi"].is_f64());
    let clearance = with_claim(files, "clearance", &|last| {
        last["hi"].is_f64() && last["lo"].is_f64() && last["until"] != "contact"
    });
    let mut changed = Vec::new();
    let mut change = |name: &str, lines: &[Value], kind: &str, edit: &dyn Fn(&mut Value)| {
        let other = with(lines, |_, line| {
            if line["type"] == kind {
                edit(line);
            }
        });
        assert_ne!(other, lines, "{name} changes nothing");
        changed.push((name.to_owned(), other));
    };
    let add = |number: &mut Value, by: f64| *number = json!(number.as_f64().unwrap() + by);
    let is_of_two = |line: &Value| line["dragons"] == json!([0, 1]);
    for by in [1e-6, -1e-6] {
        change(&format!("contact moved by {by} s"), &events, "result", &|line| {
            if is_of_two(line) {
                ["time_lo", "time_hi"].into_iter().for_each(|time| add(&mut line[time], by));
            }
        });
    }
    for (end, by) in [("lo", 2e-6), ("hi", -1e-6)] {
        change(&format!("{end} of the clearance"), &clearance, "result", &|line| {
            if is_of_two(line) {
                add(&mut line[end], by);
            }
        });
    }
    change("the benches of the near time", &clearance, "witness", &|line| {
        if line["time"].is_f64() {
            line["benches"] = json!([line["benches"][0].as_u64().unwrap() + 1, line["benches"][1]]);
        }
    });
    change("a smaller `most`", &clearance, "witness", &|line| {
        if line["time"].is_f64() {
            add(&mut line["most"], -1e-6);
        }
    });
    for kind in ["step", "both"] {
        change(&format!("a greater `apart` of a {kind}"), &clearance, kind, &|line| {
            if line["apart"].is_f64() {
                line["apart"] = json!(1e3);
            }
        });
    }
    change("spans of handle 1 elsewhere", &events, "both", &|line| {
        [0, 1].into_iter().for_each(|end| add(&mut line["spans"][0][0][end][1], 0.5));
    });
    let is_section = |line: &Value| line["type"] == "section" && is_of_two(line);
    let without = events.iter().filter(|line| !is_section(line)).cloned().collect();
    changed.push(("no section of the two".to_owned(), without));
    changed
}

#[test]
#[ignore = "computes for long: tests/run --all"]
fn a_second_judge_agrees_about_several_dragons() {
    if !can_run(python_modules(&["flint"])) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let all = cases(4, 8, 60);
    let of = |number: u64| certified(folder, &format!("two{number}"), &scene_of_two(number), &["events", "clearance"]);
    let mut files: Vec<PathBuf> = (0..all).flat_map(of).collect();
    let agreed = files.len();
    let changed = changes_of_two(&files);
    for (number, (_, lines)) in changed.iter().enumerate() {
        let file = folder.join(format!("changed{number}"));
        std::fs::write(&file, lines.iter().map(|line| format!("{line}\n")).collect::<String>()).unwrap();
        files.push(file);
    }
    let verdicts = verdicts(&files);
    let (right, wrong) = verdicts.split_at(agreed);
    for verdict in right {
        assert!(verdict["refused"].is_null() && verdict["undecided"].is_null(), "{verdict}");
    }
    for ((name, _), verdict) in changed.iter().zip(wrong) {
        assert!(verdict["refused"].is_string(), "the judge accepts {name}: {verdict}");
    }
    let names = ["events", "places", "spans", "pairs", "clearances", "undecided"];
    let count = |key: &str| right.iter().map(|verdict| verdict["counts"][key].as_u64().unwrap()).sum::<u64>();
    let counts = names.map(count);
    aloud(&format!(
        "{agreed} certificates of {all} pairs are right: {names:?} {counts:?}; {} changes refused",
        wrong.len()
    ));
    let [events, places, spans, pairs, clearances, undecided] = counts;
    assert!(events >= all && places >= 20 * all && spans >= 20 * all && pairs >= 5 * all, "{counts:?}");
    assert!(clearances >= all && undecided * 20 <= places, "{counts:?}");
}
