//! The first contact of any two boards that share no handle, by steps that certainly contain no contact.

use super::chain::{Chain, Pose, Span};
use super::geometry::{Vector, left_of};

/// Steps after which the search gives up.
const MOST_STEPS: usize = 400_000;

/// A board: half its length lies along `along`, a unit vector, to either side of its centre.
#[derive(Clone, Copy)]
struct Board {
    centre: Vector,
    along: Vector,
    half: [f64; 2],
}

impl Board {
    fn reach_along(&self, axis: Vector) -> f64 {
        self.half[0] * self.along.dot(&axis).abs() + self.half[1] * left_of(self.along).dot(&axis).abs()
    }

    /// Returns true if a point is on the board, within `slack` metres.
    fn holds(&self, point: Vector, slack: f64) -> bool {
        let offset = point - self.centre;
        offset.dot(&self.along).abs() <= self.half[0] + slack && offset.perp(&self.along).abs() <= self.half[1] + slack
    }
}

/// Returns the gap between the shadows of two boards on an axis that leads from the first to the second.
fn gap_along(axis: Vector, one: &Board, other: &Board) -> f64 {
    axis.dot(&(other.centre - one.centre)) - one.reach_along(axis) - other.reach_along(axis)
}

/// Returns the largest gap between two boards on an axis across one of their sides, and that axis. The gap is positive
/// if the boards are apart, and then at most their distance; its negative is otherwise the shortest way that parts
/// them.
fn largest_gap(one: &Board, other: &Board) -> (f64, Vector) {
    let towards = other.centre - one.centre;
    let axes = [one.along, left_of(one.along), other.along, left_of(other.along)];
    let axes = axes.map(|axis| if axis.dot(&towards) < 0.0 { -axis } else { axis });
    let gaps = axes.map(|axis| (gap_along(axis, one, other), axis));
    gaps.into_iter().fold((f64::NEG_INFINITY, towards), |most, gap| if gap.0 > most.0 { gap } else { most })
}

#[derive(Clone, Copy, Debug)]
pub struct Touch {
    pub head: f64,
    pub benches: (usize, usize),
}

pub struct Boards<'a> {
    pub chain: &'a Chain<'a>,
}

impl Boards<'_> {
    fn boards(&self, pose: &Pose) -> Vec<Board> {
        let team = self.chain.team;
        let of = |bench: usize| {
            let (front, rear) = (pose.handles[bench].point, pose.handles[bench + 1].point);
            let half = [0.5 * team.link(bench) + team.hole_inset, 0.5 * team.width(bench)];
            Board { centre: 0.5 * (front + rear), along: (front - rear) / team.link(bench), half }
        };
        (0..team.benches).map(of).collect()
    }

    fn pairs(&self) -> impl Iterator<Item = (usize, usize)> {
        let benches = self.chain.team.benches;
        (0..benches).flat_map(move |a| (a + 2..benches).map(move |b| (a, b)))
    }

    /// Returns the gap of one pair.
    pub fn gap(&self, head: f64, (a, b): (usize, usize)) -> f64 {
        let boards = self.boards(&self.chain.pose(head));
        largest_gap(&boards[a], &boards[b]).0
    }

    /// Returns the pair with the least gap.
    pub fn least_gap(&self, head: f64) -> Option<(f64, (usize, usize))> {
        let boards = self.boards(&self.chain.pose(head));
        let gaps = self.pairs().map(|(a, b)| (largest_gap(&boards[a], &boards[b]).0, (a, b)));
        gaps.min_by(|one, other| one.0.total_cmp(&other.0))
    }

    /// Returns true if a point is on both boards of a pair, within `slack` metres.
    pub fn both_hold(&self, head: f64, (a, b): (usize, usize), point: Vector, slack: f64) -> bool {
        let boards = self.boards(&self.chain.pose(head));
        boards[a].holds(point, slack) && boards[b].holds(point, slack)
    }

    /// Returns the greatest movement of a point of a board per metre of its handles. A corner is front (1 - l) + rear l
    /// + m (across), with l up to inset / link beyond both ends and m = width / 2 link.
    fn overhang(&self, bench: usize) -> f64 {
        let team = self.chain.team;
        1.0 + (2.0 * team.hole_inset + team.width(bench)) / team.link(bench)
    }

    /// Returns the first contact up to `end`, with no lock before `end`; an error if the work is too much.
    pub fn first_contact(&self, end: f64) -> Result<Option<Touch>, String> {
        if let Some((_, benches)) = self.least_gap(0.0).filter(|(gap, _)| *gap <= 0.0) {
            return Ok(Some(Touch { head: 0.0, benches }));
        }
        if self.chain.team.benches < 3 {
            return Ok(None);
        }
        let mut here = self.chain.pose(0.0);
        let mut step = 0.1 * self.chain.team.link(1);
        for _ in 0..MOST_STEPS {
            let head = (here.head + step).min(end);
            let next = self.chain.pose(head);
            let step_done = head - here.head;
            if self.is_clear(&here, &next) {
                here = next;
                step *= 1.5;
            } else if step_done > 4.0 * f64::EPSILON * (head + self.chain.team.link(1)) {
                step = 0.5 * step_done;
                continue;
            } else if let Some((_, benches)) = self.least_gap(head).filter(|(gap, _)| *gap <= 0.0) {
                return Ok(Some(Touch { head, benches }));
            } else {
                // Within the resolution of doubles, nothing happens in the last bit.
                here = next;
                step *= 2.0;
            }
            if here.head >= end {
                return Ok(None);
            }
        }
        Err(format!("contact: searched up to {} m only", here.head))
    }

    /// Returns true if certainly no two boards touch while the head goes from one pose to another.
    fn is_clear(&self, from: &Pose, to: &Pose) -> bool {
        let spans = self.chain.spans(from, to);
        // The greatest distance of each handle from its first place.
        let moved: Vec<f64> = spans
            .iter()
            .zip(&from.handles)
            .map(|(span, handle)| (span.high.s - handle.place.s).max(handle.place.s - span.low.s))
            .collect();
        let (before, after) = (self.boards(from), self.boards(to));
        // Computed only if two boards come near each other.
        let mut strays: Option<Vec<f64>> = None;
        let by = |bench: usize, ways: &[f64]| self.overhang(bench) * ways[bench].max(ways[bench + 1]);
        for a in 0..before.len() {
            for b in a + 2..before.len() {
                let (one, other) = (&before[a], &before[b]);
                let ways = by(a, &moved) + by(b, &moved);
                let radii = one.half[0] + one.half[1] + other.half[0] + other.half[1];
                if (other.centre - one.centre).norm_squared() > (radii + ways).powi(2) {
                    continue;
                }
                let places = |k: usize| [spans[k].low, spans[k].high, spans[k + 1].low, spans[k + 1].high];
                let (first, axis) = largest_gap(one, other);
                let together = [spans[a].low, spans[a].high, spans[b + 1].low, spans[b + 1].high];
                let rigid = self.chain.path.is_even(together)
                    && self.chain.path.is_even(places(a))
                    && self.chain.path.is_even(places(b));
                if first > ways || (rigid && first > 0.0) {
                    continue;
                }
                let (last, last_axis) = largest_gap(&after[a], &after[b]);
                if first <= 0.0 || last <= 0.0 {
                    return false;
                }
                let strays = strays.get_or_insert_with(|| self.strays(from, to, &spans));
                let stray = by(a, strays) + by(b, strays);
                // If all handles went straight from first to last, the gap on a fixed axis would be concave in time.
                let clear = [axis, last_axis, (axis + last_axis).normalize()]
                    .into_iter()
                    .any(|axis| gap_along(axis, one, other).min(gap_along(axis, &after[a], &after[b])) > stray);
                if !clear {
                    return false;
                }
            }
        }
        true
    }

    /// Returns the greatest deviation of each handle from a straight and even way between two poses; infinity if
    /// unknown.
    ///
    /// A velocity that stays within `wander` of its first value deviates by half of that times the step. From handle to
    /// handle, v' = v f / c, and the cosines change as path and bench turn.
    fn strays(&self, from: &Pose, to: &Pose, spans: &[Span]) -> Vec<f64> {
        let step = to.head - from.head;
        let turned: Vec<f64> = spans.iter().map(|span| self.chain.path.turned(span.low, span.high)).collect();
        // The change of the front handle's speed.
        let mut change = 0.0;
        let mut strays = Vec::with_capacity(spans.len());
        for (k, (one, other)) in from.handles.iter().zip(&to.handles).enumerate() {
            let fastest = one.speed.abs().max(other.speed.abs()) + change;
            strays.push(0.5 * step * (change + fastest * turned[k]));
            if k + 1 == spans.len() {
                break;
            }
            // The bench turns as fast as its handles move across it; both change little in a short step.
            let link = self.chain.team.link(k);
            let rate = |pose: &Pose| {
                let (front, rear) = (&pose.handles[k], &pose.handles[k + 1]);
                let bench = (front.point - rear.point) / link;
                (front.speed * front.tangent - rear.speed * rear.tangent).perp(&bench).abs() / link
            };
            let bench_turned = 2.0 * step * rate(from).max(rate(to));
            let drop = |cosine: f64, turn: f64| turn * (1.0 - cosine * cosine).max(0.0).sqrt() + 0.5 * turn * turn;
            let c = one.rear_cosine.min(other.rear_cosine);
            let front_drop = drop(one.front_cosine, turned[k] + bench_turned);
            let rear_drop = drop(one.rear_cosine, turned[k + 1] + bench_turned);
            if turned[k].max(turned[k + 1]).max(bench_turned) > 0.2 || rear_drop > 0.25 * c {
                strays.resize(spans.len(), f64::INFINITY);
                break;
            }
            let behind = from.handles[k + 1].speed.abs();
            change = (change * one.front_cosine.abs()
                + one.speed.abs() * front_drop
                + behind * rear_drop
                + change * front_drop)
                / (c - rear_drop);
        }
        strays
    }
}
