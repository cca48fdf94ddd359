//! `[placement]`: `solve`, `events --json` and `draw` against the results of the scene without it, transformed by
//! numpy.

use crate::harness::{can_run, python, python_modules, text};

#[test]
fn a_placed_scene_is_the_scene_transformed() {
    if !can_run(python_modules(&["numpy"])) {
        return;
    }
    let cases = [
        ("config/paper.toml", ["100.0", "-40.0", "0.3", "true"], "0,300.5,contact,stall"),
        ("config/turnaround.toml", ["-7.5", "3.25", "-0.4", "false"], "0,90.25,150"),
        ("config/turnaround.toml", ["0.0", "0.0", "0.0", "true"], "110.5,250"),
        ("config/procession.toml", ["1e6", "-1e6", "0.125", "true"], "0,44.5,100"),
        ("config/procession.toml", ["0.0", "0.0", "12.25", "false"], "60"),
    ];
    for (scene, placement, times) in cases {
        let mut peer = python();
        peer.args(["tests/python/placement.py", env!("CARGO_BIN_EXE_bench-dragon"), scene]);
        let output = peer.args(placement).arg(times).output().unwrap();
        let printed = text(&output.stdout);
        println!("{scene} {placement:?}\n{printed}");
        assert!(output.status.success(), "{scene} {placement:?}: {printed}{}", text(&output.stderr));
        assert!(printed.contains("drawn path"), "{printed}");
    }
}

/// Returns the lines of `check` on the placements of a scene.
fn told(placements: &str) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("placed.toml");
    std::fs::write(&file, format!("{}\n[placement]\n{placements}\n", include_str!("../../config/paper.toml"))).unwrap();
    let mut check = std::process::Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    let output = check.arg("--scene").arg(&file).arg("check").output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let printed = text(&output.stdout);
    printed.lines().filter(|line| line.contains("Placement")).map(|line| line.trim().to_owned()).collect()
}

#[test]
fn check_names_the_parts_of_a_placement_that_change_something() {
    let whole = "origin = [1.0, -2.5]\nrotation_turns = 0.25\nmirror = true";
    let words = "Placement: the path's coordinates mirrored, then turned by 0.25 turns, then moved by (1, -2.5) m.";
    assert_eq!(told(whole), [words]);
    assert_eq!(told("rotation_turns = 0.25"), ["Placement: the path's coordinates turned by 0.25 turns."]);
    assert_eq!(told("rotation_turns = 0.5"), ["Placement: the path's coordinates turned by 0.5 turns."]);
    assert_eq!(told("rotation_turns = -0.25"), ["Placement: the path's coordinates turned by -0.25 turns."]);
    assert_eq!(told("origin = [0.0, 3.0]"), ["Placement: the path's coordinates moved by (0, 3) m."]);
    assert!(told("origin = [0.0, 0.0]\nrotation_turns = 0.0").is_empty());
}
