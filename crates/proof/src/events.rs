//! Events that happen: Lemma 5 of docs/proofs.md.

use super::boards::Board;
use super::chain::{Chain, span_is_one};
use super::first_order::FirstOrder;
use super::interval::Interval;
use super::lines::EventKind;
use super::link;
use super::path::{Place, Span};
use super::problem::{Checked, ensure, problem};
use super::results::{Claim, Known, Subject};
use super::scene::Scene;
use super::shown::{At, Shown};
use super::steps::Steps;
use super::witness::{Evidence, Witness, WitnessLine, Witnesses};

/// The events that are shown so far.
#[derive(Default)]
pub(super) struct Events {
    witnesses: Witnesses,
    /// A link that has stalled.
    stall: Option<Witness>,
    /// The end of the motion.
    pub finish: Option<Finish>,
}

/// The end of a motion.
pub(super) enum Finish {
    /// The link whose follower is not continuous.
    Lock(Witness),
    /// The path's end has been reached.
    PathEnd,
}

/// The evidence of a lock: a span around the follower, which cannot be at the ends of the span.
pub(super) enum LockShown {
    /// In the end all places of the span are nearer than the link.
    Nearer(Span),
    /// In the end all places of the span are further away than the link.
    Further(Span),
}

/// Checks that an event with the head at `to` is inside the motion, from its start to the path's end.
fn check_is_in_motion(scene: &Scene, to: Place) -> Checked {
    ensure!(Interval::new(0.0).is_at_most(&scene.path.travelled(to)), "the head has not come to the start");
    if scene.path.is_within(to) { Ok(()) } else { Err(problem!("the head is beyond the end of the path")) }
}

/// Returns the handles with the head in a span that ends where the last step ended, or that is at the start.
///
/// # Errors
/// The condition that does not follow.
fn touching_chain(scene: &Scene, steps: &Steps, head: Span, spans: &[Span]) -> Checked<Chain> {
    let chain = Chain::check(scene, head, spans)?;
    let Span(from, to) = head;
    check_is_in_motion(scene, to)?;
    match steps.end {
        Some(end) if end != to => Err(problem!("it is not where the last step ended")),
        None if !scene.path.travelled(from).is_at_most(&Interval::new(0.0)) => {
            Err(problem!("no step precedes it, and it begins beyond the start"))
        }
        _ => Ok(chain),
    }
}

/// Returns the handles with the head in a span. Some place of the span must be in the motion, and the span must not
/// begin beyond the end of the last step that counts.
///
/// # Errors
/// The condition that does not follow.
fn near_step(scene: &Scene, shown: &Shown, head: Span, spans: &[Span], at: &[Place]) -> Checked<FirstOrder> {
    let (path, Span(from, to)) = (&scene.path, head);
    let chain = Chain::check(scene, head, spans)?;
    if !Interval::new(0.0).is_at_most(&path.travelled(to)) || !path.is_within(from) {
        return Err(problem!("the head is before the start or beyond the end of the path"));
    }
    ensure!(
        shown.end.is_some_and(|end| matches!(end, At::Head(end) if path.in_order(from, end))),
        "no step has come there"
    );
    FirstOrder::new(scene, &chain, at)
}

impl Events {
    /// Checks and adds boards that touch, or a board that has come to an obstacle: Lemma 5, *Contact*, and Lemma 9,
    /// *Reached*. Likewise boards that are no further apart than some metres, or a board as near to an obstacle: Lemmas 6
    /// and 11, *From above*.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn add_witness(&mut self, scene: &Scene, steps: &Steps, line: &WitnessLine) -> Checked {
        let (whom, ([head], [spans])) = (line.whom, line.spans()?);
        whom.check(&scene.obstacles, &[spans])?;
        let most = match &line.evidence {
            Evidence::Point(point) => {
                let chain = touching_chain(scene, steps, head, spans)?;
                let capsules = &chain.capsules;
                let board = |_, bench| Board::new(&capsules[bench], &capsules[bench + 1], scene.team.size(bench));
                whom.check_touch(board, &scene.obstacles, point)?;
                None
            }
            Evidence::Most(most, at) => {
                let shown = whom.obstacle().map_or(&steps.apart, |number| &steps.beside[number]);
                let step = near_step(scene, shown, head, spans, &at[0])?;
                whom.check_near(|_, bench| step.board(bench, &scene.team), &scene.obstacles, most)?;
                Some(*most)
            }
        };
        self.witnesses.add(whom, most, At::Head(head.0))
    }

    /// Checks and adds a stall: Lemma 5, *Stall*.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn add_stall(&mut self, scene: &Scene, steps: &Steps, link: usize, head: Span, spans: &[Span]) -> Checked {
        ensure!(self.stall.is_none(), "a second stall");
        let chain = Chain::check(scene, head, spans)?;
        check_is_in_motion(scene, head.1)?;
        ensure!(steps.end == Some(head.1), "it is not where the last step ended");
        ensure!(
            chain.products.get(link).is_some_and(Interval::is_negative),
            "link {link} may not have stalled (Lemma 5)"
        );
        self.stall = Some(Witness::of_event([Some(link), None], At::Head(head.0)));
        Ok(())
    }

    /// Checks and adds a lock: Lemma 5, *Lock*.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn add_lock(
        &mut self,
        scene: &Scene,
        steps: &Steps,
        link: usize,
        to: Place,
        (spans, last): (&[Span], &[Span]),
        shown: LockShown,
    ) -> Checked {
        let path = &scene.path;
        span_is_one(scene, Span(to, to))?;
        check_is_in_motion(scene, to)?;
        let (Some(from), Some(rear)) = (steps.end, steps.spans.get(link)) else {
            return Err(problem!("the last step does not list the rear handle of the link"));
        };
        ensure!(Interval::new(0.0).is_at_most(&path.travelled(from)), "no step has come to the start");
        if spans.len() != link || last.len() != link {
            return Err(problem!("expected the spans of handles 1 to {link}, twice"));
        }
        let while_going = Chain::check(scene, Span(from, to), spans)?;
        let at_end = Chain::check(scene, Span(to, to), last)?;
        let (front, front_at_end) = (&while_going.capsules[link], &at_end.capsules[link]);
        let squared = scene.team.link(link).square();
        let is_before = |a: Place, b: Place| a != b && path.in_order(a, b);
        let (LockShown::Nearer(window) | LockShown::Further(window)) = shown;
        span_is_one(scene, window).map_err(|problem| problem!("the window: {problem}"))?;
        let Span(w1, w2) = window;
        ensure!(
            is_before(w1, rear.0) && is_before(rear.1, w2) && path.in_order(w2, front.span.0),
            "the window is not around the rear's span and behind the front's"
        );
        let is_nearer = matches!(shown, LockShown::Nearer(_));
        let cannot_be_at = |place: Place| {
            let test = if is_nearer { link::is_nearer_at } else { link::is_farther };
            test(path, front, place, &squared)
        };
        ensure!(cannot_be_at(w1) && cannot_be_at(w2), "an end of the window may be at the link's length (Lemma 5)");
        let test = if is_nearer { link::is_all_nearer } else { link::is_all_further };
        ensure!(
            test(path, front_at_end, window, &squared),
            "a place of the window may be at the link's length in the end (Lemma 5)"
        );
        self.finish = Some(Finish::Lock(Witness::of_event([Some(link), None], At::Head(to))));
        Ok(())
    }

    /// Checks and adds the path's end: *Path end.*
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn add_path_end(&mut self, scene: &Scene, steps: &Steps) -> Checked {
        ensure!(
            steps.end.is_some_and(|end| scene.path.is_at_end(end)),
            "the last step did not come to the end of the path"
        );
        self.finish = Some(Finish::PathEnd);
        Ok(())
    }

    /// Returns what a section of one dragon has shown about the subject of a result.
    pub fn known<'s>(&self, scene: &'s Scene, steps: &Steps, subject: &Subject) -> Known<'s> {
        let Self { witnesses, stall, .. } = self;
        let of = subject.obstacle;
        let (ends, lock) = match self.finish {
            Some(Finish::PathEnd) => (true, None),
            Some(Finish::Lock(lock)) => (false, Some(lock)),
            None => (false, None),
        };
        let up_to = |end: Option<At>| Shown { end, ..Shown::NOTHING };
        let (shown, event, near) = match (subject.claim, subject.obstacle) {
            (Claim::Event(EventKind::Contact), _) => (steps.clear, witnesses.touched(of), None),
            (Claim::Event(EventKind::Stall), _) => (steps.moving, *stall, None),
            (Claim::Event(EventKind::Lock), _) => (up_to(steps.end.map(At::Head)), lock, None),
            (Claim::Event(EventKind::PathEnd), _) => {
                let event = ends.then_some(Witness::of_event([None; 2], At::PathEnd));
                let shown = up_to(Some(At::PathEnd));
                return Known { scene, shown, event, near: None, is_whole: lock.is_some(), locks: Vec::new() };
            }
            (Claim::Event(EventKind::Obstacle), number) => {
                (number.map_or(Shown::NOTHING, |number| steps.free[number]), witnesses.touched(of), None)
            }
            (Claim::Clearance, None) => (steps.apart, witnesses.touched(of), witnesses.near(of)),
            (Claim::Clearance, Some(number)) => (steps.beside[number], None, witnesses.near(of)),
        };
        let zero = Interval::new(0.0);
        // A lock has happened itself.
        let locks = lock.filter(|_| shown.all && subject.claim != Claim::Event(EventKind::Lock));
        let locks = locks.map(|_| [zero, shown.end.map_or(zero, |end| end.seconds(scene))]);
        Known { scene, shown, event, near, is_whole: ends && shown.all, locks: Vec::from_iter(locks) }
    }
}
