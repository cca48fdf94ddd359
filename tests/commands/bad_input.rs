//! Inputs that a user can get wrong. Each case ends with exit code 2 and one clear sentence on standard error, nothing
//! on standard output, and no panic.

use std::io::Write;
use std::process::{Command, Output};

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bench-dragon")).args(arguments).output().unwrap()
}

/// Returns the sentence that refuses an input.
fn refusal(arguments: &[&str]) -> String {
    let output = run(arguments);
    let printed = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {printed}");
    assert!(output.stdout.is_empty(), "{arguments:?} prints on standard output");
    assert!(!printed.contains("panicked"), "{arguments:?}: {printed}");
    printed
}

/// Returns the sentence that refuses the paper's scene with one text replaced.
fn scene_refusal(from: &str, to: &str) -> String {
    let scene = include_str!("../../config/paper.toml");
    assert!(scene.contains(from), "no {from} in the scene");
    let mut file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    file.write_all(scene.replacen(from, to, 1).as_bytes()).unwrap();
    let path = file.path().to_str().unwrap().to_owned();
    let printed = refusal(&["check", "--scene", &path]);
    assert!(printed.contains(&path), "the sentence does not name the file: {printed}");
    assert_eq!(printed.lines().count(), 1, "more than one sentence: {printed}");
    printed
}

/// A cue whose name a message would cut in the middle of a word, and one of 23 Chinese characters.
const LONG_CUE: &str =
    "[[cues]]\nname = \"the coil closes; the drums stop; all wait for the old man's torch\"\nat = 300.0\n[team]";
const CHINESE_CUE: &str = "[[cues]]\nname = \"龙头入阵全体停步等候长老点灯之后继续前行鼓声起\"\nat = 300.0\n[team]";

#[test]
fn scenes_that_cannot_be_played() {
    // (text of the paper's scene, its replacement, what the sentence must name)
    let cases: &[(&str, &str, &[&str])] = &[
        ("name = \"paper\"", "name = ", &["line 2"]),
        ("name = \"paper\"", "name = \"\"", &["line 2", "name"]),
        ("name = \"paper\"", "name = \"a\\u001bb\"", &["line 2", "name", "control character"]),
        ("[team]", LONG_CUE, &["line 5", "cues.name", "65 bytes", "at most 64"]),
        ("[team]", CHINESE_CUE, &["line 5", "cues.name", "69 bytes", "at most 64"]),
        ("name = \"paper\"", "name = 7", &["line 2", "name", "string"]),
        ("name = \"paper\"", "title = \"paper\"", &["line 2", "title", "unknown field"]),
        ("[team]", "[crew]", &["crew", "unknown field"]),
        ("benches = 223", "benches = 0", &["line 5", "team.benches", "0", "from 1 to 1e6"]),
        ("benches = 223", "benches = -3", &["line 5", "team.benches", "-3"]),
        ("benches = 223", "benches = 2.5", &["line 5", "benches", "integer"]),
        ("benches = 223", "benches = \"many\"", &["line 5", "benches", "integer"]),
        ("benches = 223", "benches = 1000001", &["line 5", "team.benches", "1e6"]),
        ("benches = 223", "chairs = 223", &["chairs", "unknown field"]),
        ("benches = 223 ", "# ", &["missing field", "benches"]),
        ("head_length = 3.41", "head_length = nan", &["line 6", "team.head_length", "NaN"]),
        ("head_length = 3.41", "head_length = inf", &["line 6", "team.head_length", "inf"]),
        ("head_length = 3.41", "head_length = 0.0", &["line 6", "team.head_length"]),
        ("head_length = 3.41", "head_length = 0.55", &["line 6", "head_length", "hole_inset"]),
        ("head_length = 3.41", "head_length = 1e5", &["line 6", "team.head_length", "10000"]),
        ("body_length = 2.20", "body_length = -2.2", &["line 7", "team.body_length", "-2.2"]),
        ("body_length = 2.20", "body_length = 0.5", &["line 7", "body_length", "hole_inset"]),
        ("body_length = 2.20", "body_length = true", &["line 7", "body_length", "boolean"]),
        ("width = 0.30", "width = 0", &["line 8", "team.width"]),
        ("width = 0.30", "width = -inf", &["line 8", "team.width", "-inf"]),
        ("hole_inset = 0.275", "hole_inset = 0", &["line 9", "team.hole_inset"]),
        ("hole_inset = 0.275", "hole_inset = nan", &["line 9", "team.hole_inset"]),
        ("hole_inset = 0.275", "hole_inset = 1.2", &["line 7", "body_length", "hole_inset"]),
        (
            "body_length = 2.20        # m, whole board, tail included\nwidth = 0.30              # m\nhole_inset = 0.275",
            "hole_inset = 1.2",
            &["line 7", "team.body_length is 2.2", "hole_inset"],
        ),
        ("kind = \"spiral\"", "kind = \"circle\"", &["line 12", "path.kind", "circle", "spiral"]),
        ("pitch = 0.55", "pitch = 0", &["line 13", "path.pitch"]),
        ("pitch = 0.55", "pitch = -0.55", &["line 13", "path.pitch", "-0.55"]),
        ("pitch = 0.55", "pitch = inf", &["line 13", "path.pitch", "inf"]),
        ("pitch = 0.55", "pitch = [0.55]", &["line 13", "pitch"]),
        ("start_turn = 16", "start_turn = 0", &["line 14", "path.start_turn"]),
        ("start_turn = 16", "start_turn = -16", &["line 14", "path.start_turn"]),
        ("start_turn = 16", "start_turn = 1e8", &["line 14", "path.start_turn", "1e7"]),
        ("start_turn = 16", "start_turn = 2.3", &["line 14", "path.start_turn", "at least 2.345087504"]),
        ("start_turn = 16", "start_turn = 0.1", &["line 14", "path.start_turn", "at least 2.345087504"]),
        ("head_speed = 1.0", "head_speed = 0.0", &["line 17", "motion.head_speed"]),
        ("head_speed = 1.0", "head_speed = -1.0", &["line 17", "motion.head_speed"]),
        ("head_speed = 1.0", "head_speed = 1e7", &["line 17", "motion.head_speed", "1e6"]),
        ("head_speed = 1.0", "head_speed = \"fast\"", &["line 17", "head_speed"]),
        ("accuracy = 1e-9", "accuracy = 0.0", &["line 18", "motion.accuracy"]),
        ("accuracy = 1e-9", "accuracy = nan", &["line 18", "motion.accuracy"]),
        ("accuracy = 1e-9", "accuracy = 1e-9\nsolver = \"newton\"", &["accuracy", "solver", "both"]),
        ("accuracy = 1e-9", "solver = \"euler\"", &["line 18", "solver", "euler", "newton"]),
        ("accuracy = 1e-9", "paper = { time_step = 1e-3 }", &["motion.paper", "solver"]),
        ("accuracy = 1e-9", "solver = \"paper\"\npaper = { time_step = 0.0 }", &["motion.paper.time_step"]),
        ("on_contact = \"stop\"", "on_contact = \"panic\"", &["line 19", "on_contact", "panic", "stop"]),
        ("at_end = \"hold\"", "at_end = 3", &["line 20", "at_end"]),
        ("approach_time = 10.0", "approach_time = -1.0", &["line 23", "alerts.approach_time"]),
        ("approach_clearance = 0.05", "approach_clearance = nan", &["line 24", "alerts.approach_clearance"]),
        ("rate = 60.0", "rate = 0.0", &["line 27", "publish.rate"]),
        ("rate = 60.0", "rate = -60.0", &["line 27", "publish.rate"]),
        ("rate = 60.0", "rate = 20001.0", &["line 27", "publish.rate", "0.1 to 20000 frames"]),
        ("velocities = true", "velocities = \"yes\"", &["line 28", "velocities", "boolean"]),
        ("velocities = true", "precision = \"f16\"", &["line 28", "publish.precision", "f16", "`f64` or `f32`"]),
        ("velocities = true", "precision = 32", &["line 28", "publish.precision"]),
        ("velocities = true", "every = 7", &["line 28", "publish.every is 7", "publish.precision", "f32", "both"]),
        ("velocities = true", "every = 7\nprecision = \"f64\"", &["line 28", "publish.every", "both or neither"]),
        ("velocities = true", "precision = \"f32\"\nevery = 0", &["line 29", "publish.every", "from 1 to 1e6 handles"]),
        ("velocities = true", "precision = \"f32\"\nevery = 1000001", &["line 29", "publish.every", "1e6"]),
        ("velocities = true", "precision = \"f32\"\nevery = 1.5", &["line 29", "publish.every", "integer"]),
        ("velocities = true", "queue = 0", &["line 28", "publish.queue"]),
        ("velocities = true", "subscribers = 257", &["line 28", "publish.subscribers", "1 to 256 subscribers"]),
        ("velocities = true", "[publish.ros2]\nrate = 0.0", &["line 29", "publish.ros2.rate"]),
        ("velocities = true", "[publish.ros2]\nrates = 1.0", &["line 29", "rates", "topics"]),
        ("velocities = true", "[publish.ros2]\ntopics = []", &["line 29", "publish.ros2.topics", "at least one"]),
        ("velocities = true", "[publish.ros2]\ntopics = [\"pose\"]", &["line 29", "pose", "poses"]),
        ("velocities = true", "[publish.ros2]\ncontrol = 1", &["line 29", "publish.ros2.control", "boolean"]),
        ("velocities = true", "[publish.ros2]\nstamps = \"sim\"", &["line 29", "publish.ros2.stamps", "clock", "wall"]),
        ("velocities = true", "[publish.ros2]\nstamps = \"gps\"", &["line 29", "gps", "sim"]),
        ("velocities = true", "[publish.ros2.qos.poses]\ndepth = 0", &["line 29", "publish.ros2.qos.poses.depth"]),
        ("velocities = true", "[publish.ros2.qos.markers]\ndepth = 5", &["line 28", "markers", "topics"]),
        (
            "velocities = true",
            "[publish.ros2.diagnostics]\nskipped_warn = 0",
            &["line 29", "publish.ros2.diagnostics.skipped_warn", "1"],
        ),
        (
            "velocities = true",
            "[publish.ros2.diagnostics]\nlateness_warn = 2e-3\nlateness_error = 1e-3",
            &["line 30", "publish.ros2.diagnostics.lateness_error", "0.002"],
        ),
        (
            "velocities = true",
            "[publish.ros2]\ntopics = [\"poses\"]\n[publish.ros2.diagnostics]\nskipped_error = 3",
            &["line 30", "diagnostics", "topics"],
        ),
        ("velocities = true", "[publish.ros2.qos.poses]\nreliability = \"yes\"", &["line 29", "best_effort"]),
    ];
    for (from, to, named) in cases {
        let printed = scene_refusal(from, to);
        for word in *named {
            assert!(printed.contains(word), "{to:?} is refused without naming {word:?}: {printed}");
        }
    }
}

#[test]
fn files_that_hold_no_scene() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(at("empty.toml"), "").unwrap();
    std::fs::write(at("not.toml"), "<xml>no</xml>").unwrap();
    std::fs::write(at("binary.toml"), [0xff, 0xfe, 0x00]).unwrap();
    for (file, word) in [
        (at("missing.toml"), "no such file"),
        (folder.path().to_str().unwrap().to_owned(), "folder"),
        (at("empty.toml"), "missing field"),
        (at("not.toml"), "line 1"),
        (at("binary.toml"), "UTF-8"),
    ] {
        let printed = refusal(&["check", "--scene", &file]);
        assert!(printed.contains(&file) && printed.contains(word), "{printed}");
    }
}

#[test]
fn arguments_that_cannot_be_used() {
    let long_name = "n".repeat(300);
    for (arguments, word) in [
        (vec!["run", "--rate", "0"], "--rate"),
        (vec!["run", "--rate", "nan"], "--rate"),
        (vec!["run", "--rate", "-60"], "--rate"),
        (vec!["run", "--rate", "1e6"], "--rate"),
        (vec!["run", "--time-scale", "0"], "--time-scale"),
        (vec!["run", "--time-scale", "inf"], "--time-scale"),
        (vec!["run", "--start", "-1"], "--start"),
        (vec!["run", "--start", "nan"], "--start"),
        (vec!["run", "--start", "433"], "432.917924228"),
        (vec!["run", "--duration", "soon"], "--duration"),
        (vec!["run", "--duration", "0"], "--duration"),
        (vec!["run", "--duration=-5"], "--duration"),
        (vec!["run", "--realtime", "100"], "--realtime"),
        (vec!["run", "--cpu", "4096", "--duration", "1"], "--cpu"),
        (vec!["run", "--cpu-latency", "-1"], "-1"),
        (vec!["run", "--name", ""], "--name"),
        (vec!["run", "--name", &long_name], "--name"),
        (vec!["watch", "--name", &long_name], "--name"),
        (vec!["watch", "--duration=-1s"], "--duration"),
        (vec!["run", "--name", "龙"], "expected a name for services of iceoryx2: 1 to 247 characters of ASCII"),
        (vec!["run", "--rate", "60fps"], "'60fps' for '--rate <HZ>': expected a number without a unit, such as 60"),
        (vec!["run", "--start", "1:99"], "expected seconds, or a time such as 90s, 1:30, 5m or 1h30m"),
        (vec!["run", "--cpu", "one"], "'one' for '--cpu <N>': expected a whole number"),
        (vec!["control", "seek", "soon"], "expected seconds, or a time such as 90s, 1:30"),
        (vec!["control", "play"], "control play is no command, expected resume (after a pause) or go"),
        (vec!["control", "stop"], "control stop is no command, expected pause, or hold"),
        (vec!["draw", "-o", "x.png"], "--output x.png: pictures are SVG alone, expected x.svg, which"),
        (vec!["draw", "--every", "1", "--until", "2", "-o", "f/%d.PNG"], "expected f/%d.svg, which"),
        (vec!["trade", "--plot", "x.pdf"], "--plot x.pdf: pictures are SVG alone, expected x.svg"),
        (vec!["solve"], "--at"),
        (vec!["solve", "--at", "soon"], "--at"),
        (vec!["solve", "--at", "-1"], "--at"),
        (vec!["solve", "--at", "nan"], "--at"),
        (vec!["solve", "--at", "500"], "lock"),
        (vec!["solve", "--at", "path_end"], "path_end"),
        (vec!["solve", "--every", "0", "--until", "5"], "--every"),
        (vec!["solve", "--every", "1"], "--until"),
        (vec!["solve", "--every", "1", "--until", "inf"], "--until"),
        (vec!["solve", "--every", "1e-12", "--until", "400"], "--every"),
        (vec!["solve", "--at", "0", "-o", "/no/such/folder/table.csv"], "/no/such/folder"),
        (vec!["draw", "--at", "never"], "--at"),
        (vec!["draw", "--radius", "0"], "--radius"),
        (vec!["draw", "--radius", "1e308"], "--radius is 1e308, expected a number from 1e-9 to 1e9 metres"),
        (vec!["draw", "--view", "1e308,1e308,1e308"], "a coordinate is 1e308, expected"),
        (vec!["draw", "--view", "1e16,0,1"], "a coordinate is 1e16, expected a number from -1e9 to 1e9 metres"),
        (vec!["draw", "--view", "1e9,0,0.1"], "the width is 0.1, expected at least 1 metres there"),
        (vec!["draw", "--view", "0,0,1e-300"], "the width is 1e-300, expected a number from 1e-9 to 1e9 metres"),
        (vec!["draw", "--every", "1e-300", "--until", "1", "-o", "%d.svg"], "--every 1e-300 gives 9.99"),
        (vec!["draw", "--every=-1e300", "--until", "1", "-o", "%d.svg"], "--every is -1e300, expected"),
        (vec!["run", "--rate", "1e308"], "--rate is 1e308, expected"),
        (vec!["check", "paper"], "paper: there is no such file, expected a scene file"),
        (vec!["plan", "speed", "--max-handle-speed", "1e308"], "--max-handle-speed is 1e308, expected"),
        (vec!["control", "step", "-1"], "'[PERIODS]': expected a whole number from 1 to 9007199254740992"),
        (
            vec!["draw", "--animated", "--every", "1e-5", "--from", "412", "--until", "412.01", "-o", "never.svg"],
            "--every",
        ),
        (vec!["trade", "--plot", "/no/such/folder/plot.svg"], "/no/such/folder"),
        (vec!["trade", "--display-plot", "/no/such/folder/plot.svg"], "/no/such/folder"),
        (vec!["check", "--prove", "--json", "--certificate", "/no/such/certificate"], "/no/such/certificate"),
        (vec!["record", "--recover", "/dev/null", "-o", "never.mcap"], "regular file"),
        (vec!["dance"], "dance"),
    ] {
        let printed = refusal(&arguments);
        assert!(printed.contains(word), "{arguments:?} is refused without naming {word:?}: {printed}");
        let digits = printed.split(|letter: char| !letter.is_ascii_digit()).map(str::len).max();
        assert!(digits < Some(40), "{arguments:?}: {printed}");
    }
}

#[test]
fn a_million_benches_at_a_rate_nobody_can_meet_are_no_bad_input() {
    let scene = include_str!("../../config/paper.toml")
        .replace("benches = 223", "benches = 1000000")
        .replace("start_turn = 16", "start_turn = 2000")
        .replace("[alerts]", "")
        .replace("approach_", "# approach_");
    let mut file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    file.write_all(scene.as_bytes()).unwrap();
    let name = format!("test_{}_million", std::process::id());
    let path = file.path().to_str().unwrap();
    let output = run(&["run", "--json", "--scene", path, "--name", &name, "--rate", "20000", "--duration", "2"]);
    let printed = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{printed}");
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let [frames, skipped, overruns] = ["frames", "skipped", "overruns"].map(|key| summary[key].as_u64().unwrap());
    assert_eq!(frames + skipped, 40_000, "{summary}");
    assert!(frames > 0 && overruns > 0, "{summary}");
}

/// Every command that reads a scene, with what else it needs.
const READERS: &str = "check|run|solve --at 1|events|draw|trade|plan pitch --reach-radius 4|plan turn|soak|\
                       plan speed --max-handle-speed 2|chase psn|send ros2|replay x.mcap";

#[test]
fn a_scene_is_an_argument_of_every_command_that_reads_one() {
    let with = |command: &str, more: &[&str]| {
        let words: Vec<&str> = command.split_whitespace().chain(more.iter().copied()).collect();
        refusal(&words)
    };
    for command in READERS.split('|') {
        let missing = with(command, &["no_such.toml"]);
        let sentence = "error: no_such.toml: there is no such file, expected a scene file in TOML\n";
        assert_eq!(missing, sentence, "{command}");
        assert_eq!(with(command, &["--scene", "no_such.toml"]), sentence, "{command}");
        let twice = with(command, &["a.toml", "--scene", "b.toml"]);
        assert_eq!(twice, "error: the scene is given twice, a.toml and --scene b.toml, expected one of them\n");
        assert!(with(command, &["a.toml", "b.toml"]).contains("'b.toml', expected one scene"), "{command}");
    }
    assert_eq!(refusal(&["--scene", "b.toml", "check", "a.toml"]).lines().count(), 1);
    let answer = |arguments: &[&str]| {
        let output = run(arguments);
        assert!(output.status.success(), "{arguments:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let events = answer(&["--json", "events", "config/school.toml"]);
    assert_eq!(events, answer(&["--json", "events", "--scene", "config/school.toml"]));
    assert_ne!(events, answer(&["--json", "events"]));
    assert!(answer(&["draw", "--help"]).contains("\nArguments:\n  [SCENE]"));
}

#[test]
fn a_scene_that_no_command_reads_is_refused() {
    for command in "watch|view|metrics|control go|record -o x.mcap|send psn|chase artnet|verify x.jsonl".split('|') {
        let words: Vec<&str> = command.split_whitespace().collect();
        for scene in [&["a.toml"][..], &["--scene", "a.toml"]] {
            let printed = refusal(&[&words, scene].concat());
            assert!(printed.contains(" takes no scene, expected it without a.toml"), "{command}: {printed}");
            assert!(printed.starts_with(&format!("error: {}", words[0])), "{command}: {printed}");
            assert_eq!(printed.lines().count(), 1, "{command}: {printed}");
        }
    }
    for (arguments, example) in [
        (&["a.toml"][..], "bench-dragon run a.toml"),
        (&["a.toml", "check"], "bench-dragon run a.toml"),
        (&["plan", "a.toml"], "bench-dragon plan pitch a.toml"),
        (&["send", "a.toml"], "bench-dragon send ros2 a.toml"),
    ] {
        let printed = refusal(arguments);
        assert!(printed.contains("a command before the scene") && printed.contains(example), "{printed}");
    }
}
