//! Proof of a lock: places that the follower of a link cannot pass, with no follower between them in the end. Lemma 5
//! of `docs/proofs.md`.

use super::capsule::Spanned;
use super::grid::{GridPoint, place, span};
use super::interval::Interval;
use super::link::{all_nearer, one_place_within};
use super::place::{Place, Span};
use super::step::Chain;
use bench_dragon_motion::model::root::{bisect_predicate, golden_section_min};

/// The number of places between the handles of a link at which a nearer follower is searched for. The distances of
/// these places from the follower grow by the ratio.
const JUMP_SAMPLES: i32 = 400;
const JUMP_RATIO: f64 = 1.05;

/// The distances of a window's ends from the follower, as multiples of the distance of the place of greatest distance.
const WIDER: [f64; 6] = [2.0, 4.0, 16.0, 64.0, 256.0, 1024.0];

/// Limit of halvings of the stretch in which a link that locks has no follower any more.
const LOCK_HALVINGS: u32 = 12;

impl Chain<'_> {
    /// Returns places behind and ahead of `follower`, a span of the follower of a link, that it cannot pass while the
    /// front is in `front`. Between them is no follower for any front in `last`.
    pub fn lock_window(
        &self,
        at: &mut GridPoint,
        link: usize,
        follower: Span,
        (front, last): (&Spanned, &Spanned),
    ) -> Option<Span> {
        let Chain { path, exact, team, .. } = self;
        at.extend_to(link + 1, path, team).ok()?;
        let (before, rear) = (at.handles[link].param, at.handles[link + 1].param);
        let origin = path.point(before);
        // The distance is greatest where the rear product changes its sign, some way behind the follower.
        let product = |metres: f64| {
            let place = path.param_at(path.travelled(rear) - metres);
            path.tangent(place).dot(&(origin - path.point(place)))
        };
        let mut beyond = 1e-9 * team.link(link);
        while product(beyond) > 0.0 {
            beyond *= 2.0;
            if beyond > team.link(link) {
                return None;
            }
        }
        let top = bisect_predicate(|metres| product(metres) <= 0.0, 0.0, beyond);
        let length = self.link(link);
        let square = length.square();
        WIDER.iter().find_map(|wider| {
            let behind = path.param_at(path.travelled(rear) - top * (1.0 + wider));
            let ahead = path.param_at(path.travelled(rear) + top * wider);
            let window = Span(exact.moved(place(behind), 0.0, false), exact.moved(place(ahead), 0.0, false));
            let near = |place: Place| front.capsule.distance_squared(exact.point(place)).is_below(square);
            let holds = exact.is_before(window.0, follower.0)
                && exact.is_before(follower.1, window.1)
                && exact.in_order(window.1, front.span.0)
                && near(window.0)
                && near(window.1)
                && all_nearer(exact, last, window, length, LOCK_HALVINGS);
            holds.then_some(window)
        })
    }

    /// Returns a span of the follower of a link while the front is in `front`, until the follower is lost. Requires
    /// that the link is lost with the front in `last`, at the end of `front`.
    pub fn until_lock(&self, at: &mut GridPoint, link: usize, front: &Spanned, last: &Spanned) -> Option<Span> {
        let exact = &self.exact;
        let begins = self.spans(&mut at.clone(), &mut at.clone(), link + 1)?[link + 1].span;
        let window = self.lock_window(at, link, begins, (front, last)).or_else(|| {
            let jump = self.lock_jump(at, link, begins, (front, last))?;
            let rear = at.handles[link + 1];
            let reach = exact.length(front.span.0, front.span.1) / rear.rear_cosine.max(1e-12);
            let around = |wider: &f64| {
                let rear = Spanned::new(exact, span(exact, rear.param, rear.param, reach * wider, false));
                one_place_within(exact, front, &rear, self.link(link)).map(|_| rear.span)
            };
            exact.in_order(begins.1, jump.0).then(|| [2.0, 16.0, 256.0].iter().find_map(around))?
        })?;
        (exact.in_order(window.0, begins.0) && exact.in_order(begins.1, window.1)).then_some(window)
    }

    /// Returns two places ahead of `follower`, a span of the follower of a link. The first is nearer than the link for
    /// all of `front`; the second, ahead of it, is further than the link for all of `last`.
    pub fn lock_jump(
        &self,
        at: &mut GridPoint,
        link: usize,
        follower: Span,
        (front, last): (&Spanned, &Spanned),
    ) -> Option<Span> {
        let Chain { path, exact, team, .. } = self;
        at.extend_to(link + 1, path, team).ok()?;
        let rear = at.handles[link + 1].param;
        let square = self.link(link).square();
        let (from, to) = (path.travelled(rear), path.travelled(at.handles[link].param));
        let origin = last.first.map(Interval::middle);
        let distance = |travelled: f64| {
            let at = path.point(path.param_at(travelled));
            (at.x - origin[0]).hypot(at.y - origin[1])
        };
        // The furthest place ahead of the first sample that is nearer than its neighbours, at any distance from the
        // follower.
        let sampled = |k: i32| from + (to - from) * JUMP_RATIO.powi(k - JUMP_SAMPLES);
        let falling = (1..JUMP_SAMPLES).find(|k| distance(sampled(*k)) > distance(sampled(k - 1)))?;
        let peak = (falling..JUMP_SAMPLES).max_by(|j, k| distance(sampled(*j)).total_cmp(&distance(sampled(*k))))?;
        let (_, top) = golden_section_min(|at| -distance(at), sampled(peak - 1), sampled(peak + 1));
        let at = |travelled: f64| exact.moved(place(path.param_at(travelled)), 0.0, false);
        let (between, beyond) = (at(sampled(falling - 1)), at(top));
        let holds = exact.is_before(follower.1, between)
            && exact.in_order(between, beyond)
            && exact.in_order(beyond, front.span.0)
            && front.capsule.distance_squared(exact.point(between)).is_below(square)
            && square.is_below(last.capsule.distance_squared(exact.point(beyond)));
        holds.then_some(Span(between, beyond))
    }
}
