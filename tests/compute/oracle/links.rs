//! The stalls and locks of one link anywhere on a path, by the place of its front handle.
//!
//! Both depend on the place of the front handle alone, so a path is searched once for each length of link. The search
//! halves a stretch until it is certain to hold neither. Where the first place at the link's distance jumps forward, a
//! nearer place has come to the distance. From there on the follower is the first place back from another one. That is
//! the place of least distance between the follower and the nearer places.

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
    /// Metres of travel of the front handle at which the follower vanishes or jumps, and true if the jump is too small
    /// to be sure. No handle goes past the first sure one, so nothing is searched there.
    pub jumps: Vec<(f64, bool)>,
    /// From a front handle's travel on, the follower is the first place back from the given one, or from the front.
    rules: Vec<(f64, Option<Param>)>,
    /// True if the search was complete.
    pub complete: bool,
    locked: bool,
    configurations: usize,
}

impl<'a> Link<'a> {
    pub fn new(path: &'a Path, length: f64) -> Self {
        let (stalls, jumps) = (Vec::new(), Vec::new());
        let rules = Vec::new();
        let mut link = Self { path, length, stalls, jumps, rules, complete: true, locked: false, configurations: 0 };
        // On the first curve, a line or a spiral that grows ever straighter, the stretch without events has no end.
        let mut from = -length;
        while !link.is_regular(path.place_at(from), path.place_at(from)) {
            from *= 2.0;
        }
        let cells = ((path.end - from) / (0.2 * length)).ceil() as usize;
        let at = |cell: usize| path.place_at(from + (path.end - from) * cell as f64 / cells as f64);
        for cell in 0..cells {
            let (one, other) = (at(cell), at(cell + 1));
            link.drop_rule(one);
            if link.rule(one).is_some() || !link.is_regular(one, other) {
                let (one, other) = (link.configuration(one), link.configuration(other));
                link.search(one, other);
            }
        }
        link
    }

    pub fn configuration(&self, front: Param) -> Configuration {
        let rear = self.path.first_back(self.rule(front).unwrap_or(front), front, self.length);
        let ((point, tangent), (rear_point, rear_tangent)) =
            (self.path.point_and_tangent(front), self.path.point_and_tangent(rear));
        let bench = (point - rear_point) / self.length;
        Configuration { front, rear, front_cosine: bench.dot(&tangent), rear_cosine: bench.dot(&rear_tangent) }
    }

    /// Returns the place from which the follower is the first one back; `None` for the front handle.
    fn rule(&self, front: Param) -> Option<Param> {
        let next = self.rules.partition_point(|(begin, _)| *begin <= front.s);
        self.rules[..next].last().and_then(|(_, from)| *from)
    }

    /// Ends the rule where the follower is the first place again.
    fn drop_rule(&mut self, front: Param) {
        let first = self.path.first_back(front, front, self.length);
        if self.rule(front).is_some() && (first.s - self.configuration(front).rear.s).abs() < 1e-9 * self.length {
            self.rules.push((front.s, None));
        }
    }

    /// Returns the place of least distance from the front handle that comes next ahead of the rear one.
    fn valley(&self, front: Param, rear: Param) -> Param {
        let point = self.path.point(front);
        let distance = |s: f64| (self.path.point(self.path.place_at(s)) - point).norm();
        let (mut s, mut step) = (rear.s, 1e-7 * self.length);
        while s + step < front.s && distance(s + step) < distance(s) {
            s += step;
            step = (1.1 * step).min(2e-3 * self.length);
        }
        let (mut low, mut high) = ((s - step).max(rear.s), (s + step).min(front.s));
        for _ in 0..100 {
            let (left, right) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if distance(left) < distance(right) { high = right } else { low = left }
        }
        self.path.place_at(0.5 * (low + high))
    }

    /// Begins another rule at a configuration beyond which the follower is not continuous, if there is a better one.
    fn renews(&mut self, one: &Configuration, other: &Configuration) -> bool {
        let rule = self.rule(one.front);
        if rule.is_none() && other.rear.s - one.rear.s <= DOUBTFUL_JUMP * self.length {
            return false;
        }
        let valley = self.valley(one.front, one.rear);
        let same = rule.is_some_and(|rule| (rule.s - valley.s).abs() < 1e-6 * self.length);
        let is_near = (self.path.point(valley) - self.path.point(one.front)).norm() < self.length;
        let renews = is_near && !same && self.rules.last().is_none_or(|(begin, _)| *begin < one.front.s);
        if renews {
            self.rules.push((one.front.s, Some(valley)));
        }
        renews
    }

    /// Returns true if no place near the last rule's is at the link's distance any more.
    fn is_apart(&self, front: Param, rear: Param) -> bool {
        let valley = self.valley(front, rear);
        self.rule(front).is_some() && (self.path.point(valley) - self.path.point(front)).norm() >= self.length
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
            let (between, rules) = (self.configuration(middle), self.rules.len());
            self.search(one, between);
            if self.rules.len() > rules {
                let (between, other) = (self.configuration(middle), self.configuration(other.front));
                self.search(between, other);
            } else {
                self.search(between, other);
            }
            return;
        }
        if range.is_none() && self.renews(&one, &other) {
            let (one, other) = (self.configuration(one.front), self.configuration(other.front));
            return self.search(one, other);
        }
        let jump = (other.rear.s - one.rear.s).abs() / self.length;
        let is_apart = range.is_none() && self.is_apart(other.front, one.rear);
        if is_apart || range.is_none() && jump > LEAST_JUMP {
            self.locked = is_apart || jump > DOUBTFUL_JUMP;
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
        let from = self.rule(configuration.front).unwrap_or(configuration.front);
        if (self.path.point(from) - self.path.point(configuration.front)).norm() >= self.length - h {
            return None;
        }
        let nearest = self.path.first_back(from, configuration.front, self.length - h);
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
