//! Bounds of the places of boards on a spiral, and of their relative motion.

use std::f64::consts::TAU;

use super::{Direction, Spiral};
use crate::model::curve::Coordinate;
use crate::model::curve_bounds::{CurveBounds, ReachedDisc};
use crate::model::elementary;
use crate::model::root::bisect_predicate;
use crate::model::team::Team;

impl Spiral {
    /// Returns the first place from which a board can reach into the disc. If an inward spiral ends outside the
    /// circle about the origin, but not beyond the disc, a board may still lie across its end.
    pub(super) fn first_in_disc(
        &self,
        disc: &ReachedDisc,
        begin: Option<Coordinate>,
        last: Coordinate,
    ) -> Option<Coordinate> {
        let to_origin = disc.centre.coords.norm();
        match self.direction() {
            Direction::Inward => {
                let theta = disc.about_origin / self.radius_per_radian();
                if theta >= last.high {
                    return Some(Coordinate { high: theta, low: 0.0 });
                }
                (to_origin + disc.radius >= self.radius(last)).then_some(last)
            }
            Direction::Outward => {
                let theta = (to_origin - disc.radius) / self.radius_per_radian();
                let first = Coordinate { high: theta, low: 0.0 };
                let at = begin.filter(|begin| theta <= begin.high).unwrap_or(first);
                (at.minus(last) <= 0.0).then_some(at)
            }
        }
    }

    /// Returns the place of the least radius whose [`board_clearance_bound`](Self::board_clearance_bound) is above the
    /// limit, at the earliest `last`.
    pub(super) fn quiet_from(&self, team: &Team, limit: f64, last: Coordinate) -> Option<Coordinate> {
        let quiet = |radius: f64| self.board_clearance_bound(team, radius) > limit;
        let least = 5.0 * (team.longest_link() + team.hole_inset + team.widest()).max(self.pitch());
        // Beyond that the bound grows no more.
        let most = 1e16 * least;
        if !quiet(most) {
            return None;
        }
        let radius = if quiet(least) { least } else { bisect_predicate(quiet, least, most) };
        let high = (radius / self.radius_per_radian()).max(last.high);
        Some(Coordinate { high, low: 0.0 })
    }

    /// Returns a lower bound of the clearance of two boards without a common handle on an inward spiral. All handles
    /// are at least `r` from the centre. The bound needs r >= 5 max(link + inset + width, pitch) and grows with r. Link
    /// and width are those of the longest link and the widest board; the links between two boards are body links.
    ///
    /// There theta > 31, so that the curvature is at most 1.002 / r, and chord and arc differ by less than 1 %. So the
    /// tangent turns by at most tau = 1.03 link / r <= 0.21 along one link. A chord leans by at most half of that
    /// against the tangent at its end. Let the path between the outermost handles of benches i and i + k turn by phi.
    ///
    /// - k = 2: both links lean by psi <= tau against the link between them. Along this link the gap is body_link - 2
    ///   (inset cos psi + width / 2 sin psi) or more. The bracket is greatest at psi = tau or atan(width / 2 inset).
    /// - k > 2, phi <= 2 pi / 3: against the tangent half way, each link leans by at most phi / 2. So the gap along
    ///   this tangent is at least (k - 1) body_link cos(phi / 2) - 2 inset - width sin(phi / 2). Because width <=
    ///   body_link and phi <= (k + 1) tau, this bound is more than body_link - 2 inset at k = 3, and grows with k up to
    ///   phi = 1.6. Where phi is more, k >= 7, and the bound is more than 2 body_link - 2 inset.
    /// - phi more than that: every point of a board is near the path between or just beyond its handles. Its distance
    ///   from the path is at most width / 2 + 1.05 max(link^2 / 8, inset (link + inset) / 2) / r. Let two places of the
    ///   path be p apart in polar angle, less whole turns. Where |p| > 1/2, their distance is more than 0.49 r.
    ///   Otherwise it is at least pitch r / hypot(r, 1.02 a) >= 0.999 pitch. This case is impossible where the whole
    ///   team turns by less.
    fn board_clearance_bound(&self, team: &Team, r: f64) -> f64 {
        let (hole_inset, width) = (team.hole_inset, team.widest());
        let (longest, body) = (team.longest_link(), team.link(1));
        if width > body {
            return f64::NEG_INFINITY;
        }
        let lean = (1.03 * longest / r).min(elementary::atan2(0.5 * width, hole_inset));
        let along = body - 2.0 * hole_inset * elementary::cos(lean) - width * elementary::sin(lean);
        if 1.03 * team.length() / r < TAU / 3.0 {
            return along;
        }
        let bulge = 1.05 * (longest * longest / 8.0).max(0.5 * hole_inset * (longest + hole_inset)) / r;
        let across = (0.999 * self.pitch()).min(0.49 * r) - width - 2.0 * bulge;
        along.min(across)
    }

    /// Returns an upper bound of the arc length: a radian of it grows outward.
    pub(super) fn outer_length(&self, one: Coordinate, other: Coordinate) -> f64 {
        let outer = if one.high > other.high { one } else { other };
        let (radius, a) = (self.radius(outer), self.radius_per_radian());
        other.minus(one).abs() * (radius * radius + a * a).sqrt()
    }

    /// Returns an upper bound of a handle's displacement, metres, in the frame of the reference handle. The frame turns
    /// about the centre with that handle and moves outward with it, along the direction of its follower.
    pub(super) fn seen_from_polar_frame(
        &self,
        (first, last): (Coordinate, Coordinate),
        turned: f64,
        behind: Coordinate,
    ) -> f64 {
        let a = self.radius_per_radian();
        let radius = self.radius(if first.high > last.high { first } else { last });
        let around = (last.minus(first) - turned).abs();
        let apart = first.minus(behind);
        // No less than twice the sine of half the angle.
        let aside = (apart - TAU * (apart / TAU).round()).abs() + around;
        (radius + a) * around + self.frame_travel(turned) * aside
    }
}
