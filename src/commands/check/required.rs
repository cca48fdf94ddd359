//! `[require]`: whether a show keeps over its whole route the clearances that it must keep.
//!
//! In: the least clearances that the search has found, and their proofs, if they were proved. Out: a verdict on the
//! boards and one on each obstacle, as sentences or as lines of JSON.

use bench_dragon::motion::timeline::{TimedClearance, TimedObstacleClearance, Timeline};
use bench_dragon::show::scene::{Requirements, Scene, printable};
use serde::Serialize;

use super::super::signals::gave_up;
use super::super::{CommandError, Output, figure, number};
use super::parts::Parts;

/// The outcome for one requirement.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Outcome {
    Pass,
    Fail,
    Undecided,
}

/// A verdict, which is a line of `check --json`.
#[derive(Serialize)]
struct Verdict {
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
    verdict: Outcome,
    /// The reason why nothing is decided.
    #[serde(skip)]
    because: String,
}

/// The verdicts on a show, the boards' first.
pub(super) struct Verdicts(Vec<Verdict>);

/// The results of the search.
pub(super) struct Searched<'s> {
    pub timeline: &'s Timeline,
    pub boards: Option<TimedClearance>,
    pub obstacles: &'s [TimedObstacleClearance],
}

impl Verdicts {
    /// Judges a show; without requirements there are no verdicts. With `parts` only what is proved counts.
    pub(super) fn of(scene: &Scene, searched: &Searched<'_>, parts: Option<&Parts>) -> Self {
        let Some(Requirements { clearance }) = scene.require else { return Self(Vec::new()) };
        let boards = clearance.map(|required| boards(scene, required, searched, parts));
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
                ..outcome(0.0, found.map(|found| found.least.value), gave_up, searched, parts, Some(&obstacle.name))
            }
        });
        Self(boards.into_iter().chain(obstacles).collect())
    }

    /// Prints each verdict as a line of JSON.
    pub(super) fn print_lines(&self, output: &mut Output) -> Result<(), CommandError> {
        self.0.iter().try_for_each(|verdict| output.json(verdict))
    }

    /// Prints each verdict as a sentence.
    pub(super) fn print(&self, output: &mut Output) -> Result<(), CommandError> {
        self.0.iter().try_for_each(|verdict| output.line(&format!("  {}", verdict.sentence())))
    }

    /// Returns an error unless every requirement is met.
    pub(super) fn result(&self) -> Result<(), CommandError> {
        if self.0.iter().all(|verdict| verdict.verdict == Outcome::Pass) {
            return Ok(());
        }
        Err(CommandError::Failed("the show does not keep what [require] states".to_owned()))
    }
}

/// Judges the boards.
fn boards(scene: &Scene, required: f64, searched: &Searched<'_>, parts: Option<&Parts>) -> Verdict {
    let found = searched.boards;
    let clearance = found.map(|found| found.least.value);
    let dragons = scene.ensemble.dragons();
    let can_meet = dragons.len() > 1 || dragons.iter().any(|dragon| dragon.motion.team().benches > 2);
    let verdict = match found {
        None if !can_meet => Verdict { verdict: Outcome::Pass, ..undecided("") },
        None => undecided(&format!("the search {}", gave_up())),
        Some(found) => outcome(required, clearance, found.searched_until, searched, parts, None),
    };
    Verdict { what: "boards", required, clearance, time: found.map(|found| found.time), ..verdict }
}

/// Judges a clearance from its search, or from its proof.
fn outcome(
    required: f64,
    found: Option<f64>,
    reached: Option<f64>,
    searched: &Searched<'_>,
    parts: Option<&Parts>,
    obstacle: Option<&str>,
) -> Verdict {
    let is_below = |metres: f64| metres < required;
    if let Some(parts) = parts {
        let (lo, hi) = parts.bounds(obstacle);
        return match (lo, hi) {
            (_, Some(hi)) if is_below(hi) => decided(Outcome::Fail),
            (Some(lo), _) if !is_below(lo) => decided(Outcome::Pass),
            _ => undecided("the proof does not decide it"),
        };
    }
    let until = reached.or(searched.timeline.searched_until());
    match (found, until) {
        (Some(found), _) if is_below(found) => decided(Outcome::Fail),
        (Some(_), None) => decided(Outcome::Pass),
        (_, Some(until)) => undecided(&format!("the search {} at t = {} s", gave_up(), figure(until))),
        (None, None) => undecided(&format!("the search {}", gave_up())),
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
    fn sentence(&self) -> String {
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
