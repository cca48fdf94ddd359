//! The lines of a certificate: see "The file" in `docs/proofs.md`.

use std::io::{self, Write};

use serde::Serialize;

use super::capsule::Spanned;
use super::place::{Place, Span};
use bench_dragon_messages::state::EventKind;

/// The version of the file format.
pub const FORMAT: u32 = 4;

/// The difference of the two times of a proved event, in seconds, beyond which the search gives the reason.
pub const WIDE: f64 = 1e-9;

/// The links for which a step is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Links {
    /// All links.
    All,
    /// The links of boards 0 and 1. The other links follow from earlier steps.
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
        /// The question; `None` for events.
        #[serde(skip_serializing_if = "Option::is_none")]
        about: Option<About>,
        /// The text of the scene.
        scene: &'a str,
    },
    /// The follower of a link is not the first place at its distance, but the first one back from another place.
    Branch {
        /// 0 for the head's link, 2 for that of a tail with a size of its own, 1 for all others.
        link: usize,
        /// The first place of the front handle.
        from: Place,
        /// The last place of the front handle.
        to: Place,
        /// A place between the follower and all nearer places at the distance.
        behind: Place,
    },
    /// A step of the head.
    Step(Step),
    /// Boards that touch, or that are no further apart than a number of metres.
    Witness(Witness),
    /// The front product of a link is negative.
    Stall {
        /// The link, counted from 0.
        link: usize,
        /// The first place of the head.
        from: Place,
        /// The last place of the head.
        to: Place,
        /// The spans of the handles from 1 to the rear of the link.
        spans: Vec<Span>,
    },
    /// The follower of a link vanishes.
    Lock {
        /// The link, counted from 0.
        link: usize,
        /// The place to which the head goes from the end of the last step.
        to: Place,
        /// The spans of the handles from 1 to the link's front meanwhile.
        spans: Vec<Span>,
        /// Their spans at the end.
        last: Vec<Span>,
        /// Places behind and ahead of the follower that are nearer than the link; so are all places between in the end.
        #[serde(skip_serializing_if = "Option::is_none")]
        window: Option<Span>,
        /// Places behind and ahead of the follower that are further away than the link; so are all places between in the
        /// end.
        #[serde(skip_serializing_if = "Option::is_none")]
        beyond: Option<Span>,
    },
    /// The last step has reached the path's end.
    PathEnd,
    /// The lines about one of several dragons, or about two, follow.
    Section {
        /// The dragon or the two, counted from 0.
        dragons: Vec<usize>,
    },
    /// No boards of the two dragons touch from one time to another; in a certificate of the least clearance, no link
    /// locks.
    Both {
        /// The time of the show at which the stretch begins, in seconds.
        from: f64,
        /// The time of the show at which it ends, in seconds.
        to: f64,
        /// The spans of both heads meanwhile.
        heads: [Span; 2],
        /// The spans of the handles from 1 on of each.
        spans: [Vec<Span>; 2],
        /// The distance, in metres, that boards of the two keep at least, in a certificate of the least clearance.
        #[serde(skip_serializing_if = "Option::is_none")]
        apart: Option<f64>,
        /// A place of each span of each dragon, the heads' first, for `apart`.
        #[serde(skip_serializing_if = "no_places")]
        at: [Vec<Place>; 2],
    },
    /// A result.
    Result(CertifiedResult),
    /// The speeds of all handles over a step of the head.
    Speeds {
        /// The first place of the head.
        from: Place,
        /// The last place of the head.
        to: Place,
        /// The spans of the handles from 1 on.
        spans: Vec<Span>,
        /// A place of each span, the head's first.
        at: Vec<Place>,
    },
    /// The speed of a handle with the head at the first place of `at`.
    Fast {
        /// The handle, counted from 0.
        handle: usize,
        /// The spans of the handles from 1 on.
        spans: Vec<Span>,
        /// A place of each span, the head's first.
        at: Vec<Place>,
    },
    /// The question about the least pitch.
    Reach {
        /// The radius that the head is to reach, in metres from the centre.
        radius: f64,
        /// The least pitch that is tested, metres per turn.
        from: f64,
        /// The required clearance of boards, in metres.
        #[serde(skip_serializing_if = "is_zero")]
        clearance: f64,
    },
    /// Two boards overlap, or are nearer than the clearance, with all pitches of an interval. Coordinates are in units
    /// of pitch / 2 pi.
    Overlap {
        /// The least pitch, metres per turn.
        from: f64,
        /// The greatest pitch, metres per turn.
        to: f64,
        /// The polar angle of the head, in radians.
        theta: f64,
        /// The two benches, counted from 0.
        benches: [usize; 2],
        /// The spans of the handles from 1 on.
        spans: Vec<Span>,
        /// A point of both boards; with `other`, of the first.
        point: [f64; 2],
        /// A point of the second board.
        #[serde(skip_serializing_if = "Option::is_none")]
        other: Option<[f64; 2]>,
    },
    /// The head's link locks with all pitches of an interval.
    HeadLocks {
        /// The least pitch, metres per turn.
        from: f64,
        /// The greatest pitch, metres per turn.
        to: f64,
    },
    /// No boards touch further out than a radius. Steps on the spiral of this pitch follow.
    Far {
        /// The pitch, in metres per turn.
        pitch: f64,
        /// The radius, in metres from the centre.
        radius: f64,
    },
}

/// Two boards of one dragon, a board of each of two, or a board and an obstacle: they have a point in common, or are no
/// further apart than a number of metres.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Witness {
    /// The obstacle's number on the stage, the boundary last.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub obstacle: Option<usize>,
    /// The bench at the obstacle, or the two benches, counted from 0 within their dragons.
    pub benches: Vec<usize>,
    /// With two dragons, the time of the show, in seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// The spans of the heads: of the dragon, or of the two.
    pub heads: Vec<Span>,
    /// The spans of the handles from 1 on of each.
    pub spans: Vec<Vec<Span>>,
    /// A place of each span of each dragon, the head's first, for `most`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub at: Vec<Vec<Place>>,
    /// The common point, in metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub point: Option<[f64; 2]>,
    /// The bound, in metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub most: Option<f64>,
}

impl Witness {
    /// Returns a witness about one dragon with the handles from the head's on, without a point or a bound.
    pub(super) fn of_one(obstacle: Option<usize>, benches: Vec<usize>, head: Span, handles: &[Spanned]) -> Self {
        let spans = handles[1..].iter().map(|handle| handle.span).collect();
        let (heads, spans) = (vec![head], vec![spans]);
        Self { obstacle, benches, time: None, heads, spans, at: Vec::new(), point: None, most: None }
    }
}

/// The result of a section, or of a question about one dragon.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "of", rename_all = "snake_case")]
pub enum CertifiedResult {
    /// The first event of a kind.
    Event(CertifiedEvent),
    /// The least clearance of boards.
    LeastClearance(CertifiedClearance),
    /// The least clearance of an obstacle.
    ObstacleClearance(CertifiedObstacleClearance),
    /// The greatest speed.
    GreatestSpeed(CertifiedSpeed),
    /// The least pitch.
    LeastPitch(CertifiedPitch),
}

impl CertificateLine<'_> {
    /// Writes the line as JSON, with a line feed.
    ///
    /// # Errors
    /// The errors of the output.
    pub fn write(&self, output: &mut dyn Write) -> io::Result<()> {
        let mut line = serde_json::to_vec(self)?;
        line.push(b'\n');
        output.write_all(&line)
    }
}

/// The certified least pitch with which a team reaches a radius.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CertifiedPitch {
    /// The radius that the head is to reach, in metres from the centre.
    pub radius: f64,
    /// The least pitch that is tested, metres per turn.
    pub from: f64,
    /// The required clearance of boards that share no handle, in metres; 0 if they need only be apart.
    #[serde(skip_serializing_if = "is_zero")]
    pub clearance: f64,
    /// The lower pitch, in metres per turn: with every pitch from `from` to this one, two boards overlap or are nearer
    /// than `clearance`, or a link locks before.
    pub value_lo: Option<f64>,
    /// The higher pitch, in metres per turn: with it the head reaches the radius.
    pub value_hi: Option<f64>,
}

/// The question of a certificate that is not about events.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum About {
    /// The least clearance.
    LeastClearance,
    /// The greatest speed.
    GreatestSpeed,
    /// The least pitch.
    LeastPitch,
}

/// The certified greatest speed of the head at which no handle exceeds a limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CertifiedSpeed {
    /// The speed that no handle may exceed, in metres per second.
    pub limit: f64,
    /// The lower speed, in metres per second: if the head is no faster, no handle exceeds the limit.
    pub value_lo: f64,
    /// The higher speed, in metres per second: if the head is any faster, the handle exceeds the limit.
    pub value_hi: f64,
    /// The handle has at least this ratio to the head's speed at one place.
    pub ratio_lo: f64,
    /// No handle has a greater ratio to the head's speed.
    pub ratio_hi: f64,
    /// The handle, counted from 0.
    pub handle: usize,
    /// Simulated seconds up to which this holds, from the start on.
    pub time_until: f64,
}

/// The end of the stretch for which a least clearance is certified.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Until {
    /// The path's end.
    PathEnd,
    /// The first contact.
    Contact,
    /// A time.
    Time,
}

/// The certified least clearance, from the scene's start on.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CertifiedClearance {
    /// The lower bound, in metres: no two boards that share no handle are nearer.
    pub lo: Option<f64>,
    /// The upper bound, in metres: at one place the two benches are no further apart.
    pub hi: Option<f64>,
    /// The end of the stretch.
    pub until: Until,
    /// Simulated seconds of that end, for [`Until::Time`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_until: Option<f64>,
    /// The bench of the two that is nearer the head, or the bench of the first of two dragons, counted from 0.
    pub bench_a: Option<usize>,
    /// The other bench.
    pub bench_b: Option<usize>,
    /// In a show of several dragons, the dragon that the result is about, or the two, counted from 0. Benches are
    /// counted within each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub dragons: Vec<usize>,
}

/// The certified least clearance of an obstacle, from the scene's start on.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CertifiedObstacleClearance {
    /// The obstacle's number on the stage, the boundary last.
    pub obstacle: usize,
    /// The lower bound, in metres: no board's clearance is less.
    pub lo: Option<f64>,
    /// The upper bound, in metres: at one place the bench's clearance is no more.
    pub hi: Option<f64>,
    /// The end of the stretch: the path's end or a time.
    pub until: Until,
    /// Simulated seconds of that end, for [`Until::Time`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_until: Option<f64>,
    /// The bench, counted from 0.
    pub bench: Option<usize>,
    /// In a show of several dragons, the dragon that the result is about, counted from 0.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub dragons: Vec<usize>,
}

/// A step of the head, and the statements that hold throughout it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// The links that the step shows.
    pub links: Links,
    /// The first place of the head.
    pub from: Place,
    /// The last place of the head.
    pub to: Place,
    /// No link stalls in this step or before.
    pub moving: bool,
    /// No boards touch in this step or before.
    pub clear: bool,
    /// The spans of the handles from 1 on.
    pub spans: Vec<Span>,
    /// The obstacles that all boards avoid in this step and before.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub free: Vec<usize>,
    /// The distance that boards keep at least in this step, in metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub apart: Option<f64>,
    /// By obstacle: metres that its clearance is more than in this step, if it is claimed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub beside: Vec<Option<f64>>,
    /// A place of each span, the head's first, for `apart` and `beside`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub at: Vec<Place>,
}

/// The proved result for one kind of event.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CertifiedEvent {
    /// The kind of event.
    #[serde(serialize_with = "name")]
    pub event: EventKind,
    /// The number of the obstacle on the stage, the boundary last; `None` for other kinds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub obstacle: Option<usize>,
    /// In a show of several dragons, the dragon that the result is about, or the two, counted from 0. Benches are
    /// counted within each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub dragons: Vec<usize>,
    /// The result.
    #[serde(flatten)]
    pub status: Status,
}

/// A result for one kind of event.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "status", rename_all = "snake_case")]
pub enum Status {
    /// The first event of this kind is between two times.
    Proved {
        /// Earliest time, in simulated seconds.
        time_lo: f64,
        /// The latest time, in simulated seconds.
        time_hi: f64,
        /// The bench that stalls or locks, or the first of two that touch, at the latest time; counted from 0.
        bench_a: Option<usize>,
        /// The second bench.
        bench_b: Option<usize>,
        /// The reason why the times are further apart than [`WIDE`], in words.
        #[serde(skip_serializing_if = "Option::is_none")]
        because: Option<String>,
    },
    /// There is no such event before the motion ends.
    None {
        /// Simulated seconds up to which this is proved, if a lock ends the motion: the lock is later. `None` if the
        /// path's end ends the motion, and for the path's end itself.
        #[serde(skip_serializing_if = "Option::is_none")]
        time_lo: Option<f64>,
    },
    /// There is no such event before a time. Nothing is proved about later times.
    Undecided {
        /// Simulated seconds.
        time_lo: f64,
        /// The reason, in words.
        because: String,
    },
}

/// Returns true for the default of a number that is left out.
fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

fn no_places(at: &[Vec<Place>; 2]) -> bool {
    at.iter().all(Vec::is_empty)
}

fn name<S: serde::Serializer>(kind: &EventKind, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(kind.name())
}
