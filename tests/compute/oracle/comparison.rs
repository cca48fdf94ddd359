//! The checker's result for a scene beside the program's events. Each kind of event happens in both or neither, at one
//! place of the head and for one bench or pair. Otherwise it must be ambiguous, within rounding of not happening.

use super::Event;
use super::chain::{Chain, Team, last_bits};
use super::contact::{Boards, Touch};
use super::geometry::{Path, Vector};

/// The checker's result for a scene. Times are metres of the head.
pub struct CheckerResult {
    pub contact: Result<Option<Touch>, String>,
    pub stall: Option<(f64, usize)>,
    pub lock: Option<(f64, usize)>,
    pub end: f64,
    /// Reasons why the checker is not sure.
    pub doubts: Vec<String>,
}

/// Returns the checker's own events of a team on a path.
pub fn verdict(chain: &Chain) -> CheckerResult {
    let mut doubts = Vec::new();
    if !chain.is_complete() {
        doubts.push("stalls and jumps: searched in part only".to_owned());
    }
    if chain.starts_beyond_a_jump() {
        doubts.push("the start is past a lock".to_owned());
    }
    let lock = chain.lock();
    if lock.is_some_and(|(_, _, doubtful)| doubtful) {
        doubts.push(format!("a jump at {lock:?} too small to resolve"));
    }
    let end = lock.map_or(chain.path.end, |(at, ..)| at);
    let before = if lock.is_some() { (end - last_bits(end)).max(0.0) } else { end };
    let stall = chain.stall(before);
    let contact = Boards { chain }.first_contact(before);
    doubts.extend(contact.clone().err());
    CheckerResult { contact, stall, lock: lock.map(|(at, bench, _)| (at, bench)), end, doubts }
}

/// The checker's events and the program's, compared.
pub struct Comparison {
    /// Greatest difference of two times, metres of the head.
    tolerance: f64,
    /// Rounding of the checker's own figures, metres.
    rounding: f64,
    pub compared: Vec<&'static str>,
    pub failures: Vec<String>,
    pub ambiguous: Vec<String>,
}

impl Comparison {
    /// Returns a failure in which there are no events to compare.
    pub fn failed(sentence: String) -> Self {
        let failures = vec![sentence];
        Self { tolerance: 0.0, rounding: 0.0, compared: Vec::new(), failures, ambiguous: Vec::new() }
    }

    pub fn of(team: &Team, path: &Path, events: &[Event]) -> Self {
        let chain = Chain::new(path, team);
        let verdict = verdict(&chain);
        let start = chain.pose(0.0);
        // Size of the scene, metres.
        let size = path.extent(start.handles[team.benches].place);
        let tolerance = 1e-9 * (size / 100.0).max(1.0);
        // A hundred roundings of place and distance.
        let rounding = 100.0 * f64::EPSILON * (size + path.end);
        let (compared, failures, ambiguous) = (Vec::new(), Vec::new(), verdict.doubts.clone());
        let mut comparison = Self { tolerance, rounding, compared, failures, ambiguous };
        let program = |kind: &str| events.iter().find(|event| event.kind == kind);
        comparison.ends(&verdict, &chain, program("lock"), program("path_end"));
        comparison.stalls(&verdict, &chain, program("stall"));
        comparison.contacts(&verdict, &Boards { chain: &chain }, program("contact"));
        comparison
    }

    fn disagree(&mut self, doubtful: bool, sentence: String) {
        (if doubtful { &mut self.ambiguous } else { &mut self.failures }).push(sentence);
    }

    fn near(&self, one: f64, other: f64) -> bool {
        (one - other).abs() <= self.tolerance
    }

    fn ends(&mut self, verdict: &CheckerResult, chain: &Chain, lock: Option<&Event>, path_end: Option<&Event>) {
        match (verdict.lock, lock) {
            (Some((at, bench)), Some(event)) if self.near(at, event.time) => {
                self.compared.push("lock");
                if event.bench_a != Some(bench) {
                    self.disagree(false, format!("lock of bench {bench}, the program reports {:?}", event.bench_a));
                }
            }
            (Some((at, bench)), _) => {
                // Doubtful: a start at the very lock, and a lock at the very end of the path.
                let doubtful = at <= self.tolerance || chain.path.end - at <= self.tolerance;
                self.disagree(doubtful, format!("lock at {at:.13} of bench {bench}, the program reports {lock:?}"));
            }
            (None, Some(event)) => self.disagree(false, format!("no lock, the program reports {event:?}")),
            (None, None) => {
                self.compared.push("path_end");
                if !path_end.is_some_and(|event| self.near(event.time, chain.path.end)) {
                    self.disagree(
                        false,
                        format!("path end at {:.13}, the program reports {path_end:?}", chain.path.end),
                    );
                }
            }
        }
    }

    fn stalls(&mut self, verdict: &CheckerResult, chain: &Chain, event: Option<&Event>) {
        // Doubtful: a cosine that is zero within rounding, at a place that both find in the motion.
        let grazes =
            |at: f64| chain.pose(at.min(verdict.end)).handles.iter().any(|handle| handle.front_cosine.abs() < 1e-12);
        match (verdict.stall, event) {
            (Some((at, bench)), Some(event)) if self.near(at, event.time) => {
                self.compared.push("stall");
                let handle = chain.pose(at).handles[bench + 1];
                let place = event.x.zip(event.y).map(|(x, y)| Vector::new(x, y));
                if event.bench_a != Some(bench) {
                    self.disagree(false, format!("stall of bench {bench}, the program reports {:?}", event.bench_a));
                } else if !place.is_some_and(|place| (place - handle.point).norm() <= 100.0 * self.tolerance) {
                    self.disagree(false, format!("stall at place {:?}, the program reports {place:?}", handle.point));
                }
            }
            (Some((at, bench)), _) => {
                let over = chain.pose((at + self.tolerance).min(verdict.end));
                let brief = over.handles[bench].front_cosine > 0.0 || verdict.end - at <= self.tolerance;
                let other = event.is_some_and(|event| event.time < at && grazes(event.time));
                let sentence = format!("stall at {at:.13} of bench {bench}, the program reports {event:?}");
                self.disagree(at <= self.tolerance || brief || other, sentence);
            }
            (None, Some(event)) => {
                let doubtful = verdict.end - event.time <= self.tolerance || grazes(event.time);
                self.disagree(doubtful, format!("no stall, the program reports {event:?}"));
            }
            (None, None) => self.compared.push("no stall"),
        }
    }

    fn contacts(&mut self, verdict: &CheckerResult, boards: &Boards, event: Option<&Event>) {
        let Ok(contact) = &verdict.contact else { return };
        match (contact, event) {
            (Some(touch), Some(event)) if self.near(touch.head, event.time) => {
                self.compared.push("contact");
                let Some(pair) = event.bench_a.zip(event.bench_b) else {
                    return self.disagree(false, format!("{touch:?}, the program names no pair: {event:?}"));
                };
                let least = boards.gap(touch.head, touch.benches);
                if pair != touch.benches && (boards.gap(touch.head, pair) - least).abs() > self.tolerance {
                    self.disagree(false, format!("{touch:?}, the program reports {event:?}"));
                }
                let place = event.x.zip(event.y).map(|(x, y)| Vector::new(x, y));
                let slack = 100.0 * self.tolerance;
                if !place.is_some_and(|place| boards.both_hold(touch.head, pair, place, slack)) {
                    self.disagree(false, format!("{touch:?}: {place:?} is not on both boards"));
                }
            }
            (Some(touch), _) => {
                // The depth of the overlap before the boards part again, and the accuracy of the time.
                let deepest = (0..60)
                    .map(|k| (touch.head + 1e-12 * 2f64.powi(k)).min(verdict.end))
                    .map(|head| boards.gap(head, touch.benches))
                    .take_while(|gap| *gap <= self.rounding)
                    .fold(0.0, f64::min);
                let at_theirs =
                    event.filter(|event| event.time <= verdict.end).map(|event| boards.least_gap(event.time));
                let flat = at_theirs.flatten().is_some_and(|(gap, _)| gap.abs() <= self.rounding);
                let doubtful = deepest >= -1e-11 - self.rounding || flat || verdict.end - touch.head <= self.tolerance;
                let sentence = format!("{touch:?} (depth {deepest:e}), the program reports {event:?}");
                self.disagree(doubtful, sentence);
            }
            (None, Some(event)) => {
                // In the last bits before a lock handles move as the root of the remaining distance: about 1e-4 of a
                // link.
                let last = verdict.end - event.time <= self.tolerance;
                let head = if last { (verdict.end - self.tolerance).max(0.0) } else { event.time };
                let slack = if last { 1e-3 } else { 1e-11 + self.rounding };
                let gap = boards.least_gap(head);
                let doubtful = gap.is_some_and(|(gap, _)| gap.abs() <= slack);
                self.disagree(doubtful, format!("no contact, least gap there {gap:?}, the program reports {event:?}"));
            }
            (None, None) => self.compared.push("no contact"),
        }
    }
}
