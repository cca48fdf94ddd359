//! `check --prove` of several dragons: the least clearance of each alone, of each two, and of each obstacle.

use std::path::Path;

use bench_dragon::certify::{
    BetweenEnclosure, CertificateLine, CertifyError, ClearanceEnclosure, MOST_CLEARANCE_STEPS, ObstacleEnclosure,
    SeveralClearances, certify_several_clearances,
};
use bench_dragon::motion::ensemble::{Dragon, Ensemble};
use bench_dragon::motion::timeline::TimedEvent;
use bench_dragon::show::scene::{Scene, printable};
use serde::Serialize;

use super::super::{CommandError, Common, Output, progress_bar};
use super::{CertificateFile, ProvedBounds, proved_sentence};

/// The proved least clearance of one dragon, of one and an obstacle, or of two: a line of `check --prove --json`.
#[derive(Serialize)]
pub(super) struct Part {
    dragons: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    obstacle: Option<String>,
    #[serde(flatten)]
    proved: ProvedBounds,
    bench_a: Option<usize>,
    bench_b: Option<usize>,
    /// True for a dragon of which no two benches could meet.
    #[serde(skip)]
    is_empty: bool,
}

/// Encloses the least clearances of a show of several dragons. Writes the certificate to `file`.
pub(super) fn enclosed(
    (scene, ensemble, text): (&Scene, &Ensemble, &str),
    show_end: &TimedEvent,
    file: Option<&Path>,
    common: &Common,
) -> Result<Vec<Part>, CommandError> {
    let mut certificate = file.map(CertificateFile::create).transpose()?;
    let bar = progress_bar(1000, common).with_message("proving the least clearances");
    let mut write = |line: &CertificateLine| certificate.as_mut().map_or(Ok(()), |certificate| certificate.write(line));
    let mut progress = |share| bar.set_position((1000.0 * share) as u64);
    let found = certify_several_clearances(ensemble, show_end, text, MOST_CLEARANCE_STEPS, &mut write, &mut progress);
    bar.finish_and_clear();
    let found = found.map_err(|CertifyError::Write(error)| error)?;
    if let Some(certificate) = certificate {
        certificate.finish()?;
    }
    Ok(parts(scene, ensemble, &found))
}

/// Returns the proved clearances, in the order of the certificate.
fn parts(scene: &Scene, ensemble: &Ensemble, found: &SeveralClearances) -> Vec<Part> {
    let mut parts = Vec::new();
    for (k, own) in found.own.iter().enumerate() {
        parts.push(own_part(ensemble, k, own.boards));
        let obstacles = scene.ground().obstacles().iter().zip(&own.obstacles);
        parts.extend(obstacles.map(|(obstacle, found)| obstacle_part(ensemble, k, &obstacle.name, *found)));
    }
    parts.extend(found.between.iter().map(|between| between_part(ensemble, between)));
    parts
}

fn own_part(ensemble: &Ensemble, k: usize, found: Option<ClearanceEnclosure>) -> Part {
    let Dragon { name, motion, .. } = &ensemble.dragons()[k];
    let (time_at, first) = (times_of(ensemble, k), ensemble.handles_of(k).start);
    let proved = found.map(|found| ([found.lo, found.hi], found.until, found.travelled));
    Part {
        dragons: vec![name.clone()],
        obstacle: None,
        proved: ProvedBounds::of(proved, time_at),
        bench_a: found.map(|found| first + found.bench_a),
        bench_b: found.map(|found| first + found.bench_b),
        is_empty: motion.team().benches < 3,
    }
}

fn obstacle_part(ensemble: &Ensemble, k: usize, obstacle: &str, found: Option<ObstacleEnclosure>) -> Part {
    let (time_at, first) = (times_of(ensemble, k), ensemble.handles_of(k).start);
    let proved = found.map(|found| ([found.lo, found.hi], found.until, found.travelled));
    Part {
        dragons: vec![ensemble.dragons()[k].name.clone()],
        obstacle: Some(obstacle.to_owned()),
        proved: ProvedBounds::of(proved, time_at),
        bench_a: found.map(|found| first + found.bench),
        bench_b: None,
        is_empty: false,
    }
}

fn between_part(ensemble: &Ensemble, found: &BetweenEnclosure) -> Part {
    let BetweenEnclosure { dragons, lo, hi, time, benches, until } = *found;
    let number = |k: usize| hi.map(|_| ensemble.handles_of(dragons[k]).start + benches[k]);
    Part {
        dragons: dragons.map(|dragon| ensemble.dragons()[dragon].name.clone()).to_vec(),
        obstacle: None,
        proved: ProvedBounds::new(lo, hi, until, hi.map(|_| time)),
        bench_a: number(0),
        bench_b: number(1),
        is_empty: false,
    }
}

/// Returns the time of the show at some metres of a dragon's own travel.
fn times_of(ensemble: &Ensemble, k: usize) -> impl Fn(f64) -> f64 {
    let Dragon { delay, motion, .. } = &ensemble.dragons()[k];
    // A dragon stands at its start from the beginning on.
    move |travelled| if travelled <= 0.0 { 0.0 } else { delay + motion.time_at(travelled) }
}

/// Returns the bounds of the least clearance of any two boards, and whether it is proved to the end of the show.
pub(super) fn of_boards(parts: &[Part]) -> (Option<f64>, Option<f64>, bool) {
    let of_boards = || parts.iter().filter(|part| part.obstacle.is_none() && !part.is_empty);
    let least = |of: fn(&Part) -> Option<f64>| of_boards().filter_map(of).reduce(f64::min);
    let is_whole = of_boards().all(|part| part.proved.status == "proved");
    let lo = least(|part| part.proved.lo).filter(|_| is_whole);
    (lo, least(|part| part.proved.hi), is_whole)
}

/// Prints the proved clearances.
pub(super) fn print(parts: &[Part], output: &mut Output) -> Result<(), CommandError> {
    if let (Some(lo), Some(hi), true) = of_boards(parts) {
        output.line(&format!("  {}", proved_sentence((lo, hi), None, 0.0)))?;
    }
    for part in parts.iter().filter(|part| !part.is_empty) {
        let with = part.obstacle.iter().map(|name| format!("the {}", printable(name)));
        let names: Vec<String> = part.dragons.iter().cloned().chain(with).collect();
        let bounds = part.proved.lo.zip(part.proved.hi).zip(part.proved.time);
        let sentence = match bounds {
            Some((bounds, time)) => proved_sentence(bounds, part.proved.proved_until, time),
            None => "Nothing of it could be proved.".to_owned(),
        };
        output.line(&format!("  The least clearance of {}: {sentence}", names.join(" and ")))?;
    }
    Ok(())
}
