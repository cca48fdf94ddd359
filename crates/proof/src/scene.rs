//! Reads the text of a scene: team, path and speed, in intervals that hold the real numbers of the text. Other fields
//! are ignored.

use serde::Deserialize;
use serde::de::IgnoredAny;

use super::curve::{Curve, PieceText, read_piece};
use super::elementary;
use super::ground::{Mapping, Obstacle, PlacementText, StageText};
use super::interval::{Interval, Vector};
use super::path::{Path, PathEnd, Segment};

/// Limit of benches.
const MOST: usize = 1_000_000;
/// Limit of the pieces of a route, as in a show: the cost of a step grows with them.
const MOST_PIECES: usize = 4096;

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
}

/// The team of benches.
pub(super) struct Team {
    pub benches: usize,
    pub width: Interval,
    pub hole_inset: Interval,
    head_link: Interval,
    body_link: Interval,
}

impl Team {
    /// Returns the metres between the two handles of a bench.
    pub fn link(&self, bench: usize) -> &Interval {
        if bench == 0 { &self.head_link } else { &self.body_link }
    }

    /// Returns the metres of the links from bench `first` to bench `last` in one line.
    pub fn links(&self, first: usize, last: usize) -> Interval {
        self.link(first) + self.link(1) * Interval::new((last - first) as f64)
    }
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
#[serde(deny_unknown_fields)]
struct TeamText {
    benches: usize,
    head_length: f64,
    body_length: f64,
    width: f64,
    hole_inset: f64,
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
fn parsed<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, String> {
    toml::from_str(text).map_err(|error: toml::de::Error| error.message().trim().replace('\n', ", "))
}

pub(super) fn positive(field: &str, number: f64) -> Result<Interval, String> {
    if number.is_finite() && number > 0.0 {
        Ok(Interval::new(number))
    } else {
        Err(format!("{field} is {number:?}, expected a positive number"))
    }
}

fn finite(field: &str, number: f64) -> Result<Interval, String> {
    if number.is_finite() {
        Ok(Interval::new(number))
    } else {
        Err(format!("{field} is {number:?}, expected a number"))
    }
}

impl Scene {
    /// Reads a scene.
    ///
    /// # Errors
    /// A sentence for a text that is not a scene.
    pub fn read(text: &str) -> Result<Self, String> {
        let Text { team, path, motion, placement, stage } = parsed(text)?;
        let placement = placement.unwrap_or_default();
        Self::of(DragonText { name: String::new(), delay: 0.0, team, path, placement, motion }, stage.as_ref())
    }

    /// Reads the dragons of a scene with `[[dragons]]`; an empty list for a scene with `[team]`.
    ///
    /// # Errors
    /// A sentence for a text that is not a scene.
    pub fn read_ensemble(text: &str) -> Result<Vec<Self>, String> {
        let EnsembleText { dragons, team, stage } = parsed(text)?;
        if dragons.len() > MOST_DRAGONS || !dragons.is_empty() && team.is_some() {
            return Err("expected [team], or from 1 to 16 [[dragons]]".to_owned());
        }
        dragons.into_iter().map(|dragon| Self::of(dragon, stage.as_ref())).collect()
    }

    fn of(text: DragonText, stage: Option<&StageText>) -> Result<Self, String> {
        if !(text.delay.is_finite() && text.delay >= 0.0) {
            return Err(format!("a delay is {:?}, expected a number that is not negative", text.delay));
        }
        let team = text.team.read()?;
        let path = match &text.path {
            PathText::Spiral { pitch, start_turn } => spiral(*pitch, *start_turn)?,
            PathText::Turnaround { .. } => turnaround(&text.path, &team)?,
            PathText::Pieces { start, heading_turns, pieces } => route(*start, *heading_turns, pieces)?,
        };
        if text.motion.solver.as_deref() == Some("paper") {
            return Err("the scene names the solver \"paper\", whose motion is not the exact one".to_owned());
        }
        let head_speed = positive("motion.head_speed", text.motion.head_speed)?;
        let start = if let PathText::Pieces { start, .. } = &text.path { *start } else { [0.0; 2] };
        let frame = Mapping::new(&text.placement, start)?;
        let obstacles = stage.map_or_else(|| Ok(Vec::new()), |stage| stage.read(&frame))?;
        let (name, delay) = (text.name, Interval::new(text.delay));
        Ok(Self { name, delay, frame, team, path, head_speed, obstacles })
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
        let Team { benches, width, hole_inset, head_link, body_link } = &self.team;
        let team = Team {
            benches: *benches,
            width: width / unit,
            hole_inset: hole_inset / unit,
            head_link: head_link / unit,
            body_link: body_link / unit,
        };
        Self { team, ..self.on_spiral(Interval::new(1.0)) }
    }

    /// Returns the same team on the inward spiral r = a theta. The travel is measured from the centre, negative before
    /// it.
    pub fn on_spiral(&self, a: Interval) -> Self {
        let Team { benches, width, hole_inset, head_link, body_link } = self.team;
        let team = Team { benches, width, hole_inset, head_link, body_link };
        let zero = Interval::new(0.0);
        let inward = Segment { curve: Curve::inward(a), begin: None, end: Some(zero) };
        let path = Path::new(vec![inward], zero, PathEnd::Coordinate(zero), zero);
        Self {
            name: String::new(),
            delay: zero,
            frame: Mapping::unmoved(),
            team,
            path,
            head_speed: self.head_speed,
            obstacles: Vec::new(),
        }
    }
}

impl TeamText {
    fn read(&self) -> Result<Team, String> {
        if self.benches == 0 || self.benches > MOST {
            return Err(format!("team.benches is {}, expected from 1 to {MOST}", self.benches));
        }
        let hole_inset = positive("team.hole_inset", self.hole_inset)?;
        let link = |field: &str, length: f64| {
            let link = positive(field, length)? - Interval::new(2.0) * hole_inset;
            if link.is_positive() { Ok(link) } else { Err(format!("{field} leaves no bench between its holes")) }
        };
        Ok(Team {
            benches: self.benches,
            width: positive("team.width", self.width)?,
            head_link: link("team.head_length", self.head_length)?,
            body_link: link("team.body_length", self.body_length)?,
            hole_inset,
        })
    }
}

/// Returns the metres of radius per radian.
fn growth(pitch: f64) -> Result<Interval, String> {
    Ok(positive("path.pitch", pitch)? / elementary::turns(1.0))
}

fn spiral(pitch: f64, start_turn: f64) -> Result<Path, String> {
    positive("path.start_turn", start_turn)?;
    let curve = Curve::inward(growth(pitch)?);
    let inward = Segment { curve, begin: None, end: Some(Interval::new(0.0)) };
    let start = elementary::turns(start_turn);
    let length = inward.curve.metres(&start, &Interval::new(0.0));
    Ok(Path::new(vec![inward], length, PathEnd::Coordinate(Interval::new(0.0)), length))
}

fn turnaround(text: &PathText, team: &Team) -> Result<Path, String> {
    let PathText::Turnaround { pitch, turn_radius, arc_ratio, start_turn, lead_in, lead_out } = text else {
        return Err("the path is no turnaround".to_owned());
    };
    let a = growth(*pitch)?;
    let radius = positive("path.turn_radius", *turn_radius)?;
    let ratio = positive("path.arc_ratio", *arc_ratio)?;
    let turn = radius / a;
    let inward = Curve::inward(a);
    let lead_in = match (lead_in, start_turn) {
        (Some(metres), None) if *metres == 0.0 => Interval::new(0.0),
        (Some(metres), None) => positive("path.lead_in", *metres)?,
        (None, Some(turns)) => {
            // 2 pi start_turn is not less than turn_radius / a: both sides are divided by 2 pi and multiplied by the
            // pitch.
            let outside = radius.is_at_most(&(positive("path.start_turn", *turns)? * Interval::new(*pitch)));
            if !outside {
                return Err("path.start_turn is inside the turn".to_owned());
            }
            inward.metres(&elementary::turns(*turns), &turn)
        }
        _ => return Err("expected path.lead_in or path.start_turn, and not both".to_owned()),
    };
    let lead_out = match lead_out {
        Some(metres) if *metres == 0.0 => Interval::new(0.0),
        Some(metres) => positive("path.lead_out", *metres)?,
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

fn route(start: [f64; 2], heading_turns: f64, pieces: &[PieceText]) -> Result<Path, String> {
    if pieces.is_empty() || pieces.len() > MOST_PIECES {
        return Err(format!("path.pieces has {} pieces, expected from 1 to {MOST_PIECES}", pieces.len()));
    }
    finite("path.heading_turns", heading_turns)?;
    finite("path.start", start[0]).and(finite("path.start", start[1]))?;
    // The route in its own coordinates: no statement of a certificate depends on the place of its start.
    let mut origin = Vector { x: Interval::new(0.0), y: Interval::new(0.0) };
    // Directions follow from the angle turned so far: the product of thousands of rotations would be too wide.
    let mut heading = elementary::turns(heading_turns);
    let zero = || Interval::new(0.0);
    let behind = Curve::line(origin, &heading);
    let mut segments = vec![Segment { curve: behind, begin: None, end: Some(zero()) }];
    let (mut length, mut end) = (zero(), zero());
    for piece in pieces {
        let (curve, begin, turned);
        (curve, begin, end, turned) = read_piece(piece, origin, &heading)?;
        length = length + curve.metres(&begin, &end);
        origin = curve.at(&end).point;
        heading = heading + turned;
        segments.push(Segment { curve, begin: Some(begin), end: Some(end) });
    }
    // The last segment continues beyond the path's end.
    if let Some(last) = segments.last_mut() {
        last.end = None;
    }
    Ok(Path::new(segments, zero(), PathEnd::Coordinate(end), length))
}
