//! `check --swept` and `draw --swept`: the ground that boards cover, against the union of sampled boards by shapely.

use crate::harness::{can_run, cases, program, python, python_modules, text};
use serde_json::Value;

#[test]
#[ignore = "computes for long: tests/run --all"]
fn the_ground_is_that_of_sampled_boards() {
    if !can_run(python_modules(&["numpy", "shapely"])) {
        return;
    }
    let paper = ["3.41", "2.20", "0.30", "0.275"];
    let stretches: [(&str, [&str; 4]); 3] = [
        // The whole coil.
        ("config/paper.toml", ["411.5", "412", "1", "223"]),
        // Through both arcs of the turn, and their junctions.
        ("config/turnaround.toml", ["117", "135", "1", "3"]),
        ("tests/scenes/placed_turnaround.toml", ["121", "126", "2", "12"]),
    ];
    for (scene, stretch) in &stretches[cases(1..2, 0..3, 0..3)] {
        let mut peer = python();
        peer.args(["tests/python/swept.py", env!("CARGO_BIN_EXE_bench-dragon"), scene]).args(stretch).args(paper);
        let output = peer.output().unwrap();
        println!("{scene} {stretch:?}: {}", text(&output.stdout));
        assert!(output.status.success(), "{scene} {stretch:?}: {}", text(&output.stderr));
    }
}

/// Also of a tail that is longer and wider than the benches before it, and of a wider head.
#[test]
fn the_ground_of_a_wide_head_and_tail_is_that_of_sampled_boards() {
    if !can_run(python_modules(&["numpy", "shapely"])) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("ends.toml");
    let scene = "[team]\nbenches = 6\nhead_width = 1.0\ntail_width = 0.6\ntail_length = 4.0\n[path]\nkind = \"spiral\"\n\
                 pitch = 1.5\nstart_turn = 4\n[motion]\nhead_speed = 1.0\n";
    std::fs::write(&file, scene).unwrap();
    let mut peer = python();
    peer.args(["tests/python/swept.py", env!("CARGO_BIN_EXE_bench-dragon")]).arg(&file);
    peer.args(["1", "5", "1", "6", "3.41", "2.20", "0.30", "0.275", "", "1.0", "0.6"]);
    let output = peer.output().unwrap();
    println!("{}", text(&output.stdout));
    assert!(output.status.success(), "{}", text(&output.stderr));
}

/// The ground of one of two dragons, of both, and of one that stands in part of the time.
#[test]
fn the_ground_of_two_dragons_is_that_of_sampled_boards() {
    if !can_run(python_modules(&["numpy", "shapely"])) {
        return;
    }
    let lengths = ["3.41", "2.20", "0.30", "0.275"];
    let stretches = [
        ("gold:0", ["20", "23", "2", "20"]),
        ("jade:21", ["48", "53", "1", "12"]),
        ("all:20", ["48", "52", "1", "33"]),
    ];
    for (dragon, stretch) in &stretches[..cases(1, 3, 3)] {
        let mut peer = python();
        peer.args(["tests/python/swept.py", env!("CARGO_BIN_EXE_bench-dragon"), "config/crossing.toml"]);
        let output = peer.args(stretch).args(lengths).arg(dragon).output().unwrap();
        println!("{dragon} {stretch:?}: {}", text(&output.stdout));
        assert!(output.status.success(), "{dragon} {stretch:?}: {}", text(&output.stderr));
    }
}

#[test]
fn benches_of_several_dragons_have_their_dragons_name() {
    let file = tempfile::tempdir().unwrap().path().join("ground.json");
    for (scene, benches, expected) in [
        ("crossing", "1-12", "--benches names no dragon of the scene, expected one of gold, jade, as in gold:1-20"),
        ("crossing", "rose:1-12", "expected one of gold, jade"),
        ("crossing", "jade:1-13", "--benches ends with bench 13, expected benches from 1 to 12"),
        ("paper", "jade:1-12", "--benches names a dragon and the scene has one"),
        ("paper", "jade:", "expected benches counted from 1"),
    ] {
        let scene = format!("config/{scene}.toml");
        let mut command = program("swept");
        command.args(["--scene", &scene, "draw", "--swept", "--until", "1", "--benches", benches, "-o"]).arg(&file);
        let output = command.output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{benches}");
        assert!(text(&output.stderr).contains(expected), "{benches}: {}", text(&output.stderr));
    }
    let svg = printed(&["--scene", "config/crossing.toml", "draw", "--swept", "--at", "52", "--until", "52"]);
    assert!(svg.contains("ground covered: "), "{svg}");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("ground.json");
    let said =
        printed(&["--scene", "config/crossing.toml", "check", "--swept", file.to_str().unwrap(), "--until", "1"]);
    assert!(said.contains("Left out: rings narrower than 1 mm, and the ground of a real tail that whips"), "{said}");
}

fn printed(arguments: &[&str]) -> String {
    let output = program("swept").args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    text(&output.stdout).to_owned()
}

#[test]
#[ignore = "tests/run --all"]
fn the_whole_show_is_united() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("ground.json");
    let said = printed(&["check", "--swept", file.to_str().unwrap()]);
    let feature: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    let area = feature["properties"]["area"].as_f64().unwrap();
    assert!(said.contains(&format!("{area:.3} m2, in 1 polygon")), "{said}");
    let rings = feature["geometry"]["coordinates"][0].as_array().unwrap();
    // The coil and the room that is left in its middle.
    assert_eq!(rings.len(), 2);
    let svg = printed(&["draw", "--swept", "--at", "300"]);
    assert!(svg.contains(&format!("ground covered: {} m\u{b2}", (10.0 * area).round() / 10.0)), "{area}");
}
