//! The poses that a display shows between two frames, by the readers for users, compared with the safe solver at the
//! exact times of display.

use crate::harness;

use bench_dragon::motion::Method;
use bench_dragon::motion::solve::{Chain, Velocities};
use bench_dragon::show::scene::Scene;
use harness::{Process, can_run, json_lines, program, python, python_modules, text, unique};
use serde_json::Value;

fn numbers(line: &Value, field: &str) -> Vec<f64> {
    line[field].as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// Tests ten frames a second in a Python process that displays at random times.
fn python_reader(transport: &str, modules: &[&str]) {
    if !can_run(python_modules(modules)) {
        return;
    }
    let name = format!("display_{transport}");
    let mut run = program(&name);
    run.args(["run", "--json", "--rate", "10", "--start", "380"]);
    if transport == "ros2" {
        run.arg("--ros2");
    }
    let _publisher = Process::start(&mut run);
    let mut display = python();
    display.args(["tests/python/display_times.py", "--transport", transport, "--name", &unique(&name)]);
    display.args(["--moments", "60", "--delay", "0.2"]);
    let output = Process::start(&mut display).output();
    let lines = json_lines(&output);
    assert!(lines.len() > 50, "{} moments: {}", lines.len(), text(&output.stderr));
    let motion = Scene::paper().ensemble.only().unwrap().with_method(Method::Newton).unwrap();
    let mut newton = motion.solver(Velocities::Omitted).solver;
    let (mut chain, mut worst, mut between) = (Chain::new(224), 0.0f64, 0);
    for line in &lines {
        let time = line["time"].as_f64().unwrap();
        between += u64::from(((time * 10.0).fract() - 0.5).abs() < 0.4);
        newton.solve(time, &mut chain).unwrap();
        let (x, y, heading) = (numbers(line, "x"), numbers(line, "y"), numbers(line, "heading"));
        assert_eq!((x.len(), y.len(), heading.len()), (224, 224, 224));
        // A cubic is off by the fourth power of its interval, which is longer if a loaded machine skipped periods.
        let longer = (line["interval"].as_f64().unwrap() / 0.1).max(1.0);
        for handle in 0..224 {
            worst = worst.max((x[handle] - chain.x[handle]).hypot(y[handle] - chain.y[handle]) / longer.powi(4));
            let turned = (heading[handle] - chain.heading[handle] + 3.0).rem_euclid(std::f64::consts::TAU) - 3.0;
            assert!(turned.abs() < 1e-7 * longer.powi(4), "heading of handle {handle} at {time}: off by {turned:e}");
        }
    }
    assert!(between > 30, "{between} of {} moments lie between frames", lines.len());
    // 2e-8 m at 10 Hz around 411 s, where the head turns fastest; holding the last frame would be 0.1 m off.
    assert!(worst < 4e-8, "{worst:e} m");
}

#[test]
fn the_python_reader_shows_the_dragon_where_it_is() {
    python_reader("iceoryx2", &["iceoryx2", "numpy"]);
}

#[cfg(feature = "ros2")]
#[test]
fn the_ros2_reader_shows_the_dragon_where_it_is() {
    python_reader("ros2", &["cyclonedds", "numpy"]);
}
