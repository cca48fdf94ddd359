//! Layout of the table before it is made: its reach forward, its bands of rows, and the phases at which the path's
//! junctions cut it.

use super::beginning::Beginning;
use super::rows::{LANES, Piece};
use super::track::{Node, Track};
use crate::event::Budget;
use crate::linkage;
use crate::model::curve::Curve;
use crate::model::path::Param;
use crate::model::team::Team;

/// Kinks nearer together than this, in links, count as one.
const SAME_KINK: f64 = 1e-11;

/// The greatest number of rows ahead of the team: for a longer path the table covers its beginning.
const MOST_ROWS_AHEAD: usize = 1 << 15;

/// Rows of the frontmost band; each further band reaches twice as far back.
const FIRST_BAND: usize = 8;

/// Returns the first row of each band and the row behind it, from the rear forward.
pub(super) fn bands(end: usize) -> Vec<(usize, usize)> {
    let mut begins = vec![0];
    let mut next = FIRST_BAND;
    // A short last band is avoided.
    while next + next / 2 <= end {
        begins.push(next);
        next *= 2;
    }
    let ends = begins.iter().skip(1).copied().chain([end]);
    let mut bands: Vec<(usize, usize)> = begins.iter().copied().zip(ends).collect();
    bands.reverse();
    bands
}

/// Returns the metres of the head's travel that a table may cover.
pub(super) fn longest_reach(track: &Track, team: &Team) -> f64 {
    track.path.length().min(MOST_ROWS_AHEAD as f64 * team.link(1))
}

/// Returns the foremost place of the second handle while the head travels `reach` metres; `None` if there is none, or
/// the budget is spent.
pub(super) fn foremost(track: &Track, team: &Team, reach: f64, budget: &mut Budget) -> Option<Param> {
    let second = |travelled: f64| linkage::follower(track.path, track.path.param_at(travelled), team.link(0)).ok();
    let mut foremost = second(0.0)?;
    let mut farther = |place: Param| {
        if track.path.arc_length(foremost, place) > 0.0 {
            foremost = place;
        }
    };
    let step = team.link(0).max(team.link(1));
    let (mut good, mut bad) = (0.0, f64::INFINITY);
    while bad == f64::INFINITY && good < reach {
        budget.spend(1).ok()?;
        let next = (good + step).min(reach);
        match second(next) {
            Some(place) => {
                farther(place);
                good = next;
            }
            None => bad = next,
        }
    }
    for _ in 0..if bad.is_finite() { 40 } else { 0 } {
        let middle = 0.5 * (good + bad);
        match second(middle) {
            Some(place) => {
                farther(place);
                good = middle;
            }
            None => bad = middle,
        }
    }
    Some(foremost)
}

/// Returns alpha of every junction at which the path's curvature changes, in order of phase. None is further ahead than
/// `furthest`. Some are missing if the budget is spent.
pub(super) fn kinks(
    track: &Track,
    beginning: &Beginning,
    link: f64,
    end: usize,
    furthest: Param,
    budget: &mut Budget,
) -> Vec<f64> {
    let path = track.path;
    let margin = 2.0 * (LANES + 4) as f64 * link;
    let is_covered =
        |segment: &usize| path.arc_length(furthest, Param { segment: *segment, at: path.first(*segment) }) <= margin;
    let mut kinks: Vec<f64> = (1..path.segments())
        .take_while(is_covered)
        .filter_map(|segment| {
            let junction = Param { segment, at: path.first(segment) };
            let is_straight = |segment| path.segment_at(segment).constant_curvature() == Some(0.0);
            if is_straight(segment - 1) && is_straight(segment) {
                return None;
            }
            let (mut place, mut links) = (junction, 0.0);
            loop {
                if let Some(alpha) = beginning.alpha(place) {
                    break Some(end as f64 + alpha - links);
                }
                budget.spend(1).ok()?;
                place = track.follower(place, link)?;
                links += 1.0;
            }
        })
        .filter(|alpha| *alpha >= 0.0)
        .collect();
    kinks.sort_by(|a, b| a.fract().total_cmp(&b.fract()));
    kinks
}

/// Returns the places of the head, in metres of travel, at which a handle behind it crosses a junction, because frames
/// have kinks there. The list covers every junction and all handles that have only one place each. It does not depend
/// on a table. Returns `None` if the budget is spent.
pub(super) fn crossings(track: &Track, team: &Team, budget: &mut Budget) -> Option<Vec<f64>> {
    let path = track.path;
    let mut crossings = Vec::new();
    for segment in 1..path.segments() {
        let at = Param { segment, at: path.first(segment) };
        let first = Node { at, tangent: path.tangent(at), spacing: 1.0, heading: 0.0, heading_rate: 0.0 };
        let (mut gap, mut head_gap) = (team.link(1), team.link(0));
        let second_handles = std::iter::successors(Some(first), move |rear| track.ahead(rear, &mut gap, team.link(1)));
        let heads = second_handles.map_while(|second| track.ahead(&second, &mut head_gap, team.link(0)));
        let travelled = heads.take(team.benches).map(|head| path.travelled(head.at));
        for travelled in travelled.take_while(|travelled| *travelled < path.length()) {
            budget.spend(2).ok()?;
            crossings.push(travelled);
        }
    }
    Some(crossings)
}

/// Returns the pieces into which the kinks of a band cut the phases.
pub(super) fn between_kinks(kinks: &[f64], first_row: usize) -> Vec<Piece> {
    let mut cuts = vec![0.0];
    for kink in kinks.iter().filter(|kink| **kink >= first_row as f64) {
        let phase = kink.fract();
        if phase - cuts[cuts.len() - 1] > SAME_KINK && phase < 1.0 - SAME_KINK {
            cuts.push(phase);
        }
    }
    cuts.push(1.0);
    cuts.windows(2).map(|cut| Piece { begin: cut[0], end: cut[1] }).collect()
}
