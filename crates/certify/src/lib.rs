//! Events with a proof: enclosures of every handle over steps of the head, rounded outward, from which it follows when
//! contact, stall, lock and the path's end happen for the first time, or that they do not.
//!
//! In: a scene's motion, its events as the ordinary search found them, its text. Out: the lines of a certificate, and
//! what they prove. The `events` command calls it; `proof` checks what it writes, with code of its own. The ordinary
//! search only tells where to look: what it has missed makes the proof fail. Lemmas and file: `docs/proofs.md`.

mod boards;
mod capsule;
mod clearance;
mod elementary;
mod first_order;
mod first_order_step;
mod grid;
mod interval;
mod lines;
mod link;
mod lock;
mod path;
mod pitch;
pub mod plan;
mod search;
pub mod speed;
mod step;

use std::io;

pub use capsule::Span;
pub use clearance::{ClearanceEnclosure, MOST_CLEARANCE_STEPS, enclose_least_clearance};
pub use lines::{CertificateLine, CertifiedEvent, FORMAT, Links, Status, Step};
pub use path::Place;

use bench_dragon_motion::Motion;
use bench_dragon_motion::event::Event;
use bench_dragon_motion::model::description::PathDescription;
use bench_dragon_motion::model::path::Path;
use bench_dragon_motion::model::team::Team;
use bench_dragon_motion::timeline::Timeline;

/// Steps after which the search gives up where nothing else is requested: some minutes, and hundreds of megabytes.
pub const MOST_STEPS: u64 = 400_000;

/// Why there is no certificate.
#[derive(Debug, thiserror::Error)]
pub enum CertifyError {
    /// It cannot be written.
    #[error(transparent)]
    Write(#[from] io::Error),
}

/// What the search is given.
#[derive(Clone, Copy)]
pub(crate) struct Given<'a> {
    scene: &'a str,
    description: &'a PathDescription,
    path: &'a Path,
    team: &'a Team,
    head_speed: f64,
    events: &'a [Event],
    most_steps: u64,
}

/// Certifies the events of a motion. `scene` is the text that states it. Each line of the certificate is given to
/// `write`; `progress` gets the share of the motion that is done, from 0 to 1. After `most_steps` the search gives up.
///
/// # Errors
/// [`CertifyError::Write`]
pub fn certify(
    motion: &Motion,
    timeline: &Timeline,
    scene: &str,
    most_steps: u64,
    write: &mut dyn FnMut(&CertificateLine) -> io::Result<()>,
    progress: &mut dyn FnMut(f64),
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
    };
    search::CertificateSearch::new(given, write).run(progress)
}

#[cfg(test)]
mod tests;
