//! One step of the head: the spans of the handles, and the lemmas over them.

use std::cell::OnceCell;

use super::boards::{MovingBoard, Shape};
use super::branch::{Branch, branches, link_kind};
use super::capsule::{Spanned, moved_back};
use super::grid::{GridPoint, span};
use super::ground::Barrier;
use super::interval::{Interval, minus, norm};
use super::lines::{Links, Step};
use super::link::{Front, follower_within};
use super::path::ExactPath;
use super::place::{Place, Span};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::model::Point;
use bench_dragon_motion::model::board::Board;
use bench_dragon_motion::model::path::Path;
use bench_dragon_motion::model::separation::{closest_points_board_board, overlap_centre, separation_board_board};
use bench_dragon_motion::model::team::Team;

/// The statements that a step must show.
#[derive(Debug, Clone, Copy)]
pub(super) struct Claim {
    pub links: Links,
    pub moving: bool,
    pub clear: bool,
}

/// The part of a step that could not be shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Obstacle {
    /// A link's follower cannot be enclosed.
    Link(usize),
    /// A link's front product is not surely positive.
    Stall(usize),
    /// Handle 1 may be behind where it started.
    Behind,
    /// Two boards may touch.
    Pair(usize, usize),
    /// A board may come to an obstacle of the stage, which has this number.
    Stage(usize),
}

impl Obstacle {
    /// Returns true if an event of this kind explains the obstacle.
    pub fn is_of(self, kind: EventKind) -> bool {
        match self {
            Self::Pair(..) => kind == EventKind::Contact,
            Self::Stall(_) => kind == EventKind::Stall,
            Self::Link(_) => kind == EventKind::Lock,
            Self::Stage(_) => kind == EventKind::Obstacle,
            Self::Behind => false,
        }
    }
}

/// A step that is shown.
pub(super) struct Shown {
    pub step: Step,
    /// True if every link behind the head's surely goes forward.
    pub body_forward: bool,
}

/// A team on a path, in intervals.
pub(super) struct Chain<'a> {
    pub path: &'a Path,
    pub exact: ExactPath,
    pub team: &'a Team,
    /// By [kind of bench](Team::kinds): the metres between its handles, and the shape of its board.
    pub links: [Interval; 3],
    pub shapes: [Shape; 3],
    /// A bound of S of Lemma 4: a place no earlier than the start of handle 1.
    pub start: Option<Place>,
    /// The obstacles of the stage.
    pub barriers: Vec<Barrier>,
    pub branches: Vec<Branch>,
    /// The metres that boards must keep from each other to be clear.
    pub clearance: f64,
}

/// Length added to both ends of a span, as a multiple of the rounding of doubles.
const PAD: f64 = 64.0 * f64::EPSILON;

/// Multiples of the pad that are tried for each handle, in this order. The first list is for most steps. The second
/// list is for steps next to an event, where the width of the spans is the width of the event's enclosure.
const COARSE: [f64; 3] = [1.0, 16.0, 256.0];
const FINE: [f64; 11] = [0.015625, 0.03125, 0.0625, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 16.0, 256.0];

/// The length of a step next to an event, in links.
const NEXT_TO_EVENT: f64 = 1e-9;

/// Returns the metres between the handles of a bench.
pub(super) fn link_of(team: &Team, bench: usize) -> Interval {
    Interval::point(team.board_length(bench)) - Interval::point(team.hole_inset) * 2.0
}

impl<'a> Chain<'a> {
    pub fn new(path: &'a Path, exact: ExactPath, team: &'a Team) -> Self {
        let branches = branches(path, &exact, team);
        let kinds = team.kinds();
        let (links, shapes) = (kinds.map(|bench| link_of(team, bench)), kinds.map(|bench| Shape::new(team, bench)));
        Self { path, exact, team, links, shapes, start: None, barriers: Vec::new(), clearance: 0.0, branches }
    }

    /// Returns the metres between the handles of a bench.
    pub fn link(&self, bench: usize) -> Interval {
        self.links[self.kind(bench)]
    }

    /// Returns the shape of the board of a bench.
    pub fn shape(&self, bench: usize) -> Shape {
        self.shapes[self.kind(bench)]
    }

    /// Returns all branches, and the kind of a bench's link.
    pub fn branches_of(&self, bench: usize) -> (&[Branch], usize) {
        (&self.branches, link_kind(self.team, bench))
    }

    fn kind(&self, bench: usize) -> usize {
        if bench > 0 && bench + 1 == self.team.benches { 2 } else { bench.min(1) }
    }

    /// Returns the first benches of the runs of equal boards from a bench on, which is not the head: a tail with a size
    /// of its own is a run by itself.
    pub fn runs(&self, first: usize) -> impl Iterator<Item = usize> + use<> {
        let tail = self.team.own_tail().filter(|tail| first < *tail);
        std::iter::once(first).chain(tail)
    }

    /// Returns the number of links, and their length, of the run of equal boards that begins with a bench.
    pub fn run(&self, first: usize) -> (usize, Interval) {
        let (benches, tail) = (self.team.benches, self.team.own_tail());
        if tail == Some(first) {
            return (1, self.links[2]);
        }
        let links = benches - first - usize::from(tail.is_some());
        (links, self.links[1] * links as f64)
    }

    /// Returns the shape of a board that holds every board behind the head's.
    pub fn rear_shape(&self) -> Shape {
        let [_, body, tail] = self.shapes;
        Shape { half_width: body.half_width.max(tail.half_width), ..body }
    }

    /// Returns the first bench behind a bench from which on a step must test the pairs of both. The others have been in
    /// their position before: Lemma 4. A tail with a size of its own has not, and is the last bench.
    pub fn first_partner(&self, links: Links, bench: usize) -> Option<usize> {
        let first = if links == Links::All || bench < 2 { Some(bench + 2) } else { self.team.own_tail() };
        first.filter(|first| bench + 2 <= *first && *first < self.team.benches)
    }

    /// Shows a claim over the step between two grid points, and that boards stay clear of the obstacles `free`.
    ///
    /// # Errors
    /// The obstacle.
    pub fn show(
        &self,
        from: &mut GridPoint,
        to: &mut GridPoint,
        claim: Claim,
        free: &[usize],
    ) -> Result<Shown, Obstacle> {
        let mut listed = Listed::new(self, Span(from.head, to.head), to.travelled - from.travelled);
        while listed.handles.len() <= self.team.benches && !listed.is_enough(claim) {
            listed.extend(from, to, claim)?;
        }
        if claim.clear {
            listed.boards_are_apart(claim.links)?;
        }
        listed.boards_avoid(free, claim.links)?;
        let spans = listed.handles[1..].iter().map(|handle| handle.span).collect();
        let Claim { links, moving, clear } = claim;
        let (free, apart, beside, at) = (free.to_vec(), None, Vec::new(), Vec::new());
        let step = Step { links, from: from.head, to: to.head, moving, clear, spans, free, apart, beside, at };
        Ok(Shown { step, body_forward: listed.body_forward })
    }

    /// Returns handles 0 to `handle` between two grid points, if Lemma 1 holds for every link between them.
    pub fn spans(&self, from: &mut GridPoint, to: &mut GridPoint, handle: usize) -> Option<Vec<Spanned>> {
        self.spans_until(from, to, |handles| handles.len() > handle)
    }

    /// Returns handles from 0 on between two grid points until `enough` holds, if Lemma 1 holds for every link between
    /// them.
    pub fn spans_until(
        &self,
        from: &mut GridPoint,
        to: &mut GridPoint,
        enough: impl Fn(&[Spanned]) -> bool,
    ) -> Option<Vec<Spanned>> {
        let claim = Claim { links: Links::All, moving: false, clear: false };
        let mut listed = Listed::new(self, Span(from.head, to.head), to.travelled - from.travelled);
        while !enough(&listed.handles) {
            listed.extend(from, to, claim).ok()?;
        }
        Some(listed.handles)
    }

    /// Returns a point that is proved to be in both boards.
    pub fn common_point(&self, handles: &[Spanned], benches: [usize; 2]) -> Option<[f64; 2]> {
        let boards = benches.map(|bench| {
            let Shape { inset, half_width } = self.shape(bench);
            let [front, rear] = [bench, bench + 1].map(|handle| {
                let [x, y] = handles[handle].capsule.point.map(Interval::middle);
                Point::new(x, y)
            });
            Board::from_handles(front, rear, inset.middle(), 2.0 * half_width.middle())
        });
        let point: [f64; 2] = overlap_centre(&boards[0], &boards[1]).into();
        let holds = |bench: &usize| self.board(handles, *bench).holds(point.map(Interval::point));
        benches.iter().all(holds).then_some(point)
    }

    /// Returns a point of each of two boards that is proved to be in it. The two are less than `metres` apart, or one
    /// point if `metres` is not positive.
    pub fn near_points(&self, handles: &[Spanned], benches: [usize; 2], metres: Interval) -> Option<[[f64; 2]; 2]> {
        if !metres.is_positive() {
            return self.common_point(handles, benches).map(|point| [point; 2]);
        }
        let boards = benches.map(|bench| self.board(handles, bench).in_doubles());
        let inside = |metres: f64| {
            let [one, other] = boards.map(|board| board.grown(-metres));
            if separation_board_board(&one, &other) > 0.0 {
                return closest_points_board_board(&one, &other);
            }
            let point = overlap_centre(&one, &other);
            (point, point)
        };
        let most = boards.iter().map(|board| board.half_width.min(board.half_length)).fold(f64::INFINITY, f64::min);
        // As far inside as the metres allow: handles that are uncertain move the boards.
        let is_too_far = |metres_inside: f64| {
            let (one, other) = inside(metres_inside);
            (other - one).norm() >= metres.lo * (1.0 - 1e-12)
        };
        let (mut near, mut far) = (0.0, most);
        while far - near > 1e-3 * near && far > 1e-15 * most {
            let middle = 0.5 * (near + far);
            if is_too_far(middle) { far = middle } else { near = middle }
        }
        let (one, other) = inside(near);
        let points = [one, other].map(<[f64; 2]>::from);
        let [one, other] = points.map(|point| point.map(Interval::point));
        let holds = |bench: usize, point| self.board(handles, bench).holds(point);
        let are_near = norm(minus(other, one)).is_below(metres);
        (are_near && holds(benches[0], one) && holds(benches[1], other)).then_some(points)
    }

    /// Returns the board of a bench from listed handles.
    pub fn board(&self, handles: &[Spanned], bench: usize) -> MovingBoard {
        self.shape(bench).board(handles[bench].capsule, handles[bench + 1].capsule, self.link(bench))
    }
}

/// The handles of a step that are enclosed so far.
pub(super) struct Listed<'c, 'a> {
    chain: &'c Chain<'a>,
    pub handles: Vec<Spanned>,
    /// Pad of the last handle, in metres.
    pad: f64,
    /// Multiples of the pad to try, and the number of multiples that were too small for the last handle.
    multiples: &'static [f64],
    too_small: usize,
    /// The length added to every pad, in metres, for a path that is an interval of paths.
    slack: f64,
    /// True if every link behind the head's surely goes forward.
    pub body_forward: bool,
    /// An upper bound of the distance from the centre of boards 0 and 1, once requested. Listed handles do not change.
    front_reach: OnceCell<f64>,
}

/// Returns an upper bound of the sum of two numbers.
pub(super) fn sum_above(one: f64, other: f64) -> f64 {
    (Interval::point(one) + Interval::point(other)).hi
}

impl<'c, 'a> Listed<'c, 'a> {
    /// Lists the head over a step of `metres`.
    pub fn new(chain: &'c Chain<'a>, head: Span, metres: f64) -> Self {
        let handles = vec![Spanned::new(&chain.exact, head)];
        Self::behind(chain, handles, metres)
    }

    /// Continues behind handles that are already enclosed. The span between the two grid points must be the last
    /// handle's.
    pub fn behind(chain: &'c Chain<'a>, handles: Vec<Spanned>, metres: f64) -> Self {
        let is_fine = metres < NEXT_TO_EVENT * chain.team.shortest_link();
        let multiples = if is_fine { &FINE[..] } else { &COARSE };
        Self {
            chain,
            handles,
            pad: 0.0,
            multiples,
            too_small: 0,
            slack: 0.0,
            body_forward: true,
            front_reach: OnceCell::new(),
        }
    }

    /// Adds metres to the pad of every handle that is still to be enclosed.
    pub fn with_slack(self, slack: f64) -> Self {
        Self { slack, ..self }
    }

    /// Returns true for a step next to an event: places have low words.
    fn is_fine(&self) -> bool {
        self.multiples.len() == FINE.len()
    }

    /// Returns true if a handle is on a straight line without a beginning.
    pub fn is_on_line(&self, handle: usize) -> bool {
        let Chain { exact, .. } = self.chain;
        self.handles[handle].span.1.0 == 0 && exact.segments[0].curve.is_straight()
    }

    /// Returns a lower bound of the distance from the centre of all handles from this one on; minus infinity if
    /// unknown.
    fn ring(&self, handle: usize) -> f64 {
        let Place(segment, theta, _) = self.handles[handle].span.1;
        if segment > 0 {
            return f64::NEG_INFINITY;
        }
        self.chain.exact.segments[0].curve.distance_from_centre(theta)
    }

    /// Returns a lower bound of the distance from the centre of all boards from a handle on. The handle is not the
    /// head's. Returns minus infinity if the bound is unknown.
    pub fn innermost(&self, from_handle: usize) -> f64 {
        let [_, body, tail] = self.chain.links;
        self.chain.rear_shape().innermost(self.ring(from_handle), body.max(tail))
    }

    /// Returns true if boards 0 and 1, whose handles are listed, are further than `metres` from all boards from a
    /// handle on.
    pub fn is_beyond_front(&self, metres: f64, from_handle: usize) -> bool {
        let reach = self.front_reach.get_or_init(|| {
            let of_bench = |bench| self.chain.shape(bench).outermost(&self.chain.board(&self.handles, bench));
            f64::max(of_bench(0), of_bench(1))
        });
        self.innermost(from_handle) > sum_above(*reach, metres)
    }

    /// Returns true if the listed handles suffice for the claim.
    fn is_enough(&self, claim: Claim) -> bool {
        let last = self.handles.len() - 1;
        if last < 2 {
            return false;
        }
        match claim.links {
            // No other board has been where a tail with a size of its own is.
            Links::Front if self.chain.team.own_tail().is_some() => self.is_on_line(last),
            Links::Front if !claim.clear => true,
            Links::Front if self.chain.exact.begins_inward() => self.is_beyond_front(self.chain.clearance, last),
            _ => self.is_on_line(last),
        }
    }

    /// Encloses one more handle.
    pub fn extend(&mut self, from: &mut GridPoint, to: &mut GridPoint, claim: Claim) -> Result<(), Obstacle> {
        let Chain { path, exact, team, start, .. } = self.chain;
        let link = self.handles.len() - 1;
        let solved = from.extend_to(link + 1, path, team).and_then(|()| to.extend_to(link + 1, path, team));
        solved.map_err(|_| Obstacle::Link(link))?;
        let front = self.handles[link];
        let ends = [from.handles[link + 1], to.handles[link + 1]];
        let length = self.chain.link(link);
        let fine = self.is_fine();
        // A unit in the last place of a spiral's coordinate theta is theta times as many metres as one of its radius.
        let turned = if fine { 0.0 } else { exact.curve(front.span.0).polar_angle(front.span.0.1) };
        let radius = front.first[0].magnitude() + front.first[1].magnitude();
        let size = length.hi + radius * (1.0 + 0.1 * turned);
        let rear_cosine = ends[0].rear_cosine.min(ends[1].rear_cosine).max(1e-12);
        let front_cosine = ends.iter().map(|end| end.front_cosine.abs()).fold(0.0, f64::max);
        let mut least = (1.000_001 * self.pad * front_cosine + self.slack) / rear_cosine;
        let turns = ends[0].front_cosine.signum() != ends[1].front_cosine.signum();
        if turns {
            let half = front.capsule.half;
            least += 4.0 * (1.0 + front.capsule.curvature * length.hi) * half * (half / length.lo) / rear_cosine;
        }
        let first = self.too_small.saturating_sub(1);
        let padded = self.multiples.iter().enumerate().skip(first).find_map(|(too_small, multiple)| {
            let pad = least + multiple * PAD * size / rear_cosine;
            let rear = Spanned::new(exact, span(exact, ends[0].param, ends[1].param, pad, fine));
            let sign = follower_within(exact, &front, &rear, length, self.chain.branches_of(link))?;
            Some((too_small, pad, rear, sign))
        });
        let (too_small, pad, rear, sign) = padded.ok_or(Obstacle::Link(link))?;
        (self.too_small, self.pad) = (too_small, pad);
        let forward = sign == Front::Forward;
        if !forward && (claim.moving || link == 1 && claim.links == Links::Front) {
            return Err(Obstacle::Stall(link));
        }
        if link == 0 && claim.links == Links::Front && !start.is_some_and(|start| exact.in_order(start, rear.span.0)) {
            return Err(Obstacle::Behind);
        }
        self.body_forward &= forward || link == 0;
        self.handles.push(rear);
        Ok(())
    }

    /// Shows that boards are apart: all of them, or boards 0 and 1 from the others.
    fn boards_are_apart(&self, links: Links) -> Result<(), Obstacle> {
        let (chain, benches) = (self.chain, self.chain.team.benches);
        let listed = self.handles.len() - 1;
        let boards: Vec<_> = (0..listed).map(|bench| chain.board(&self.handles, bench)).collect();
        let is_spiral = chain.exact.begins_inward();
        let innermost: Vec<f64> = (0..=listed).map(|handle| self.innermost(handle)).collect();
        for (a, board) in boards.iter().enumerate() {
            let outermost = sum_above(chain.shape(a).outermost(board), chain.clearance);
            let mut beyond = false;
            let Some(first) = chain.first_partner(links, a) else { break };
            for (b, other) in boards.iter().enumerate().skip(first) {
                beyond = innermost[b] > outermost;
                if beyond {
                    break;
                }
                if !board.is_apart_by(chain.clearance, other) {
                    return Err(Obstacle::Pair(a, b));
                }
            }
            // The boards that are not listed.
            let next = listed.max(first);
            if next < benches && !beyond {
                let apart = if is_spiral {
                    innermost[listed] > outermost
                } else {
                    chain.runs(next).all(|run| board.is_apart_by(chain.clearance, &self.straight_run(run)))
                };
                if !apart {
                    return Err(Obstacle::Pair(a, next));
                }
            }
        }
        if links == Links::All && !is_spiral && listed < benches {
            let inset = Interval::point(chain.team.hole_inset) * 2.0 + Interval::point(chain.clearance);
            if !inset.is_below(chain.links[1]) {
                return Err(Obstacle::Pair(listed, listed + 2));
            }
        }
        Ok(())
    }

    /// Returns the boards that obstacles concern, with their benches: all, with the boards that are not listed as one
    /// board, or boards 0 and 1 and a tail with a size of its own.
    pub fn boards_on_ground(&self, links: Links) -> Vec<(usize, MovingBoard)> {
        let (chain, benches) = (self.chain, self.chain.team.benches);
        let listed = self.handles.len() - 1;
        let own_tail = chain.team.own_tail();
        let concerns = |bench: &usize| links == Links::All || *bench < 2 || own_tail == Some(*bench);
        let of_listed = (0..listed).filter(concerns).map(|bench| (bench, chain.board(&self.handles, bench)));
        let mut boards: Vec<_> = of_listed.collect();
        let rest = if links == Links::All { Some(listed) } else { own_tail };
        boards.extend(
            rest.filter(|first| (listed..benches).contains(first))
                .into_iter()
                .flat_map(|first| chain.runs(first))
                .map(|first| (first, self.straight_run(first))),
        );
        boards
    }

    /// Shows that boards stay clear of obstacles: all boards, or boards 0 and 1.
    fn boards_avoid(&self, free: &[usize], links: Links) -> Result<(), Obstacle> {
        if free.is_empty() {
            return Ok(());
        }
        let (chain, boards) = (self.chain, self.boards_on_ground(links));
        let is_near =
            |obstacle: &&usize| !boards.iter().all(|(_, board)| chain.barriers[**obstacle].is_avoided_by(board));
        free.iter().find(is_near).map_or(Ok(()), |obstacle| Err(Obstacle::Stage(*obstacle)))
    }

    /// Returns the run of equal boards from `first` on as one board, on the line of the last listed handle.
    pub fn straight_run(&self, first: usize) -> MovingBoard {
        let (chain, listed) = (self.chain, self.handles.len() - 1);
        let back = |metres: Interval| moved_back(&self.handles[listed].capsule, metres);
        let (links, length) = chain.run(first);
        let front = chain.links[1] * (first - listed) as f64;
        let is_own_tail = chain.team.own_tail() == Some(first);
        let rear = if is_own_tail { front + length } else { chain.links[1] * (first + links - listed) as f64 };
        chain.shape(first).board(back(front), back(rear), length)
    }
}
