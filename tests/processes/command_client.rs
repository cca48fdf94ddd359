//! Control clients of a publisher that is stopped, dies, or executes a long command: their answers, and the commands
//! that are not executed any more. The publisher is a separate process. No test asserts a speed.

use crate::control::{control, done};
use crate::harness;

use std::time::Instant;

use bench_dragon::client::control::command_client::{Action, CommandClient};
use bench_dragon::client::control::{ControlError, Controller, PendingCommand};
use bench_dragon::messages::control::Command as Conduct;
use harness::{Process, answering, long, patience, program, scene_file, text, unique, wait};
use nix::sys::signal::Signal;

fn publisher(name: &str, arguments: &[&str]) -> Process {
    let scene = scene_file(name, &[("accuracy = 1e-9", "solver = \"newton\"")]);
    let mut command = program(name);
    command.args(["--scene", scene.to_str().unwrap(), "run", "--quiet", "--json", "--start", "100"]);
    let rate: &[&str] = if arguments.contains(&"--rate") { &[] } else { &["--rate", "50"] };
    answering(Process::start(command.args(rate).args(arguments)), || program(name))
}

/// Returns the numbers of actions in the order of their answers, each with its result in a word.
fn answers(actions: &[Action], between: impl FnOnce(), name: &str) -> Vec<(usize, String)> {
    let (sender, receiver) = std::sync::mpsc::channel();
    let client = CommandClient::start(&unique(name), move |number: usize, conducted| {
        let word = match conducted {
            Ok((command, response)) => {
                format!("{}: {}", command.name(), response.result().unwrap().name())
            }
            Err(ControlError::Overtaken) => "overtaken".to_owned(),
            Err(error) => error.to_string(),
        };
        sender.send((number, word)).unwrap();
    });
    let client = client.unwrap();
    for (number, action) in actions.iter().enumerate() {
        client.request(number, *action).unwrap();
        // Each command has been sent, or waits, before the next one starts.
        wait(0.02);
    }
    between();
    actions.iter().map(|_| receiver.recv_timeout(patience()).unwrap()).collect()
}

#[test]
fn nothing_that_was_asked_before_a_hold_is_done_after_it() {
    let name = "hold_overtakes";
    let publisher = publisher(name, &[]);
    publisher.stop();
    let send = |command| Action::Send(command);
    // Three are sent, the last of them a query; four wait for its answer, and two of them would end the hold.
    let actions = [
        send(Conduct::Pause),
        send(Conduct::Rate(2.0)),
        Action::Toggle,
        send(Conduct::Seek(50.0)),
        send(Conduct::Release),
        send(Conduct::Resume),
        Action::SeekBy { seconds: 5.0, end: 300.0 },
        send(Conduct::Hold),
    ];
    let mut answered = answers(&actions, || publisher.signal(Signal::SIGCONT), name);
    answered.sort();
    let words: Vec<&str> = answered.iter().map(|(_, word)| word.as_str()).collect();
    let [overtaken, pause, rate, hold] = ["overtaken", "pause: done", "rate: done", "hold: done"];
    let expected = [pause, rate, overtaken, overtaken, overtaken, overtaken, overtaken, hold];
    assert_eq!(words, expected);
    let state = done(name, &["state"]);
    assert_eq!(state["playback"], "held", "{state}");
    assert!(state["sim_time"].as_f64().unwrap() >= 100.0, "no seek: {state}");
}

#[test]
fn each_action_finds_the_show_as_the_one_before_left_it() {
    let name = "each_in_turn";
    let publisher = publisher(name, &[]);
    publisher.stop();
    let step = Action::Send(Conduct::Step(1));
    let actions = [Action::Toggle, Action::Toggle, Action::Toggle, step];
    let answered = answers(&actions, || publisher.signal(Signal::SIGCONT), name);
    let words = ["pause: done", "resume: done", "pause: done", "step: done"];
    assert_eq!(answered, Vec::from_iter(words.map(str::to_owned).into_iter().enumerate()));
}

#[test]
fn a_publisher_that_dies_before_it_answers_is_noticed() {
    let name = "dies_unanswered";
    let publisher = publisher(name, &["--paused"]);
    let stepping = Process::start(program(name).args(["control", "step", "1000000"]));
    let deadline = Instant::now() + patience();
    while done(name, &["state"])["playback"] != "playing" {
        assert!(Instant::now() < deadline, "the step does not begin");
        wait(0.05);
    }
    publisher.signal(Signal::SIGKILL);
    let output = stepping.output();
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("has ended without an answer"), "{}", text(&output.stderr));
}

#[test]
fn commands_to_a_publisher_that_dies_are_given_up_in_their_order() {
    let name = "dies_in_order";
    let publisher = publisher(name, &[]);
    publisher.stop();
    let actions = [2.0, 3.0, 4.0, 5.0, 6.0].map(|rate| Action::Send(Conduct::Rate(rate)));
    let answered = answers(&actions, || publisher.signal(Signal::SIGKILL), name);
    println!("{answered:?}");
    for (place, (number, word)) in answered.iter().enumerate() {
        assert_eq!(place, *number, "{answered:?}");
        assert!(word.contains("no publisher has the name"), "{word}");
    }
}

/// The loop takes a command every five seconds, and the command queue is full.
#[test]
fn a_question_that_is_refused_answers_nothing() {
    let name = "full_door";
    let _publisher = publisher(name, &["--rate", "0.2"]);
    let mut floods: Vec<_> = (0..9).map(|_| Controller::new(&unique(name)).unwrap()).collect();
    let mut waiting = Vec::new();
    let deadline = Instant::now() + patience();
    loop {
        // Refused commands are sent again; a client may have a limited number of commands waiting.
        waiting.retain(|pending: &PendingCommand| matches!(pending.poll(), Ok(None)));
        waiting.extend(floods.iter_mut().flat_map(|controller| {
            let requests = [(); 8].map(|()| controller.request(Conduct::State).ok());
            requests.into_iter().flatten()
        }));
        wait(0.2);
        let (code, line, sentence) = control(name, &["--timeout", "1", "toggle"]);
        // A command may find a place that has just become free.
        if code == 0 || sentence.contains("has not answered") {
            continue;
        }
        assert!(code == 1 && line.is_null(), "{code} {line}");
        assert!(sentence.contains("state is refused: too many commands are waiting"), "{sentence}");
        let [(0, answer)] = &answers(&[Action::Toggle], || (), name)[..] else { panic!("one answer") };
        if answer == "state: too_many" {
            return;
        }
        assert!(["pause: done", "resume: done"].contains(&answer.as_str()), "{answer}");
        assert!(Instant::now() < deadline, "the command queue is never full");
    }
}

/// A step that lasts longer than the client waits for any other answer.
#[test]
fn a_long_step_is_awaited() {
    if !long() {
        return;
    }
    let name = "long_step";
    let _publisher = publisher(name, &["--paused"]);
    let answer = done(name, &["step", "2000"]);
    assert_eq!(answer["playback"], "paused");
    let (code, _, sentence) = control(name, &["--timeout", "1", "step", "2000"]);
    assert!(code == 1 && sentence.contains("has not answered within 1 s"), "{sentence}");
}
