//! The pieces of a route: lines, arcs, spirals, and turns from an inward spiral to an outward one.
//!
//! In: a table of `path.pieces` from serde. Out: [`RouteStep`]s, or one sentence about the wrong field.

use std::f64::consts::TAU;

use serde::Deserialize;
use toml::Spanned;

use super::{Accepted, SceneError, Source};
use bench_dragon_messages::sentence::number;
use bench_dragon_motion::model::curve::{Curve, Side};
use bench_dragon_motion::model::description::RouteStep;
use bench_dragon_motion::model::double_double::DoubleDouble;
use bench_dragon_motion::model::spiral::{Direction, Spiral};
use bench_dragon_motion::solve::reference::{Piece, Turn, TurnArcs};

/// The turns above which an arc is doubted: a dance has no ten rounds on one circle, and degrees are mostly above.
const MOST_ARC_TURNS: f64 = 10.0;
/// The radius of the first arc of a turn over that of the second, unless the scene has another.
pub const ARC_RATIO: f64 = 2.0;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPiece {
    kind: Kind,
    length: Option<Spanned<f64>>,
    radius: Option<Spanned<f64>>,
    turns: Option<Spanned<f64>>,
    side: Option<RawSide>,
    pitch: Option<Spanned<f64>>,
    direction: Option<RawDirection>,
    to_radius: Option<Spanned<f64>>,
    arc_ratio: Option<Spanned<f64>>,
}

#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Kind {
    Line,
    Arc,
    Spiral,
    Turn,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum RawDirection {
    In,
    Out,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum RawSide {
    Left,
    Right,
}

impl RawSide {
    fn side(self) -> Side {
        match self {
            Self::Left => Side::Left,
            Self::Right => Side::Right,
        }
    }
}

impl RawPiece {
    /// Checks the piece and adds its steps. `before` is what the piece before it leads to.
    pub(super) fn add_to(
        &self,
        steps: &mut Vec<RouteStep>,
        before: Option<Ending>,
        source: &Source,
        at: &Spanned<Self>,
    ) -> Result<Ending, SceneError> {
        let step = match (self.kind, before) {
            (Kind::Line, _) => self.line(source, at)?,
            (Kind::Arc, _) => self.arc(source, at)?,
            (Kind::Turn, Some(Ending::Inward(side, spiral))) => {
                let (arcs, after) = self.turn(side, spiral, source, at)?;
                steps.extend(arcs);
                return Ok(after);
            }
            (Kind::Turn, _) => {
                return Err(
                    source.field_error(at, "a turn has to follow an inward spiral, from which it leads outward")
                );
            }
            (Kind::Spiral, Some(Ending::Turned(side, spiral))) => self.spiral_after(side, spiral, source, at)?,
            (Kind::Spiral, _) => self.spiral(source, at)?,
        };
        steps.push(step);
        Ok(match step {
            RouteStep::Spiral { side, direction: Direction::Inward, pitch, radius, turns } => {
                let radius = radius.minus_product(pitch, turns);
                Ending::Inward(side, Piece { direction: Direction::Inward, pitch, radius })
            }
            _ => Ending::Any,
        })
    }

    fn line(&self, source: &Source, at: &Spanned<Self>) -> Result<RouteStep, SceneError> {
        match self {
            Self {
                kind: _,
                length: Some(length),
                radius: None,
                turns: None,
                side: None,
                pitch: None,
                direction: None,
                to_radius: None,
                arc_ratio: None,
            } => Ok(RouteStep::Line { length: checked(source, "length", length, Accepted::LEG)? }),
            _ => Err(source.field_error(at, "a line has a length and nothing else")),
        }
    }

    fn arc(&self, source: &Source, at: &Spanned<Self>) -> Result<RouteStep, SceneError> {
        let (
            Self { radius: Some(radius), side: Some(side), pitch: None, direction: None, arc_ratio: None, .. },
            Some(extent @ (Extent::Turns(_) | Extent::Length(_))),
        ) = (self, self.extent())
        else {
            return Err(source.field_error(
                at,
                "an arc has a radius, a side (\"left\" or \"right\") and either turns (0.25 is a quarter circle) or a \
                 length",
            ));
        };
        let radius = checked(source, "radius", radius, Accepted::LENGTH)?;
        let turns = match extent {
            Extent::Length(length) => {
                let metres = checked(source, "length", length, Accepted::LEG)?;
                as_turns(source, "length", length, metres / (TAU * radius))?;
                turns_of_arc(metres, radius)
            }
            Extent::Turns(given) | Extent::ToRadius(given) => {
                let turns = checked(source, "turns", given, Accepted::ARC_TURNS)?;
                if turns > MOST_ARC_TURNS {
                    let metres = turns * TAU * radius;
                    let sentence = format!(
                        "path.pieces.turns is {turns}, an arc of {metres:.0} m: degrees? 90 degrees are 0.25 turns"
                    );
                    source.doubt(given, &sentence);
                }
                turns.into()
            }
        };
        Ok(RouteStep::Arc { side: side.side(), turns, radius: radius.into() })
    }

    fn spiral(&self, source: &Source, at: &Spanned<Self>) -> Result<RouteStep, SceneError> {
        let (
            Self {
                pitch: Some(pitch),
                radius: Some(radius),
                side: Some(side),
                direction: Some(way),
                arc_ratio: None,
                ..
            },
            Some(extent),
        ) = (self, self.extent())
        else {
            return Err(source.field_error(
                at,
                "a spiral has a pitch, a radius (its distance from its centre where it begins), a direction (\"in\" or \
                 \"out\"), a side (\"left\" or \"right\") and one of turns around its centre, a length and a \
                 to_radius (its distance from its centre where it ends)",
            ));
        };
        let pitch = checked(source, "pitch", pitch, Accepted::LENGTH)?;
        let radius = checked(source, "radius", radius, Accepted::LENGTH)?.into();
        let direction = match way {
            RawDirection::In => Direction::Inward,
            RawDirection::Out => Direction::Outward,
        };
        extent.of_spiral(side.side(), Piece { direction, pitch, radius }, source)
    }

    /// Returns the outward spiral after a turn, which begins as the turn ends.
    fn spiral_after(
        &self,
        side: Side,
        spiral: Piece,
        source: &Source,
        at: &Spanned<Self>,
    ) -> Result<RouteStep, SceneError> {
        let is_outward = self.direction.is_none_or(|way| matches!(way, RawDirection::Out));
        match (self, self.extent()) {
            (Self { pitch: None, radius: None, side: None, arc_ratio: None, .. }, Some(extent)) if is_outward => {
                extent.of_spiral(side, spiral, source)
            }
            _ => Err(source.field_error(
                at,
                "the spiral after a turn leads outward about the same centre: it has one of turns, a length and a \
                 to_radius, and nothing else",
            )),
        }
    }

    /// Returns the two arcs of a turn after an inward spiral, whose place at the end is `spiral`.
    fn turn(
        &self,
        side: Side,
        spiral: Piece,
        source: &Source,
        at: &Spanned<Self>,
    ) -> Result<([RouteStep; 2], Ending), SceneError> {
        let Self {
            kind: _,
            length: None,
            radius: None,
            turns: None,
            side: None,
            pitch: None,
            direction: None,
            to_radius: None,
            arc_ratio,
        } = self
        else {
            return Err(source.field_error(
                at,
                "a turn has an arc_ratio (the radius of its first arc over that of its second, 2 without it) and \
                 nothing else",
            ));
        };
        let arc_ratio = match arc_ratio {
            Some(given) => checked(source, "arc_ratio", given, Accepted::ARC_RATIO)?,
            None => ARC_RATIO,
        };
        let Piece { direction: _, pitch, radius } = spiral;
        let arcs = Turn { pitch, radius, arc_ratio }.arcs();
        let TurnArcs { radii: [first, second], turns } =
            arcs.map_err(|error| source.field_error(at, &error.to_string()))?;
        let arcs = [
            RouteStep::Arc { side, radius: first, turns },
            RouteStep::Arc { side: side.opposite(), radius: second, turns },
        ];
        Ok((arcs, Ending::Turned(side.opposite(), Piece { direction: Direction::Outward, ..spiral })))
    }

    /// Returns the extent, if it is given once.
    fn extent(&self) -> Option<Extent<'_>> {
        match (&self.turns, &self.length, &self.to_radius) {
            (Some(turns), None, None) => Some(Extent::Turns(turns)),
            (None, Some(length), None) => Some(Extent::Length(length)),
            (None, None, Some(to_radius)) => Some(Extent::ToRadius(to_radius)),
            _ => None,
        }
    }
}

/// The end of a piece, on which the next piece may depend.
#[derive(Clone, Copy)]
pub(super) enum Ending {
    /// On an inward spiral, its centre on this side.
    Inward(Side, Piece),
    /// At the beginning of the outward spiral that a turn leads to.
    Turned(Side, Piece),
    Any,
}

/// The extent of a bent piece.
#[derive(Clone, Copy)]
enum Extent<'a> {
    Turns(&'a Spanned<f64>),
    Length(&'a Spanned<f64>),
    ToRadius(&'a Spanned<f64>),
}

impl Extent<'_> {
    /// Returns the spiral of this extent.
    fn of_spiral(self, side: Side, begin: Piece, source: &Source) -> Result<RouteStep, SceneError> {
        let Piece { direction, pitch, radius } = begin;
        let turns = match self {
            Self::Turns(given) => {
                let turns = checked(source, "turns", given, Accepted::ARC_TURNS)?;
                ends_before_centre(begin, turns, "turns", given, source)?;
                turns.into()
            }
            Self::Length(given) => {
                let metres = checked(source, "length", given, Accepted::LEG)?;
                let (spiral, first) = (Spiral::new(pitch, direction), DoubleDouble::from_turns(radius.high / pitch));
                let rough = spiral.advance(first, metres).minus(first).abs() / TAU;
                ends_before_centre(begin, rough, "length", given, source)?;
                let turns = begin.turns_of_metres(metres, as_turns(source, "length", given, rough)?);
                turns.map_err(|error| source.field_error(given, &error.to_string()))?
            }
            Self::ToRadius(given) => {
                let to_radius = checked(source, "to_radius", given, Accepted::LENGTH)?;
                let by = radius.plus(-to_radius);
                let (by, relation) = match direction {
                    Direction::Inward => (by, "less"),
                    Direction::Outward => (DoubleDouble { high: -by.high, low: -by.low }, "more"),
                };
                if by.high <= 0.0 {
                    let sentence = format!(
                        "path.pieces.to_radius is {}, expected {relation} than {} m, where the spiral begins",
                        number(to_radius),
                        number(radius.high)
                    );
                    return Err(source.field_error(given, &sentence));
                }
                let turns = by.over(pitch);
                as_turns(source, "to_radius", given, turns.high)?;
                turns
            }
        };
        Ok(RouteStep::Spiral { side, direction, pitch, radius, turns })
    }
}

/// Checks that an inward spiral ends as far from its centre as the tightest spiral may begin.
fn ends_before_centre(
    Piece { direction, pitch, radius }: Piece,
    turns: f64,
    field: &str,
    given: &Spanned<f64>,
    source: &Source,
) -> Result<(), SceneError> {
    if direction == Direction::Outward || radius.high - pitch * turns >= Accepted::LENGTH.least {
        return Ok(());
    }
    let begin = radius.over(pitch);
    let (most, unit) = if field == "turns" {
        (begin.high, "turns")
    } else {
        let spiral = Spiral::new(pitch, direction);
        (spiral.arc_length(DoubleDouble::from_turns(begin), DoubleDouble::ZERO), "metres")
    };
    let sentence = format!(
        "path.pieces.{field} is {}, which leads to the centre of the spiral or past it, expected less than {most:.3} \
         {unit}",
        number(*given.get_ref())
    );
    Err(source.field_error(given, &sentence))
}

fn checked(source: &Source, field: &str, value: &Spanned<f64>, accepted: Accepted) -> Result<f64, SceneError> {
    source.check(&format!("path.pieces.{field}"), value, accepted)
}

/// Checks the turns of a piece whose extent is given in another way.
fn as_turns(source: &Source, field: &str, given: &Spanned<f64>, turns: f64) -> Result<f64, SceneError> {
    let checked = Accepted::ARC_TURNS.check(&format!("path.pieces.{field} in turns"), turns);
    checked.map_err(|error| source.field_error(given, &error.to_string()))
}

/// Returns the turns of an arc of some metres, to 30 digits.
fn turns_of_arc(metres: f64, radius: f64) -> DoubleDouble {
    let rough = metres / (TAU * radius);
    let DoubleDouble { high, low } = DoubleDouble::from_turns(rough);
    let product = high * radius;
    let rest = (metres - product) - high.mul_add(radius, -product) - low * radius;
    DoubleDouble::sum(rough, rest / (TAU * radius))
}
