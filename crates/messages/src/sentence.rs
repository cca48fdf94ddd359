//! Alerts in words, for people. Benches are counted from 1, and the sentence states this.
//!
//! In: a [`CollisionAlert`] and the [`Stage`] with the names. Out: a sentence, the same for the terminal and for the
//! page.

use std::borrow::Cow;
use std::error::Error;
use std::fmt::{self, Display};
use std::io;

use super::layouts::{ChaseStatus, CollisionAlert, Cue, OBSTACLE_BOUNDARY, Stage};
pub use super::roster::name_in;
use super::roster::obstacle_number;
use crate::chase::{ChaseSource, ChaseState};
use crate::state::EventKind;
use crate::state::{FrameState, Level};

/// The place of the values that change from frame to frame: the time until the event, and the clearance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Figures {
    /// In the sentence.
    Shown {
        /// Simulated seconds per second of wall time, in which the time until the event is given; 0 while paused.
        time_scale: f64,
    },
    /// Beside the sentence.
    Omitted,
}

/// Returns a cue that the show has reached, as a sentence.
pub fn cue_sentence(cue: &Cue) -> String {
    let waits = if cue.pauses == 1 { ": waiting for go" } else { "" };
    format!("cue {} \"{}\"{waits}", cue.number, cue.name.as_str())
}

/// Returns the warning that another program has removed files of a running show.
pub fn lost_files_sentence(files: u64) -> String {
    format!(
        "{files} of the show's files were removed by another program: no other process can connect until it is restarted"
    )
}

/// Returns the status of a chase as a sentence: the source, its label or tracker, the state and the error.
pub fn chase_sentence(status: &ChaseStatus) -> String {
    let source = status.chase_source().map_or("unknown source", ChaseSource::title);
    let state = status.chase_state();
    let subject = match (status.label(), status.tracker) {
        (Some(label), _) => format!("{source} {label}"),
        (None, 0) => source.to_owned(),
        (None, tracker) => format!("{source} tracker {tracker}"),
    };
    let is_at_work = matches!(state, Some(ChaseState::Locked | ChaseState::Freewheeling));
    let error = if is_at_work && !status.error.is_nan() {
        format!(", {} ms", rounded(1e3 * status.error, 1))
    } else {
        String::new()
    };
    let distance =
        if status.distance.is_nan() { String::new() } else { format!(", {:.2} m off the path", status.distance) };
    format!("{subject} {}{error}{distance}", state.map_or("in an unknown state", ChaseState::words))
}

/// Returns the name of the obstacle that an alert is about: the obstacle of its event, or else the nearest obstacle.
/// Returns `None` if the alert is about boards alone.
pub fn obstacle_in<'a>(stage: &'a Stage, alert: &CollisionAlert) -> Option<&'a str> {
    obstacle_name(stage, alert.event_bench_b).or_else(|| obstacle_name(stage, alert.bench_b))
}

/// Returns the name of the obstacle of a number that follows the handles; `None` for a bench.
pub fn obstacle_name(stage: &Stage, number: u32) -> Option<&str> {
    Some(stage.obstacles.get(obstacle_number(stage, number)?)?.name.as_str())
}

/// Returns an alert of a show as a sentence; the stage has the names. A past event is in the past tense, since the show
/// may continue. For a coming event, its place and the two benches that are nearest now are separate.
pub fn alert_sentence(alert: &CollisionAlert, stage: &Stage, figures: Figures) -> String {
    let happened = alert.alert_level().is_some_and(Level::has_happened);
    let sentence = match (happened, alert.event_kind()) {
        (true, Some(kind)) => happening(alert, kind, stage),
        (true, None) => "at an unknown place".to_owned(),
        (false, kind) => {
            let coming = kind.map(|kind| coming(alert, kind, stage, figures));
            let coming = coming.unwrap_or_else(|| "no contact, stall or lock ahead".to_owned());
            match nearest(alert, stage, figures) {
                Some(nearest) => format!("{coming}; {nearest}"),
                None => coming,
            }
        }
    };
    if sentence.contains("bench ") { format!("{sentence} (counting from 1)") } else { sentence }
}

/// Returns a state that no alert reports, as a sentence, or `None` if an alert reports it or nothing has happened. A
/// show of several dragons is at the end of its paths when all of them are.
pub fn state_sentence(state: FrameState, stage: &Stage) -> Option<&'static str> {
    match state {
        FrameState::PathEnd if stage.dragons.len() > 1 => Some("all heads have reached the ends of their paths"),
        FrameState::PathEnd => Some("the head has reached the end of the path"),
        _ => None,
    }
}

fn happening(alert: &CollisionAlert, kind: EventKind, stage: &Stage) -> String {
    let who = names(alert.event_benches(), stage);
    let (time, place) = (alert.event_time, place(alert));
    match kind {
        EventKind::Obstacle => {
            let [bench, obstacle] = [alert.event_bench_a, alert.event_bench_b].map(|of| name_in(stage, of));
            format!("{bench} met {obstacle} at {place}, t = {time:.6} s")
        }
        EventKind::Contact => format!("{who} touched at {place}, t = {time:.6} s"),
        EventKind::Stall => {
            format!("{who} stalled, t = {time:.6} s: from the handle at {place} on, the team was pushed backwards")
        }
        EventKind::Lock => {
            format!("{who} locked, its rear handle at {place}, t = {time:.6} s: that handle would need unbounded speed")
        }
        EventKind::PathEnd if stage.dragons.len() > 1 => {
            format!("all heads reached the ends of their paths, t = {time:.6} s")
        }
        EventKind::PathEnd => format!("the head reached the end of the path, t = {time:.6} s"),
    }
}

fn place(alert: &CollisionAlert) -> String {
    format!("({:.3}, {:.3}) m", alert.event_x, alert.event_y)
}

fn coming(alert: &CollisionAlert, kind: EventKind, stage: &Stage, figures: Figures) -> String {
    let who = names(alert.event_benches(), stage);
    let when = match figures {
        Figures::Shown { time_scale } => format!(" {}", time_until(alert.time_to_event, time_scale)),
        Figures::Omitted => String::new(),
    };
    format!("{}: {who} at {}{when}", kind.name(), place(alert))
}

/// Returns the wall time until `seconds` simulated seconds have passed, at the rate in force; none while the show
/// stands still.
pub fn time_until(simulated_seconds: f64, time_scale: f64) -> String {
    if time_scale > 0.0 { format!("in {:.1} s", simulated_seconds / time_scale) } else { "not while paused".to_owned() }
}

/// Returns a number with the fewest digits that read back to the same bits. Outside 1e-6 to 1e15, where Rust would
/// write every zero, the number has an exponent.
pub fn number(value: f64) -> String {
    let is_plain = value == 0.0 || !value.is_finite() || (1e-6..1e15).contains(&value.abs());
    if is_plain { value.to_string() } else { format!("{value:e}") }
}

/// A text of another form than the one that is expected, such as `seconds, or a time such as 90s`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Expected(pub Cow<'static, str>);

impl Display for Expected {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "expected {}", self.0)
    }
}

impl Error for Expected {}

/// Returns the sentence for a file that cannot be created.
pub fn not_writable(file: impl Display, error: &io::Error) -> String {
    format!("{file}: {error}, expected a file to write")
}

/// Returns a number with at most `decimals` decimals: no zeros at its end, and no minus before zero.
pub fn rounded(value: f64, decimals: usize) -> String {
    let fixed = format!("{value:.decimals$}");
    let short = if fixed.contains('.') { fixed.trim_end_matches('0').trim_end_matches('.') } else { &fixed };
    if short == "-0" { "0".to_owned() } else { short.to_owned() }
}

fn nearest(alert: &CollisionAlert, stage: &Stage, figures: Figures) -> Option<String> {
    alert.nearest_benches().next()?;
    let nearest = format!("nearest now are {}", names(alert.nearest_benches(), stage));
    if figures == Figures::Omitted {
        return Some(nearest);
    }
    let obstacle = obstacle_number(stage, alert.bench_b).and_then(|index| stage.obstacles.get(index));
    let is_boundary = obstacle.is_some_and(|obstacle| obstacle.kind == OBSTACLE_BOUNDARY);
    let overlap = if is_boundary { "outside by" } else { "overlap by" };
    Some(format!("{nearest}, {}", apart(alert.clearance, keep_out(stage, alert.bench_b), overlap)))
}

/// Returns the metres that boards stay away from the obstacle of a number that follows the handles; 0 for a bench.
pub fn keep_out(stage: &Stage, number: u32) -> f64 {
    let obstacle = obstacle_number(stage, number).and_then(|index| stage.obstacles.get(index));
    obstacle.map_or(0.0, |obstacle| obstacle.keep_out)
}

/// Returns the distance that belongs to a clearance in words, and the part of it beyond the keep-out, if there is one.
fn apart(clearance: f64, keep_out: f64, overlap: &str) -> String {
    // Without the sign of zero: the clearance of a touch is solved to the last bits, on either side.
    let [clearance, distance] = [clearance, clearance + keep_out].map(|metres| (metres * 1e4).round() / 1e4 + 0.0);
    let apart = if distance < 0.0 { format!("{overlap} {:.4} m", -distance) } else { format!("{distance:.4} m apart") };
    if keep_out == 0.0 {
        return apart;
    }
    let side = if clearance < 0.0 { "inside" } else { "beyond" };
    format!("{apart}, {:.4} m {side} the keep-out of {} m", clearance.abs(), number(keep_out))
}

fn names(concerned: impl Iterator<Item = u32>, stage: &Stage) -> String {
    concerned.map(|bench| name_in(stage, bench)).collect::<Vec<_>>().join(" and ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{List, NO_BENCH, SceneName, StageDragon, StageObstacle};

    const SHOWN: Figures = Figures::Shown { time_scale: 2.0 };

    fn alert(level: Level, kind: Option<EventKind>) -> CollisionAlert {
        let event = kind.map_or(0, |kind| FrameState::from(kind) as u32);
        CollisionAlert {
            level: level as u32,
            bench_a: 0,
            bench_b: 9,
            clearance: 0.0031,
            event,
            event_time: 412.473837682,
            time_to_event: 13.0,
            event_bench_a: 0,
            event_bench_b: 8,
            event_x: 1.25,
            event_y: -0.5,
            ..Default::default()
        }
    }

    /// The stage of one team.
    fn team(benches: u32) -> Stage {
        Stage { dragons: List::of([StageDragon { benches, ..StageDragon::default() }]), ..Stage::default() }
    }

    #[test]
    fn an_obstacle_is_named() {
        let lamp = StageObstacle { name: SceneName::new("stone lamp"), ..StageObstacle::default() };
        let stage = Stage { obstacles: List::of([lamp]), ..team(12) };
        let met = CollisionAlert { event_bench_b: 13, ..alert(Level::Obstacle, Some(EventKind::Obstacle)) };
        let sentence = alert_sentence(&met, &stage, SHOWN);
        assert!(sentence.starts_with("bench 1 (the head) met the stone lamp at (1.250, -0.500) m"), "{sentence}");
        assert_eq!(obstacle_in(&stage, &met), Some("stone lamp"));
        let near = CollisionAlert { bench_b: 13, ..alert(Level::Approaching, None) };
        let sentence = alert_sentence(&near, &stage, SHOWN);
        assert!(
            sentence.contains("nearest now are bench 1 (the head) and the stone lamp, 0.0031 m apart"),
            "{sentence}"
        );
        assert_eq!(obstacle_in(&stage, &alert(Level::Approaching, None)), None);
        let lamp = StageObstacle { keep_out: 0.5, ..lamp };
        let kept = Stage { obstacles: List::of([lamp]), ..team(12) };
        for (clearance, words) in [
            (0.0031, "stone lamp, 0.5031 m apart, 0.0031 m beyond the keep-out of 0.5 m"),
            (-0.1, "stone lamp, 0.4000 m apart, 0.1000 m inside the keep-out of 0.5 m"),
            (-0.7, "stone lamp, overlap by 0.2000 m, 0.7000 m inside the keep-out of 0.5 m"),
        ] {
            let sentence = alert_sentence(&CollisionAlert { clearance, ..near }, &kept, SHOWN);
            assert!(sentence.contains(words), "{sentence}");
        }
        let boundary =
            StageObstacle { name: SceneName::new("boundary"), kind: OBSTACLE_BOUNDARY, keep_out: 0.0, ..lamp };
        let outside = Stage { obstacles: List::of([boundary]), ..team(12) };
        let sentence = alert_sentence(&CollisionAlert { clearance: -156.0, ..near }, &outside, SHOWN);
        assert!(sentence.contains("bench 1 (the head) and the boundary, outside by 156.0000 m"), "{sentence}");
        // A number that the stage does not list, and a stage that has not come.
        assert_eq!(name_in(&stage, 14), "obstacle 2");
        assert_eq!(name_in(&Stage::default(), 14), "bench 15");
    }

    #[test]
    fn what_comes_has_its_kind_its_benches_and_its_time() {
        let coming = alert(Level::Approaching, Some(EventKind::Contact));
        let nearest = "nearest now are bench 1 (the head) and bench 10, 0.0031 m apart (counting from 1)";
        let sentence = |figures| alert_sentence(&coming, &team(223), figures);
        assert_eq!(
            sentence(SHOWN),
            format!("contact: bench 1 (the head) and bench 9 at (1.250, -0.500) m in 6.5 s; {nearest}")
        );
        let words = "contact: bench 1 (the head) and bench 9 at (1.250, -0.500) m; \
                     nearest now are bench 1 (the head) and bench 10 (counting from 1)";
        assert_eq!(sentence(Figures::Omitted), words);
        let stall = CollisionAlert {
            event_bench_b: NO_BENCH,
            bench_a: NO_BENCH,
            bench_b: NO_BENCH,
            ..alert(Level::Clear, Some(EventKind::Stall))
        };
        assert_eq!(
            alert_sentence(&stall, &team(2), SHOWN),
            "stall: bench 1 (the head) at (1.250, -0.500) m in 6.5 s (counting from 1)"
        );
        let nothing = alert(Level::Approaching, None);
        assert_eq!(alert_sentence(&nothing, &team(223), SHOWN), format!("no contact, stall or lock ahead; {nearest}"));
    }

    #[test]
    fn what_has_happened_has_its_place_and_its_time() {
        let contact = alert(Level::Contact, Some(EventKind::Contact));
        assert_eq!(
            alert_sentence(&contact, &team(9), SHOWN),
            "bench 1 (the head) and bench 9 (the tail) touched at (1.250, -0.500) m, t = 412.473838 s (counting from 1)"
        );
        let lock = CollisionAlert { event_bench_b: NO_BENCH, ..alert(Level::Lock, Some(EventKind::Lock)) };
        let sentence = alert_sentence(&lock, &team(223), SHOWN);
        assert!(sentence.starts_with("bench 1 (the head) locked, its rear handle at (1.250, -0.500) m"), "{sentence}");
    }

    #[test]
    fn a_show_that_stands_still_comes_to_no_event() {
        let contact = alert(Level::Approaching, Some(EventKind::Contact));
        let sentence = alert_sentence(&contact, &team(9), Figures::Shown { time_scale: 0.0 });
        assert!(
            sentence.starts_with(
                "contact: bench 1 (the head) and bench 9 (the tail) at (1.250, -0.500) m not while paused"
            ),
            "{sentence}"
        );
    }

    #[test]
    fn the_heads_of_several_reach_the_ends_of_their_paths() {
        let dragon = StageDragon { benches: 3, ..StageDragon::default() };
        let two = Stage { dragons: List::of([dragon; 2]), ..Stage::default() };
        let sentence = |stage| state_sentence(FrameState::PathEnd, stage).unwrap();
        assert_eq!(sentence(&two), "all heads have reached the ends of their paths");
        assert_eq!(sentence(&team(3)), "the head has reached the end of the path");
        assert_eq!(state_sentence(FrameState::Contact, &two), None);
    }

    #[test]
    fn an_alert_about_nothing_names_no_bench() {
        let nothing = CollisionAlert::default();
        assert_eq!(alert_sentence(&nothing, &team(2), SHOWN), "no contact, stall or lock ahead");
    }
}
