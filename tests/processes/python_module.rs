//! The Python module `bench_dragon` (`packaging/python`), used as a user's program does.

use crate::harness;

use harness::{Process, can_run, json_lines, program, python, python_modules, scene_file, text, unique};
use nix::sys::signal::Signal::SIGINT;

#[test]
fn a_program_of_global_variables_reads_every_service() {
    if !can_run(python_modules(&["iceoryx2", "numpy"])) {
        return;
    }
    let file = scene_file("python_module", &[]);
    let cues: String = (401..431).map(|at| format!("\n[[cues]]\nname = \"at {at}\"\nat = {at}.0\n")).collect();
    let whole = std::fs::read_to_string(&file).unwrap() + &cues;
    std::fs::write(&file, &whole).unwrap();
    let mut run = program("python_module");
    let run = run.arg("--scene").arg(&file).args(["run", "--json", "--start", "400", "--duration", "300"]);
    let publisher = Process::start(run);
    let mut peer = python();
    let output = Process::start(peer.args(["tests/python/module_peer.py", "--name", &unique("python_module")]))
        .output_within(240);
    let found = json_lines(&output).pop().unwrap_or_else(|| panic!("{}", text(&output.stderr)));
    let number = |field: &str| found[field].as_u64().unwrap_or_else(|| panic!("no {field} in {found}"));
    assert_eq!(number("frames") + number("missed"), number("last") - number("first") + 1, "{found}");
    assert_eq!((number("handles"), number("benches"), number("answer")), (224, 223, 0));
    assert_eq!(number("segments"), 1, "a spiral");
    assert_eq!((&found["scene"], &found["alert_run"]), (&whole.as_str().into(), &true.into()));
    assert!(found["cue"].as_str().unwrap().starts_with("at 4"), "{found}");
    publisher.signal(SIGINT);
    assert!(publisher.output_within(60).status.success());
    assert!(text(&output.stderr).is_empty(), "{}", text(&output.stderr));
}

#[test]
fn its_type_hints_are_strict() {
    if !can_run(python_modules(&["mypy", "numpy"])) {
        return;
    }
    let mut mypy = python();
    mypy.current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/packaging/python"));
    let output = Process::start(mypy.args(["-m", "mypy", "--cache-dir", "/dev/null"])).output_within(300);
    assert!(output.status.success(), "{}", text(&output.stdout));
}
