//! Reads the text of a scene: team, path and speed, in intervals that hold the real numbers of the text. Other fields
//! are ignored.

use serde::Deserialize;
use serde::de::IgnoredAny;

use super::branch::Branches;
use super::curve::Curve;
use super::elementary;
use super::ground::{Obstacle, StageText};
use super::interval::Interval;
use super::path::{Path, PathEnd, Segment};
use super::pieces::{PieceText, route};
use super::placement::{Mapping, PlacementText};
use super::problem::{Checked, ensure, problem};
use super::team::{Team, TeamText};

/// The greatest number of dragons.
const MOST_DRAGONS: usize = 16;

/// One dragon of the scene of a certificate.
pub(super) struct Scene {
    /// The name; empty in a scene of one dragon.
    pub name: String,
    /// The time of the show, in seconds, during which it stands at its start.
    pub delay: Interval,
    /// The place of the path on the stage.
    pub frame: Mapping,
    pub team: Team,
    pub path: Path,
    /// The speed of the head, in metres per second.
    pub head_speed: Interval,
    /// The obstacles in the path's own coordinates, the boundary last.
    pub obstacles: Vec<Obstacle>,
    /// The branches that the certificate states.
    pub branches: Branches,
}

/// The fields of a scene that a proof needs. The other fields concern the publisher.
#[derive(Deserialize)]
struct Text {
    team: TeamText,
    path: PathText,
    motion: MotionText,
    placement: Option<PlacementText>,
    stage: Option<StageText>,
}

/// The dragons of a scene with `[[dragons]]`.
#[derive(Deserialize)]
struct EnsembleText {
    #[serde(default)]
    dragons: Vec<DragonText>,
    team: Option<IgnoredAny>,
    stage: Option<StageText>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DragonText {
    name: String,
    #[serde(default)]
    delay: f64,
    team: TeamText,
    path: PathText,
    #[serde(default)]
    placement: PlacementText,
    motion: MotionText,
}

#[derive(Deserialize)]
struct MotionText {
    head_speed: f64,
    solver: Option<String>,
}

#[derive(Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
enum PathText {
    Spiral {
        pitch: f64,
        start_turn: f64,
    },
    Turnaround {
        pitch: f64,
        turn_radius: f64,
        arc_ratio: f64,
        start_turn: Option<f64>,
        lead_in: Option<f64>,
        lead_out: Option<f64>,
    },
    Pieces {
        #[serde(default)]
        start: [f64; 2],
        #[serde(default)]
        heading_turns: f64,
        pieces: Vec<PieceText>,
    },
}

/// Reads a text.
fn parsed<T: serde::de::DeserializeOwned>(text: &str) -> Checked<T> {
    toml::from_str(text).map_err(|error: toml::de::Error| problem!("{}", error.message().trim().replace('\n', ", ")))
}

impl Scene {
    /// Reads a scene.
    ///
    /// # Errors
    /// A sentence for a text that is not a scene.
    pub fn read(text: &str) -> Checked<Self> {
        let Text { team, path, motion, placement, stage } = parsed(text)?;
        let placement = placement.unwrap_or_default();
        Self::of(DragonText { name: String::new(), delay: 0.0, team, path, placement, motion }, stage.as_ref())
    }

    /// Reads the dragons of a scene with `[[dragons]]`; an empty list for a scene with `[team]`.
    ///
    /// # Errors
    /// A sentence for a text that is not a scene.
    pub fn read_ensemble(text: &str) -> Checked<Vec<Self>> {
        let EnsembleText { dragons, team, stage } = parsed(text)?;
        if dragons.len() > MOST_DRAGONS || !dragons.is_empty() && team.is_some() {
            return Err(problem!("expected [team], or from 1 to 16 [[dragons]]"));
        }
        dragons.into_iter().map(|dragon| Self::of(dragon, stage.as_ref())).collect()
    }

    fn of(text: DragonText, stage: Option<&StageText>) -> Checked<Self> {
        ensure!(
            text.delay.is_finite() && text.delay >= 0.0,
            "a delay is {:?}, expected a number that is not negative",
            text.delay
        );
        let team = text.team.read()?;
        let path = match &text.path {
            PathText::Spiral { pitch, start_turn } => spiral(*pitch, *start_turn)?,
            PathText::Turnaround { .. } => turnaround(&text.path, &team)?,
            PathText::Pieces { start, heading_turns, pieces } => route(*start, *heading_turns, pieces)?,
        };
        ensure!(
            text.motion.solver.as_deref() != Some("paper"),
            "the scene names the solver \"paper\", whose motion is not the exact one"
        );
        let head_speed = Interval::positive("motion.head_speed", text.motion.head_speed)?;
        let start = if let PathText::Pieces { start, .. } = &text.path { *start } else { [0.0; 2] };
        let frame = Mapping::new(&text.placement, start)?;
        let obstacles = stage.map_or_else(|| Ok(Vec::new()), |stage| stage.read(&frame))?;
        let (name, delay) = (text.name, Interval::new(text.delay));
        let branches = Branches::default();
        Ok(Self { name, delay, frame, team, path, head_speed, obstacles, branches })
    }

    /// Returns the seconds of the show at which the head has travelled some metres. Up to the path's start they are 0.
    /// If the metres may or may not be positive, the seconds begin at 0.
    pub fn time(&self, travelled: &Interval) -> Interval {
        let zero = Interval::new(0.0);
        let seconds = (travelled / self.head_speed).max(&zero);
        if !self.delay.is_positive() {
            seconds
        } else if travelled.is_positive() {
            seconds + self.delay
        } else if travelled.is_at_most(&zero) {
            zero
        } else {
            zero.hull(&(seconds + self.delay))
        }
    }

    /// Returns the metres that the head has travelled at a time of the show if it never comes to the path's end.
    pub fn travelled_by(&self, time: &Interval) -> Interval {
        ((time - self.delay) * self.head_speed).max(&Interval::new(0.0))
    }

    /// Returns the metres that the head has travelled at a time of the show.
    pub fn travelled_at(&self, time: &Interval) -> Interval {
        self.travelled_by(time).min(&self.path.length)
    }

    /// Returns the head's speed from one time of the show to another: 0 while it stands, and every speed between where
    /// that changes.
    pub fn speed_between(&self, from: &Interval, to: &Interval) -> Interval {
        let (zero, end) = (Interval::new(0.0), self.delay + self.path.length / self.head_speed);
        if to.is_at_most(&self.delay) || end.is_at_most(from) {
            zero
        } else if self.delay.is_at_most(from) && to.is_at_most(&end) {
            self.head_speed
        } else {
            zero.hull(&self.head_speed)
        }
    }

    /// Returns the same team in units of `unit` metres, on the inward spiral r = theta.
    pub fn in_units(&self, unit: &Interval) -> Self {
        Self { team: self.team.in_units(unit), ..self.on_spiral(Interval::new(1.0)) }
    }

    /// Returns the same team on the inward spiral r = a theta. The travel is measured from the centre, negative before
    /// it.
    pub fn on_spiral(&self, a: Interval) -> Self {
        let zero = Interval::new(0.0);
        let inward = Segment { curve: Curve::inward(a), begin: None, end: Some(zero) };
        let path = Path::new(vec![inward], zero, PathEnd::Coordinate(zero), zero);
        Self {
            name: String::new(),
            delay: zero,
            frame: Mapping::unmoved(),
            team: self.team.clone(),
            path,
            head_speed: self.head_speed,
            obstacles: Vec::new(),
            branches: Branches::default(),
        }
    }
}

/// Returns the metres of radius per radian.
fn growth(pitch: f64) -> Checked<Interval> {
    Ok(Interval::positive("path.pitch", pitch)? / elementary::turns(1.0))
}

fn spiral(pitch: f64, start_turn: f64) -> Checked<Path> {
    Interval::positive("path.start_turn", start_turn)?;
    let curve = Curve::inward(growth(pitch)?);
    let inward = Segment { curve, begin: None, end: Some(Interval::new(0.0)) };
    let start = elementary::turns(start_turn);
    let length = inward.curve.metres(&start, &Interval::new(0.0));
    Ok(Path::new(vec![inward], length, PathEnd::Coordinate(Interval::new(0.0)), length))
}

fn turnaround(text: &PathText, team: &Team) -> Checked<Path> {
    let PathText::Turnaround { pitch, turn_radius, arc_ratio, start_turn, lead_in, lead_out } = text else {
        return Err(problem!("the path is no turnaround"));
    };
    let a = growth(*pitch)?;
    let radius = Interval::positive("path.turn_radius", *turn_radius)?;
    let ratio = Interval::positive("path.arc_ratio", *arc_ratio)?;
    let turn = radius / a;
    let inward = Curve::inward(a);
    let lead_in = match (lead_in, start_turn) {
        (Some(metres), None) if *metres == 0.0 => Interval::new(0.0),
        (Some(metres), None) => Interval::positive("path.lead_in", *metres)?,
        (None, Some(turns)) => {
            // 2 pi start_turn is not less than turn_radius / a: both sides are divided by 2 pi and multiplied by the
            // pitch.
            let outside = radius.is_at_most(&(Interval::positive("path.start_turn", *turns)? * Interval::new(*pitch)));
            ensure!(outside, "path.start_turn is inside the turn");
            inward.metres(&elementary::turns(*turns), &turn)
        }
        _ => return Err(problem!("expected path.lead_in or path.start_turn, and not both")),
    };
    let lead_out = match lead_out {
        Some(metres) if *metres == 0.0 => Interval::new(0.0),
        Some(metres) => Interval::positive("path.lead_out", *metres)?,
        None => team.links(0, team.benches - 1),
    };
    let both = (radius.square() + a.square()).sqrt();
    let second_radius = both / (Interval::new(1.0) + ratio);
    let first_radius = second_radius * ratio;
    let angle = elementary::atan(&turn) * Interval::new(2.0);
    let at = inward.at(&turn);
    let first = Curve::arc(at.point, at.tangent, Interval::new(-1.0), first_radius);
    let middle = first.at(&angle);
    let second = Curve::arc(middle.point, middle.tangent, Interval::new(1.0), second_radius);
    let zero = || Some(Interval::new(0.0));
    let length = lead_in + both * angle + lead_out;
    let segments = vec![
        Segment { curve: inward, begin: None, end: Some(turn) },
        Segment { curve: first, begin: zero(), end: Some(angle) },
        Segment { curve: second, begin: zero(), end: Some(angle) },
        Segment { curve: Curve::outward(a), begin: Some(turn), end: None },
    ];
    Ok(Path::new(segments, lead_in, PathEnd::Travelled, length))
}
