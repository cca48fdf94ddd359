//! `check --prove`: the least clearance of each dragon, of each dragon and obstacle, and of each two dragons.
//!
//! In: a scene and what the ordinary search has found. Out: a sentence or a line of JSON for each part. The parts of a
//! dragon without a name have no names.

use std::path::Path;

use bench_dragon::certify::{
    BetweenEnclosure, CertificateLine, CertifyError, ClearanceEnclosures, ClearanceHints, MOST_CLEARANCE_STEPS,
    certify_clearances,
};
use bench_dragon::motion::ensemble::{Dragon, Ensemble};
use bench_dragon::motion::ground::Obstacle;
use bench_dragon::motion::timeline::{TimedClearance, TimedEvent, TimedObstacleClearance};
use bench_dragon::show::scene::{Scene, printable};
use serde::Serialize;

use super::super::certificate_file::CertificateFile;
use super::super::signals::report;
use super::super::{CommandError, Common, Output, progress_bar};

/// The proved bounds of a least clearance, in every line of `check --prove --json`.
#[derive(Serialize)]
struct ProvedBounds {
    #[serde(rename = "least_clearance_lo")]
    lo: Option<f64>,
    #[serde(rename = "least_clearance_hi")]
    hi: Option<f64>,
    #[serde(rename = "least_clearance_status")]
    status: &'static str,
    /// Simulated seconds up to which the bounds are proved, unless to the end of the show.
    proved_until: Option<f64>,
    time: Option<f64>,
}

impl ProvedBounds {
    /// Creates the fields of a proof up to a time, or to the end of the show. The upper bound is met at `time`.
    fn new(lo: Option<f64>, hi: Option<f64>, until: Option<f64>, time: Option<f64>) -> Self {
        let status = match (lo.is_some() && hi.is_some(), until.is_none()) {
            (true, true) => "proved",
            (true, false) => "given_up",
            (false, _) => "searched",
        };
        Self { lo, hi, status, proved_until: until.map(rounded_down), time }
    }

    /// Creates the fields of an enclosure, if there is one. The fields are its bounds, the metres of travel up to which
    /// these hold, and the metres where the upper bound is met.
    fn of(found: Option<([f64; 2], Option<f64>, f64)>, time_at: impl Fn(f64) -> f64) -> Self {
        let Some(([lo, hi], until, travelled)) = found else { return Self::new(None, None, None, None) };
        Self::new(Some(lo), Some(hi), until.map(&time_at), Some(time_at(travelled)))
    }
}

/// Returns a proved time rounded down, so that it is not after the exact one.
fn rounded_down(time: f64) -> f64 {
    time.next_down().max(0.0)
}

/// The proved least clearance of one dragon, of one and an obstacle, or of two: a line of `check --prove --json`.
#[derive(Serialize)]
struct Part {
    /// The names of the dragons.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    dragons: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    obstacle: Option<String>,
    /// The clearance that the ordinary search has found, of a dragon without a name.
    #[serde(skip_serializing_if = "Option::is_none")]
    least_clearance: Option<Option<f64>>,
    #[serde(flatten)]
    proved: ProvedBounds,
    #[serde(flatten)]
    benches: Benches,
    /// True for a dragon with a name of which no two benches could meet.
    #[serde(skip)]
    is_empty: bool,
}

/// The benches of a line.
#[derive(Serialize)]
#[serde(untagged)]
enum Benches {
    /// Of boards; of an obstacle the second is none.
    Two { bench_a: Option<usize>, bench_b: Option<usize> },
    /// Of an obstacle and a dragon without a name.
    One { bench: Option<usize> },
}

/// The proved least clearances of a show, in the order of the certificate.
pub(super) struct Parts(Vec<Part>);

/// The least clearances that the ordinary search has found.
#[derive(Clone, Copy)]
pub(super) struct Found<'f> {
    pub boards: Option<TimedClearance>,
    pub obstacles: &'f [TimedObstacleClearance],
}

impl Parts {
    /// Encloses the least clearances of a show, given the text of its scene. Writes the certificate to `file`.
    pub(super) fn enclosed(
        scene: &Scene,
        text: &str,
        show_end: &TimedEvent,
        found: Found<'_>,
        file: Option<&Path>,
        common: &Common,
    ) -> Result<Self, CommandError> {
        let mut certificate = file.map(CertificateFile::create).transpose()?;
        if certificate.is_some() && found.boards.is_none() && found.obstacles.is_empty() {
            let sentence = "no certificate is written: the search found no least clearance";
            return Err(CommandError::Failed(sentence.to_owned()));
        }
        let bar = progress_bar(1000, common).with_message("proving the least clearance");
        let mut write =
            |line: &CertificateLine| certificate.as_mut().map_or(Ok(()), |certificate| certificate.write(line));
        let mut progress = |share| report(&bar, share);
        let least = found.boards.map(|found| found.least);
        let hints = ClearanceHints { boards: least.as_ref(), obstacles: found.obstacles };
        let (ensemble, most_steps) = (&scene.ensemble, MOST_CLEARANCE_STEPS);
        let proved = certify_clearances(ensemble, show_end, hints, text, most_steps, &mut write, &mut progress);
        bar.finish_and_clear();
        let proved = proved.map_err(|CertifyError::Write(error)| error)?;
        if let Some(certificate) = certificate {
            certificate.finish()?;
        }
        let own = proved.own.iter().enumerate().flat_map(|(k, own)| own_parts(ensemble, k, own, found));
        Ok(Self(own.chain(proved.between.iter().map(|between| between_part(ensemble, between))).collect()))
    }

    /// Returns the proved bounds of the least clearance of boards, or of boards and an obstacle: the lower one if it is
    /// proved to the end of the motion, and the upper one.
    pub(super) fn bounds(&self, obstacle: Option<&str>) -> (Option<f64>, Option<f64>) {
        let parts = || self.0.iter().filter(|part| part.obstacle.as_deref() == obstacle && !part.is_empty);
        let least = |of: fn(&Part) -> Option<f64>| parts().filter_map(of).reduce(f64::min);
        let is_whole = parts().all(|part| part.proved.lo.is_some() && part.proved.proved_until.is_none());
        (least(|part| part.proved.lo).filter(|_| is_whole), least(|part| part.proved.hi))
    }

    /// Prints each part as a line of JSON.
    pub(super) fn print_lines(&self, output: &mut Output) -> Result<(), CommandError> {
        self.0.iter().try_for_each(|part| output.json(part))
    }

    /// Prints the part of a dragon without a name: of its boards, or of its boards and an obstacle.
    pub(super) fn print_unnamed(&self, obstacle: Option<&str>, output: &mut Output) -> Result<(), CommandError> {
        let mut unnamed = self.0.iter().filter(|part| part.dragons.is_empty() && part.obstacle.as_deref() == obstacle);
        unnamed.try_for_each(|part| output.line(&format!("  {}", part.sentence())))
    }

    /// Prints the parts of dragons with names, after the least clearance of all boards.
    pub(super) fn print_named(&self, output: &mut Output) -> Result<(), CommandError> {
        let named = || self.0.iter().filter(|part| !part.dragons.is_empty() && !part.is_empty);
        let of_boards = || named().filter(|part| part.obstacle.is_none());
        let least = |of: fn(&Part) -> Option<f64>| of_boards().filter_map(of).reduce(f64::min);
        let bounds = least(|part| part.proved.lo).zip(least(|part| part.proved.hi));
        if let Some(bounds) = bounds.filter(|_| of_boards().all(|part| part.proved.status == "proved")) {
            output.line(&format!("  {}", proved_sentence(bounds)))?;
        }
        for part in named() {
            let with = part.obstacle.iter().map(|name| format!("the {}", printable(name)));
            let names: Vec<String> = part.dragons.iter().cloned().chain(with).collect();
            output.line(&format!("  The least clearance of {}: {}", names.join(" and "), part.sentence()))?;
        }
        Ok(())
    }
}

/// Returns the parts of one dragon: of its boards, and of each obstacle.
fn own_parts(ensemble: &Ensemble, k: usize, own: &ClearanceEnclosures, found: Found<'_>) -> Vec<Part> {
    let Dragon { name, delay, motion } = &ensemble.dragons()[k];
    let (is_unnamed, first) = (name.is_empty(), ensemble.handles_of(k).start);
    let names = || if is_unnamed { Vec::new() } else { vec![name.clone()] };
    // A dragon stands at its start from the beginning on.
    let time_at = |travelled| if travelled <= 0.0 { 0.0 } else { delay + motion.time_at(travelled) };
    let boards = own.boards;
    let of_boards = Part {
        dragons: names(),
        obstacle: None,
        least_clearance: is_unnamed.then(|| found.boards.map(|found| found.least.value)),
        proved: ProvedBounds::of(boards.map(|found| ([found.lo, found.hi], found.until, found.travelled)), time_at),
        benches: Benches::Two {
            bench_a: boards.map(|found| first + found.bench_a),
            bench_b: boards.map(|found| first + found.bench_b),
        },
        is_empty: !is_unnamed && motion.team().benches < 3,
    };
    let of_obstacle = |(number, obstacle): (usize, &Obstacle)| {
        let enclosure = own.obstacles.get(number).copied().flatten();
        let found = found.obstacles.iter().find(|found| found.obstacle == number);
        let bench = enclosure.map(|found| first + found.bench);
        let proved = enclosure.map(|found| ([found.lo, found.hi], found.until, found.travelled));
        (found.is_some() || !is_unnamed).then(|| Part {
            dragons: names(),
            obstacle: Some(obstacle.name.clone()),
            least_clearance: found.filter(|_| is_unnamed).map(|found| Some(found.least.value)),
            proved: ProvedBounds::of(proved, time_at),
            benches: if is_unnamed { Benches::One { bench } } else { Benches::Two { bench_a: bench, bench_b: None } },
            is_empty: false,
        })
    };
    let obstacles = ensemble.ground().obstacles().iter().enumerate().filter_map(of_obstacle);
    [of_boards].into_iter().chain(obstacles).collect()
}

fn between_part(ensemble: &Ensemble, found: &BetweenEnclosure) -> Part {
    let BetweenEnclosure { dragons, lo, hi, time, benches, until } = *found;
    let number = |k: usize| hi.map(|_| ensemble.handles_of(dragons[k]).start + benches[k]);
    Part {
        dragons: dragons.map(|dragon| ensemble.dragons()[dragon].name.clone()).to_vec(),
        obstacle: None,
        least_clearance: None,
        proved: ProvedBounds::new(lo, hi, until, hi.map(|_| time)),
        benches: Benches::Two { bench_a: number(0), bench_b: number(1) },
        is_empty: false,
    }
}

/// Returns a sentence for people on a least clearance that is proved to the end of the show.
fn proved_sentence((lo, hi): (f64, f64)) -> String {
    if lo == hi { format!("Proved: it is {lo} m.") } else { format!("Proved: it is between {lo} m and {hi} m.") }
}

impl Part {
    /// Returns a sentence for people on the proof.
    fn sentence(&self) -> String {
        let ProvedBounds { lo: Some(lo), hi: Some(hi), proved_until, time: Some(at), .. } = self.proved else {
            return "Nothing of it could be proved.".to_owned();
        };
        match (proved_until, &self.obstacle) {
            (None, _) => proved_sentence((lo, hi)),
            (Some(until), None) => format!(
                "Proved: up to t = {until} s no two boards are nearer than {lo} m; at t = {at} s two are no further \
                 apart than {hi} m. Not decided beyond."
            ),
            (Some(until), Some(_)) => format!(
                "Proved: up to t = {until} s it is not less than {lo} m; at t = {at} s it is at most {hi} m. Not \
                 decided beyond."
            ),
        }
    }
}
