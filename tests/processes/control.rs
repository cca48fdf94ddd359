//! Control of a running publisher over shared memory, from the command line and from Python. Control works in every
//! state, at an exact tick, and at no cost to the stream.

use crate::harness;

use std::process::Command;
use std::time::Instant;

use bench_dragon::client::control::Controller;
use bench_dragon::messages::ControlResponse;
use bench_dragon::messages::control::{Code, Command as Conduct};
use bench_dragon::messages::state::PlaybackState;
use harness::{
    LONG_QUEUE, Place, Process, answering, can_run, example, json_lines, patience, program, python, python_modules,
    root, scene_file, stopped, summary, text, unique, wait,
};
use serde_json::Value;

fn publisher(name: &str, arguments: &[&str]) -> Process {
    answering(Process::start(program(name).args(["run", "--json"]).args(arguments)), || program(name))
}

/// Returns the exit code, the response as printed, and the sentence on standard error.
pub fn control(name: &str, arguments: &[&str]) -> (i32, Value, String) {
    let output = program(name).args(["--json", "control"]).args(arguments).output().unwrap();
    let line = json_lines(&output).pop().unwrap_or(Value::Null);
    (output.status.code().unwrap(), line, text(&output.stderr))
}

pub fn done(name: &str, arguments: &[&str]) -> Value {
    let (code, line, sentence) = control(name, arguments);
    assert_eq!((code, &line["code"]), (0, &"done".into()), "{arguments:?}: {line} {sentence}");
    line
}

fn peer(name: &str, what: &str) -> Command {
    let mut command = python();
    command.args(["tests/python/conduct_peer.py", "--name", &unique(name), what]);
    command
}

#[test]
fn the_command_line_conducts_a_show() {
    let name = "conducted";
    let publisher = publisher(name, &["--rate", "50", "--start", "100"]);
    let paused = done(name, &["pause"]);
    assert_eq!((&paused["playback"], &paused["time_scale"]), (&"paused".into(), &0.0.into()));
    let at = paused["sim_time"].as_f64().unwrap();
    assert_eq!(at, 100.0 + paused["tick"].as_f64().unwrap() / 50.0, "the pause is at the tick it names");
    wait(0.3);
    assert_eq!(done(name, &["state"])["sim_time"], at);
    let (code, line, sentence) = control(name, &["pause"]);
    assert_eq!((code, &line["code"]), (0, &"already".into()), "{sentence}");
    let stepped = done(name, &["step", "10"]);
    assert!((stepped["sim_time"].as_f64().unwrap() - (at + 10.0 / 50.0)).abs() < 1e-12);
    assert_eq!(stepped["playback"], "paused");
    assert_eq!(done(name, &["seek", "300.5"])["sim_time"], 300.5);
    done(name, &["rate", "4"]);
    let resumed = done(name, &["toggle"]);
    assert_eq!((&resumed["playback"], &resumed["time_scale"]), (&"playing".into(), &4.0.into()));
    let later = done(name, &["state"]);
    let [ticks, seconds] =
        ["tick", "sim_time"].map(|key| later[key].as_f64().unwrap() - resumed[key].as_f64().unwrap());
    assert!((seconds - 4.0 * ticks / 50.0).abs() < 1e-9 && ticks > 0.0, "{seconds} s in {ticks} ticks");
    assert_eq!(done(name, &["restart"])["sim_time"], 100.0);
    // Hold is latched.
    assert_eq!(done(name, &["hold"])["playback"], "held");
    let (code, line, sentence) = control(name, &["resume"]);
    assert_eq!((code, &line["code"]), (1, &"refused".into()));
    assert!(sentence.contains("resume is refused: the show is held"), "{sentence}");
    assert_eq!(done(name, &["release"])["playback"], "paused");
    let (code, _, sentence) = control(name, &["seek", "1e6"]);
    assert!(code == 1 && sentence.contains("out of range"), "{code} {sentence}");
    let (code, _, sentence) = control("no_publisher", &["pause"]);
    assert!(code == 1 && sentence.contains("no publisher has the name"), "{code} {sentence}");
    assert_eq!(control(name, &["step", "0"]).0, 2);
    publisher.signal(nix::sys::signal::Signal::SIGINT);
    let summary = summary(&publisher.output());
    assert_eq!(summary["end"], "signal");
}

#[test]
fn every_command_in_every_state_from_python() {
    if !can_run(python_modules(&["iceoryx2", "numpy"])) {
        return;
    }
    let name = "table";
    let _publisher = publisher(name, &["--rate", "200"]);
    let output = Process::start(&mut peer(name, "table")).output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let lines = json_lines(&output);
    let codes = |state: &str| -> Vec<u64> {
        lines.iter().filter(|line| line["state"] == state).map(|line| line["code"].as_u64().unwrap()).collect()
    };
    // state, pause, resume, rate, seek, step, restart, hold, release, go
    assert_eq!(codes("playing"), [0, 0, 1, 0, 0, 2, 0, 0, 2, 2]);
    assert_eq!(codes("paused"), [0, 1, 0, 0, 0, 0, 0, 0, 2, 2]);
    assert_eq!(codes("held"), [0, 2, 2, 2, 2, 2, 2, 1, 0, 2]);
    // Two commands that do not exist, and six values that no show accepts.
    assert_eq!(codes("any"), [4, 4, 3, 3, 3, 3, 3, 3]);
}

#[test]
fn a_flood_and_killed_clients_cost_the_stream_nothing() {
    if !can_run(python_modules(&["iceoryx2", "numpy"])) {
        return;
    }
    let name = "flooded";
    let scene = scene_file(name, &[("[publish]", &format!("[publish]\n{LONG_QUEUE}"))]);
    let scene = scene.to_str().unwrap();
    let publisher = publisher(name, &["--scene", scene, "--rate", "100"]);
    let mut watch = Process::start(program(name).args(["watch", "--json"]));
    let printed = watch.lines();
    printed.until("\"state\":\"moving\"");
    for _ in 0..2 {
        let mut flood = Process::start(&mut peer(name, "flood"));
        flood.lines().until("flooding");
        wait(1.0);
        // Another command is answered meanwhile.
        done(name, &["pause"]);
        done(name, &["resume"]);
        flood.signal(nix::sys::signal::Signal::SIGKILL);
    }
    let summary = stopped(publisher);
    let seconds = printed.all_until("\"state\":\"waiting\"");
    let seconds = Vec::from_iter(seconds.iter().map(|line| serde_json::from_str::<Value>(line).unwrap()));
    let last = seconds.iter().rfind(|line| line["tick"].is_u64()).unwrap();
    assert_eq!(last["missed"], 0, "{last}");
    let [frames, skipped] = ["frames", "skipped"].map(|key| summary[key].as_u64().unwrap());
    assert!(last["tick"].as_u64().unwrap() < frames + skipped, "{summary} {last}");
}

#[test]
fn a_show_waits_for_go_at_its_start_and_at_its_cues() {
    let name = "cues";
    let scene = scene_file(name, &[]);
    let cues = "[[cues]]\nname = \"lamps\"\nat = 0.2\n[[cues]]\nname = \"coil\"\ntravelled = 0.5\nthen = \"pause\"\n";
    std::fs::write(&scene, format!("{}\n{cues}", std::fs::read_to_string(&scene).unwrap())).unwrap();
    let scene = scene.to_str().unwrap();
    let _publisher = publisher(name, &["--scene", scene, "--rate", "50", "--paused"]);
    let state = done(name, &["state"]);
    assert_eq!((&state["playback"], &state["sim_time"], &state["cue"]), (&"paused".into(), &0.0.into(), &0.into()));
    done(name, &["go"]);
    let deadline = Instant::now() + patience();
    let mut state = done(name, &["state"]);
    while state["cue"] != 2 && Instant::now() < deadline {
        wait(0.1);
        state = done(name, &["state"]);
    }
    assert_eq!((&state["playback"], &state["sim_time"], &state["cue"]), (&"paused".into(), &0.5.into(), &2.into()));
    done(name, &["go"]);
    let (code, line, sentence) = control(name, &["go"]);
    assert!(code == 1 && line["code"] == "refused" && sentence.contains("waits for nothing"), "{line} {sentence}");
}

/// A frame that passes all cues announces every one of them, however many there are.
#[test]
fn all_cues_of_one_step_are_announced() {
    let name = "many_cues";
    let scene = scene_file(name, &[]);
    let numbers = 0..20;
    let cues =
        numbers.clone().map(|cue| format!("[[cues]]\nname = \"cue {cue}\"\nat = {}\n", 0.2 + 0.1 * f64::from(cue)));
    let cues = cues.collect::<String>();
    std::fs::write(&scene, format!("{}\n{cues}", std::fs::read_to_string(&scene).unwrap())).unwrap();
    let scene = scene.to_str().unwrap();
    let arguments = ["--scene", scene, "--rate", "50", "--paused", "--time-scale", "200"];
    let _publisher = publisher(name, &arguments);
    let mut watch = Process::start(program(name).args(["watch", "--json"]));
    let printed = watch.lines();
    let of = |line: &str| serde_json::from_str::<Value>(line).unwrap();
    // The subscriber has received frames before; otherwise it would be sent the last cue alone.
    printed.all_until_one(|line| of(line)["received"].as_u64().is_some_and(|frames| frames > 0), "a frame");
    done(name, &["go"]);
    let mut lines = printed.all_until("cue 19");
    watch.signal(nix::sys::signal::Signal::SIGINT);
    lines.extend(printed.rest());
    let lines = Vec::from_iter(lines.iter().map(|line| of(line)));
    let names = lines.iter().filter(|line| line["type"] == "cue").map(|line| line["name"].as_str().unwrap());
    assert_eq!(Vec::from_iter(names), Vec::from_iter(numbers.map(|cue| format!("cue {cue}"))));
}

/// The state of a show when a command arrives.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Stand {
    Playing,
    Paused,
    Stepping,
    Waiting,
    Held,
    Ended,
}

const STANDS: [Stand; 6] = [Stand::Playing, Stand::Paused, Stand::Stepping, Stand::Waiting, Stand::Held, Stand::Ended];

/// Two clients of a publisher: one awaits the end of a step, the other commands meanwhile.
struct TwoClients {
    controller: Controller,
    second: String,
    step: Option<std::thread::JoinHandle<ControlResponse>>,
}

impl TwoClients {
    fn new(name: &str) -> Self {
        Self { controller: Controller::new(&unique(name)).unwrap(), second: unique(name), step: None }
    }

    fn send(&mut self, command: Conduct) -> (Code, PlaybackState) {
        let answer = self.controller.send(command, patience()).unwrap();
        (answer.result().unwrap(), answer.playback_state().unwrap())
    }

    fn until(&mut self, wanted: PlaybackState) {
        let deadline = Instant::now() + patience();
        while self.send(Conduct::State).1 != wanted {
            assert!(Instant::now() < deadline, "the show is never {}", wanted.name());
        }
    }

    /// Brings the show to a state; the scene's cue at 0.2 s pauses, and the show ends after 412.4 s.
    fn bring_to(&mut self, stand: Stand) {
        self.send(Conduct::Release);
        self.send(Conduct::Rate(1.0));
        // A resume also ends a wait at a cue.
        self.send(Conduct::Resume);
        self.send(Conduct::Pause);
        assert_eq!(self.send(Conduct::Seek(1.0)), (Code::Done, PlaybackState::Paused));
        match stand {
            Stand::Playing => drop(self.send(Conduct::Resume)),
            Stand::Paused => (),
            Stand::Stepping => {
                let name = self.second.clone();
                self.step = Some(std::thread::spawn(move || {
                    Controller::new(&name).unwrap().send(Conduct::Step(1_000_000), patience()).unwrap()
                }));
                self.until(PlaybackState::Playing);
            }
            Stand::Waiting => {
                self.send(Conduct::Seek(0.19));
                self.send(Conduct::Resume);
                self.until(PlaybackState::Paused);
            }
            Stand::Held => drop(self.send(Conduct::Hold)),
            Stand::Ended => {
                self.send(Conduct::Seek(412.46));
                self.send(Conduct::Resume);
                self.until(PlaybackState::Ended);
            }
        }
    }

    /// Returns the answer to the step, if one was in progress; the step is cancelled.
    fn end_step(&mut self) -> Option<Code> {
        let step = self.step.take()?;
        if !step.is_finished() {
            self.send(Conduct::Pause);
        }
        step.join().unwrap().result()
    }
}

/// Returns a publisher whose show waits at a cue, and ends at its contact.
fn publisher_with_a_cue(name: &str) -> Process {
    let scene = scene_file(name, &[("accuracy = 1e-9", "solver = \"newton\"")]);
    let cue = "[[cues]]\nname = \"wait\"\nat = 0.2\nthen = \"pause\"\n";
    std::fs::write(&scene, format!("{}\n{cue}", std::fs::read_to_string(&scene).unwrap())).unwrap();
    publisher(name, &["--scene", scene.to_str().unwrap(), "--rate", "250", "--duration", "300"])
}

#[test]
fn every_command_in_every_state() {
    use Code::{Already, Done, Refused};
    use PlaybackState::{Ended, Held, Paused, Playing};
    let name = "whole_table";
    let _publisher = publisher_with_a_cue(name);
    let mut clients = TwoClients::new(name);
    let held = (Refused, Held);
    // Playing, paused, stepping, waiting, held, ended: the code, and the state after the command. A step has no answer
    // before it is complete.
    let table: [(Conduct, [(Code, PlaybackState); 6]); 10] = [
        (
            Conduct::State,
            [(Done, Playing), (Done, Paused), (Done, Playing), (Done, Paused), (Done, Held), (Done, Ended)],
        ),
        (Conduct::Pause, [(Done, Paused), (Already, Paused), (Done, Paused), (Already, Paused), held, (Done, Paused)]),
        (
            Conduct::Resume,
            [(Already, Playing), (Done, Playing), (Done, Playing), (Done, Playing), held, (Already, Ended)],
        ),
        (Conduct::Rate(2.0), [(Done, Playing), (Done, Paused), (Done, Playing), (Done, Paused), held, (Done, Ended)]),
        (Conduct::Seek(5.0), [(Done, Playing), (Done, Paused), (Done, Paused), (Done, Paused), held, (Done, Playing)]),
        (
            Conduct::Step(3),
            [(Refused, Playing), (Done, Paused), (Refused, Playing), (Done, Paused), held, (Refused, Ended)],
        ),
        (Conduct::Restart, [(Done, Playing), (Done, Paused), (Done, Paused), (Done, Paused), held, (Done, Playing)]),
        (Conduct::Hold, [(Done, Held), (Done, Held), (Done, Held), (Done, Held), (Already, Held), (Done, Held)]),
        (
            Conduct::Release,
            [
                (Refused, Playing),
                (Refused, Paused),
                (Refused, Playing),
                (Refused, Paused),
                (Done, Paused),
                (Refused, Ended),
            ],
        ),
        (
            Conduct::Go,
            [(Refused, Playing), (Refused, Paused), (Refused, Playing), (Done, Playing), held, (Refused, Ended)],
        ),
    ];
    for (command, expected) in table {
        for (stand, expected) in STANDS.into_iter().zip(expected) {
            clients.bring_to(stand);
            assert_eq!(clients.send(command), expected, "{command:?} while {stand:?}");
            // A command that cancels a step causes its refusal.
            assert_eq!(clients.end_step(), (stand == Stand::Stepping).then_some(Refused), "{command:?}");
        }
    }
    let unusable =
        [Conduct::Rate(0.0), Conduct::Rate(1e7), Conduct::Rate(f64::NAN), Conduct::Seek(-1.0), Conduct::Seek(1e9)];
    for command in unusable {
        for stand in STANDS {
            clients.bring_to(stand);
            let expected = if stand == Stand::Held { Refused } else { Code::OutOfRange };
            assert_eq!(clients.send(command).0, expected, "{command:?} while {stand:?}");
            clients.end_step();
        }
    }
    for (stand, expected) in [(Stand::Paused, Code::OutOfRange), (Stand::Held, Refused)] {
        clients.bring_to(stand);
        assert_eq!(clients.send(Conduct::Step(0)).0, expected, "no periods while {stand:?}");
    }
}

/// The service's files belong to their owner alone, unless the program was built to admit all users.
#[test]
fn another_user_cannot_conduct() {
    if !can_run(root("become another user")) {
        return;
    }
    let place = Place::new("clients");
    let publisher = Process::start(place.program().args(["run", "--json", "--rate", "100"]));
    let state = || json_lines(&place.program().args(["--json", "control", "state"]).output().unwrap()).pop();
    let deadline = Instant::now() + patience();
    while state().is_none() {
        assert!(Instant::now() < deadline, "no publisher");
        wait(0.1);
    }
    let output = place.as_other_user(&["control", "pause"]);
    let printed = text(&output.stderr);
    if cfg!(feature = "any_user") {
        assert_eq!(output.status.code(), Some(0), "{printed}");
    } else {
        assert_eq!(output.status.code(), Some(1), "{printed}");
        assert!(printed.contains("another user"), "{printed}");
        assert_eq!(state().unwrap()["playback"], "playing");
    }
    publisher.signal(nix::sys::signal::Signal::SIGINT);
    summary(&publisher.output());
}

#[test]
fn the_example_pauses_seeks_and_resumes() {
    let name = "example";
    let _publisher = publisher(name, &["--rate", "50", "--start", "100"]);
    let output = Process::start(example("conduct").arg(unique(name))).output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let printed = text(&output.stdout);
    let lines: Vec<_> = printed.lines().collect();
    assert!(lines[0].starts_with("Pause: done, paused at 0 x"), "{printed}");
    assert!(lines[1].starts_with("Seek(300.0): done, paused at 0 x, t = 300.000 s"), "{printed}");
    assert!(lines[2].starts_with("Resume: done, playing at 1 x, t = 300.000 s"), "{printed}");
}
