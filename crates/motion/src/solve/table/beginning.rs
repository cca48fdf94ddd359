//! The beginning of the table: one link's length of path, so far behind the team that it is straight or nearly so.
//!
//! Here alpha is known for every place. On a straight line T is linear. On a spiral a polynomial A with A(follower of
//! p) = A(p) + 1 is fitted over a few links.

use nalgebra::{DMatrix, DVector};

use super::track::{Node, Track};
use crate::linkage;
use crate::model::curve::{Coordinate, Curve, Follower};
use crate::model::curve_bounds::CurveBounds;
use crate::model::path::Param;
use crate::model::root::increasing_root;
use crate::model::team::Team;

/// Links beyond the tail at which a table on a spiral begins, so far out that it is smooth.
const LEAD: f64 = 64.0;

/// Links over which the beginning is fitted on a spiral; the degree of the polynomial; the number of fitted places.
const FITTED_LINKS: usize = 4;
const FITTED_DEGREE: usize = 8;
const FITTED_PLACES: usize = 32;

/// T on and behind a place of the path's first segment, where alpha is 0.
#[derive(Debug)]
pub(super) struct Beginning {
    base: Param,
    link: f64,
    fit: Option<Fit>,
}

/// A(y) = sum of c_k y^k, y = 2 (theta - theta of the base) / span - 1, less its value at -1.
#[derive(Debug)]
struct Fit {
    span: f64,
    coefficients: Vec<f64>,
}

impl Beginning {
    /// Makes the beginning for a team whose head starts at the path's start.
    pub(super) fn new(track: &Track, team: &Team) -> Option<Self> {
        let (start, link) = (track.path.param_at(0.0), team.link(1));
        let head = if start.segment == 0 { start } else { Param { segment: 0, at: track.path.last(0) } };
        let curve = track.path.segment(head);
        if curve.constant_curvature() == Some(0.0) {
            return Some(Self { base: track.advanced(head, -team.length() - 2.0 * link), link, fit: None });
        }
        if !curve.tightens() {
            return None;
        }
        // The arc over a link is longest where the path bends most, which is over the first links.
        let stretch = [team.link(0), link].into_iter().try_fold(1f64, |stretch, link| {
            let rear = linkage::follower(track.path, head, link).ok()?;
            Some(stretch.max(track.path.arc_length(rear, head) / link))
        })?;
        let base = track.advanced(head, -(team.length() + LEAD * link) * stretch);
        let mut place = base;
        for _ in 0..FITTED_LINKS {
            place = linkage::follower(track.path, place, link).ok()?;
        }
        let span = place.at.minus(base.at);
        let rear_of = |ahead: f64| match curve.follower(base.at.plus(ahead), f64::INFINITY, link) {
            Ok(Follower::Behind(by)) => Some(ahead + by),
            _ => None,
        };
        let fit = Fit { span, coefficients: fitted(span, rear_of)? };
        Some(Self { base, link, fit: Some(fit) })
    }

    /// Returns the node `alpha` links behind the base, from 0 to 1.
    pub(super) fn node(&self, track: &Track, alpha: f64) -> Node {
        let (at, spacing) = match &self.fit {
            None => (self.base.at.plus(-alpha * self.link), self.link),
            Some(fit) => {
                let excess = |y: f64| {
                    let (links, slope) = fit.links_and_slope(y);
                    (links - alpha, slope)
                };
                let y = increasing_root(excess, -1.0, 1.0, 2.0 * alpha / FITTED_LINKS as f64 - 1.0);
                let at = self.base.at.plus(0.5 * (y + 1.0) * fit.span);
                let per_link = 0.5 * fit.span / fit.links_and_slope(y).1;
                (at, -track.path.segment(self.base).rate(at) * per_link)
            }
        };
        let at = Param { segment: 0, at };
        let tangent = track.path.tangent(at);
        // No link of the table is led from here, so that its heading does not matter.
        Node { at, tangent, spacing, heading: 0.0, heading_rate: 0.0 }
    }

    /// Returns alpha of a place, if it is known here: anywhere on the line, or at and behind the base on a spiral.
    pub(super) fn alpha(&self, place: Param) -> Option<f64> {
        if place.segment != 0 {
            return None;
        }
        let behind = self.behind(place.at);
        match &self.fit {
            None => Some(behind / self.link),
            Some(fit) => (behind >= 0.0).then(|| fit.links_and_slope(2.0 * behind / fit.span - 1.0).0),
        }
    }

    fn behind(&self, at: Coordinate) -> f64 {
        let further = at.minus(self.base.at);
        if self.fit.is_some() { further } else { -further }
    }
}

impl Fit {
    fn links_and_slope(&self, y: f64) -> (f64, f64) {
        let (mut value, mut slope, mut power, mut at_base) = (0.0, 0.0, 1.0, 1.0);
        for (index, coefficient) in self.coefficients.iter().enumerate() {
            slope += coefficient * (index + 1) as f64 * power;
            power *= y;
            at_base = -at_base;
            value += coefficient * (power - at_base);
        }
        (value, slope)
    }
}

/// The least pivot of the fit, as a share of the greatest, that is more than rounding.
const LEAST_PIVOT: f64 = 1e-15;

/// Returns the coefficients with which A of a follower less A of its front is 1, by least squares.
fn fitted(span: f64, rear_of: impl Fn(f64) -> Option<f64>) -> Option<Vec<f64>> {
    let scaled = |ahead: f64| 2.0 * ahead / span - 1.0;
    let before_last = span * (1.0 - 1.0 / FITTED_LINKS as f64);
    let mut equations = DMatrix::zeros(FITTED_PLACES, FITTED_DEGREE);
    for row in 0..FITTED_PLACES {
        let ahead = before_last * row as f64 / (FITTED_PLACES - 1) as f64;
        let (front, rear) = (scaled(ahead), scaled(rear_of(ahead)?));
        for column in 0..FITTED_DEGREE {
            equations[(row, column)] = rear.powi(column as i32 + 1) - front.powi(column as i32 + 1);
        }
    }
    // By QR, because nalgebra's singular values use the C library's hypotenuse.
    let factors = equations.qr();
    let mut ones = DVector::from_element(FITTED_PLACES, 1.0);
    factors.q_tr_mul(&mut ones);
    let triangle = factors.r();
    let diagonal = || (0..FITTED_DEGREE).map(|row| triangle[(row, row)].abs());
    // A nearly singular system would have coefficients of rounding errors.
    if diagonal().fold(f64::INFINITY, f64::min) < LEAST_PIVOT * diagonal().fold(0.0, f64::max) {
        return None;
    }
    let solution = triangle.solve_upper_triangular(&ones.rows(0, FITTED_DEGREE).clone_owned())?;
    Some(solution.iter().copied().collect())
}
