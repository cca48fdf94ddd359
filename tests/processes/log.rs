//! `run --log` and `verify`, as programs. The cases are a show under control, a turnaround, a show that loops, a
//! publisher that is killed, and a full file. A reader of frames in Python computes the same hashes.

use crate::harness;

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use harness::{Process, can_run, json_lines, program, python, python_modules, summary, text, unique, wait};
use nix::sys::signal::Signal;
use nix::sys::stat::Mode;
use serde_json::Value;

/// Returns a scene of the folder `config` with the safe solver: an unoptimised build makes tables for seconds.
fn scene(folder: &Path, name: &str) -> PathBuf {
    let text = std::fs::read_to_string(format!("config/{name}.toml")).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with("accuracy"));
    let text: String = lines.map(|line| format!("{line}\n")).collect();
    let file = folder.join(format!("{name}.toml"));
    std::fs::write(&file, text.replace("[motion]\n", "[motion]\nsolver = \"newton\"\n")).unwrap();
    file
}

fn run(name: &str, scene: &Path, log: &Path, arguments: &[&str]) -> Process {
    let mut command = program(name);
    command.args(["--json", "--scene", scene.to_str().unwrap(), "run", "--log", log.to_str().unwrap()]).args(arguments);
    Process::start(&mut command)
}

/// Returns the exit code, the line of `verify --json`, and the sentence on standard error.
fn verify(log: &Path) -> (i32, Value, String) {
    let mut command = program("verify");
    let output = command.args(["--json", "verify", log.to_str().unwrap()]).output().unwrap();
    let line = json_lines(&output).pop().unwrap_or(Value::Null);
    (output.status.code().unwrap(), line, text(&output.stderr))
}

fn proved(log: &Path) -> Value {
    let (code, line, sentence) = verify(log);
    assert_eq!((code, &line["verdict"]), (0, &"same".into()), "{line} {sentence}");
    line
}

/// Verifies the log of a run with its end, compares it with the summary, and returns the line.
fn proved_whole(log: &Path, summary: &Value) -> Value {
    let line = proved(log);
    for field in ["frames", "skipped"] {
        assert_eq!(line[field], summary[field], "{line} {summary}");
    }
    assert_eq!(lines(log).pop().unwrap()["reason"], summary["end"]);
    assert_eq!((&line["complete"], &line["lost"]), (&true.into(), &0.into()));
    line
}

/// Returns the complete lines of a log.
fn lines_of(log: &Path) -> Vec<String> {
    std::fs::read_to_string(log).unwrap().lines().map(str::to_owned).collect()
}

fn lines(log: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(log).unwrap();
    let whole = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
    whole.map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn of_type<'a>(lines: &'a [Value], kind: &str) -> Vec<&'a Value> {
    lines.iter().filter(|line| line["type"] == kind).collect()
}

/// Waits until a log has `seconds` lines of seconds.
fn wait_for_seconds(log: &Path, seconds: usize) {
    for _ in 0..1200 {
        if log.exists() && of_type(&lines(log), "second").len() >= seconds {
            return;
        }
        wait(0.05);
    }
    panic!("{} has no {seconds} seconds", log.display());
}

fn control(name: &str, arguments: &[&str]) -> Value {
    let output = program(name).args(["--json", "control"]).args(arguments).output().unwrap();
    json_lines(&output).pop().unwrap_or_else(|| panic!("{arguments:?}: {}", text(&output.stderr)))
}

#[test]
fn a_conducted_show_is_proved_with_every_command_at_its_tick() {
    let folder = tempfile::tempdir().unwrap();
    let (name, log) = ("log_conducted", folder.path().join("show.jsonl"));
    let publisher = run(name, &scene(folder.path(), "paper"), &log, &["--rate", "100", "--start", "100"]);
    wait_for_seconds(&log, 1);
    let commands: [&[&str]; 12] = [
        &["pause"],
        &["step", "7"],
        &["resume"],
        &["rate", "3.3"],
        &["seek", "411.9"],
        &["seek", "1e6"],
        &["hold"],
        &["resume"],
        &["release"],
        &["restart"],
        &["resume"],
        &["state"],
    ];
    let answers: Vec<Value> = commands.iter().map(|command| control(name, command)).collect();
    let seconds = of_type(&lines(&log), "second").len();
    wait_for_seconds(&log, seconds + 1);
    publisher.signal(Signal::SIGINT);
    let summary = summary(&publisher.output());
    let lines = lines(&log);
    // A step is answered when it is complete.
    let logged = lines.iter().filter(|line| !line["code"].is_null());
    let logged: Vec<_> = logged.map(|line| (&line["tick"], &line["code"])).collect();
    let answered: Vec<_> = answers.iter().map(|answer| (&answer["tick"], &answer["code"])).collect();
    assert_eq!(logged, answered);
    let named: Vec<_> = of_type(&lines, "command").iter().map(|line| line["command"].as_str().unwrap()).collect();
    assert_eq!(named, commands.map(|command| command[0]));
    assert!(answers.iter().any(|answer| answer["code"] == "refused") && answers[5]["code"] == "out_of_range");
    let line = proved_whole(&log, &summary);
    assert_eq!(line["commands"], 12);
    assert_eq!(summary["log"]["frames"], summary["frames"]);

    // Cut behind its last command: a command in no compared second does not count.
    let cut = folder.path().join("cut.jsonl");
    let last = lines.iter().rposition(|line| line["type"] == "command").unwrap();
    let kept = lines_of(&log).into_iter().take(last + 1).map(|line| format!("{line}\n"));
    std::fs::write(&cut, kept.collect::<String>()).unwrap();
    let seconds = of_type(&lines[..last], "second");
    let last_tick = seconds.last().unwrap()["to"].as_u64();
    let frames = seconds.iter().map(|second| second["frames"].as_u64().unwrap()).sum::<u64>();
    let commands = lines[..=last].iter().filter(|line| line["type"] == "command" && line["tick"].as_u64() <= last_tick);
    let line = proved(&cut);
    assert_eq!((line["frames"].as_u64(), line["last_tick"].as_u64()), (Some(frames), last_tick), "{line}");
    assert_eq!(line["commands"].as_u64(), Some(commands.count() as u64), "{line}");

    // For people: the same in words; and one digit of a hash.
    let output = program("verify").args(["verify", log.to_str().unwrap()]).output().unwrap();
    assert!(output.status.success() && text(&output.stdout).contains("seconds have the same bits"), "{output:?}");
    let wrong = folder.path().join("wrong.jsonl");
    let text = std::fs::read_to_string(&log).unwrap();
    let at = text.find("\"hash\":\"").unwrap() + 8;
    let digit = if &text[at..=at] == "0" { "1" } else { "0" };
    std::fs::write(&wrong, format!("{}{digit}{}", &text[..at], &text[at + 1..])).unwrap();
    let (code, line, sentence) = verify(&wrong);
    let number = text[..at].lines().count();
    assert!(code == 2 && line.is_null(), "{code} {line}");
    assert!(sentence.contains(&format!("wrong.jsonl, line {number}: its check is")), "{sentence}");
}

#[test]
fn a_turnaround_and_a_looping_show_with_skipped_periods_are_proved() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("turnaround.jsonl");
    let arguments = ["--rate", "50", "--start", "60", "--time-scale", "5", "--duration", "3"];
    let scene_file = scene(folder.path(), "turnaround");
    // The search for its contact takes an unoptimised build half a minute.
    let (before, after) = (std::fs::read_to_string(&scene_file).unwrap(), "[publish]");
    let (before, rest) = before.split_once("[alerts]").unwrap();
    std::fs::write(&scene_file, format!("{before}{after}{}", rest.split_once(after).unwrap().1)).unwrap();
    let turned = summary(&run("log_turn", &scene_file, &log, &arguments).output());
    proved_whole(&log, &turned);

    // A third of a second of show, repeated; stopped for a while as by a debugger.
    let log = folder.path().join("loop.jsonl");
    let arguments = ["--rate", "200", "--start", "412.2", "--loop", "--end-hold", "0.05"];
    let publisher = run("log_loop", &scene(folder.path(), "paper"), &log, &arguments);
    wait_for_seconds(&log, 1);
    publisher.stop();
    wait(0.3);
    publisher.signal(Signal::SIGCONT);
    let seconds = of_type(&lines(&log), "second").len();
    wait_for_seconds(&log, seconds + 2);
    publisher.signal(Signal::SIGTERM);
    let summary = summary(&publisher.output());
    proved_whole(&log, &summary);
    let lines = lines(&log);
    let longest = of_type(&lines, "skipped")
        .into_iter()
        .map(|line| line["to"].as_u64().unwrap() - line["from"].as_u64().unwrap() + 1)
        .max();
    assert!(longest.unwrap() >= 30, "{longest:?} of the 60 periods of the stop");
}

#[test]
fn a_publisher_that_is_killed_leaves_every_complete_second() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("killed.jsonl");
    let publisher = run("log_killed", &scene(folder.path(), "school"), &log, &["--rate", "300"]);
    wait_for_seconds(&log, 2);
    publisher.signal(Signal::SIGKILL);
    publisher.output();
    let line = proved(&log);
    assert_eq!((&line["complete"], &line["cut"]), (&false.into(), &false.into()));
    assert!(line["seconds"].as_u64().unwrap() >= 2, "{line}");
    // A log that ends before the first second is complete.
    let early = folder.path().join("early.jsonl");
    let text_of_log = std::fs::read_to_string(&log).unwrap();
    std::fs::write(&early, format!("{}\n", text_of_log.lines().next().unwrap())).unwrap();
    let (code, line, sentence) = verify(&early);
    assert_eq!((code, &line["verdict"], &line["seconds"]), (1, &"nothing".into(), &0.into()), "{sentence}");
    assert!(sentence.contains("early.jsonl: nothing could be compared"), "{sentence}");
    // A log cut as by a loss of power.
    let bytes = std::fs::read(&log).unwrap();
    std::fs::write(&log, &bytes[..bytes.len() - 40]).unwrap();
    assert_eq!(proved(&log)["cut"], true);
    let output = program("verify").args(["verify", log.to_str().unwrap()]).output().unwrap();
    assert!(text(&output.stdout).contains("The log has no end, its last line is cut: proved up to tick"), "{output:?}");
}

#[test]
fn a_file_that_takes_no_more_ends_the_log_and_not_the_stream() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path(), "school");
    // No byte can be written.
    let output = run("log_full", &scene, Path::new("/dev/full"), &["--rate", "100", "--duration", "1"]).output();
    let counts = json_lines(&output).pop().unwrap();
    assert_eq!(counts["frames"].as_u64().unwrap() + counts["skipped"].as_u64().unwrap(), 100, "{counts}");
    let sentence = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{sentence}");
    assert!(
        sentence.contains("--log: /dev/full: No space left on device") && sentence.contains("the show continues"),
        "{sentence}"
    );

    // In the middle: a pipe whose reader goes away.
    let pipe = folder.path().join("pipe");
    nix::unistd::mkfifo(&pipe, Mode::S_IRWXU).unwrap();
    let publisher = run("log_pipe", &scene, &pipe, &["--rate", "100", "--duration", "5"]);
    let mut reader = BufReader::new(std::fs::File::open(&pipe).unwrap());
    let mut first = String::new();
    reader.read_line(&mut first).unwrap();
    assert!(first.starts_with("{\"type\":\"show\""), "{first}");
    drop(reader);
    let output = publisher.output();
    assert_eq!((output.status.code(), &json_lines(&output).pop().unwrap()["end"]), (Some(1), &"duration".into()));
    assert!(text(&output.stderr).contains("Broken pipe"), "{}", text(&output.stderr));

    // The folder does not exist: refused before anything is published.
    let output = run("log_nowhere", &scene, Path::new("/no/such/folder/x.jsonl"), &["--duration", "1"]).output();
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0));
    assert!(text(&output.stderr).contains("--log: /no/such/folder/x.jsonl: No such file"), "{}", text(&output.stderr));
}

#[test]
fn what_is_no_log_is_refused_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    for (content, expected) in [
        (&b"name = \"paper\"\n"[..], "line 1: it does not end in a check, expected a line of a log"),
        (b"", "line 1: the file is empty, expected a log"),
        (b"\xff\xfe\n", "line 1: it is not UTF-8 text"),
        (b"{\"type\":\"show\"", "line 1: it is cut, expected the line of the show"),
    ] {
        let file = folder.path().join("other");
        std::fs::write(&file, content).unwrap();
        let (code, _, sentence) = verify(&file);
        assert!(code == 2 && sentence.contains(expected) && sentence.lines().count() == 1, "{code} {sentence}");
    }
    // A file without an end, and without a newline.
    let (code, _, sentence) = verify(Path::new("/dev/zero"));
    assert!(code == 2 && sentence.contains("line 1: it is longer than 67108864 bytes"), "{code} {sentence}");
    let (code, _, sentence) = verify(&folder.path().join("nothing"));
    assert!(code == 2 && sentence.contains("No such file"), "{code} {sentence}");
}

#[test]
fn python_computes_the_hashes_of_the_log_from_the_stream() {
    if !can_run(python_modules(&["iceoryx2", "blake3"])) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (name, log) = ("log_python", folder.path().join("show.jsonl"));
    let mut peer = python();
    let rate = "100";
    peer.args(["tests/python/log_hash.py", "--name", &unique(name), "--rate", rate, "--seconds", "3"]);
    let reader = Process::start(&mut peer);
    let publisher = run(name, &scene(folder.path(), "paper"), &log, &["--rate", rate, "--start", "405"]);
    let output = reader.output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    publisher.signal(Signal::SIGINT);
    summary(&publisher.output());
    let (computed, logged) = (json_lines(&output), lines(&log));
    let computed = of_type(&computed, "second");
    assert!(computed.len() >= 3, "{computed:?}");
    for second in computed {
        let own = logged.iter().find(|line| line["type"] == "second" && line["second"] == second["second"]).unwrap();
        for field in ["from", "to", "frames", "hash"] {
            assert_eq!(second[field], own[field], "{field} of second {}", second["second"]);
        }
    }
    proved(&log);
}
