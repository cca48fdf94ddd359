//! The lines of a certificate (docs/proofs.md, "The file").

use serde::{Deserialize, Serialize};

use super::path::{Place, Span};
use super::witness::WitnessLine;

/// A line of a certificate.
#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum ParsedLine {
    Certificate {
        format: u32,
        version: String,
        #[serde(default)]
        about: About,
        scene: String,
    },
    Step {
        links: Links,
        from: Place,
        to: Place,
        moving: bool,
        clear: bool,
        spans: Vec<Span>,
        #[serde(default)]
        free: Vec<usize>,
        #[serde(default)]
        apart: Option<f64>,
        #[serde(default)]
        beside: Vec<Option<f64>>,
        #[serde(default)]
        at: Vec<Place>,
    },
    Branch {
        link: usize,
        from: Place,
        to: Place,
        behind: Place,
    },
    Witness(WitnessLine),
    Stall {
        link: usize,
        from: Place,
        to: Place,
        spans: Vec<Span>,
    },
    Lock {
        link: usize,
        to: Place,
        spans: Vec<Span>,
        last: Vec<Span>,
        #[serde(default)]
        window: Option<Span>,
        #[serde(default)]
        beyond: Option<Span>,
    },
    PathEnd {},
    Section {
        dragons: Vec<usize>,
    },
    Both {
        from: f64,
        to: f64,
        heads: [Span; 2],
        spans: [Vec<Span>; 2],
        #[serde(default)]
        apart: Option<f64>,
        #[serde(default)]
        at: [Vec<Place>; 2],
    },
    Result(ProvedResult),
    Speeds {
        from: Place,
        to: Place,
        spans: Vec<Span>,
        at: Vec<Place>,
    },
    Fast {
        handle: usize,
        spans: Vec<Span>,
        at: Vec<Place>,
    },
    Reach {
        radius: f64,
        from: f64,
        #[serde(default)]
        clearance: f64,
    },
    Overlap {
        from: f64,
        to: f64,
        theta: f64,
        benches: [usize; 2],
        spans: Vec<Span>,
        point: [f64; 2],
        #[serde(default)]
        other: Option<[f64; 2]>,
    },
    HeadLocks {
        from: f64,
        to: f64,
    },
    Far {
        pitch: f64,
        radius: f64,
    },
}

/// A result of a section, or of a question about one dragon.
#[derive(Deserialize)]
#[serde(tag = "of", rename_all = "snake_case")]
pub(super) enum ProvedResult {
    Event(ProvedEvent),
    LeastClearance(ProvedClearance),
    ObstacleClearance(ProvedObstacleClearance),
    GreatestSpeed(ProvedSpeed),
    LeastPitch(ProvedPitch),
}

impl ProvedResult {
    /// Returns the question that the result belongs to.
    pub fn about(&self) -> About {
        match self {
            Self::Event(_) => About::Events,
            Self::LeastClearance(_) | Self::ObstacleClearance(_) => About::LeastClearance,
            Self::GreatestSpeed(_) => About::GreatestSpeed,
            Self::LeastPitch(_) => About::LeastPitch,
        }
    }
}

/// The question that a certificate answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum About {
    #[default]
    Events,
    LeastClearance,
    GreatestSpeed,
    LeastPitch,
}

/// The links that a step shows.
#[derive(Deserialize, Clone, Copy, PartialEq)]
#[serde(rename_all = "snake_case")]
pub(super) enum Links {
    All,
    Front,
}

/// The kinds of events, in the order of the results.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// Two boards that share no handle touch.
    Contact,
    /// The front product of a link comes to 0.
    Stall,
    /// A link's follower ceases to exist.
    Lock,
    /// The path ends.
    PathEnd,
    /// A board comes within the keep-out of an obstacle.
    Obstacle,
}

/// The status of a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// The first such event is between two times.
    Proved,
    /// There is no such event before the motion ends; if a lock ends it, before `time_lo`.
    None,
    /// There is no such event before a time.
    Undecided,
}

/// The proved result for one kind of event.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProvedEvent {
    /// The kind of event.
    pub event: EventKind,
    /// The status.
    pub status: Status,
    /// The time, in seconds, before which the event does not happen.
    #[serde(default)]
    pub time_lo: Option<f64>,
    /// The time, in seconds, by which the event has happened.
    #[serde(default)]
    pub time_hi: Option<f64>,
    /// The bench of a link that has stalled or locked at `time_hi`, or the first of two that overlap then.
    #[serde(default)]
    pub bench_a: Option<usize>,
    /// The second bench.
    #[serde(default)]
    pub bench_b: Option<usize>,
    /// The number of the obstacle on the stage, from 0; the boundary is the last.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obstacle: Option<usize>,
    /// In a scene of several dragons, the dragon that the result is about, or the two, counted from 0. Benches are
    /// counted within each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub dragons: Vec<usize>,
    /// The reason for `undecided`, or for times far apart, from the program that wrote the certificate. The reason is
    /// not checked.
    #[serde(default)]
    pub because: Option<String>,
}

/// The end of the stretch for which a least clearance is proved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Until {
    /// The path's end.
    PathEnd,
    /// The first contact.
    Contact,
    /// A time.
    Time,
}

/// The proved least clearance, from the scene's start on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProvedClearance {
    /// The lower bound, in metres: no two boards that share no handle are nearer.
    #[serde(default)]
    pub lo: Option<f64>,
    /// The upper bound, in metres: at one place the two benches are no further apart.
    #[serde(default)]
    pub hi: Option<f64>,
    /// The end of the stretch.
    pub until: Until,
    /// The time of that end, in seconds, for [`Until::Time`].
    #[serde(default)]
    pub time_until: Option<f64>,
    /// The bench of the two that is nearer the head, or the bench of the first of two dragons, counted from 0.
    #[serde(default)]
    pub bench_a: Option<usize>,
    /// The other bench.
    #[serde(default)]
    pub bench_b: Option<usize>,
    /// In a scene of several dragons, the dragon that the result is about, or the two, counted from 0. Benches are
    /// counted within each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub dragons: Vec<usize>,
}

/// The proved least clearance of an obstacle, from the scene's start on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProvedObstacleClearance {
    /// The number of the obstacle on the stage, from 0; the boundary is the last.
    pub obstacle: usize,
    /// The lower bound, in metres: no board's clearance is less.
    #[serde(default)]
    pub lo: Option<f64>,
    /// The upper bound, in metres: at one place the bench's clearance is no more.
    #[serde(default)]
    pub hi: Option<f64>,
    /// The end of the stretch: the path's end or a time.
    pub until: Until,
    /// The time of that end, in seconds, for [`Until::Time`].
    #[serde(default)]
    pub time_until: Option<f64>,
    /// The bench, counted from 0.
    #[serde(default)]
    pub bench: Option<usize>,
    /// In a scene of several dragons, the dragon that the result is about, counted from 0.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub dragons: Vec<usize>,
}

/// The proved greatest speed of the head at which no handle exceeds a limit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProvedSpeed {
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
    /// The time up to which this holds from the scene's start on, in seconds at the scene's own speed.
    pub time_until: f64,
}

/// The proved least pitch with which a team reaches a radius on an inward spiral, from any distance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProvedPitch {
    /// The radius that the head is to reach, in metres from the centre.
    pub radius: f64,
    /// The least pitch that is looked at, metres per turn.
    pub from: f64,
    /// The required clearance of boards that share no handle, in metres; 0 if they need only be apart.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub clearance: f64,
    /// The lower pitch, in metres per turn: with every pitch from `from` to this one, two boards are nearer than
    /// `clearance` or overlap, or a link locks before.
    #[serde(default)]
    pub value_lo: Option<f64>,
    /// The higher pitch, in metres per turn: with it the head reaches the radius.
    #[serde(default)]
    pub value_hi: Option<f64>,
}

/// Returns true for the default of a number that is left out.
fn is_zero(number: &f64) -> bool {
    *number == 0.0
}
