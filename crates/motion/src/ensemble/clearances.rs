//! The least clearances of an ensemble over its show: of boards of one dragon, of boards of two, and of obstacles.
//!
//! In: the end of the show. Out: clearances with the times and numbers of the show.

use bench_dragon_messages::state::EventKind;

use super::{Dragon, Ensemble, noted, pairs};
use crate::CONTACT_BUDGET;
use crate::contact::between::{self, Meeting};
use crate::contact::{LeastClearance, ObstacleClearance};
use crate::event::{Budget, Progress};
use crate::timeline::{TimedClearance, TimedEvent, TimedObstacleClearance, Timeline};

/// The least clearances of a show. Where the search of some dragons failed, that of the others is complete up to 0 s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastClearances {
    /// The least clearance of two boards of one dragon; `None` if there are no two, or the search failed.
    pub own: Option<TimedClearance>,
    /// The least clearance of boards of two dragons; `None` likewise.
    pub between: Option<TimedClearance>,
    /// The least clearance of any two boards; `None` likewise.
    pub of_show: Option<TimedClearance>,
    /// True if the search is complete: of all boards, up to the end of the show.
    pub is_complete: bool,
}

impl Ensemble {
    /// Returns the least clearances of any two boards that share no handle, from the start until the show ends at
    /// `show_end`. `own` is for boards of one dragon, `between` for boards of two dragons. `timeline` is of this
    /// ensemble.
    pub fn least_clearances(
        &self,
        timeline: &Timeline,
        show_end: &TimedEvent,
        progress: Progress<'_>,
    ) -> LeastClearances {
        let (own_share, share) = self.shares();
        let mut is_stopped = false;
        let mut progress = |share| noted(progress(share), &mut is_stopped);
        let contact = timeline.find(EventKind::Contact);
        let own =
            |k: usize| self.own_least_clearance(k, contact, show_end, &mut |part| progress(share * (k as f64 + part)));
        let can_meet = |&k: &usize| self.dragons[k].motion.team().benches > 2;
        let own = (0..self.dragons.len()).filter(can_meet).map(own).reduce(nearer);
        let between = (self.dragons.len() > 1).then(|| {
            self.least_clearance_between(show_end.time, &mut |part| progress(own_share + (1.0 - own_share) * part))
        });
        // Before its first guess is complete, a search knows nothing.
        let begin = contact.map_or(0.0, |contact| contact.time);
        let is_known = |found: &TimedClearance| !is_stopped || found.searched_until.is_none_or(|until| until > begin);
        let (own, between) = (own.map(|own| own.filter(is_known)), between.map(|between| between.filter(is_known)));
        let of_show = own.into_iter().chain(between).reduce(nearer);
        let is_complete =
            !is_stopped && of_show.is_none_or(|found| found.is_some_and(|found| found.searched_until.is_none()));
        let of_show = of_show.flatten();
        LeastClearances { own: own.flatten(), between: between.flatten(), of_show, is_complete }
    }

    /// Returns the least clearance of two boards of one dragon, with the numbers and at the times of the show. Returns
    /// `None` if there are no two boards, or the search failed.
    fn own_least_clearance(
        &self,
        dragon: usize,
        contact: Option<&TimedEvent>,
        show_end: &TimedEvent,
        progress: Progress<'_>,
    ) -> Option<TimedClearance> {
        let Dragon { delay, motion, .. } = &self.dragons[dragon];
        let first = self.first_handles[dragon] as u32;
        // Before the first contact, every clearance is above that at the contact.
        let is_own =
            |bench: Option<u32>| bench.is_some_and(|bench| self.handles_of(dragon).contains(&(bench as usize)));
        let own = contact.filter(|contact| is_own(contact.event.bench_a) && is_own(contact.event.bench_b));
        let from = own.map_or(0.0, |contact| contact.event.travelled);
        let to = self.own_end(dragon, show_end);
        let found = motion.least_clearance((from, to), progress)?;
        let LeastClearance { value, travelled, bench_a, bench_b } = found.value?;
        let time_at = |travelled| motion.time_at(travelled) + delay;
        Some(TimedClearance {
            least: LeastClearance { value, travelled, bench_a: bench_a + first, bench_b: bench_b + first },
            time: time_at(travelled),
            searched_until: (found.searched_until < to).then(|| self.searched_time(dragon, found.searched_until)),
        })
    }

    /// Returns the least clearance of boards of two dragons, from the start to a time; `None` if there are no two, or
    /// the search failed.
    fn least_clearance_between(&self, to: f64, progress: Progress<'_>) -> Option<TimedClearance> {
        if self.dragons.len() < 2 {
            return None;
        }
        let found = self.singularities(progress);
        let known = self.known_to(&found, to);
        let mut budget = Budget::new(CONTACT_BUDGET, progress);
        let moving = self.moving(&found, &mut budget).ok()?;
        let mut best: Option<(Meeting, [usize; 2])> = None;
        // The nearest guess leaves little to prove of the others.
        for pair in pairs(moving.len()) {
            let guess = between::guess_least_clearance(pair.map(|k| &moving[k]), (0.0, known), &mut budget).ok()?;
            best = guess.map(|meeting| (meeting, pair)).into_iter().chain(best).min_by(least);
        }
        let mut searched_until = None;
        for pair in pairs(moving.len()) {
            let below = best.map(|(meeting, _)| meeting);
            let found = between::least_clearance(pair.map(|k| &moving[k]), (0.0, known), below, &mut budget).ok()?;
            searched_until = earlier(searched_until, (found.searched_until < to).then_some(found.searched_until));
            best = found.value.map(|meeting| (meeting, pair)).into_iter().chain(best).min_by(least);
        }
        let (meeting, pair) = best?;
        let [bench_a, bench_b] = self.numbered(&meeting, pair);
        let travelled = self.dragons[pair[0]].travelled_at(meeting.time);
        let least = LeastClearance { value: meeting.value, travelled, bench_a, bench_b };
        Some(TimedClearance { least, time: meeting.time, searched_until })
    }

    /// Returns the time at which boards of two dragons are nearest, up to a time of the show. Returns also a bench of
    /// each dragon, counted within the dragon. Returns `None` if the search failed.
    pub fn nearest_of(&self, pair: [usize; 2], to: f64, progress: Progress<'_>) -> Option<(f64, [usize; 2])> {
        let two = self.pair(pair);
        let TimedClearance { least, time, .. } = two.least_clearance_between(to, progress)?;
        Some((time, two.within([least.bench_a, least.bench_b])))
    }

    /// Returns the least clearance of each obstacle over all dragons from the start until the show ends at `show_end`.
    /// The list is empty without obstacles. An obstacle of which nothing is known, because the search failed or was
    /// stopped, is missing.
    pub fn obstacle_clearances(&self, show_end: &TimedEvent, progress: Progress<'_>) -> Vec<TimedObstacleClearance> {
        let share = 1.0 / self.dragons.len() as f64;
        let mut is_stopped = false;
        let mut progress = |share| noted(progress(share), &mut is_stopped);
        let own = |k: usize| self.own_obstacle_clearances(k, show_end, &mut |part| progress(share * (k as f64 + part)));
        let own: Vec<_> = (0..self.dragons.len()).map(own).collect();
        let of_obstacle =
            |obstacle: usize| own.iter().map(|own| own.get(obstacle).copied().flatten()).reduce(nearer).flatten();
        let is_known =
            |found: &TimedObstacleClearance| !is_stopped || found.searched_until.is_none_or(|until| until > 0.0);
        (0..self.ground().obstacles().len()).filter_map(of_obstacle).filter(is_known).collect()
    }

    /// Returns the least clearance of each obstacle and one dragon, with the numbers and at the times of the show. It is
    /// `None`, or the list is empty, if the search failed.
    fn own_obstacle_clearances(
        &self,
        dragon: usize,
        show_end: &TimedEvent,
        progress: Progress<'_>,
    ) -> Vec<Option<TimedObstacleClearance>> {
        let Dragon { delay, motion, .. } = &self.dragons[dragon];
        let to = self.own_end(dragon, show_end);
        let (least, reached) = motion.obstacle_clearances(to, progress);
        let time_at = |travelled| motion.time_at(travelled) + delay;
        let searched_until = (reached < to).then(|| self.searched_time(dragon, reached));
        let of_show = |(obstacle, least): (usize, Option<ObstacleClearance>)| {
            let ObstacleClearance { value, travelled, bench } = least?;
            let least = ObstacleClearance { value, travelled, bench: bench + self.first_handles[dragon] as u32 };
            Some(TimedObstacleClearance { obstacle, least, time: time_at(travelled), searched_until })
        };
        least.into_iter().enumerate().map(of_show).collect()
    }

    /// Returns the time up to which a search has come. One that has not left the start knows nothing of the delay either.
    fn searched_time(&self, dragon: usize, travelled: f64) -> f64 {
        let Dragon { delay, motion, .. } = &self.dragons[dragon];
        if travelled > 0.0 { motion.time_at(travelled) + delay } else { 0.0 }
    }

    /// Returns the metres that a dragon's head has travelled when the show ends.
    fn own_end(&self, dragon: usize, show_end: &TimedEvent) -> f64 {
        match self.only() {
            // Without the rounding of the time.
            Some(_) => show_end.event.travelled,
            None => self.dragons[dragon].travelled_at(show_end.time),
        }
    }
}

/// Compares clearances.
fn least((one, _): &(Meeting, [usize; 2]), (other, _): &(Meeting, [usize; 2])) -> std::cmp::Ordering {
    one.value.total_cmp(&other.value)
}

/// The result of a search that may have given up: its value, and the time that it came to.
trait Searched: Copy {
    fn parts(&mut self) -> (f64, &mut Option<f64>);
}

impl Searched for TimedClearance {
    fn parts(&mut self) -> (f64, &mut Option<f64>) {
        (self.least.value, &mut self.searched_until)
    }
}

impl Searched for TimedObstacleClearance {
    fn parts(&mut self) -> (f64, &mut Option<f64>) {
        (self.least.value, &mut self.searched_until)
    }
}

/// Returns the lesser clearance of two searches. One that failed, `None`, has searched nothing.
fn nearer<T: Searched>(one: Option<T>, other: Option<T>) -> Option<T> {
    let (Some(mut one), Some(mut other)) = (one, other) else {
        let mut only = one.or(other)?;
        *only.parts().1 = Some(0.0);
        return Some(only);
    };
    let ((value, until), (other_value, other_until)) = (one.parts(), other.parts());
    let until = earlier(*until, *other_until);
    let mut least = if other_value < value { other } else { one };
    *least.parts().1 = until;
    Some(least)
}

fn earlier(one: Option<f64>, other: Option<f64>) -> Option<f64> {
    one.into_iter().chain(other).reduce(f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(value: f64, searched_until: Option<f64>) -> Option<TimedClearance> {
        let least = LeastClearance { value, travelled: 7.0, bench_a: 0, bench_b: 5 };
        Some(TimedClearance { least, time: 7.0, searched_until })
    }

    #[test]
    fn what_one_dragon_did_not_search_nobody_has_searched() {
        assert_eq!(nearer(found(0.3, None), found(0.2, None)), found(0.2, None));
        assert_eq!(nearer(found(0.2, None), found(0.3, Some(9.0))), found(0.2, Some(9.0)));
        assert_eq!(nearer(found(0.2, None), None), found(0.2, Some(0.0)));
        assert_eq!(nearer(None, found(0.2, None)), found(0.2, Some(0.0)));
        assert_eq!(nearer::<TimedClearance>(None, None), None);
    }
}
