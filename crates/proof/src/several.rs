//! Two of several dragons on the stage: Lemma 12 of docs/proofs.md.

use super::boards::{Board, covers};
use super::capsule::Capsule;
use super::chain::{Chain, span_is_one};
use super::events::{Events, Finish};
use super::interval::{Interval, Vector};
use super::lines::{EventKind, ProvedEvent, Status};
use super::path::{Place, Span};
use super::scene::Scene;
use super::steps::{Steps, straight_run};

/// What the section of a dragon has shown.
pub(super) struct Alone {
    /// The end of its last step.
    end: Option<Place>,
    ends_with_path: bool,
    locks: bool,
}

impl Alone {
    pub fn new(steps: &Steps, events: &Events) -> Self {
        let locks = matches!(events.finish, Some(Finish::Lock(..)));
        Self { end: steps.end, ends_with_path: matches!(events.finish, Some(Finish::PathEnd)), locks }
    }
}

/// Links of travel before the end of a dragon's last step, up to which two boards must be shown to be apart.
const BEFORE_LOCK: f64 = 1e-3;

impl Alone {
    /// Returns true if the dragon locks, and a time is before the end of its last step by next to nothing.
    fn locks_just_after(&self, scene: &Scene, time: f64) -> bool {
        let Some(end) = self.end.filter(|_| self.locks) else { return false };
        let end = scene.time(&scene.path.travelled(end));
        let link = scene.team.link(0).min(scene.team.link(1));
        let before = end - link * Interval::new(BEFORE_LOCK) / scene.head_speed;
        let time = Interval::new(time);
        before.is_at_most(&time) && time.is_at_most(&end)
    }
}

/// The section of two dragons.
pub(super) struct Pair {
    pub dragons: [usize; 2],
    /// Seconds up to which no boards of the two touch.
    clear: Option<f64>,
    /// Two benches that overlap, and seconds.
    meeting: Option<([usize; 2], f64)>,
    /// Counts for the report.
    pub steps: u64,
    pub links: u64,
    pub pairs: u64,
}

/// The two dragons while their heads are in two spans.
struct Together {
    capsules: [Vec<Capsule>; 2],
    /// The boards on the line without end, if they are not listed.
    runs: [Option<(Capsule, Capsule, Interval)>; 2],
    links: u64,
}

/// Returns true if a head is surely in a span from one time to another: it stands at the start before its delay has
/// passed, and at the path's end.
fn is_in_span(scene: &Scene, Span(lo, hi): Span, from: &Interval, to: &Interval) -> bool {
    let zero = Interval::new(0.0);
    let travelled = |time: &Interval| ((time - scene.delay) * scene.head_speed).max(&zero).min(&scene.path.length);
    scene.path.travelled(lo).is_at_most(&travelled(from))
        && (scene.path.is_at_end(hi) || travelled(to).is_at_most(&scene.path.travelled(hi)))
}

impl Together {
    /// Checks that both heads are in their spans from one time to another, and Lemma 1 for the listed links.
    fn new(scenes: [&Scene; 2], [from, to]: [f64; 2], heads: [Span; 2], spans: [&[Span]; 2]) -> Result<Self, String> {
        let [from, to] = [from, to].map(Interval::new);
        let mut together = Self { capsules: [Vec::new(), Vec::new()], runs: [None, None], links: 0 };
        for (k, scene) in scenes.into_iter().enumerate() {
            span_is_one(scene, heads[k]).map_err(|problem| format!("head {k} of the two: {problem}"))?;
            if !is_in_span(scene, heads[k], &from, &to) {
                return Err(format!("head {k} of the two may be outside its span"));
            }
            let chain = Chain::check(scene, heads[k], spans[k])?;
            let on_stage = |capsule: &Capsule| capsule.placed(&scene.frame);
            together.links += chain.products.len() as u64;
            together.capsules[k] = chain.capsules.iter().map(on_stage).collect();
            if chain.last() < scene.team.benches && chain.ends_on_line(scene) {
                let (front, rear, length) = straight_run(scene, &chain, chain.last());
                together.runs[k] = Some((on_stage(&front), on_stage(&rear), length));
            }
        }
        Ok(together)
    }

    fn board<'c>(&'c self, scene: &Scene, k: usize, bench: usize) -> Board<'c> {
        let capsules = &self.capsules[k];
        Board::new(&capsules[bench], &capsules[bench + 1], *scene.team.link(bench), &scene.team)
    }

    /// Returns all boards of a dragon, those on the line without end as one.
    fn boards<'c>(&'c self, scene: &Scene, k: usize) -> Result<Vec<Board<'c>>, String> {
        let listed = self.capsules[k].len() - 1;
        let mut boards: Vec<Board> = (0..listed).map(|bench| self.board(scene, k, bench)).collect();
        match &self.runs[k] {
            Some((front, rear, length)) => boards.push(Board::new(front, rear, *length, &scene.team)),
            None if listed == scene.team.benches => {}
            None => return Err("not all links are listed, and the last handle is not on a line without end".to_owned()),
        }
        Ok(boards)
    }
}

impl Pair {
    pub fn new(dragons: [usize; 2]) -> Self {
        Self { dragons, clear: None, meeting: None, steps: 0, links: 0, pairs: 0 }
    }

    fn scenes<'s>(&self, scenes: &'s [Scene]) -> [&'s Scene; 2] {
        self.dragons.map(|dragon| &scenes[dragon])
    }

    /// Checks and adds a stretch of time in which no boards of the two touch.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn add_clear(
        &mut self,
        scenes: &[Scene],
        [from, to]: [f64; 2],
        heads: [Span; 2],
        spans: [&[Span]; 2],
    ) -> Result<(), String> {
        if self.meeting.is_some() {
            return Err("a step after a contact of the two".to_owned());
        }
        if !(from.is_finite() && to.is_finite() && from < to) {
            return Err("it does not go forward in time".to_owned());
        }
        match self.clear {
            Some(end) if end != from => return Err("it does not begin when the step before it ended".to_owned()),
            None if from > 0.0 => return Err("the first step begins after the start".to_owned()),
            _ => {}
        }
        let scenes = self.scenes(scenes);
        let together = Together::new(scenes, [from, to], heads, spans)?;
        let boards = [together.boards(scenes[0], 0)?, together.boards(scenes[1], 1)?];
        for (a, one) in boards[0].iter().enumerate() {
            if let Some(b) = boards[1].iter().position(|other| !one.is_apart_from(other)) {
                return Err(format!("bench {a} of the first and bench {b} of the second may touch (Lemma 2)"));
            }
        }
        self.pairs += (boards[0].len() * boards[1].len()) as u64;
        self.links += together.links;
        self.steps += 1;
        self.clear = Some(to);
        Ok(())
    }

    /// Checks and adds a contact of two boards at a time.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn add_meeting(
        &mut self,
        scenes: &[Scene],
        alone: &[Alone],
        (benches, time): ([usize; 2], f64),
        (heads, spans): ([Span; 2], [&[Span]; 2]),
        [x, y]: [f64; 2],
    ) -> Result<(), String> {
        if self.meeting.is_some() {
            return Err("a second contact of the two".to_owned());
        }
        if !(time.is_finite() && time >= 0.0) {
            return Err("the time is before the start".to_owned());
        }
        let (scenes, point) = (self.scenes(scenes), Vector::new(x, y));
        let together = Together::new(scenes, [time; 2], heads, spans)?;
        for (k, scene) in scenes.into_iter().enumerate() {
            // Otherwise the motion may have ended with a lock.
            let Alone { end, ends_with_path, .. } = alone[self.dragons[k]];
            let has_come = |end: Place| scene.path.in_order(heads[k].1, end);
            if !(ends_with_path || end.is_some_and(has_come)) {
                return Err(format!("no step of dragon {} has come there", self.dragons[k]));
            }
            if benches[k] >= spans[k].len() {
                return Err(format!("bench {} is not listed", benches[k]));
            }
            if !covers(&together.board(scene, k, benches[k]), &point) {
                return Err(format!("the point may be outside bench {} (Lemma 5)", benches[k]));
            }
        }
        self.meeting = Some((benches, time));
        Ok(())
    }

    /// Checks the result.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn check(&self, scenes: &[Scene], alone: &[Alone], outcome: &ProvedEvent) -> Result<(), String> {
        let ProvedEvent { event, status, time_lo, time_hi, bench_a, bench_b, obstacle, ref dragons, .. } = *outcome;
        if event != EventKind::Contact || obstacle.is_some() || *dragons != self.dragons {
            return Err("it is not the result for a contact of these two dragons".to_owned());
        }
        let clear = self.clear.unwrap_or(0.0);
        let begins = |lo: f64| lo >= 0.0 && lo <= clear;
        let no_benches = bench_a.is_none() && bench_b.is_none();
        let ends = |scene: &Scene| scene.time(&scene.path.length).is_at_most(&Interval::new(clear));
        let follows = match (status, time_lo, time_hi) {
            (Status::None, None, None) => {
                no_benches && self.clear.is_some() && self.scenes(scenes).into_iter().all(ends)
            }
            (Status::None, Some(lo), None) => {
                let is_of = |dragon: &usize| alone[*dragon].locks_just_after(&scenes[*dragon], lo);
                no_benches && self.clear.is_some() && begins(lo) && self.dragons.iter().any(is_of)
            }
            (Status::Undecided, Some(lo), None) => no_benches && begins(lo),
            (Status::Proved, Some(lo), Some(hi)) => {
                let is_of = |(benches, time): ([usize; 2], f64)| {
                    benches.map(Some) == [bench_a, bench_b] && hi.is_finite() && time <= hi
                };
                begins(lo) && self.meeting.is_some_and(is_of)
            }
            _ => false,
        };
        if follows && !(status == Status::None && self.meeting.is_some()) {
            Ok(())
        } else {
            Err("the result for a contact of two dragons does not follow".to_owned())
        }
    }
}
