//! `[require]`: whether a show keeps over its whole route the clearances that it must keep.
//!
//! In: the least clearances that the search has found, and their proofs, if they were proved. Out: a verdict on the
//! boards and one on each obstacle, which are lines of `check --json`, with sentences.

use serde::Serialize;

use crate::results::figure;
use crate::scene::{Requirements, Scene, printable};
use bench_dragon_messages::sentence::number;
use bench_dragon_motion::timeline::{TimedClearance, TimedObstacleClearance, Timeline};

/// The outcome for one requirement.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// It is kept.
    Pass,
    /// It is not kept.
    Fail,
    /// It is not known, which is a failure too.
    Undecided,
}

/// A verdict, which is a line of `check --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    check: &'static str,
    what: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    obstacle: Option<String>,
    /// The distance that is required, in metres.
    required: f64,
    /// The least distance, in metres; `None` if no two boards could meet, or the search found nothing.
    clearance: Option<f64>,
    /// The simulated seconds at which the distance is least.
    time: Option<f64>,
    /// The outcome.
    pub verdict: Outcome,
    /// The reason why nothing is decided.
    #[serde(skip)]
    because: String,
}

/// Returns the proved bounds of the least clearance of boards, or of boards and the obstacle of a name. The lower one is
/// given if it is proved to the end of the motion.
pub type Bounds<'b> = &'b dyn Fn(Option<&str>) -> (Option<f64>, Option<f64>);

/// The results of the search.
pub struct Searched<'s> {
    /// The events.
    pub timeline: &'s Timeline,
    /// The least clearance of boards.
    pub boards: Option<TimedClearance>,
    /// The least clearances of obstacles.
    pub obstacles: &'s [TimedObstacleClearance],
    /// The words for the end of a search that came to no end.
    pub gave_up: &'static str,
}

/// Judges a show, the boards first; without requirements there are no verdicts. With `proved` only what is proved
/// counts.
pub fn verdicts(scene: &Scene, searched: &Searched<'_>, proved: Option<Bounds<'_>>) -> Vec<Verdict> {
    let Some(Requirements { clearance }) = scene.require else { return Vec::new() };
    let boards = clearance.map(|required| boards(scene, required, searched, proved));
    let obstacles = scene.ensemble.ground().obstacles().iter().enumerate();
    let obstacles = obstacles.map(|(index, obstacle)| {
        let found = searched.obstacles.iter().find(|found| found.obstacle == index);
        let gave_up = found.map_or(Some(0.0), |found| found.searched_until);
        Verdict {
            what: "obstacle",
            obstacle: Some(obstacle.name.clone()),
            required: obstacle.keep_out,
            clearance: found.map(|found| found.least.value + obstacle.keep_out),
            time: found.map(|found| found.time),
            // The clearance of an obstacle begins at its keep-out.
            ..outcome(0.0, found.map(|found| found.least.value), gave_up, searched, proved, Some(&obstacle.name))
        }
    });
    boards.into_iter().chain(obstacles).collect()
}

/// Judges the boards.
fn boards(scene: &Scene, required: f64, searched: &Searched<'_>, proved: Option<Bounds<'_>>) -> Verdict {
    let found = searched.boards;
    let clearance = found.map(|found| found.least.value);
    let dragons = scene.ensemble.dragons();
    let can_meet = dragons.len() > 1 || dragons.iter().any(|dragon| dragon.motion.team().benches > 2);
    let verdict = match found {
        None if !can_meet => Verdict { verdict: Outcome::Pass, ..undecided("") },
        None => undecided(&format!("the search {}", searched.gave_up)),
        Some(found) => outcome(required, clearance, found.searched_until, searched, proved, None),
    };
    Verdict { what: "boards", required, clearance, time: found.map(|found| found.time), ..verdict }
}

/// Judges a clearance from its search, or from its proof.
fn outcome(
    required: f64,
    found: Option<f64>,
    reached: Option<f64>,
    searched: &Searched<'_>,
    proved: Option<Bounds<'_>>,
    obstacle: Option<&str>,
) -> Verdict {
    let is_below = |metres: f64| metres < required;
    if let Some(bounds) = proved {
        return match bounds(obstacle) {
            (_, Some(hi)) if is_below(hi) => decided(Outcome::Fail),
            (Some(lo), _) if !is_below(lo) => decided(Outcome::Pass),
            _ => undecided("the proof does not decide it"),
        };
    }
    let until = reached.or(searched.timeline.searched_until());
    match (found, until) {
        (Some(found), _) if is_below(found) => decided(Outcome::Fail),
        (Some(_), None) => decided(Outcome::Pass),
        (_, Some(until)) => undecided(&format!("the search {} at t = {} s", searched.gave_up, figure(until))),
        (None, None) => undecided(&format!("the search {}", searched.gave_up)),
    }
}

fn decided(verdict: Outcome) -> Verdict {
    Verdict { verdict, ..undecided("") }
}

fn undecided(because: &str) -> Verdict {
    Verdict {
        check: "require",
        what: "boards",
        obstacle: None,
        required: 0.0,
        clearance: None,
        time: None,
        verdict: Outcome::Undecided,
        because: because.to_owned(),
    }
}

impl Verdict {
    /// Returns the verdict in words. An undecided one is a failure.
    pub fn sentence(&self) -> String {
        let word = if self.verdict == Outcome::Pass { "PASS" } else { "FAIL" };
        let who = match &self.obstacle {
            None => "boards".to_owned(),
            Some(name) => format!("the {}", printable(name)),
        };
        let least = match (self.clearance, self.time) {
            (Some(f64::NEG_INFINITY), _) => "no board fits inside".to_owned(),
            (Some(clearance), Some(time)) => {
                format!("{} m at the least, at t = {} s", figure(clearance), figure(time))
            }
            _ if self.verdict == Outcome::Pass => "no two could meet".to_owned(),
            _ => "no least distance was found".to_owned(),
        };
        let undecided = match self.verdict {
            Outcome::Undecided => format!("; not decided, because {}", self.because),
            _ => String::new(),
        };
        format!("{word}: {who}: {least}; required: {} m{undecided}.", number(self.required))
    }
}
