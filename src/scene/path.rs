//! The `[path]` table: a spiral, a turnaround, or a route of lines and arcs.
//!
//! In: what serde has read. Out: a [`ScenePath`], or one sentence about the field that is wrong. Only [`super`] calls
//! the reading part.

use serde::Deserialize;
use toml::Spanned;

use super::{Accepted, SceneError, Source};
use crate::chain::Team;
use crate::geometry::path::Path;
use crate::geometry::pieces::{Leg, PiecePath, Shape, ShapeKind, Side};
use crate::geometry::root::first_true;
use crate::geometry::spiral::Spiral;
use crate::geometry::{Point, Vector};

/// The curve that a scene's handles ride.
#[derive(Debug, Clone, PartialEq)]
pub enum ScenePath {
    /// Inward along a spiral to its centre.
    Spiral(Spiral),
    /// A turnaround, or a route of lines and arcs.
    Pieces(PiecePath),
}

impl ScenePath {
    /// The spiral, where the path is nothing else.
    pub fn spiral(&self) -> Option<&Spiral> {
        match self {
            Self::Spiral(spiral) => Some(spiral),
            Self::Pieces(_) => None,
        }
    }

    /// Metres that the head can travel.
    pub fn length(&self) -> f64 {
        match self {
            Self::Spiral(spiral) => spiral.length(),
            Self::Pieces(path) => path.length(),
        }
    }

    /// What a drawing needs of each piece, in order.
    pub fn shapes(&self) -> Vec<Shape> {
        match self {
            Self::Spiral(spiral) => {
                let tangent = spiral.tangent(spiral.start());
                vec![Shape {
                    kind: ShapeKind::Inward { pitch: spiral.pitch(), first: spiral.start().radians(), last: 0.0 },
                    start: spiral.point(spiral.start()),
                    heading: tangent.y.atan2(tangent.x),
                    length: spiral.length(),
                }]
            }
            Self::Pieces(path) => path.shapes().collect(),
        }
    }

    /// The point at which the head is after so many metres of travel.
    pub fn head_point(&self, travelled: f64) -> Point {
        match self {
            Self::Spiral(spiral) => spiral.point(spiral.place_at(travelled)),
            Self::Pieces(path) => path.point(path.place_at(travelled)),
        }
    }
}

/// The most legs of a route: what a stage message has room for, less the line on which the team stands.
pub const MOST_LEGS: usize = crate::messages::MOST_PIECES - 1;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPath {
    kind: Spanned<String>,
    pitch: Option<Spanned<f64>>,
    start_turn: Option<Spanned<f64>>,
    turn_radius: Option<Spanned<f64>>,
    arc_ratio: Option<Spanned<f64>>,
    lead_in: Option<Spanned<f64>>,
    lead_out: Option<Spanned<f64>>,
    start: Option<Spanned<[f64; 2]>>,
    heading_turns: Option<Spanned<f64>>,
    pieces: Option<Spanned<Vec<Spanned<RawLeg>>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawLeg {
    kind: RawLegKind,
    length: Option<Spanned<f64>>,
    radius: Option<Spanned<f64>>,
    turns: Option<Spanned<f64>>,
    side: Option<RawSide>,
}

#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum RawLegKind {
    Line,
    Arc,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum RawSide {
    Left,
    Right,
}

impl RawPath {
    pub(super) fn validated(&self, source: &Source, team: &Team) -> Result<ScenePath, SceneError> {
        match self.kind.get_ref().as_str() {
            "spiral" => self.spiral(source, team).map(ScenePath::Spiral),
            "turnaround" => self.turnaround(source, team).map(ScenePath::Pieces),
            "pieces" => self.route(source, team).map(ScenePath::Pieces),
            other => {
                let sentence = format!("path.kind is \"{other}\", expected \"spiral\", \"turnaround\" or \"pieces\"");
                Err(source.wrong(&self.kind, &sentence))
            }
        }
    }

    /// Refuses fields that the kind does not have.
    fn only(&self, source: &Source, fields: &[&str]) -> Result<(), SceneError> {
        let refused = |field: &str, at: usize| {
            let (kind, fields) = (self.kind.get_ref(), fields.join(", "));
            let sentence = format!("path.{field} is given but path.kind is \"{kind}\", expected only {fields}");
            source.wrong_at(at, &sentence)
        };
        let numbers = [
            ("pitch", &self.pitch),
            ("start_turn", &self.start_turn),
            ("turn_radius", &self.turn_radius),
            ("arc_ratio", &self.arc_ratio),
            ("lead_in", &self.lead_in),
            ("lead_out", &self.lead_out),
            ("heading_turns", &self.heading_turns),
        ];
        let numbers = numbers.map(|(field, value)| (field, value.as_ref().map(|value| value.span().start)));
        let others = [
            ("start", self.start.as_ref().map(|value| value.span().start)),
            ("pieces", self.pieces.as_ref().map(|value| value.span().start)),
        ];
        for (field, given) in numbers.into_iter().chain(others) {
            if let Some(at) = given.filter(|_| !fields.contains(&field)) {
                return Err(refused(field, at));
            }
        }
        Ok(())
    }

    fn needed<'a, T>(
        &self,
        source: &Source,
        field: &str,
        value: &'a Option<Spanned<T>>,
    ) -> Result<&'a Spanned<T>, SceneError> {
        value.as_ref().ok_or_else(|| {
            let sentence = format!("path.{field} is missing, a path of kind \"{}\" needs it", self.kind.get_ref());
            source.wrong(&self.kind, &sentence)
        })
    }

    fn number(
        &self,
        source: &Source,
        field: &str,
        value: &Option<Spanned<f64>>,
        accepted: Accepted,
    ) -> Result<f64, SceneError> {
        source.check(&format!("path.{field}"), self.needed(source, field, value)?, accepted)
    }

    fn spiral(&self, source: &Source, team: &Team) -> Result<Spiral, SceneError> {
        self.only(source, &["pitch", "start_turn"])?;
        let pitch = self.number(source, "pitch", &self.pitch, Accepted::LENGTH)?;
        let given = self.needed(source, "start_turn", &self.start_turn)?;
        let start_turn = source.check("path.start_turn", given, Accepted::START_TURN)?;
        if let Some(least) = least_legal_start(pitch, start_turn, team) {
            let sentence = format!(
                "path.start_turn is {start_turn}, which is so near the centre that a bench is folded back on itself, \
                 expected at least {least:.9}"
            );
            return Err(source.wrong(given, &sentence));
        }
        Ok(Spiral::new(pitch, start_turn))
    }

    fn turnaround(&self, source: &Source, team: &Team) -> Result<PiecePath, SceneError> {
        self.only(source, &["pitch", "turn_radius", "arc_ratio", "start_turn", "lead_in", "lead_out"])?;
        let pitch_given = self.needed(source, "pitch", &self.pitch)?;
        let pitch = source.check("path.pitch", pitch_given, Accepted::LENGTH)?;
        let turn_radius = self.number(source, "turn_radius", &self.turn_radius, Accepted::LENGTH)?;
        let arc_ratio = self.number(source, "arc_ratio", &self.arc_ratio, Accepted::ARC_RATIO)?;
        let turn = Spiral::new(pitch, turn_radius / pitch);
        let lead_in = self.lead_in(source, &turn)?;
        if let Some(least) = least_legal_start(pitch, turn.place_at(-lead_in).in_turns(), team) {
            let needed = turn.distance_between(Spiral::new(pitch, least).start(), turn.start());
            let sentence = format!(
                "the head starts so near the centre that a bench is folded back on itself, expected path.start_turn \
                 of at least {least:.9}, or path.lead_in of at least {needed:.9}"
            );
            return Err(
                source.wrong(self.start_turn.as_ref().or(self.lead_in.as_ref()).unwrap_or(pitch_given), &sentence)
            );
        }
        let lead_out = match &self.lead_out {
            Some(given) => source.check("path.lead_out", given, Accepted::ROUTE)?,
            None => team_length(team),
        };
        PiecePath::turnaround(pitch, turn_radius, arc_ratio, lead_in, lead_out)
            .map_err(|error| source.wrong(&self.kind, &format!("the path has a gap: {error}")))
    }

    /// Metres of path before the turn.
    fn lead_in(&self, source: &Source, turn: &Spiral) -> Result<f64, SceneError> {
        match (&self.lead_in, &self.start_turn) {
            (Some(lead_in), Some(_)) => {
                let sentence = "path.lead_in and path.start_turn are both given, expected one of them";
                Err(source.wrong(lead_in, sentence))
            }
            (Some(lead_in), None) => source.check("path.lead_in", lead_in, Accepted::ROUTE),
            (None, Some(given)) => {
                let start_turn = source.check("path.start_turn", given, Accepted::START_TURN)?;
                if start_turn < turn.start_turn() {
                    let sentence = format!(
                        "path.start_turn is {start_turn}, which is inside the turn, expected at least {} \
                         (path.turn_radius / path.pitch)",
                        turn.start_turn()
                    );
                    return Err(source.wrong(given, &sentence));
                }
                Ok(turn.distance_between(Spiral::new(turn.pitch(), start_turn).start(), turn.start()))
            }
            (None, None) => {
                let sentence = "path.lead_in and path.start_turn are both missing, expected one of them";
                Err(source.wrong(&self.kind, sentence))
            }
        }
    }

    fn route(&self, source: &Source, team: &Team) -> Result<PiecePath, SceneError> {
        self.only(source, &["start", "heading_turns", "pieces"])?;
        let start = match &self.start {
            Some(given) => {
                for number in given.get_ref() {
                    Accepted::PLACE.check("path.start", *number).map_err(|sentence| source.wrong(given, &sentence))?;
                }
                Point::from(*given.get_ref())
            }
            None => Point::origin(),
        };
        let heading_turns = match &self.heading_turns {
            Some(given) => source.check("path.heading_turns", given, Accepted::HEADING)?,
            None => 0.0,
        };
        let given = self.needed(source, "pieces", &self.pieces)?;
        if given.get_ref().is_empty() || given.get_ref().len() > MOST_LEGS {
            let sentence = format!("path.pieces has {} pieces, expected from 1 to {MOST_LEGS}", given.get_ref().len());
            return Err(source.wrong(given, &sentence));
        }
        // The team stands in the wings: on a straight line behind the first piece.
        let wings = team_length(team) * (1.0 + 1e-9);
        let (sine, cosine) = (std::f64::consts::TAU * heading_turns).sin_cos();
        let first = start - wings * Vector::new(cosine, sine);
        let mut legs = vec![Leg::Line { length: wings }];
        for leg in given.get_ref() {
            legs.push(leg.get_ref().validated(source, leg)?);
        }
        PiecePath::route(first, heading_turns, &legs, wings)
            .map_err(|error| source.wrong(given, &format!("the path has a gap: {error}")))
    }
}

impl RawLeg {
    fn validated(&self, source: &Source, at: &Spanned<Self>) -> Result<Leg, SceneError> {
        let check = |field: &str, value: &Spanned<f64>, accepted: Accepted| {
            source.check(&format!("path.pieces.{field}"), value, accepted)
        };
        match (self.kind, &self.length, &self.turns, &self.radius, self.side) {
            (RawLegKind::Line, Some(length), None, None, None) => {
                Ok(Leg::Line { length: check("length", length, Accepted::LEG)? })
            }
            (RawLegKind::Line, ..) => Err(source.wrong(at, "a line has a length and nothing else")),
            (RawLegKind::Arc, length, turns, Some(radius), Some(side)) if length.is_some() != turns.is_some() => {
                let radius = check("radius", radius, Accepted::LENGTH)?;
                let turns = match (turns, length) {
                    (Some(turns), _) => check("turns", turns, Accepted::ARC_TURNS)?,
                    (None, Some(length)) => {
                        let turns = check("length", length, Accepted::LEG)? / (std::f64::consts::TAU * radius);
                        Accepted::ARC_TURNS
                            .check("path.pieces.length in turns", turns)
                            .map_err(|sentence| source.wrong(length, &sentence))?
                    }
                    // The guard has seen one of the two.
                    (None, None) => return Err(source.wrong(at, "an arc needs turns or a length")),
                };
                let side = match side {
                    RawSide::Left => Side::Left,
                    RawSide::Right => Side::Right,
                };
                Ok(Leg::Arc { side, turns, radius })
            }
            (RawLegKind::Arc, ..) => Err(source.wrong(
                at,
                "an arc has a radius, a side (\"left\" or \"right\") and either turns (0.25 is a quarter circle) or a \
                 length",
            )),
        }
    }
}

/// Metres from the first handle to the last, the team being stretched.
pub fn team_length(team: &Team) -> f64 {
    team.link(0) + team.link(1) * (team.benches - 1) as f64
}

/// Where a start is illegal, the least number of turns that is not, rounded up to nine decimals.
///
/// Only the first link of each length can be at or inside its fold: all others of that length are further out.
fn least_legal_start(pitch: f64, start_turn: f64, team: &Team) -> Option<f64> {
    let spiral = Spiral::new(pitch, start_turn);
    let folds = [0, 1].map(|bench| spiral.fold(team.link(bench)));
    let outside = |theta: f64, fold: Option<f64>| fold.is_none_or(|fold| theta > fold);
    let legal = |theta: f64| {
        outside(theta, folds[0])
            && (team.benches < 2
                || spiral
                    .follower(spiral.place_of_theta(theta), team.link(0))
                    .is_ok_and(|second| outside(second.radians(), folds[1])))
    };
    let start = spiral.start().radians();
    if legal(start) {
        return None;
    }
    // Beyond both folds every start is legal.
    let safe = folds.iter().flatten().fold(start, |most, fold| most.max(*fold)) * 1.01;
    let least = first_true(legal, start, safe);
    Some((least / std::f64::consts::TAU * 1e9).ceil() / 1e9)
}
