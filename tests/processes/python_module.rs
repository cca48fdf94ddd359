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
    let output =
        Process::start(peer.args(["tests/python/module_peer.py", "--name", &unique("python_module")])).output();
    let found = json_lines(&output).pop().unwrap_or_else(|| panic!("{}", text(&output.stderr)));
    let number = |field: &str| found[field].as_u64().unwrap_or_else(|| panic!("no {field} in {found}"));
    assert_eq!(number("frames") + number("missed"), number("last") - number("first") + 1, "{found}");
    assert_eq!((number("handles"), number("benches"), number("answer")), (224, 223, 0));
    assert_eq!(number("segments"), 1, "a spiral");
    assert_eq!((&found["scene"], &found["alert_run"]), (&whole.as_str().into(), &true.into()));
    assert!(found["cue"].as_str().unwrap().starts_with("at 4"), "{found}");
    publisher.signal(SIGINT);
    assert!(publisher.output().status.success());
    assert!(text(&output.stderr).is_empty(), "{}", text(&output.stderr));
}

/// Prints the number of segments of the stage, the greatest gap between two, and the bytes of the scene.
const STAGE_OF_A_LONG_ROUTE: &str = "
import json, math, sys
from bench_dragon import subscribe
feed = subscribe(sys.argv[1], seconds=120)
stage, scene = None, None
for frame in feed:
    stage, scene = stage or feed.stage(), scene or feed.scene()
    if stage and scene:
        break
path = stage[1]
gaps = [math.hypot(b.x - a.x - a.length * math.cos(a.heading), b.y - a.y - a.length * math.sin(a.heading))
        for a, b in zip(path, path[1:]) if a.kind == 0]
print(json.dumps({'segments': len(path), 'lines': len(gaps), 'gap': max(gaps), 'scene': len(scene[1])}))
";

#[test]
fn a_route_of_4096_pieces_is_one_message() {
    if !can_run(python_modules(&["iceoryx2", "numpy"])) {
        return;
    }
    let line = "[[path.pieces]]\nkind = \"line\"\nlength = 2.0\n";
    let arc = "[[path.pieces]]\nkind = \"arc\"\nradius = 5.0\nturns = 0.1\nside = ";
    let pieces = format!("{line}{arc}\"left\"\n{line}{arc}\"right\"\n").repeat(1024);
    let scene = format!(
        "name = \"long\"\n[team]\nbenches = 1\nhead_length = 3.41\nbody_length = 2.2\nwidth = 0.3\nhole_inset = 0.275\n\
         [path]\nkind = \"pieces\"\n{pieces}[motion]\nhead_speed = 1.0\nsolver = \"newton\"\n"
    );
    let file = scene_file("pieces_4096", &[]);
    std::fs::write(&file, &scene).unwrap();
    let mut run = program("pieces_4096");
    let publisher = Process::start(run.arg("--scene").arg(&file).args(["run", "--json", "--duration", "300"]));
    let mut peer = python();
    peer.env("PYTHONPATH", "packaging/python").args(["-c", STAGE_OF_A_LONG_ROUTE, &unique("pieces_4096")]);
    let output = Process::start(&mut peer).output();
    let found = json_lines(&output).pop().unwrap_or_else(|| panic!("{}", text(&output.stderr)));
    assert_eq!((found["segments"].as_u64(), found["lines"].as_u64()), (Some(4096), Some(2048)), "{found}");
    assert!(found["gap"].as_f64().unwrap() < 1e-9, "{found}");
    assert_eq!(found["scene"].as_u64(), Some(scene.len() as u64));
    publisher.signal(SIGINT);
    assert!(publisher.output().status.success());
}

#[test]
fn its_type_hints_are_strict() {
    if !can_run(python_modules(&["mypy", "numpy"])) {
        return;
    }
    let mut mypy = python();
    mypy.current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/packaging/python"));
    let output = Process::start(mypy.args(["-m", "mypy", "--cache-dir", "/dev/null"])).output();
    assert!(output.status.success(), "{}", text(&output.stdout));
}

/// Prints the greatest difference between the heading of a dragon's last handle and the direction of its last bench.
/// One reader is without the stage and one with it; the moment is half-way between two frames.
const LAST_HEADINGS_OF_TWO: &str = "
import json, math, sys
from bench_dragon import HermiteReader, subscribe
feed, readers, stage, before = subscribe(sys.argv[1], seconds=120), [HermiteReader(), HermiteReader()], None, None
for frame in feed:
    stage = stage or feed.stage()
    for reader in readers:
        reader.push(frame.header, frame.handles)
    if stage and before is not None:
        break
    before = frame.header.deadline_ns
readers[1].set_stage(stage[0])
tails = [dragon.first_handle + dragon.benches for dragon in stage[0].dragons]
def error(reader, tail):
    _, handles = reader.at((before + frame.header.deadline_ns) // 2)
    front, rear = handles[tail - 1], handles[tail]
    return abs(math.sin(rear['heading'] - math.atan2(front['y'] - rear['y'], front['x'] - rear['x'])))
print(json.dumps({'tails': tails, 'errors': [max(error(reader, tail) for tail in tails) for reader in readers]}))
";

#[test]
fn the_last_handle_of_each_of_two_dragons_has_the_heading_of_its_last_bench() {
    if !can_run(python_modules(&["iceoryx2", "numpy"])) {
        return;
    }
    let mut run = program("python_headings");
    run.args(["--scene", "config/coil.toml", "run", "--start", "100", "--rate", "10", "--duration", "300"]);
    let publisher = Process::start(&mut run);
    let mut reading = python();
    reading.env("PYTHONPATH", "packaging/python").args(["-c", LAST_HEADINGS_OF_TWO, &unique("python_headings")]);
    let output = Process::start(&mut reading).output();
    let found = json_lines(&output).pop().unwrap_or_else(|| panic!("{}", text(&output.stderr)));
    let [without, with] = [0, 1].map(|reader| found["errors"][reader].as_f64().unwrap());
    assert_eq!(found["tails"], serde_json::json!([60, 121]));
    assert!(without > 0.1 && with < 1e-12, "{found}");
    publisher.signal(SIGINT);
    assert!(publisher.output().status.success());
}

/// Prints what a user sees of messages, and a command that is refused.
const PRINTED: &str = "
import json, sys
from bench_dragon import CommandRefused, Controller, subscribe
feed, alerts, cues, stage = subscribe(sys.argv[1], seconds=120), [], [], None
for frame in feed:
    alerts += feed.alerts()
    cues += feed.cues()
    stage = stage or feed.stage()
    if alerts and cues and stage:
        break
controller = Controller(sys.argv[1])
held = controller.send('hold')
try:
    controller.send('resume')
except CommandRefused as error:
    refused = [str(error), error.answer.playback, error.answer.code]
controller.send('release')
print(json.dumps([repr(one) for one in (frame.header, alerts[0], cues[0], stage[0], stage[1][0], held)] + refused))
";

#[test]
fn messages_and_refusals_print_what_they_say() {
    if !can_run(python_modules(&["iceoryx2", "numpy"])) {
        return;
    }
    let file = scene_file("python_printed", &[]);
    let cue = "\n[[cues]]\nname = \"gong\"\nat = 400.5\n";
    std::fs::write(&file, std::fs::read_to_string(&file).unwrap() + cue).unwrap();
    let mut run = program("python_printed");
    let run = run.arg("run").arg(&file).args(["--json", "--start", "400", "--duration", "300"]);
    let publisher = Process::start(run);
    let mut peer = python();
    peer.env("PYTHONPATH", "packaging/python").args(["-c", PRINTED, &unique("python_printed")]);
    let output = Process::start(&mut peer).output();
    let found = json_lines(&output).pop().unwrap_or_else(|| panic!("{}", text(&output.stderr)));
    let [header, alert, cue, stage, segment, held, refused] =
        [0, 1, 2, 3, 4, 5, 6].map(|k| found[k].as_str().unwrap_or_else(|| panic!("{found}")));
    for (printed, parts) in [
        (header, &["FrameHeader(run_id=", "sim_time=40", "handles=224, state=", "playback=playing"][..]),
        (alert, &["CollisionAlert(", "level=", "event=contact", "event_bench_a=0, event_bench_b=8)"]),
        (cue, &["Cue(", "name='gong'"]),
        (stage, &["dragons=[StageDragon(", "benches=223", "state=contact", "StageCue(", "bench_b=NO_BENCH"]),
        (segment, &["StageSegment(", "kind=inward_spiral"]),
        (held, &["ControlResponse(", "code=done", "playback=held"]),
        (refused, &["resume is refused: refused in this state: held at 0.0 x, t = 40"]),
    ] {
        for part in parts {
            assert!(printed.contains(part), "no {part} in {printed}");
        }
        assert!(!printed.contains(" object at "), "{printed}");
    }
    assert!(!header.contains("reserved") && !header.contains("state=0"), "{header}");
    assert_eq!((found[7].as_u64(), found[8].as_u64()), (Some(2), Some(2)), "{found}");
    publisher.signal(SIGINT);
    assert!(publisher.output().status.success());
}
