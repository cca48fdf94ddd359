//! The chain to more than 30 digits, by an independent method, against which the solvers are measured.
//!
//! In: a path by the numbers of the scene, a team and a time. Out: every handle as sums of two doubles. Points are
//! Cartesian, and the condition on a follower is the plain distance of two points, because no formula is rearranged to
//! save digits. The method shares only names with the path, the linkage and the solvers in doubles, and takes some
//! milliseconds a frame. `trade` and tests use it, and so does a scene, for the turns of a spiral whose length is
//! given.

mod curve;
mod path;
mod real;
mod trace;
mod walk;

#[cfg(test)]
mod tests;

use self::curve::RealParam;
use self::path::RealPath;
use self::real::Real;
use self::trace::{Trace, place_behind};
use self::walk::Walk;
use crate::linkage::NoFollower;
use crate::model::description::PathDescription;
use crate::model::double_double::DoubleDouble;
use crate::model::spiral::Direction;
use crate::model::team::Team;

/// The reason for a missing reference.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ReferenceError {
    /// There is no memory for the constants pi and ln 2.
    #[error("the high-precision reference: {0:?}")]
    NoMemory(astro_float::Error),
    /// The path has tight bends and is too long.
    #[error("the path has tight bends and is too long for the reference with 38 digits")]
    TooLong,
}

/// One handle of the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceHandle {
    /// The coordinate to the right of the centre, in metres.
    pub x: DoubleDouble,
    /// The coordinate up from the centre, in metres.
    pub y: DoubleDouble,
    /// Signed speed along the path, in metres per second.
    pub speed: f64,
}

/// A spiral piece of a route, without its end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece {
    /// Towards the centre or away from it.
    pub direction: Direction,
    /// The pitch, in metres per turn.
    pub pitch: f64,
    /// The distance from the centre to its beginning, in metres.
    pub radius: DoubleDouble,
}

/// The S of two arcs that leads from an inward spiral to the outward spiral about the same centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    /// The pitch of both spirals, in metres per turn.
    pub pitch: f64,
    /// The distance from the centre to its beginning and to its end, in metres.
    pub radius: DoubleDouble,
    /// The radius of the first arc over the radius of the second.
    pub arc_ratio: f64,
}

/// The arcs of a [`Turn`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TurnArcs {
    /// The radii, in metres, in the order of travel.
    pub radii: [DoubleDouble; 2],
    /// The change of direction of each of the two, in turns.
    pub turns: DoubleDouble,
}

impl Turn {
    /// Returns the arcs, to 30 digits.
    ///
    /// # Errors
    /// [`ReferenceError::NoMemory`]
    pub fn arcs(self) -> Result<TurnArcs, ReferenceError> {
        curve::arcs_of_turn(self)
    }
}

impl Piece {
    /// Returns the turns around the centre of the first `metres`, to 30 digits. `rough` is the double nearest to them
    /// that is known.
    ///
    /// # Errors
    /// [`ReferenceError::NoMemory`]
    pub fn turns_of_metres(self, metres: f64, rough: f64) -> Result<DoubleDouble, ReferenceError> {
        curve::turns_of_metres(self, metres, rough)
    }
}

/// The exact motion of one team on one path.
pub struct Reference {
    team: Team,
    path: RealPath,
    head_speed: f64,
    /// By length of a link; `None` where the follower is the first place everywhere.
    traces: Vec<(f64, Option<Trace>)>,
}

/// A handle on the path.
struct Seat {
    segment: usize,
    place: RealParam,
    /// Change of the coordinate per second.
    rate: Real,
}

impl Reference {
    /// Creates the reference for `team` on the path of `description`, the head moving at `head_speed` metres per second
    /// along the curve.
    ///
    /// # Errors
    /// [`ReferenceError`]
    pub fn new(team: Team, description: &PathDescription, head_speed: f64) -> Result<Self, ReferenceError> {
        let path = RealPath::new(description)?;
        if [0, 1, team.benches - 1].into_iter().any(|bench| trace::is_too_long(&path, team.link(bench))) {
            return Err(ReferenceError::TooLong);
        }
        Ok(Self { team, path, head_speed, traces: Vec::new() })
    }

    /// Returns all handles at `time` simulated seconds, the head first.
    ///
    /// # Errors
    /// [`NoFollower`] if a link has no follower; if its front handle is on an inward spiral, on the first rise of the
    /// chord.
    pub fn handles(&mut self, time: f64) -> Result<Vec<ReferenceHandle>, NoFollower> {
        Ok(self.seats(time)?.iter().map(|seat| self.handle(seat)).collect())
    }

    fn handle(&self, Seat { segment, place, rate }: &Seat) -> ReferenceHandle {
        let curve = &self.path.segment(*segment).curve;
        let speed = curve.forward() * (rate * curve.rate(&place.at)).rounded();
        ReferenceHandle { x: place.point.x.split(), y: place.point.y.split(), speed }
    }

    fn seats(&mut self, time: f64) -> Result<Vec<Seat>, NoFollower> {
        let head_speed = Real::from(self.head_speed);
        let (segment, place) = self.path.place_at(&(&head_speed * Real::from(time)));
        let curve = &self.path.segment(segment).curve;
        let rate = Real::from(curve.forward()) * head_speed / curve.rate(&place.at);
        let mut seats = vec![Seat { segment, place, rate }];
        for bench in 0..self.team.benches {
            let front = &seats[bench];
            let (segment, place) = self.follower(front.segment, &front.place, self.team.link(bench))?;
            let front = &seats[bench];
            // Both ends of a link have the same velocity along it.
            let link = &front.place.point - &place.point;
            let rate = &front.rate * front.place.slope.dot(&link) / place.slope.dot(&link);
            seats.push(Seat { segment, place, rate });
        }
        Ok(seats)
    }

    /// Returns the follower: a guess by a walk back in doubles, then Newton's method.
    ///
    /// The guess is the first place at the distance, or the one that continues it, up to the rounding of doubles. The
    /// result of Newton's method counts as the same place if it is within a millionth of the link and the distance grows
    /// backward there.
    fn follower(&mut self, segment: usize, front: &RealParam, link: f64) -> Result<(usize, RealParam), NoFollower> {
        let (mut segment, guess) = self.guess(segment, front, link)?;
        let mut place = self.settled(segment, front, guess.clone(), link)?;
        // Near a junction the place may be on a segment next to the segment of the guess.
        for _ in 0..self.path.segments() {
            let Some((neighbour, junction)) = self.neighbour(segment, &place) else { break };
            segment = neighbour;
            place = self.settled(segment, front, junction, link)?;
        }
        let (moved, toward) = (&place.point - &guess.point, &front.point - &place.point);
        let grows = self.path.segment(segment).curve.forward() * place.slope.dot(&toward).rounded();
        if grows > 0.0 && moved.rounded().norm() <= 1e-6 * link { Ok((segment, place)) } else { Err(NoFollower) }
    }

    fn guess(&mut self, segment: usize, front: &RealParam, link: f64) -> Result<(usize, RealParam), NoFollower> {
        let known = self.traces.iter().position(|(length, _)| *length == link);
        let trace = known.unwrap_or_else(|| {
            self.traces.push((link, Trace::new(&self.path, link)));
            self.traces.len() - 1
        });
        let trace = self.traces[trace].1.as_ref();
        let ahead = trace.map_or(Ok(None), |trace| trace.ahead(&self.path, segment, front))?;
        let ahead = ahead.map(|(segment, back)| (segment, place_behind(&mut self.path, segment, back)));
        let (segment, place) = ahead.as_ref().map_or((segment, front), |(segment, place)| (*segment, place));
        for index in (0..=segment).rev() {
            let on = self.path.segment(index);
            let from = if index == segment { place } else { &on.last };
            if let Some(back) = Walk::new(on, index == 0, from, front).first_at(link)? {
                let by = Real::from(-on.curve.forward() * back);
                let from = from.clone();
                return Ok((index, self.path.moved(index, &from, &by)));
            }
        }
        Err(NoFollower)
    }

    /// Newton's method on the square of the distance from `front`, from a place on a segment, which continues beyond
    /// its ends.
    fn settled(
        &mut self,
        segment: usize,
        front: &RealParam,
        from: RealParam,
        link: f64,
    ) -> Result<RealParam, NoFollower> {
        let square = Real::from(link).square();
        let mut place = from;
        for _ in 0..60 {
            let offset = &place.point - &front.point;
            let excess = offset.dot(&offset) - &square;
            let step = -(excess / (Real::from(2.0) * place.slope.dot(&offset)));
            place = self.path.moved(segment, &place, &step);
            let metres = step.rounded().abs() * place.slope.rounded().norm();
            // The next step is the square of this one.
            if metres <= 1e-20 * link {
                return Ok(place);
            }
        }
        Err(NoFollower)
    }

    /// Returns the neighbouring segment beyond whose end a place is, and the place on it where the two join.
    fn neighbour(&self, segment: usize, place: &RealParam) -> Option<(usize, RealParam)> {
        let on = self.path.segment(segment);
        let ahead = on.curve.forward() * (&place.at - &on.last.at).rounded();
        let behind = on.curve.forward() * (&on.first.at - &place.at).rounded();
        if ahead > 0.0 && segment + 1 < self.path.segments() {
            Some((segment + 1, self.path.segment(segment + 1).first.clone()))
        } else if behind > 0.0 && segment > 0 {
            Some((segment - 1, self.path.segment(segment - 1).last.clone()))
        } else {
            None
        }
    }
}
