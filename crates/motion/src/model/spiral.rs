//! The Archimedean spiral r = a theta, a = pitch / 2 pi, travelled inward (clockwise, theta decreasing) or outward.
//!
//! All formulas are derived in the polar frame of a handle, so that none subtracts two nearly equal positions.

mod bounds;
mod links;

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::LazyLock;

use super::curve::{Coordinate, Curve, Follower, LinkPose, NoFollower};
use super::curve_bounds::{CurveBounds, ReachedDisc};
use super::double_double::DoubleDouble;
use super::elementary::{asinh, cos, hypot, pow, sin, sin_cos, tan};
use super::root::{bisect_predicate, increasing_root};
use super::team::Team;
use super::{Point, Vector};

/// The direction of travel on a spiral.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Towards the centre.
    Inward,
    /// Away from the centre, on the inward spiral turned by half a turn: the two are each other's continuation through
    /// an S of two arcs.
    Outward,
}

/// The spiral. Its coordinate is the polar angle theta of the unturned spiral, in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spiral {
    pitch: f64,
    radius_per_radian: DoubleDouble,
    direction: Direction,
}

/// The longest step, in radians, of the search for a follower along a spiral.
const LONGEST_STEP: f64 = 0.5;

impl Spiral {
    /// Creates a spiral of `pitch` metres per turn, which must be positive and finite: the scene refuses other values
    /// with file and line.
    pub fn new(pitch: f64, direction: Direction) -> Self {
        debug_assert!(pitch > 0.0);
        // a = pitch / 2 pi to 32 digits: 2 pi is itself a sum of two doubles.
        let DoubleDouble { high, low } = DoubleDouble::quotient(pitch, TAU);
        let tau_low = DoubleDouble::from_turns(1.0).low;
        Self { pitch, radius_per_radian: DoubleDouble { high, low: low - high * tau_low / TAU }, direction }
    }

    /// Returns the metres per turn.
    pub fn pitch(&self) -> f64 {
        self.pitch
    }

    /// Returns the metres of radius per radian: a = pitch / 2 pi.
    pub fn radius_per_radian(&self) -> f64 {
        self.radius_per_radian.high
    }

    /// Returns the direction of travel.
    pub fn direction(&self) -> Direction {
        self.direction
    }

    /// Returns the distance of a place from the centre, in metres.
    pub fn radius(&self, at: Coordinate) -> f64 {
        let DoubleDouble { high, low } = self.radius_per_radian;
        at.high.mul_add(high, at.high * low + at.low * high)
    }

    /// Returns the arc length between `theta` and `theta - span`, in metres.
    ///
    /// The length follows from s = a/2 (theta w + asinh theta), w = sqrt(1 + theta^2). Both differences are written as
    /// products of the span, so that short spans far out keep all digits:
    /// 1. theta w - theta' w' = span (w + theta' (theta + theta') / (w + w')),
    /// 2. asinh theta - asinh theta' = asinh(span (theta + theta') / (theta w' + theta' w)).
    fn inward_length(&self, theta: f64, span: f64) -> f64 {
        if span == 0.0 {
            return 0.0;
        }
        let inner = theta - span;
        let (w, w_inner) = (hypot(1.0, theta), hypot(1.0, inner));
        let algebraic = span * (w + inner * (theta + inner) / (w + w_inner));
        let logarithmic = asinh(span * (theta + inner) / (theta * w_inner + inner * w));
        0.5 * self.radius_per_radian.high * (algebraic + logarithmic)
    }

    /// Returns the place `metres` inward of another, outward if negative; the centre if that is nearer.
    fn inward(&self, from: Coordinate, metres: f64) -> Coordinate {
        let (theta, a) = (from.high, self.radius_per_radian.high);
        if metres == 0.0 {
            return from;
        }
        if metres >= self.inward_length(theta, theta) {
            return Coordinate::ZERO;
        }
        // Without the logarithm the arc length is (theta^2 - theta'^2) a / 2.
        let twice = 2.0 * metres / a;
        let guess = twice / (theta + (theta * theta - twice).max(0.0).sqrt());
        let span = increasing_root(
            |span| (self.inward_length(theta, span) - metres, a * hypot(1.0, theta - span)),
            if metres < 0.0 { 2.0 * guess } else { 0.0 },
            theta,
            guess,
        );
        from.plus(-span)
    }

    /// Returns the residual of the chord from a handle at radius `r` to the point `d` radians outward, and its
    /// derivative by d. The residual is G = (a d)^2 + 4 r (r + a d) sin^2(d/2) - link^2 (law of cosines).
    pub(crate) fn chord_residual(&self, r: f64, link: f64) -> impl Fn(f64) -> (f64, f64) + use<> {
        let a = self.radius_per_radian.high;
        move |d| {
            let (sine, cosine) = sin_cos(0.5 * d);
            let rise = a * d;
            let outer = r + rise;
            let value = rise.mul_add(rise, (2.0 * r * sine) * (2.0 * outer * sine)) - link * link;
            let slope = 2.0 * a * rise + 4.0 * r * a * sine * sine + 4.0 * r * outer * sine * cosine;
            (value, slope)
        }
    }

    /// Returns the angle from a handle at radius `r` outward to the first point at the link's distance, in radians.
    pub(crate) fn follower_angle(&self, r: f64, link: f64) -> Result<f64, NoFollower> {
        let a = self.radius_per_radian.high;
        let residual = self.chord_residual(r, link);
        // Up to half a turn every term of the slope is positive: the root there is single.
        let high = if residual(PI).0 >= 0.0 {
            PI
        } else {
            match first_chord_maximum(r / a) {
                // The chord grows without limit and is at least the radial rise.
                None => (link / a).max(PI),
                Some(maximum) => {
                    let value = residual(maximum).0;
                    if value < -8.0 * f64::EPSILON * link * link {
                        return Err(NoFollower);
                    }
                    if value <= 0.0 {
                        return Ok(maximum);
                    }
                    maximum
                }
            }
        };
        let first = link / hypot(r, a);
        let second = link / hypot(r + 0.5 * a * first.min(PI), a);
        Ok(increasing_root(residual, 0.0, high, second))
    }

    /// Returns the outermost fold for links of `link` metres: the polar angle at which a front handle's link locks.
    /// Returns `None` if the link is so short against the pitch that it never locks.
    ///
    /// The first maximum of the chord grows with theta: d(chord^2)/d theta = 4 a^2 (2 theta + d) sin^2(d/2) > 0. So at
    /// most one theta has a first maximum equal to the link.
    pub fn fold(&self, link: f64) -> Option<f64> {
        let ratio = link / self.radius_per_radian.high;
        // Returns the excess of the square of the first maximum over the square of the link, divided by a^2, and its
        // slope. At the maximum, the slope is the derivative by theta alone.
        let excess = |theta: f64| match first_chord_maximum(theta) {
            Some(d) => {
                let square = sin(0.5 * d).powi(2);
                let chord_square = d * d + 4.0 * theta * (theta + d) * square;
                (chord_square - ratio * ratio, 4.0 * (2.0 * theta + d) * square)
            }
            None => (f64::NEG_INFINITY, 0.0),
        };
        let least = *LEAST_WITH_MAXIMUM;
        if excess(least).0 >= 0.0 {
            return None;
        }
        // At radius link / 2 the chord of half a turn is longer than the link.
        Some(increasing_root(excess, least, (0.5 * ratio).max(1.0), 0.5 * (ratio - PI)))
    }
}

/// The least theta from which the chord stops growing: below 1/4 it never does, from 1 it does.
static LEAST_WITH_MAXIMUM: LazyLock<f64> =
    LazyLock::new(|| bisect_predicate(|theta| first_chord_maximum(theta).is_some(), 0.25, 1.0));

/// Returns the angle d at which the chord from theta to theta + d first stops growing, in (pi, 2 pi). Returns `None` if
/// the chord grows without limit. The angle depends on theta alone.
///
/// Half the slope of the squared chord over a^2 is H(d) = d + 2 theta sin^2(d/2) + theta (theta + d) sin d, positive up
/// to pi. If H' >= 0 at pi, it stays so. If not, H has one minimum before 2 pi, and a zero exactly if that minimum is
/// not above zero. If the first turn has no zero, no later turn has a zero. The reason is that at sin d = -1,
/// H = (1 - theta)(d + theta), and the part of the dip below that value shrinks with d.
fn first_chord_maximum(theta: f64) -> Option<f64> {
    let half_slope = |d: f64| {
        let sine = sin(0.5 * d);
        d + 2.0 * theta * sine * sine + theta * (theta + d) * sin(d)
    };
    let curvature = |d: f64| 1.0 + 2.0 * theta * sin(d) + theta * (theta + d) * cos(d);
    if curvature(PI) >= 0.0 {
        return None;
    }
    let lowest = bisect_predicate(|d| curvature(d) >= 0.0, PI, TAU);
    if half_slope(lowest) > 0.0 {
        return None;
    }
    Some(bisect_predicate(|d| half_slope(d) <= 0.0, PI, lowest))
}

impl Curve for Spiral {
    fn point(&self, at: Coordinate) -> Point {
        let r = match self.direction {
            Direction::Inward => self.radius(at),
            Direction::Outward => -self.radius(at),
        };
        let (sine, cosine) = at.sine_and_cosine();
        Point::new(r * cosine, r * sine)
    }

    fn tangent(&self, at: Coordinate) -> Vector {
        let (r, a) = (self.radius(at), self.radius_per_radian.high);
        let (sine, cosine) = at.sine_and_cosine();
        // dp/dtheta = a e_r + r e_phi, and theta decreases. Turned by half a turn and travelled the other way, the
        // outward spiral has the same tangent.
        Vector::new(r * sine - a * cosine, -a * sine - r * cosine) / hypot(r, a)
    }

    /// (2 + theta^2) / (a (1 + theta^2)^(3/2)), which falls outward.
    fn curvature(&self, at: Coordinate) -> f64 {
        let square = at.high * at.high;
        (2.0 + square) / (self.radius_per_radian.high * pow(1.0 + square, 1.5))
    }

    fn arc_length(&self, from: Coordinate, to: Coordinate) -> f64 {
        match self.direction {
            Direction::Inward => self.inward_length(from.high, from.minus(to)),
            Direction::Outward => self.inward_length(to.high, to.minus(from)),
        }
    }

    fn advance(&self, from: Coordinate, metres: f64) -> Coordinate {
        match self.direction {
            Direction::Inward => self.inward(from, metres),
            Direction::Outward => self.inward(from, -metres),
        }
    }

    #[inline]
    fn sign(&self) -> f64 {
        match self.direction {
            Direction::Inward => -1.0,
            Direction::Outward => 1.0,
        }
    }

    fn rate(&self, at: Coordinate) -> f64 {
        self.sign() * (self.radius_per_radian.high * hypot(1.0, at.high))
    }

    fn contains(&self, at: Coordinate) -> bool {
        at.high > 0.0
    }

    fn turning(&self) -> f64 {
        // Inward is clockwise.
        self.sign()
    }

    fn displacement(&self, from: Coordinate, to: Coordinate) -> Vector {
        // A "link" of one metre has the displacement as its direction.
        self.pose(to, from, 1.0).direction
    }

    fn link_pose(&self, front: Coordinate, rear: Coordinate, link: f64) -> LinkPose {
        self.pose(front, rear, link)
    }

    fn follower(&self, front: Coordinate, behind: f64, link: f64) -> Result<Follower, NoFollower> {
        Ok(match self.direction {
            Direction::Inward => Follower::Behind(self.follower_angle(self.radius(front), link)?),
            Direction::Outward => self.inner_follower(front, behind, link),
        })
    }

    fn ahead(&self, rear: Coordinate, gap: f64, link: f64) -> Option<f64> {
        self.angle_ahead(rear, gap, link)
    }
}

impl CurveBounds for Spiral {
    fn tightens(&self) -> bool {
        self.direction == Direction::Inward
    }

    fn length_bound(&self, one: Coordinate, other: Coordinate) -> f64 {
        self.outer_length(one, other)
    }

    fn largest_summand(&self, _: Coordinate, _: Coordinate, _: f64) -> f64 {
        0.0
    }

    fn second_derivative_bound(&self, at: Coordinate, distance: f64) -> f64 {
        let a = self.radius_per_radian.high;
        let theta = match self.direction {
            Direction::Inward => at.high + LONGEST_STEP,
            Direction::Outward => at.high,
        };
        a * a * (1.0 + theta * theta) + distance * a * hypot(2.0, theta)
    }

    fn longest_step(&self) -> f64 {
        LONGEST_STEP
    }

    fn distance_grows(&self, front: Coordinate, rear: Coordinate) -> bool {
        rear.minus(front).abs() <= FRAC_PI_2 && (self.direction == Direction::Inward || front.high >= 1.0 + FRAC_PI_2)
    }

    /// On the outward spiral, let the front handle be at theta and the rear one at theta - d. Then chord^2 = (a d)^2 +
    /// 4 a^2 theta (theta - d) sin^2(d/2) grows with d while tan(d/2) <= theta - d, and with theta for fixed d. So if
    /// that inequality holds at the follower, it holds at all smaller d; and because d falls as theta grows, it
    /// continues to hold. There the rear cosine is positive, and the front one (see `pose`) is larger.
    fn is_steady(&self, front: Coordinate, rear: Coordinate) -> bool {
        let d = front.minus(rear);
        self.direction == Direction::Outward && d < PI && tan(0.5 * d) < rear.high
    }

    /// From theta = max(1, link / a) outward sin(d/2) <= link / (2 r) <= 1/2.
    fn stall_free_until(&self, link: f64) -> Option<Coordinate> {
        let theta = (link / self.radius_per_radian.high).max(1.0);
        Some(Coordinate { high: theta, low: 0.0 })
    }

    fn fold(&self, link: f64) -> Option<f64> {
        Self::fold(self, link)
    }

    fn first_within(&self, disc: &ReachedDisc, begin: Option<Coordinate>, last: Coordinate) -> Option<Coordinate> {
        self.first_in_disc(disc, begin, last)
    }

    fn quiet_place(&self, team: &Team, limit: f64, last: Coordinate) -> Option<Coordinate> {
        self.quiet_from(team, limit, last)
    }

    fn seen_from_frame(&self, moved: (Coordinate, Coordinate), turned: f64, behind: Coordinate) -> Option<f64> {
        Some(self.seen_from_polar_frame(moved, turned, behind))
    }

    fn frame_travel(&self, turned: f64) -> f64 {
        self.radius_per_radian.high * turned.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the greatest chord before the chords first shrink. The chords lead from `theta` on a spiral of radius
    /// theta to places up to a turn outward, in small steps. Returns `None` if the chords grow all the time.
    fn greatest_before_shrinking(theta: f64) -> Option<f64> {
        let place = |phi: f64| Point::new(phi * phi.cos(), phi * phi.sin());
        let chords: Vec<f64> =
            (0..=200_000).map(|k| (place(theta + TAU * f64::from(k) / 200_000.0) - place(theta)).norm()).collect();
        chords.windows(2).find(|pair| pair[1] < pair[0]).map(|pair| pair[0])
    }

    #[test]
    fn a_link_locks_at_the_fold_where_the_chord_is_no_longer_than_it_before_it_shrinks() {
        for ratio in [5.784, 6.4, 10.0, 26.0, 80.0, 1000.0] {
            let fold = Spiral::new(TAU, Direction::Inward).fold(ratio).unwrap();
            let chord = greatest_before_shrinking(fold).unwrap();
            assert!((chord / ratio - 1.0).abs() < 1e-8, "{chord} at the fold {fold} of {ratio}");
            assert_eq!(Spiral::new(2.0 * TAU, Direction::Inward).fold(2.0 * ratio), Some(fold));
        }
    }

    #[test]
    fn a_link_too_short_to_lock_has_no_fold() {
        let links = [0.1, 1.0, 4.0, 5.783];
        for link in links {
            assert_eq!(Spiral::new(TAU, Direction::Inward).fold(link), None, "{link}");
        }
        let maxima: Vec<f64> = (0..=40).filter_map(|k| greatest_before_shrinking(0.025 * f64::from(k))).collect();
        assert!(
            !maxima.is_empty() && maxima.iter().all(|maximum| links.iter().all(|link| link < maximum)),
            "{maxima:?}"
        );
        assert!(Spiral::new(TAU, Direction::Inward).fold(5.784).is_some());
    }
}
