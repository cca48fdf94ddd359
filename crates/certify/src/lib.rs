//! Certified events. The search encloses every handle over steps of the head, rounded outward. The enclosures show when
//! contact, stall, lock and path end first happen, or that they do not.
//!
//! In: a scene's motion, its text, and its events from the ordinary search. Out: the lines of a certificate and the
//! events that they prove. The crate `proof` checks the lines with code of its own. The ordinary search only suggests
//! where to search, so an event that it misses makes the proof fail. Lemmas and file format: `docs/proofs.md`.

mod between;
mod boards;
mod bracket;
mod branch;
mod capsule;
mod clearance;
mod elementary;
mod first_order;
mod first_order_step;
mod grid;
mod ground;
mod interval;
mod lines;
mod link;
mod lock;
mod path;
mod pitch;
mod place;
pub mod plan;
mod search;
mod spaced;
pub mod speed;
mod step;
mod turn;
mod walk;

use std::io;

pub use between::{BetweenEnclosure, EnsembleClearances, certify, certify_clearances};
pub use clearance::{
    ClearanceEnclosure, ClearanceEnclosures, ClearanceHints, MOST_CLEARANCE_STEPS, ObstacleEnclosure, Write,
};
pub use lines::{
    About, CertificateLine, CertifiedClearance, CertifiedEvent, CertifiedObstacleClearance, CertifiedPitch,
    CertifiedResult, CertifiedSpeed, FORMAT, Links, Status, Step, Until, WIDE, Witness,
};
pub use place::{Place, Span};

use bench_dragon_motion::Motion;
use bench_dragon_motion::event::{Event, Progress};
use bench_dragon_motion::model::description::PathDescription;
use bench_dragon_motion::model::path::Path;
use bench_dragon_motion::model::team::Team;
use bench_dragon_motion::timeline::Timeline;

/// The default limit of steps: some minutes, and hundreds of megabytes.
pub const MOST_STEPS: u64 = 400_000;

/// The reason for a missing certificate.
#[derive(Debug, thiserror::Error)]
pub enum CertifyError {
    /// The certificate cannot be written.
    #[error(transparent)]
    Write(#[from] io::Error),
}

/// Input of the search.
#[derive(Clone, Copy)]
pub(crate) struct Given<'a> {
    scene: &'a str,
    description: &'a PathDescription,
    path: &'a Path,
    team: &'a Team,
    head_speed: f64,
    events: &'a [Event],
    most_steps: u64,
    most_spans: usize,
    /// The number of the dragon and its delay in seconds, if it has a name.
    dragon: Option<(usize, f64)>,
}

/// Certifies the events of a dragon without a name. `scene` is the text of its scene. `write` receives each line of the certificate,
/// `progress` the share of the motion that is done, from 0 to 1. The search gives up after `most_steps`.
///
/// # Errors
/// [`CertifyError::Write`]
pub(crate) fn certify_alone(
    motion: &Motion,
    timeline: &Timeline,
    scene: &str,
    most_steps: u64,
    write: &mut dyn FnMut(&CertificateLine) -> io::Result<()>,
    progress: Progress<'_>,
) -> Result<Vec<CertifiedEvent>, CertifyError> {
    let events: Vec<Event> = timeline.events().iter().map(|timed| timed.event).collect();
    let given = Given {
        scene,
        description: motion.description(),
        path: motion.path(),
        team: motion.team(),
        head_speed: motion.head_speed(),
        events: &events,
        most_steps,
        most_spans: search::MOST_SPANS,
        dragon: None,
    };
    search::CertificateSearch::new(given, ground::barriers(motion), write).run(progress)
}

#[cfg(test)]
mod tests;
