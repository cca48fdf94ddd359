//! Limits of the search: the rearmost place of the path from which a board can come near the foremost boards, and the
//! place behind which no boards come near each other.

use crate::model::Point;
use crate::model::curve_bounds::{CurveBounds, ReachedDisc};
use crate::model::elementary::hypot;
use crate::model::path::{Param, Path};
use crate::model::team::Team;

/// A circle about some boards, and the circle about the origin that holds them. The origin is the centre of every
/// spiral but the spirals of routes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    pub centre: Point,
    pub radius: f64,
    /// The distance from the origin to the outermost point of the boards, in metres.
    pub outermost: f64,
}

impl Reach {
    /// Returns the rearmost place of the path from which a board can come within `limit`, 0 or more, of the boards. A
    /// board whose front handle is behind this place cannot.
    ///
    /// No point of a board is further than hypot(max(link / 2, inset), width / 2) from the nearer one of its handles.
    /// On an inward spiral about the origin, let both handles of a board be at least r from the origin. Then its axis
    /// is at least min(sqrt(r^2 - link^2 / 4), r - inset) from the origin, and its points half a width less.
    pub fn rearmost(&self, path: &Path, team: &Team, limit: f64) -> Option<Param> {
        let half = 0.5 * team.longest_link();
        let disc = self.radius + limit + hypot(half.max(team.hole_inset), 0.5 * team.widest());
        let ring = self.outermost + limit + 0.5 * team.widest();
        let about_origin = hypot(ring, half).max(ring + team.hole_inset);
        let disc = ReachedDisc { centre: self.centre, radius: disc, about_origin };
        let near = |segment: &usize| path.can_meet(*segment, disc.centre, disc.radius);
        (0..path.segments()).filter(near).find_map(|segment| {
            let begin = (segment > 0).then(|| path.first(segment));
            let at = path.segment_at(segment).first_within(&disc, begin, path.last(segment))?;
            Some(Param { segment, at })
        })
    }
}

/// Returns the place of the first segment behind which no two boards without a common handle come within `limit`
/// metres, if one is known.
pub(super) fn quiet_place(path: &Path, team: &Team, limit: f64) -> Option<Param> {
    let at = path.segment_at(0).quiet_place(team, limit, path.last(0))?;
    Some(Param { segment: 0, at })
}
