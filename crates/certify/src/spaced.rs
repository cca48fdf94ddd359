//! A team, and the distance that its boards must keep.
//!
//! In: a team alone, or with a clearance.

use bench_dragon_motion::model::team::Team;

/// A team, and the clearance that its boards must keep.
///
/// # Examples
///
/// ```
/// use bench_dragon_certify::plan::{Spaced, least_pitch};
/// use bench_dragon_motion::event::unreported;
/// use bench_dragon_motion::model::team::{Ends, Team};
///
/// let (head_length, body_length, ends) = (0.52, 0.57, Ends::NONE);
/// let team = Team { benches: 20, head_length, body_length, width: 0.054, hole_inset: 0.135, ends };
/// let apart = least_pitch(&team, 0.5, &mut unreported).unwrap();
/// let spaced = least_pitch(Spaced { team: &team, clearance: 0.02 }, 0.5, &mut unreported).unwrap();
/// assert!(spaced.value_lo > apart.value_lo);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Spaced<'a> {
    /// The team.
    pub team: &'a Team,
    /// The clearance of any two boards that share no handle, in metres; 0 if they need only be apart.
    pub clearance: f64,
}

impl<'a> From<&'a Team> for Spaced<'a> {
    fn from(team: &'a Team) -> Self {
        Self { team, clearance: 0.0 }
    }
}

impl Spaced<'_> {
    /// Returns the reason why boards are too near even on a straight line, or `None` if they are not.
    pub(crate) fn too_near_on_a_line(&self) -> Option<String> {
        let Self { team, clearance } = *self;
        let link = team.link(1);
        if team.benches < 3 || link - 2.0 * team.hole_inset > clearance {
            return None;
        }
        Some(if clearance > 0.0 {
            format!(
                "a bench has {link} m between its holes and insets of {} m, so that the boards before and after it are \
                 no more than {clearance} m apart even on a straight line",
                team.hole_inset
            )
        } else {
            format!(
                "a bench is as long as two insets or shorter ({link} m between its holes), so that the boards before \
                 and after it overlap even on a straight line"
            )
        })
    }
}
