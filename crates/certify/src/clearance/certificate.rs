//! The lines of a certificate of the least clearance, beside its steps. See "The file" in `docs/proofs.md`.

use std::io;

use super::beside::{Beside, UpperBeside};
use super::{Descent, Finish, Part, Upper, Write};
use crate::first_order::When;
use crate::first_order_step::{FirstOrderStep, step_points};
use crate::grid::GridPoint;
use crate::interval::Interval;
use crate::lines::{
    About, CertificateLine, CertifiedClearance, CertifiedObstacleClearance, CertifiedResult, Links, Until, Witness,
};
use crate::place::{Place, Span};

/// An allowance for the rounding of the checker, in metres, which is added to an upper bound.
const SPARE: f64 = 1e-12;

/// Writes the first line.
pub(crate) fn first_line(write: Write<'_>, scene: &str) -> io::Result<()> {
    let (version, about) = (env!("CARGO_PKG_VERSION"), Some(About::LeastClearance));
    write(&CertificateLine::Certificate { format: crate::FORMAT, version, about, scene })
}

impl Descent<'_, '_> {
    /// Writes a line, unless there is no certificate or an earlier line could not be written.
    pub(super) fn write(&mut self, line: &CertificateLine) {
        if let (Some(write), None) = (&mut self.write, &self.failed) {
            self.failed = write(line).err();
        }
    }

    /// Returns the line that shows two boards to overlap with the head at `point`, the end of the last step.
    pub(super) fn overlap(&self, point: &GridPoint, benches: [usize; 2]) -> Option<CertificateLine<'static>> {
        let handles = self.chain.spans(&mut point.clone(), &mut point.clone(), benches[1] + 1)?;
        let common = self.chain.common_point(&handles, benches)?;
        let head = Span(point.head, point.head);
        let witness = Witness::of_one(None, benches.to_vec(), head, &handles);
        Some(CertificateLine::Witness(Witness { point: Some(common), ..witness }))
    }

    /// Writes that two boards, or a board and an obstacle, are near at a place of the head. Returns the upper bound of
    /// their clearance.
    fn write_witness(
        &mut self,
        obstacle: Option<usize>,
        benches: Vec<usize>,
        head: [Place; 2],
        travelled: f64,
    ) -> Option<f64> {
        let [mut from, mut to] = head.map(|place| GridPoint::at(place, travelled));
        let mut middle = from.clone();
        let mut step = FirstOrderStep::new(&self.chain, &step_points(&mut from, &mut middle, &mut to));
        while step.listed.handles.len() <= benches.last()? + 1 {
            step.extend(step_points(&mut from, &mut middle, &mut to), Links::All).ok()?;
        }
        let board = step.board(benches[0]);
        let most = match obstacle {
            Some(number) => self.chain.barriers[number].at_most(&board, When::Always),
            None => board.at_most(&step.board(benches[1]), When::Always),
        } + SPARE;
        let witness = Witness::of_one(obstacle, benches, Span(head[0], head[1]), &step.listed.handles);
        let line = CertificateLine::Witness(Witness { at: vec![step.places], most: Some(most), ..witness });
        self.write(&line);
        Some(most)
    }

    /// Writes that a board is near an obstacle, at a place that the steps have come to. Returns the upper bound.
    fn write_near_obstacle(&mut self, obstacle: usize, head_speed: f64) -> Option<f64> {
        let Beside { upper, shown, .. } = self.beside[obstacle];
        let (chain, (UpperBeside { head, travelled, bench, .. }, (_, end))) = (&self.chain, (upper?, shown?));
        let is_before = self.is_whole(obstacle) || self.is_by(head[0], end, head_speed);
        if !chain.exact.in_order(head[0], end) || !is_before {
            return None;
        }
        self.write_witness(Some(obstacle), vec![bench], head, travelled)
    }

    /// Returns the result for an obstacle.
    fn result_beside(&self, obstacle: usize, hi: Option<f64>, head_speed: f64) -> CertifiedObstacleClearance {
        let Beside { upper, shown, .. } = self.beside[obstacle];
        let bench = upper.filter(|_| hi.is_some()).map(|upper| upper.bench);
        let (until, time_until) = match self.is_whole(obstacle) {
            true => (Until::PathEnd, None),
            false => (Until::Time, Some(self.time_of(shown.map(|(_, end)| end), head_speed))),
        };
        let (lo, dragons) = (shown.map(|(least, _)| least), self.part.dragons.clone());
        CertifiedObstacleClearance { obstacle, lo, hi, until, time_until, bench, dragons }
    }

    /// Returns true if the clearance of an obstacle is shown from the start to the path's end.
    fn is_whole(&self, obstacle: usize) -> bool {
        let Beside { shown, is_lost, .. } = self.beside[obstacle];
        matches!(self.finish, Some(Finish::PathEnd)) && shown.is_some() && !is_lost
    }

    /// Returns a time by which the head has come to a place; 0 without a place.
    fn time_of(&self, place: Option<Place>, head_speed: f64) -> f64 {
        let Part { delay, show_end, .. } = self.part;
        let own = |end| self.chain.exact.travelled(end).over(Interval::point(head_speed));
        let time =
            |end| ((own(end) + Interval::point(delay)) * (1.0 - 1e-14)).lo.min(show_end.unwrap_or(f64::INFINITY));
        place.map_or(0.0, time).max(0.0)
    }

    /// Returns true if the head comes to a place by the time that is stated for the end of a stretch.
    fn is_by(&self, place: Place, end: Place, head_speed: f64) -> bool {
        let time = Interval::point(self.time_of(Some(end), head_speed));
        let until = (time - Interval::point(self.part.delay)) * head_speed;
        self.chain.exact.travelled(place).hi <= until.lo.max(0.0)
    }

    /// Writes that two boards are near, at a place that the steps have come to. Returns the upper bound.
    fn write_near(&mut self, Upper { head, travelled, benches, .. }: Upper, head_speed: f64) -> Option<f64> {
        let (chain, (_, end)) = (&self.chain, self.shown?);
        let is_before = matches!(self.finish, Some(Finish::PathEnd)) || self.is_by(head[0], end, head_speed);
        if !chain.exact.in_order(head[0], end) || !is_before {
            return None;
        }
        self.write_witness(None, benches.to_vec(), head, travelled)
    }

    /// Writes the last lines.
    ///
    /// # Errors
    /// A line cannot be written.
    pub(super) fn write_result(mut self, head_speed: f64) -> io::Result<()> {
        let near = self.upper.filter(|_| !matches!(self.finish, Some(Finish::Contact(_))));
        let hi = near.and_then(|upper| self.write_near(upper, head_speed));
        let benches = near.filter(|_| hi.is_some()).map(|upper| upper.benches);
        let beside: Vec<_> =
            (0..self.beside.len()).map(|obstacle| self.write_near_obstacle(obstacle, head_speed)).collect();
        let mut result = CertifiedClearance {
            lo: self.shown.map(|(least, _)| least),
            hi,
            until: Until::Time,
            time_until: None,
            bench_a: benches.map(|benches| benches[0]),
            bench_b: benches.map(|benches| benches[1]),
            dragons: self.part.dragons.clone(),
        };
        match self.finish {
            Some(Finish::PathEnd) => {
                self.write(&CertificateLine::PathEnd);
                match self.shown {
                    Some(_) => result.until = Until::PathEnd,
                    None => result.time_until = Some(0.0),
                }
            }
            Some(Finish::Contact([bench_a, bench_b])) => {
                let benches = (Some(bench_a), Some(bench_b));
                (result.lo, result.hi, (result.bench_a, result.bench_b)) = (Some(0.0), Some(0.0), benches);
                result.until = Until::Contact;
            }
            None => {
                result.time_until = Some(self.time_of(self.shown.map(|(_, end)| end), head_speed));
            }
        }
        self.write(&CertificateLine::Result(CertifiedResult::LeastClearance(result)));
        for (obstacle, hi) in beside.into_iter().enumerate() {
            let result = self.result_beside(obstacle, hi, head_speed);
            self.write(&CertificateLine::Result(CertifiedResult::ObstacleClearance(result)));
        }
        self.failed.map_or(Ok(()), Err)
    }
}
