//! The `[path]` table: a spiral, a turnaround, or a route of lines, arcs and spirals.
//!
//! In: the table from serde. Out: a [`PathDescription`], or one sentence about the wrong field.

use std::f64::consts::TAU;

use serde::Deserialize;
use toml::Spanned;

use super::piece::RawPiece;
use super::{Accepted, SceneError, Source};
use bench_dragon_messages::sentence::number;
use bench_dragon_motion::linkage::follower;
use bench_dragon_motion::model::Vector;
use bench_dragon_motion::model::curve::Curve;
use bench_dragon_motion::model::description::PathDescription;
use bench_dragon_motion::model::double_double::DoubleDouble;
use bench_dragon_motion::model::path::Path;
use bench_dragon_motion::model::root::bisect_predicate;
use bench_dragon_motion::model::spiral::{Direction, Spiral};
use bench_dragon_motion::model::team::Team;

/// The greatest number of pieces of a route.
pub(crate) const MOST_STEPS: usize = 4096;
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
    pieces: Option<Spanned<Vec<Spanned<RawPiece>>>>,
}

impl RawPath {
    /// Returns the place where a route starts, in metres.
    pub(super) fn start(&self, source: &Source) -> Result<Vector, SceneError> {
        source.place("path.start", self.start.as_ref())
    }

    /// Checks the table and returns its path, in the path's own coordinates.
    pub(super) fn validated(&self, source: &Source, team: &Team) -> Result<PathDescription, SceneError> {
        match self.kind.get_ref().as_str() {
            "spiral" => self.spiral(source, team),
            "turnaround" => self.turnaround(source, team),
            "pieces" => self.route(source),
            other => {
                let sentence = format!("path.kind is \"{other}\", expected \"spiral\", \"turnaround\" or \"pieces\"");
                Err(source.field_error(&self.kind, &sentence))
            }
        }
    }

    /// Returns an error of the path as a whole.
    pub(super) fn error(&self, source: &Source, sentence: &str) -> SceneError {
        source.field_error(&self.kind, sentence)
    }

    /// Refuses fields that the kind does not have.
    fn only(&self, source: &Source, fields: &[&str]) -> Result<(), SceneError> {
        let refused = |field: &str, at: usize| {
            let (kind, fields) = (self.kind.get_ref(), fields.join(", "));
            let sentence = format!("path.{field} is given but path.kind is \"{kind}\", expected only {fields}");
            source.field_error_at(at, &sentence)
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
            source.field_error(&self.kind, &sentence)
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

    fn spiral(&self, source: &Source, team: &Team) -> Result<PathDescription, SceneError> {
        self.only(source, &["pitch", "start_turn"])?;
        let pitch = self.number(source, "pitch", &self.pitch, Accepted::LENGTH)?;
        let given = self.needed(source, "start_turn", &self.start_turn)?;
        let start_turn = source.check("path.start_turn", given, Accepted::START_TURN)?;
        if let Some(least) = least_legal_start(pitch, start_turn, team) {
            let sentence = format!(
                "path.start_turn is {}, which is so near the centre that a bench is folded back on itself, \
                 expected at least {least:.9}",
                number(start_turn)
            );
            return Err(source.field_error(given, &sentence));
        }
        Ok(PathDescription::Spiral { pitch, start_turn })
    }

    fn turnaround(&self, source: &Source, team: &Team) -> Result<PathDescription, SceneError> {
        self.only(source, &["pitch", "turn_radius", "arc_ratio", "start_turn", "lead_in", "lead_out"])?;
        let pitch_given = self.needed(source, "pitch", &self.pitch)?;
        let pitch = source.check("path.pitch", pitch_given, Accepted::LENGTH)?;
        let turn_radius = self.number(source, "turn_radius", &self.turn_radius, Accepted::LENGTH)?;
        let arc_ratio = self.number(source, "arc_ratio", &self.arc_ratio, Accepted::ARC_RATIO)?;
        let spiral = Spiral::new(pitch, Direction::Inward);
        let turn = DoubleDouble::from_turns(turn_radius / pitch);
        let lead_in = self.lead_in(source, &spiral, turn_radius / pitch)?;
        let start_turn = spiral.advance(turn, -lead_in).high / TAU;
        if let Some(least) = least_legal_start(pitch, start_turn, team) {
            let needed = spiral.arc_length(DoubleDouble::from_turns(least), turn);
            let sentence = format!(
                "the head starts so near the centre that a bench is folded back on itself, expected path.start_turn \
                 of at least {least:.9}, or path.lead_in of at least {needed:.9}"
            );
            return Err(source
                .field_error(self.start_turn.as_ref().or(self.lead_in.as_ref()).unwrap_or(pitch_given), &sentence));
        }
        let lead_out = match &self.lead_out {
            Some(given) => source.check("path.lead_out", given, Accepted::ROUTE)?,
            None => team.length(),
        };
        Ok(PathDescription::Turnaround { pitch, turn_radius, arc_ratio, lead_in, lead_out })
    }

    /// Returns the metres of path before the turn.
    fn lead_in(&self, source: &Source, spiral: &Spiral, turn: f64) -> Result<f64, SceneError> {
        match (&self.lead_in, &self.start_turn) {
            (Some(lead_in), Some(_)) => {
                let sentence = "path.lead_in and path.start_turn are both given, expected one of them";
                Err(source.field_error(lead_in, sentence))
            }
            (Some(lead_in), None) => source.check("path.lead_in", lead_in, Accepted::ROUTE),
            (None, Some(given)) => {
                let start_turn = source.check("path.start_turn", given, Accepted::START_TURN)?;
                if start_turn < turn {
                    let sentence = format!(
                        "path.start_turn is {}, which is inside the turn, expected at least {} \
                         (path.turn_radius / path.pitch)",
                        number(start_turn),
                        number(turn)
                    );
                    return Err(source.field_error(given, &sentence));
                }
                Ok(spiral.arc_length(DoubleDouble::from_turns(start_turn), DoubleDouble::from_turns(turn)))
            }
            (None, None) => {
                let sentence = "path.lead_in and path.start_turn are both missing, expected one of them";
                Err(source.field_error(&self.kind, sentence))
            }
        }
    }

    fn route(&self, source: &Source) -> Result<PathDescription, SceneError> {
        self.only(source, &["start", "heading_turns", "pieces"])?;
        let heading_turns = match &self.heading_turns {
            Some(given) => source.check("path.heading_turns", given, Accepted::HEADING)?,
            None => 0.0,
        };
        let given = self.needed(source, "pieces", &self.pieces)?;
        if given.get_ref().is_empty() || given.get_ref().len() > MOST_STEPS {
            let sentence = format!("path.pieces has {} pieces, expected from 1 to {MOST_STEPS}", given.get_ref().len());
            return Err(source.field_error(given, &sentence));
        }
        let mut steps = Vec::with_capacity(given.get_ref().len());
        let mut before = None;
        for piece in given.get_ref() {
            before = Some(piece.get_ref().add_to(&mut steps, before, source, piece)?);
        }
        Ok(PathDescription::Route { heading_turns, steps })
    }
}

/// Returns true if one Euler step of the paper's rules, `metres` long, ends where a bench is folded back on itself, or
/// at the centre.
pub(super) fn is_folded_after(pitch: f64, start_turn: f64, metres: f64, team: &Team) -> bool {
    let start = TAU * start_turn;
    let theta = start - metres * TAU / (pitch * start);
    theta.is_nan() || theta <= 0.0 || least_legal_start(pitch, theta / TAU, team).is_some()
}

/// Returns the least legal number of turns, rounded up to nine decimals, for an illegal start.
///
/// Only the first link of each length can be at or inside its fold: all other links of that length are further out.
fn least_legal_start(pitch: f64, start_turn: f64, team: &Team) -> Option<f64> {
    let spiral = Spiral::new(pitch, Direction::Inward);
    let folds = [0, 1].map(|bench| spiral.fold(team.link(bench)));
    let tail = team.own_tail().map(|tail| (tail, spiral.fold(team.link(tail))));
    let outside = |theta: f64, fold: Option<f64>| fold.is_none_or(|fold| theta > fold);
    let legal = |turns: f64| {
        let path = Path::spiral(pitch, turns);
        let head = path.param_at(0.0);
        outside(head.coordinate().high, folds[0])
            && (team.benches < 2
                || follower(&path, head, team.link(0)).is_ok_and(|second| outside(second.coordinate().high, folds[1])))
            && tail.is_none_or(|(tail, fold)| {
                let mut links = (0..tail).map(|bench| team.link(bench));
                // All handles are further out than the head's.
                outside(head.coordinate().high, fold)
                    || links
                        .try_fold(head, |front, link| follower(&path, front, link))
                        .is_ok_and(|front| outside(front.coordinate().high, fold))
            })
    };
    if legal(start_turn) {
        return None;
    }
    // Beyond all folds every start is legal.
    let folds = folds.into_iter().chain(tail.map(|(_, fold)| fold));
    let safe = folds.flatten().fold(start_turn, |most, fold| most.max(fold / TAU)) * 1.01;
    Some((bisect_predicate(legal, start_turn, safe) * 1e9).ceil() / 1e9)
}
