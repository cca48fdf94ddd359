//! Logs that were damaged or forged.

use super::super::lines::Line;
use super::super::verify::{Verdict, VerifyError};
use super::setup::{conducted, forged, sealed, verified};

#[test]
fn one_wrong_character_anywhere_is_found_and_its_line_named() {
    let run = conducted();
    assert_eq!(verified(&run.log).unwrap().verdict, "same");
    let text = String::from_utf8(run.log.clone()).unwrap();
    let kinds: Vec<_> = text.lines().map(|line| line[9..].split('"').next().unwrap()).collect();
    for kind in ["show", "command", "step_finished", "skipped", "second", "end"] {
        assert!(kinds.contains(&kind), "no {kind} in {kinds:?}");
    }
    let mut begins = 0;
    for (number, line) in text.split_inclusive('\n').enumerate() {
        for at in (0..line.len()).step_by(line.len() / 7 + 1) {
            let mut damaged = run.log.clone();
            damaged[begins + at] ^= 1;
            match verified(&damaged) {
                Err(VerifyError::Line { line, .. }) => assert_eq!(line, number as u64 + 1, "byte {at}"),
                other => panic!("line {}, byte {at}: {other:?}", number + 1),
            }
        }
        begins += line.len();
    }
}

fn is_number(line: &Line, wanted: u64) -> bool {
    matches!(line, Line::Second(second) if second.second == wanted)
}

#[test]
fn a_log_forged_with_right_checks_differs_in_the_second_that_was_forged() {
    let run = conducted();
    let difference = |verdict: Result<Verdict, VerifyError>| {
        let verdict = verdict.unwrap();
        assert_eq!(verdict.verdict, "differs");
        let found = verdict.difference.unwrap();
        (found.second, found.from, found.to, found.what)
    };
    // The scene, by a millimetre a second.
    let (second, from, to, what) = difference(forged(&run, |line| {
        let Line::Show(show) = line else { return false };
        show.scene = show.scene.replace("head_speed = 1.0", "head_speed = 1.001");
        true
    }));
    assert_eq!((second, from, to), (0, 0, 49), "{what}");
    assert!(what.contains("m apart"), "{what}");
    // A hash, and the places beside it.
    let (second, from, to, what) = difference(forged(&run, |line| {
        let own = is_number(line, 2);
        if let (true, Line::Second(second)) = (own, line) {
            second.hash = second.hash.replace(['0', '1', '2'], "3");
        }
        own
    }));
    assert_eq!((second, from, to), (2, 100, 149), "{what}");
    let (second, .., what) = difference(forged(&run, |line| {
        let own = is_number(line, 1);
        if let (true, Line::Second(second)) = (own, line) {
            second.handles[1].1 = second.handles[1].1.next_up();
        }
        own
    }));
    assert!(second == 1 && what.contains("not its hash"), "{second} {what}");
    // The commands and their results.
    let (second, .., what) = difference(forged(&run, |line| match line {
        Line::Command { value: Some(value), command, .. } if command == "seek" => {
            *value += 1e-9;
            true
        }
        _ => false,
    }));
    assert!(second == 0 && what.contains("hash"), "{what}");
    let (second, from, to, what) = difference(forged(&run, |line| match line {
        Line::Command { code, command, .. } if command == "pause" => {
            *code = Some("refused".to_owned());
            true
        }
        _ => false,
    }));
    assert!(second == 0 && from == to && what.contains("pause (refused), computed pause (done)"), "{what}");
    let (.., what) = difference(forged(&run, |line| match line {
        Line::StepFinished { code, .. } => {
            *code = "already".to_owned();
            true
        }
        _ => false,
    }));
    assert!(
        what.contains(
            "the end of a step (already), resume (done), computed the end of a step (refused), resume (done)"
        ),
        "{what}"
    );
}

#[test]
fn lines_that_no_run_can_have_written_are_refused_with_their_number() {
    let run = conducted();
    let problem = |verdict: Result<Verdict, VerifyError>| match verdict {
        Err(VerifyError::Line { line, problem }) => (line, problem.to_string()),
        other => panic!("{other:?}"),
    };
    let (_, sentence) = problem(forged(&run, |line| match line {
        Line::Skipped { to, .. } => {
            *to += 1;
            true
        }
        _ => false,
    }));
    assert!(sentence.contains("expected second 1"), "{sentence}");
    let (_, sentence) = problem(forged(&run, |line| match line {
        Line::Second(second) if second.second == 1 => {
            (second.from, second.to) = (second.from + 1, u64::MAX - 1);
            true
        }
        _ => false,
    }));
    assert!(sentence.contains("of several seconds"), "{sentence}");
    let (_, sentence) = problem(forged(&run, |line| match line {
        Line::Command { command, .. } => {
            *command = "jump".to_owned();
            true
        }
        _ => false,
    }));
    assert!(sentence.contains("not understood"), "{sentence}");
    let (line, sentence) = problem(forged(&run, |line| match line {
        Line::Show(show) => {
            show.format = 1;
            true
        }
        _ => false,
    }));
    assert!(line == 1 && sentence == "the format is 1, expected 2", "{sentence}");
    let mut lines = run.lines();
    lines.remove(0);
    assert!(problem(verified(&sealed(&lines))).1.contains("expected the line of the show"));
    // The lines between the last hash and the end.
    let mut lines = run.lines();
    let end = lines.pop().unwrap();
    let late = Line::Command { tick: 150, command: "hold".to_owned(), value: None, code: Some("done".to_owned()) };
    lines.extend([late, end]);
    let (line, sentence) = problem(verified(&sealed(&lines)));
    assert!(line == lines.len() as u64 && sentence.contains("tick 150"), "{line} {sentence}");
    let mut lines = run.lines();
    let unhashed = lines.iter().rposition(|line| matches!(line, Line::Second(_))).unwrap();
    lines[unhashed] = Line::Lost { from: 149, to: 149 };
    let (_, sentence) = problem(verified(&sealed(&lines)));
    assert_eq!(sentence, "the frames from tick 100 on have no hash");
    let scene = forged(&run, |line| match line {
        Line::Show(show) => {
            show.scene = show.scene.replace("benches = 12", "benches = 0");
            true
        }
        _ => false,
    });
    let Err(VerifyError::Scene(error)) = scene else { panic!("{scene:?}") };
    let sentence = error.to_string();
    assert!(
        sentence.contains("line 1, the scene \"small.toml\", line") && sentence.contains("team.benches"),
        "{sentence}"
    );
}
