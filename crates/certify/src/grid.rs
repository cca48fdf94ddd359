//! Grid points of the search: the handles for one place of the head, in doubles. They are the starting guess of the
//! spans, so correctness does not depend on them.

use super::interval::Interval;
use super::path::ExactPath;
use super::place::{Place, Span};
use bench_dragon_motion::linkage::{NoFollower, follower, link_pose};
use bench_dragon_motion::model::curve::Coordinate;
use bench_dragon_motion::model::path::{Param, Path};
use bench_dragon_motion::model::team::Team;

/// A handle at a grid point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Handle {
    pub param: Param,
    /// Cosines at the front and at the rear of the link that ends at this handle.
    pub front_cosine: f64,
    pub rear_cosine: f64,
}

/// A place of the head, and as many handles as were needed.
#[derive(Debug, Clone)]
pub(super) struct GridPoint {
    /// The travel in metres, approximate.
    pub travelled: f64,
    pub head: Place,
    pub handles: Vec<Handle>,
}

impl GridPoint {
    pub fn new(path: &Path, exact: &ExactPath, travelled: f64) -> Self {
        let param = path.param_at(travelled);
        let place = place(param);
        let tiny = 1e-14 * (1.0 + travelled.abs());
        let head = if exact.is_inside(place) { place } else { exact.moved(place, tiny, false) };
        Self::at(head, travelled)
    }

    pub fn at(head: Place, travelled: f64) -> Self {
        let handle = Handle { param: param(head), front_cosine: 1.0, rear_cosine: 1.0 };
        Self { travelled, head, handles: vec![handle] }
    }

    /// Returns the nearest grid point on one side of a travel for the travel of which `holds` is proved.
    pub fn beside(
        path: &Path,
        exact: &ExactPath,
        travelled: f64,
        side: f64,
        holds: impl Fn(Interval) -> bool,
    ) -> Option<Self> {
        let least = f64::EPSILON * (1.0 + path.length());
        let mut points = (0..40).map(|power| Self::new(path, exact, travelled + side * least * 2f64.powi(power)));
        points.find(|point| holds(exact.travelled(point.head)))
    }

    /// Returns the grid point some metres further on; without a length, the target. If the metres are less than the
    /// distance of two doubles, it is at the next one: a step leads on.
    pub fn towards(&self, target: &Self, metres: Option<f64>, path: &Path, exact: &ExactPath) -> Self {
        let Some(metres) = metres else { return target.clone() };
        let to = Self::new(path, exact, self.travelled + metres);
        if exact.is_before(self.head, to.head) {
            return to;
        }
        let head = exact.moved(self.head, metres, false);
        Self::at(head, exact.travelled(head).middle().max(to.travelled))
    }

    /// Solves handles up to `handle`.
    pub fn extend_to(&mut self, handle: usize, path: &Path, team: &Team) -> Result<(), NoFollower> {
        while self.handles.len() <= handle {
            let link = self.handles.len() - 1;
            let (front, length) = (self.handles[link].param, team.link(link));
            let rear = follower(path, front, length)?;
            let pose = link_pose(path, front, rear, length);
            self.handles.push(Handle { param: rear, front_cosine: pose.front_cosine, rear_cosine: pose.rear_cosine });
        }
        Ok(())
    }
}

/// Returns the parameter of a place.
pub(super) fn param(place: Place) -> Param {
    Param::new(place.0, Coordinate { high: place.1, low: place.2 })
}

/// Returns the place nearest to a parameter.
pub(super) fn place(param: Param) -> Place {
    Place(param.segment(), param.coordinate().high, 0.0)
}

/// Returns the place of a parameter, with its low word.
pub(super) fn fine_place(param: Param) -> Place {
    let Coordinate { high, low } = param.coordinate();
    Place(param.segment(), high, low)
}

/// Returns the span of a handle between two grid points, `pad` metres longer at both ends. Its ends are places of one
/// double each unless `fine` is true.
pub(super) fn span(exact: &ExactPath, one: Param, other: Param, pad: f64, fine: bool) -> Span {
    let (one, other) = if fine { (fine_place(one), fine_place(other)) } else { (place(one), place(other)) };
    let (first, last) = if exact.in_order(one, other) { (one, other) } else { (other, one) };
    Span(exact.moved(first, -pad, fine), exact.moved(last, pad, fine))
}
