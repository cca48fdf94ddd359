//! A placed show, rotated and mirrored: PosiStageNet as pypsn decodes it, OSC as python-osc does, and its log. The
//! expected places are those of the scene without a placement, by the formula.

use bench_dragon::motion::Method;
use bench_dragon::motion::solve::{Chain, Velocities};
use bench_dragon::show::scene::Scene;
use nix::sys::signal::Signal;
use serde_json::Value;

use crate::harness::{
    Process, can_run, json_lines, program, python, python_modules, scene_file, summary, text, unique,
};
use crate::send::{NEWTON, end_desk, free_port, heard, until_equal};

const ORIGIN: [f64; 2] = [12.5, -40.25];
const TURNS: f64 = 0.3;
const PLACED: &str =
    "[placement]\norigin = [12.5, -40.25]\nrotation_turns = 0.3\nmirror = true\n\n[publish]\nqueue = 300";

/// The scene without its placement, solved at one time.
fn home(time: f64) -> Chain {
    let mut chain = Chain::new(224);
    let motion = Scene::paper().ensemble.only().unwrap().with_method(Method::Newton).unwrap();
    motion.solver(Velocities::Computed).solver.solve(time, &mut chain).unwrap();
    chain
}

/// Returns a vector mirrored and turned as the placement does it.
fn turned([x, y]: [f64; 2]) -> [f64; 2] {
    let (sin, cos) = (std::f64::consts::TAU * TURNS).sin_cos();
    [cos * x + sin * y, sin * x - cos * y]
}

/// Asserts that a handle's place, direction and velocity are those of the placed scene, within some metres.
fn is_placed(chain: &Chain, handle: usize, place: [f64; 2], direction: [f64; 2], velocity: [f64; 2], most: f64) {
    let moved = turned([chain.x[handle], chain.y[handle]]);
    let expected = [
        ([moved[0] + ORIGIN[0], moved[1] + ORIGIN[1]], place),
        (turned([chain.heading[handle].cos(), chain.heading[handle].sin()]), direction),
        (turned([chain.vx[handle], chain.vy[handle]]), velocity),
    ];
    for (expected, found) in expected {
        let apart = (expected[0] - found[0]).hypot(expected[1] - found[1]);
        assert!(apart < most, "handle {handle}: {found:?}, expected {expected:?}");
    }
}

fn numbers(values: &Value) -> Vec<f64> {
    values.as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
}

/// Asserts that pypsn's trackers of some frames are where the placed scene has them.
fn trackers_are_placed(samples: &Value) {
    let samples = samples.as_array().unwrap();
    assert!(samples.len() > 1, "{} frames", samples.len());
    for sample in samples {
        let chain = home(sample["sim_time"].as_f64().unwrap());
        let trackers = sample["trackers"].as_array().unwrap();
        assert_eq!(trackers.len(), 224);
        for (handle, tracker) in trackers.iter().enumerate() {
            // x and depth of the stage, and the vertical between them.
            let [place, speed, turn] = [0, 1, 2].map(|field| numbers(&tracker[field]));
            assert_eq!((place[1], turn[0], turn[2]), (0.0, 0.0, 0.0), "a tracker leaves the floor: {tracker}");
            let heading = -turn[1];
            let direction = [heading.cos(), heading.sin()];
            is_placed(&chain, handle, [place[0], place[2]], direction, [speed[0], speed[2]], 2e-5);
        }
    }
}

/// Asserts that python-osc's heads are where the placed scene has them. A float of 300 s is rounded by 15 microseconds.
fn heads_are_placed(messages: &[Value], name: &str) {
    let address = |field: &str| format!("/{}/{field}", unique(name));
    let (times, heads) = (address("sim_time"), address("head"));
    let heads: Vec<&Value> = heard(messages, &heads).collect();
    assert!(heads.len() > 20, "{} frames", heads.len());
    for (time, head) in heard(messages, &times).zip(heads).step_by(7) {
        let (chain, head) = (home(time[0].as_f64().unwrap()), numbers(head));
        is_placed(&chain, 0, [head[0], head[1]], [head[2].cos(), head[2].sin()], [head[3], head[4]], 1e-4);
    }
}

#[test]
fn a_placed_show_is_sent_where_it_stands_and_its_log_verifies() {
    if !can_run(python_modules(&["iceoryx2", "numpy", "pypsn", "pythonosc"])) {
        return;
    }
    let (name, folder) = ("placed_show", tempfile::tempdir().unwrap());
    let log = folder.path().join("show.jsonl");
    let scene = scene_file(name, &[NEWTON, ("[publish]", PLACED)]);
    let mut run = program(name);
    run.arg("--scene").arg(scene).args(["run", "--json", "--rate", "30", "--start", "250"]);
    let publisher = Process::start(run.arg("--log").arg(&log));
    let [psn_port, osc_port] = [free_port().to_string(), free_port().to_string()];
    let mut psn_peer = python();
    psn_peer.args(["tests/python/psn_peer.py", "--name", &unique(name), "--port", &psn_port, "--samples"]);
    psn_peer.arg("--progress");
    let mut psn_peer = Process::start(&mut psn_peer);
    let mut osc_peer = Process::start(python().args(["tests/python/osc_peer.py", "--port", &osc_port]));
    let (psn_lines, osc_lines) = (psn_peer.lines(), osc_peer.lines());
    psn_lines.until("listening");
    osc_lines.until("listening");
    let mut send = program(name);
    let desk = format!("127.0.0.1:{psn_port}");
    send.args(["send", "psn", "--json", "--interface", "127.0.0.1", "--to", &desk]);
    let psn = Process::start(&mut send);
    let osc = Process::start(program(name).args(["send", "osc", "--json", "--to", &format!("127.0.0.1:{osc_port}")]));
    // Heads of three seconds.
    let lines: Vec<String> = (0..90).flat_map(|_| osc_lines.all_until("/head\"")).collect();
    until_equal(&psn_lines, 60);
    let messages: Vec<Value> = lines.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
    for sender in [psn, osc] {
        sender.signal(Signal::SIGTERM);
        summary(&sender.output());
    }
    end_desk(&desk);
    heads_are_placed(&messages, name);
    let last = psn_lines.rest().pop();
    let output = psn_peer.output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let heard: Value = serde_json::from_str(&last.unwrap()).unwrap();
    assert!(heard["equal"].as_u64() > Some(30), "{}", heard["publishers"]);
    trackers_are_placed(&heard["samples"]);

    publisher.signal(Signal::SIGTERM);
    let run = summary(&publisher.output());
    let verified = program("placed_verify").args(["--json", "verify"]).arg(&log).output().unwrap();
    let line = json_lines(&verified).pop().unwrap_or_else(|| panic!("{}", text(&verified.stderr)));
    assert_eq!((&line["verdict"], &line["frames"]), (&"same".into(), &run["frames"]), "{line}");
    // The log has the placement: without it the same frames are other frames.
    let other = folder.path().join("other.jsonl");
    let text = std::fs::read_to_string(&log).unwrap();
    assert!(text.contains("rotation_turns = 0.3"));
    std::fs::write(&other, text.replacen("rotation_turns = 0.3", "rotation_turns = 0.4", 1)).unwrap();
    let verified = program("placed_verify").args(["--json", "verify"]).arg(&other).output().unwrap();
    let line = json_lines(&verified).pop();
    assert!(!verified.status.success() && line.is_none_or(|line| line["verdict"] != "same"), "{verified:?}");
}
