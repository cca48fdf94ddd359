//! Proof of a lock: places that the follower of a link cannot pass, with no place at the distance between them in the
//! end. Lemma 5 of `docs/proofs.md`.

use super::capsule::Spanned;
use super::grid::{GridPoint, place};
use super::interval::Interval;
use super::link::all_distances;
use super::place::{Place, Span};
use super::step::Chain;
use bench_dragon_motion::model::root::bisect_predicate;

/// The distances of a window's ends from the follower, as multiples of the distance of the place of greatest distance.
const WIDER: [f64; 6] = [2.0, 4.0, 16.0, 64.0, 256.0, 1024.0];

/// Limit of halvings of the stretch in which a link that locks has no follower any more.
const LOCK_HALVINGS: u32 = 12;

/// Places around a follower that vanishes.
#[derive(Debug, Clone, Copy)]
pub(super) enum LockWindow {
    /// They are nearer than the link: the follower meets the next place at the distance behind it.
    Nearer(Span),
    /// They are further away: the follower meets the next place at the distance ahead of it.
    Further(Span),
}

impl LockWindow {
    pub fn span(self) -> Span {
        let (Self::Nearer(span) | Self::Further(span)) = self;
        span
    }
}

impl Chain<'_> {
    /// Returns places behind and ahead of `follower`, a span of the follower of a link, that it cannot pass while the
    /// front is in `front`. Between them is no place at the distance for any front in `last`.
    pub fn lock_window(
        &self,
        at: &mut GridPoint,
        link: usize,
        follower: Span,
        fronts: (&Spanned, &Spanned),
    ) -> Option<LockWindow> {
        let nearer = self.window(at, link, follower, fronts, true).map(LockWindow::Nearer);
        nearer.or_else(|| self.window(at, link, follower, fronts, false).map(LockWindow::Further))
    }

    fn window(
        &self,
        at: &mut GridPoint,
        link: usize,
        follower: Span,
        (front, last): (&Spanned, &Spanned),
        is_nearer: bool,
    ) -> Option<Span> {
        let Chain { path, exact, team, .. } = self;
        at.extend_to(link + 1, path, team).ok()?;
        let (before, rear) = (at.handles[link].param, at.handles[link + 1].param);
        let origin = path.point(before);
        let way = if is_nearer { -1.0 } else { 1.0 };
        // The distance is greatest, or least, where the rear product changes its sign, some way behind the follower, or
        // ahead of it.
        let product = |metres: f64| {
            let place = path.param_at(path.travelled(rear) + way * metres);
            path.tangent(place).dot(&(origin - path.point(place)))
        };
        let mut beyond = 1e-9 * team.link(link);
        while product(beyond) > 0.0 {
            beyond *= 2.0;
            if beyond > team.link(link) {
                return None;
            }
        }
        let top = way * bisect_predicate(|metres| product(metres) <= 0.0, 0.0, beyond);
        let square = self.link(link).square();
        let holds_at = |distance: Interval| {
            if is_nearer { distance.is_below(square) } else { square.is_below(distance) }
        };
        WIDER.iter().find_map(|wider| {
            let ends = [top * (1.0 + wider), -top * wider];
            let ends = ends.map(|by| exact.moved(place(path.param_at(path.travelled(rear) + by)), 0.0, false));
            let window = if is_nearer { Span(ends[0], ends[1]) } else { Span(ends[1], ends[0]) };
            let beside = |place: Place| holds_at(front.capsule.distance_squared(exact.point(place)));
            let holds = exact.is_before(window.0, follower.0)
                && exact.is_before(follower.1, window.1)
                && exact.in_order(window.1, front.span.0)
                && beside(window.0)
                && beside(window.1)
                && all_distances(exact, last, window, &holds_at, LOCK_HALVINGS);
            holds.then_some(window)
        })
    }

    /// Returns a span of the follower of a link while the front is in `front`, until the follower is lost. Requires
    /// that the link is lost with the front in `last`, at the end of `front`.
    pub fn until_lock(&self, at: &mut GridPoint, link: usize, front: &Spanned, last: &Spanned) -> Option<Span> {
        let begins = self.spans(&mut at.clone(), &mut at.clone(), link + 1)?[link + 1].span;
        self.lock_window(at, link, begins, (front, last)).map(LockWindow::span)
    }
}
