//! `[placement]`: `solve`, `events --json` and `draw` against those of the scene without it, transformed by numpy.

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
