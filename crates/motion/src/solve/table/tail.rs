//! The last handle of a team whose tail has a link of its own length: it is no place of the table.
//!
//! In: the table's place of the tail's front handle. Out: the last handle, found from there as exactly as by the safe
//! solver.

use std::sync::Arc;

use super::rows::{Alpha, Rows};
use super::track::{Ends, Track};
use crate::model::path::{Param, Path};
use crate::model::team::Team;
use crate::solve::newton::heading;
use crate::solve::{ChainMut, Velocities};

/// The steps of Newton's method from the centre of a piece, which is a fraction of a link away.
const MOST_STEPS: usize = 12;

/// The tail of a team behind its table.
#[derive(Debug, Clone)]
pub(super) struct OwnTail {
    link: f64,
    path: Arc<Path>,
    ends: Ends,
}

impl OwnTail {
    /// Returns the tail of a team if it is not one of the table's links.
    pub(super) fn of(team: &Team, track: &Track) -> Option<Self> {
        let link = team.link(team.own_tail_link()?);
        Some(Self { link, path: Arc::new(track.path.clone()), ends: track.ends.clone() })
    }

    /// Writes the last handle, and the heading of the tail's front handle. `second` is the place of the second handle.
    /// Returns `None` if the last handle cannot be found from the table.
    pub(super) fn write(&self, rows: &Rows, second: Alpha, velocities: Velocities, chain: &mut ChainMut) -> Option<()> {
        let track = Track { path: &self.path, ends: self.ends.clone() };
        let last = chain.handles() - 1;
        let front = place(rows, &track, Alpha { row: second.row + last - 2, ..second })?;
        let rear = track.follower(front, self.link)?;
        let direction = track.displacement(rear, front) / self.link;
        let (point, tangent) = (self.path.point(rear), self.path.tangent(rear));
        (chain.x[last], chain.y[last]) = (point.x, point.y);
        chain.heading[last] = heading(direction);
        chain.heading[last - 1] = chain.heading[last];
        if velocities == Velocities::Computed {
            let ratio = direction.dot(&self.path.tangent(front)) / direction.dot(&tangent);
            chain.speed[last] = ratio * chain.speed[last - 1];
            chain.vx[last] = chain.speed[last] * tangent.x;
            chain.vy[last] = chain.speed[last] * tangent.y;
        }
        Some(())
    }
}

/// Returns the place on the path that the table has for `alpha`.
fn place(rows: &Rows, track: &Track, alpha: Alpha) -> Option<Param> {
    let (centre, local) = rows.local(alpha)?;
    let mut place = centre;
    for _ in 0..MOST_STEPS {
        let step = (local.offset - track.displacement(centre, place)).dot(&track.path.tangent(place));
        place = track.moved(place, step)?;
        // The next step is about the square of this one over the radius of curvature.
        if step.abs() <= 1e-9 * local.rate.norm() {
            return Some(place);
        }
    }
    None
}
