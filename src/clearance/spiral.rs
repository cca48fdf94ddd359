//! What the shape of a spiral says of clearance without asking a pair: who can be beside whom, and how near at most.
//!
//! All handles are on the spiral and all benches but the head have one link. Called by the clearance only.

use crate::chain::{Chain, Team};
use crate::geometry::rectangle::Board;

/// Which benches are beside a bench on a spiral, by the handles' distances r from the origin, which grow along the chain
/// and tell the polar angles, theta = 2 pi r / pitch. All benches but the head have one link l; inset e, half width W.
///
/// - A board's points are within c = hypot(e, W) of the segment between its handles. That segment's points are within
///   l / 2 of a handle, so at r - l / 2 or further out, and its polar angles are between those of its handles. So the
///   board's points are at rho = r - l / 2 - c or further out, and at most asin(c / (r - l / 2)) beyond these angles.
/// - Two points within s of each other, both at rho or further out, are at most 2 asin(s / 2 rho) <= asin(s / rho) apart
///   in polar angle, give or take whole turns.
/// - asin(q) <= (pi / 3) q for q <= 1/2, since asin is convex and asin(1/2) = pi / 6.
///
/// So benches a < b, both behind the head, can only be within s of each other if for some whole number of turns their
/// handles' angles overlap when widened by w = (pi / 3) (2 c / (r - l / 2) + s / rho), with r that of a's front handle.
/// In distances from the origin: r_b <= r_(a+1) + turns pitch + width and r_(b+1) >= r_a + turns pitch - width, with
/// width = w pitch / 2 pi.
///
/// And b's points are at sqrt(r_b^2 - l^2 / 4) - c or further out (the foot of the origin on the link's line is within
/// l / 2 of the front handle, or not between the handles), a's at r_(a+1) + c or further in.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sweep {
    pitch: f64,
    link: f64,
    corner: f64,
    /// What solver and rounding can have done to a distance, metres.
    rounding: f64,
    /// Where the window on the next turn began for the bench before.
    next_turn: usize,
}

/// How far beside a bench others matter.
#[derive(Debug, Clone, Copy)]
pub(super) struct Beside {
    /// Metres by which distances from the origin are widened.
    width: f64,
    /// Metres within which others matter.
    limit: f64,
}

impl Sweep {
    pub(super) fn new(chain: &Chain, team: &Team, pitch: f64, radii: &mut [f64]) -> Self {
        for ((radius, x), y) in radii.iter_mut().zip(&chain.x).zip(&chain.y) {
            *radius = (x * x + y * y).sqrt();
        }
        let outermost = radii.last().copied().unwrap_or(0.0);
        let rounding = (1e-9 + 64.0 * f64::EPSILON * outermost) * (1.0 + team.link(1));
        let corner = team.hole_inset.hypot(0.5 * team.width);
        Self { pitch, link: team.link(1), corner, rounding, next_turn: 0 }
    }

    /// How far beside `a` others can be within `limit`; `None` where `a` is too near to the origin to tell.
    pub(super) fn beside(&self, radii: &[f64], a: usize, limit: f64) -> Option<Beside> {
        let limit = limit.max(0.0) + self.rounding;
        let nearest = radii[a] - 0.5 * self.link - self.rounding;
        let rho = nearest - self.corner;
        if !(self.corner <= 0.5 * nearest && limit <= 0.5 * rho) {
            return None;
        }
        let widened = std::f64::consts::FRAC_PI_3 * (2.0 * self.corner / nearest + limit / rho);
        let width = widened * self.pitch / std::f64::consts::TAU + 2.0 * self.rounding;
        Some(Beside { width, limit })
    }

    /// The benches after `a` that can matter, so many turns further out; `None` where none can on any turn beyond.
    pub(super) fn window(
        &mut self,
        radii: &[f64],
        a: usize,
        turns: usize,
        beside: Beside,
    ) -> Option<std::ops::Range<usize>> {
        let benches = radii.len() - 1;
        let turned = turns as f64 * self.pitch;
        let (first, last) = (radii[a] + turned - beside.width, radii[a + 1] + turned + beside.width);
        let begins = |from: usize| from + radii[from + 1..].partition_point(|radius| *radius < first);
        let start = match turns {
            0 => a + 2,
            1 => {
                // From bench to bench the window moves on by few.
                self.next_turn = self.next_turn.max(a + 2);
                while self.next_turn < benches && radii[self.next_turn + 1] < first {
                    self.next_turn += 1;
                }
                self.next_turn
            }
            _ => begins(self.next_turn.min(benches - 1)),
        };
        if start >= benches {
            return None;
        }
        let reach = radii[a + 1] + 2.0 * self.corner + beside.limit + 2.0 * self.rounding;
        if turns > 0 && radii[start] * radii[start] - 0.25 * self.link * self.link > reach * reach {
            return None;
        }
        let length = radii[start..benches].iter().take_while(|radius| **radius <= last).count();
        Some(start..start + length)
    }
}

/// A value of [`spiral_bound`], which holds from its radius outward.
#[derive(Debug, Clone, Copy)]
pub(super) struct SpiralBound {
    pub(super) radius: f64,
    pub(super) bound: f64,
}

impl SpiralBound {
    pub(super) const NONE: Self = Self { radius: f64::INFINITY, bound: f64::NEG_INFINITY };

    pub(super) fn excludes(&self, r: f64, limit: f64) -> bool {
        r >= self.radius && self.bound > limit
    }
}

/// A lower bound of the clearance of every two boards that share no handle, among benches of equal links whose handles
/// are all on the spiral at radius `r` or further out; minus infinity where there is no such bound.
///
/// Write delta = rho - a psi for how far a point (rho, psi) is off the spiral, psi counted on along the turns. With link
/// l, inset e, half width W, increment d from handle to handle and a = pitch / 2 pi:
///
/// - d <= 2 asin(l / 2r), as l^2 = (a d)^2 + 4 r r' sin^2(d/2); and d >= l / (r' + a), as the arc is longer than the
///   chord. r' = r + a d.
/// - The link's line passes the origin at h; its points have |x| <= X = l/2 + e + (r'^2 - r^2) / 2l from the foot, so
///   h^2 >= r^2 - X^2. Along it delta = sqrt(h^2 + x^2) - a atan(x / h) is convex for h > 2a with curvature at most
///   K = (1 + 2a/h) / h, and 0 at the handles. So delta >= -K l^2 / 8 between them and <= K e (l + e) / 2 beyond them.
///   Off the line by w, rho changes by at most W and psi by at most W X / (h (h - W)).
/// - Two points of boards on different turns: along the segment s between them delta's gradient is at most
///   sqrt(1 + (a / rho)^2), and it must make up the pitch at least once:
///   s >= (pitch + least delta - greatest delta) / sqrt(1 + (a / rho)^2), rho^2 >= (h - W)^2 - s^2 / 4.
/// - Two points on the same turn: between the boards is a whole link, of which corners reach over at most asin(q / r)
///   from either end, q = hypot(e, W). That link's front handle is at r', its rear one at r'' <= r' + a d. So the points
///   are gamma = l / (r'' + a) - 2 asin(q / r) < l / r apart about the origin, or more, and
///   s >= (h - W) sin(gamma) >= (h - W) gamma (1 - (l / r)^2 / 6).
///
/// Each piece is monotone in r the favourable way, so the bound at r holds at every greater radius.
pub(super) fn spiral_bound(r: f64, pitch: f64, team: &Team) -> f64 {
    let link = team.link(1);
    let (inset, half_width) = (team.hole_inset, 0.5 * team.width);
    let a = pitch / std::f64::consts::TAU;
    let corner = inset.hypot(half_width);
    if link > r || corner >= 0.5 * r {
        return f64::NEG_INFINITY;
    }
    let increment = 2.0 * (0.5 * link / r).asin();
    let outer = r + a * increment;
    let most_along = 0.5 * link + inset + a * increment * (outer + r) / (2.0 * link);
    let height_squared = r * r - most_along * most_along;
    let height = height_squared.max(0.0).sqrt();
    let inner = height - half_width;
    let rho_squared = inner * inner - 0.25 * pitch * pitch;
    if height <= 2.0 * a || inner <= 0.0 || rho_squared <= 0.0 {
        return f64::NEG_INFINITY;
    }
    let curvature = (1.0 + 2.0 * a / height) / height;
    let bulge = curvature * (0.125 * link * link + 0.5 * inset * (link + inset));
    let slant = 2.0 * a * half_width * most_along / (height * inner);
    let next_turn = (pitch - team.width - bulge - slant) / (1.0 + a * a / rho_squared).sqrt();
    let ratio = link / r;
    let gap = link * inner / (outer + a * increment + a) - 2.0 * r * (corner / r).asin();
    if next_turn <= 0.0 || gap <= 0.0 {
        return f64::NEG_INFINITY;
    }
    // The handles are on the spiral up to the solver's accuracy and the last digits of their coordinates.
    let rounding = (1e-9 + 64.0 * f64::EPSILON * r) * 2.0 * Board::reach(link, inset, team.width);
    next_turn.min(gap * (1.0 - ratio * ratio / 6.0)) - rounding
}
