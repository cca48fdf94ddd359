//! The stalls and jumps of one link anywhere on a path, by the place of its front handle.
//!
//! Both depend on the place of the front handle alone, so a path is searched once for each length of link. The search
//! halves a stretch until it is certain to hold neither.

use super::geometry::{Param, Path};

/// Jumps below this share of the link cannot be distinguished from a very fast follower. Over the last bit of a place
/// near a fold, 1e-13 m in 100, a follower moves by the root of that.
const DOUBTFUL_JUMP: f64 = 3e-6;
/// A smaller jump, as a share of the link, is not counted.
const LEAST_JUMP: f64 = 1e-9;
/// Error that the rounding of two places can add to the distance between them, in roundings of the largest number
/// involved.
const ROUNDINGS: f64 = 32.0;
/// Configurations after which the search gives up: some seconds. If an arc's diameter is within a share x of the link,
/// the search takes several hundred over the root of x.
const MOST_CONFIGURATIONS: usize = 20_000_000;

#[derive(Clone, Copy)]
pub struct Configuration {
    pub front: Param,
    pub rear: Param,
    /// Cosines between the bench and the path at its front and its rear handle.
    pub front_cosine: f64,
    pub rear_cosine: f64,
}

pub struct Link<'a> {
    path: &'a Path,
    pub length: f64,
    /// Places of the front handle at which the front cosine changes its sign, and the followers there: they turn round.
    pub stalls: Vec<Configuration>,
    /// Metres of travel of the front handle at which the follower jumps, and true if the jump is too small to be sure.
    /// No handle goes past the first sure jump, so nothing is searched there.
    pub jumps: Vec<(f64, bool)>,
    /// True if the search was complete.
    pub complete: bool,
    locked: bool,
    configurations: usize,
}

impl<'a> Link<'a> {
    pub fn new(path: &'a Path, length: f64) -> Self {
        let (stalls, jumps) = (Vec::new(), Vec::new());
        let mut link = Self { path, length, stalls, jumps, complete: true, locked: false, configurations: 0 };
        // On the first curve, a line or a spiral that grows ever straighter, the stretch without events has no end.
        let mut from = -length;
        while !link.is_regular(path.place_at(from), path.place_at(from)) {
            from *= 2.0;
        }
        let cells = ((path.end - from) / (0.2 * length)).ceil() as usize;
        let at = |cell: usize| path.place_at(from + (path.end - from) * cell as f64 / cells as f64);
        for cell in 0..cells {
            let (one, other) = (at(cell), at(cell + 1));
            if !link.is_regular(one, other) {
                let (one, other) = (link.configuration(one), link.configuration(other));
                link.search(one, other);
            }
        }
        link
    }

    pub fn configuration(&self, front: Param) -> Configuration {
        let rear = self.path.follower(front, self.length);
        let ((point, tangent), (rear_point, rear_tangent)) =
            (self.path.point_and_tangent(front), self.path.point_and_tangent(rear));
        let bench = (point - rear_point) / self.length;
        Configuration { front, rear, front_cosine: bench.dot(&tangent), rear_cosine: bench.dot(&rear_tangent) }
    }

    /// Returns true for a path that turns by less than `MOST` in the 1.4 links behind every front handle. Its chord is
    /// at least 1.4 cos(MOST / 2) > 1 link, and grows all the way. So there is neither stall nor jump.
    fn is_regular(&self, from: Param, to: Param) -> bool {
        const MOST: f64 = 1.5;
        self.path.turned(self.path.place_at(from.s - 1.4 * self.length), to) < MOST
    }

    fn search(&mut self, one: Configuration, other: Configuration) {
        self.configurations += 1;
        self.complete &= self.configurations <= MOST_CONFIGURATIONS;
        if self.locked || !self.complete || self.path.is_even([one.front, one.rear, other.front, other.rear]) {
            return;
        }
        let range = self.continuous(&one, &other).or_else(|| self.continuous(&other, &one));
        if range.is_some_and(|range| self.keeps_sign(&one, &other, range)) {
            return;
        }
        let middle = self.path.place_at(0.5 * (one.front.s + other.front.s));
        if other.front.s - one.front.s > 4.0 * f64::EPSILON * (one.front.s.abs() + self.length) {
            let middle = self.configuration(middle);
            self.search(one, middle);
            self.search(middle, other);
            return;
        }
        let jump = (other.rear.s - one.rear.s).abs() / self.length;
        if range.is_none() && jump > LEAST_JUMP {
            self.locked = jump > DOUBTFUL_JUMP;
            if self.locked {
                // In the last bits before a jump the follower is fast.
                self.jumps.retain(|(at, _)| middle.s - at > 1e-10 * (1.0 + middle.s.abs()));
            }
            self.jumps.push((middle.s, !self.locked));
        } else if (one.front_cosine > 0.0) != (other.front_cosine > 0.0) {
            self.stalls.push(other);
        }
    }

    /// Returns the metres in which the follower stays if it is certainly continuous between two configurations.
    ///
    /// With the front handle at most h from its first place, a place that was nearer than link - h remains nearer than
    /// the link. From that place back, over `range` metres, the angle between path and bench changes by at most
    /// `change`. If its cosine stays above half of its value now, the distance grows all the way, from below the link
    /// to above it.
    fn continuous(&self, configuration: &Configuration, other: &Configuration) -> Option<f64> {
        let size = configuration.front.s.abs() + self.path.point(configuration.front).norm() + self.length;
        let h = (other.front.s - configuration.front.s).abs() + ROUNDINGS * f64::EPSILON * size;
        let rest = self.length - 2.0 * h;
        if rest <= 0.0 || configuration.rear_cosine <= 0.0 {
            return None;
        }
        let nearest = self.path.follower(configuration.front, self.length - h);
        let furthest = self.path.place_at(configuration.rear.s - 2.0 * h / configuration.rear_cosine);
        let range = nearest.s - furthest.s;
        let across = (range + h) / rest;
        // Up to 1/2 an arc sine is less than 1.1 times its sine.
        let change = self.path.turned(furthest, nearest) + 1.1 * across;
        let kept = (configuration.rear_cosine.min(1.0).acos() + change).cos() >= 0.5 * configuration.rear_cosine;
        let stays = (other.rear.s - configuration.rear.s).abs() <= range;
        (across < 0.5 && change < 1.5 && kept && stays).then_some(range)
    }

    /// Returns true if the front cosine certainly has one sign between two configurations, with the follower within
    /// `range` metres.
    fn keeps_sign(&self, one: &Configuration, other: &Configuration, range: f64) -> bool {
        let h = other.front.s - one.front.s;
        let change = self.path.turned(one.front, other.front) + 1.1 * (range + h) / (self.length - 2.0 * h);
        let margin = one.front_cosine.abs().min(1.0).asin();
        (one.front_cosine > 0.0) == (other.front_cosine > 0.0) && margin > change
    }

    /// Returns all stalls of a front handle between two places.
    pub fn stalls_between(&self, low: f64, high: f64) -> impl Iterator<Item = &Configuration> {
        self.stalls.iter().filter(move |configuration| low <= configuration.front.s && configuration.front.s <= high)
    }

    /// Returns the first jump in the list of a front handle between two places.
    pub fn jump_between(&self, low: f64, high: f64) -> Option<&(f64, bool)> {
        self.jumps.iter().find(|(at, _)| low <= *at && *at <= high)
    }
}
