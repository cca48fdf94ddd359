//! The lines of a certificate: see "The file" in `docs/proofs.md`. The search writes them, a command prints its
//! results.

use serde::Serialize;

use super::capsule::Span;
use super::path::Place;
use bench_dragon_messages::state::EventKind;

/// The number of the file's form.
pub const FORMAT: u32 = 1;

/// Which links a step shows to hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Links {
    /// All of them.
    All,
    /// Those of boards 0 and 1: the others follow from what was shown before.
    Front,
}

/// A line of a certificate.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum CertificateLine<'a> {
    /// The first line.
    Certificate {
        /// [`FORMAT`].
        format: u32,
        /// The version of the program.
        version: &'a str,
        /// The text of the scene.
        scene: &'a str,
    },
    /// A step of the head.
    Step(Step),
    /// Two boards have a point in common.
    Contact {
        /// The two benches, counted from 0.
        benches: [usize; 2],
        /// The first place of the head.
        from: Place,
        /// The last place of the head.
        to: Place,
        /// Where the handles from 1 on are.
        spans: Vec<Span>,
        /// The point, metres.
        point: [f64; 2],
    },
    /// The front product of a link is negative.
    Stall {
        /// The link, counted from 0.
        link: usize,
        /// The first place of the head.
        from: Place,
        /// The last place of the head.
        to: Place,
        /// Where the handles from 1 to behind the link are.
        spans: Vec<Span>,
    },
    /// A link has no continuous follower.
    Lock {
        /// The link, counted from 0.
        link: usize,
        /// Where the head goes from the end of the last step.
        to: Place,
        /// Where the handles from 1 to the link's front are meanwhile.
        spans: Vec<Span>,
        /// Where they are at the end.
        last: Vec<Span>,
        /// Places behind and ahead of the link's follower that it cannot pass, where it vanishes.
        #[serde(skip_serializing_if = "Option::is_none")]
        window: Option<Span>,
        /// A place ahead of the follower that it cannot pass, and one that it would have to be at or ahead of, where a
        /// nearer place comes to be at the distance.
        #[serde(skip_serializing_if = "Option::is_none")]
        jump: Option<Span>,
    },
    /// The last step has come to the path's end.
    PathEnd,
    /// What follows for one kind of event.
    Result(CertifiedEvent),
}

/// A step of the head, and what holds all the while.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// The links that are shown.
    pub links: Links,
    /// Where the head begins.
    pub from: Place,
    /// Where the head ends.
    pub to: Place,
    /// No link stalls in this step or before.
    pub moving: bool,
    /// No boards touch in this step or before.
    pub clear: bool,
    /// Where the handles from 1 on are.
    pub spans: Vec<Span>,
}

/// What is proved of one kind of event.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CertifiedEvent {
    /// The kind.
    #[serde(serialize_with = "name")]
    pub event: EventKind,
    /// What is known.
    #[serde(flatten)]
    pub status: Status,
}

/// What is known of one kind of event.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "status", rename_all = "snake_case")]
pub enum Status {
    /// The first one is between two times.
    Proved {
        /// Simulated seconds, at the earliest.
        time_lo: f64,
        /// Simulated seconds, at the latest.
        time_hi: f64,
        /// The bench, counted from 0, or the first of two, of which it is true at the latest time.
        bench_a: Option<usize>,
        /// The second bench.
        bench_b: Option<usize>,
    },
    /// There is none before the motion ends.
    None {
        /// Simulated seconds: what is meant where a lock ends the motion, which happens after that. `None` where the
        /// path's end does, and for the path's end itself.
        #[serde(skip_serializing_if = "Option::is_none")]
        time_lo: Option<f64>,
    },
    /// There is none before a time; beyond that nothing is known.
    Undecided {
        /// Simulated seconds.
        time_lo: f64,
        /// Why not, in words.
        because: String,
    },
}

fn name<S: serde::Serializer>(kind: &EventKind, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(kind.name())
}
