//! Several dragons in one show: their motions on the show's clock, and the events of all of them.
//!
//! In: named motions with delays, in the order of the scene. Out: one timeline, one chain, one least clearance. Handles
//! are numbered through: bench i joins handles i and i + 1, so the number of a dragon's last handle names no bench.
//! Obstacles follow the handles. The show and the commands call it for a scene with several dragons.

use std::ops::Range;

use bench_dragon_messages::Roster;
use bench_dragon_messages::state::EventKind;

use crate::contact::LeastClearance;
use crate::contact::between::{self, Meeting, MovingDragon};
use crate::event::{Budget, Event};
use crate::ground::{Ground, Obstacle};
use crate::linkage::NoFollower;
use crate::singularities::Singularities;
use crate::solve::table::Instructions;
use crate::solve::{Chain, Solver, Velocities};
use crate::timeline::{TimedClearance, TimedEvent, TimedObstacleClearance, Timeline};
use crate::{CONTACT_BUDGET, Motion};

/// One of several dragons.
#[derive(Debug, Clone, PartialEq)]
pub struct Dragon {
    /// Its name, unique in the show.
    pub name: String,
    /// Seconds of the show during which it stands at its start.
    pub delay: f64,
    /// Its motion, in its own time.
    pub motion: Motion,
}

impl Dragon {
    /// Returns the time of its own motion at a time of the show, and true if it moves then. It stands at its start
    /// before its delay has passed, and at its path's end from then on.
    pub fn own_time(&self, show_time: f64) -> (f64, bool) {
        let own = show_time - self.delay;
        let end = self.motion.time_at(self.motion.path().length());
        if own < 0.0 {
            (0.0, false)
        } else if own >= end {
            (end, false)
        } else {
            (own, true)
        }
    }

    /// Returns the metres that its head has travelled at a time of the show.
    pub fn travelled_at(&self, show_time: f64) -> f64 {
        self.motion.travelled_at(self.own_time(show_time).0)
    }
}

/// The dragons of a show.
#[derive(Debug, Clone, PartialEq)]
pub struct Ensemble {
    dragons: Vec<Dragon>,
    /// The number of each dragon's first handle, and that of all handles.
    first_handles: Vec<usize>,
}

impl Ensemble {
    /// Creates an ensemble of dragons, at least one, that dance on one ground.
    pub fn new(dragons: Vec<Dragon>) -> Self {
        let mut first_handles = vec![0];
        let mut next = 0;
        for dragon in &dragons {
            next += dragon.motion.team().handles();
            first_handles.push(next);
        }
        Self { dragons, first_handles }
    }

    /// Returns the same dragons, whose tables are read with these instructions, one set for each dragon, or `None` if
    /// this processor lacks them.
    pub fn with_instructions(&self, sets: &[Instructions]) -> Option<Self> {
        let of = |(dragon, set): (&Dragon, &Instructions)| {
            let motion = dragon.motion.clone().with_instructions(*set)?;
            Some(Dragon { motion, ..dragon.clone() })
        };
        let dragons: Option<Vec<Dragon>> = self.dragons.iter().zip(sets).map(of).collect();
        dragons.filter(|dragons| dragons.len() == self.dragons.len()).map(Self::new)
    }

    /// Returns the dragons in the order of the scene.
    pub fn dragons(&self) -> &[Dragon] {
        &self.dragons
    }

    /// Returns the number of all handles.
    pub fn handles(&self) -> usize {
        self.first_handles[self.dragons.len()]
    }

    /// Returns the number of all benches.
    pub fn benches(&self) -> usize {
        self.handles() - self.dragons.len()
    }

    /// Returns the numbers of a dragon's handles.
    pub fn handles_of(&self, dragon: usize) -> Range<usize> {
        self.first_handles[dragon]..self.first_handles[dragon + 1]
    }

    /// Returns the dragon of a bench or handle, by its number, and the number within the dragon; `None` for the number
    /// of an obstacle.
    pub fn owner(&self, number: usize) -> Option<(usize, usize)> {
        let dragon = self.first_handles.partition_point(|first| *first <= number).checked_sub(1)?;
        (dragon < self.dragons.len()).then(|| (dragon, number - self.first_handles[dragon]))
    }

    /// Returns the greatest error of a link in a frame besides rounding, metres, as [`Motion::link_tolerance`].
    pub fn link_tolerance(&self) -> f64 {
        self.dragons.iter().map(|dragon| dragon.motion.link_tolerance()).fold(0.0, f64::max)
    }

    /// Returns the names of the benches and obstacles, for people.
    pub fn roster(&self) -> Roster {
        let dragon = |dragon: &Dragon| (dragon.name.clone(), dragon.motion.team().benches as u32);
        Roster::new(self.dragons.iter().map(dragon).collect(), self.ground().names())
    }

    /// Returns the obstacles, in stage coordinates.
    pub fn ground(&self) -> &Ground {
        self.dragons[0].motion.ground()
    }

    /// Returns the number that stands for an obstacle where a second bench would: obstacles follow the handles.
    pub fn obstacle_number(&self, obstacle: usize) -> u32 {
        (self.handles() + obstacle) as u32
    }

    /// Returns the obstacle that an event reaches; `None` for other kinds.
    pub fn obstacle_of(&self, event: &Event) -> Option<&Obstacle> {
        let number = event.bench_b.filter(|_| event.kind == EventKind::Obstacle)?;
        self.ground().obstacles().get((number as usize).checked_sub(self.handles())?)
    }

    /// Returns the events of all dragons. `progress` is as in [`Motion::timeline`].
    pub fn timeline(&self, progress: &mut dyn FnMut(f64)) -> Timeline {
        let share = 0.5 / self.dragons.len() as f64;
        let own = |(k, dragon): (usize, &Dragon)| {
            let timeline = dragon.motion.timeline(&mut |part| progress(share * (k as f64 + part)));
            self.on_the_shows_clock(k, &timeline)
        };
        let own: Vec<Timeline> = self.dragons.iter().enumerate().map(own).collect();
        let end = end_of(&own);
        let mut until = own.iter().filter_map(Timeline::searched_until).fold(f64::INFINITY, f64::min);
        let contacts = own.iter().filter_map(|timeline| timeline.find(EventKind::Contact));
        let mut first = contacts.copied().min_by(|a, b| a.time.total_cmp(&b.time));
        let to = first.map_or(end.time, |contact| contact.time.min(end.time));
        match self.contact_between(to, &mut |part| progress(0.5 + 0.5 * part)) {
            Ok((between, reached)) => {
                until = until.min(reached);
                first = between.into_iter().chain(first).min_by(|a, b| a.time.total_cmp(&b.time));
            }
            Err(stuck) => {
                log::warn!("the search for a contact of two dragons stopped at a place without a solution: {stuck}");
                until = 0.0;
            }
        }
        collected(&own, end, first, until)
    }

    /// Returns the events without contacts and obstacles, which cost a search.
    pub fn timeline_without_contact(&self) -> Timeline {
        let own = |(k, dragon): (usize, &Dragon)| self.on_the_shows_clock(k, &dragon.motion.timeline_without_contact());
        let own: Vec<Timeline> = self.dragons.iter().enumerate().map(own).collect();
        let until = own.iter().filter_map(Timeline::searched_until).fold(f64::INFINITY, f64::min);
        collected(&own, end_of(&own), None, until)
    }

    /// Returns a dragon's own timeline at the times of the show, with the numbers of the show.
    fn on_the_shows_clock(&self, dragon: usize, timeline: &Timeline) -> Timeline {
        let Dragon { delay, motion, .. } = &self.dragons[dragon];
        let first = self.first_handles[dragon] as u32;
        let obstacles_from = motion.team().handles() as u32;
        let numbered = |timed: &TimedEvent| {
            let Event { kind, travelled, bench_a, bench_b, place } = timed.event;
            let bench_b = match kind {
                EventKind::Obstacle => bench_b.map(|number| number - obstacles_from + self.handles() as u32),
                _ => bench_b.map(|bench| bench + first),
            };
            // The head of the dragon that reaches its path's end.
            let bench_a = bench_a.map_or((kind == EventKind::PathEnd).then_some(first), |bench| Some(bench + first));
            // A dragon that stands on itself or at an obstacle does so from the show's start on.
            let is_at_start = timed.time == 0.0 && matches!(kind, EventKind::Contact | EventKind::Obstacle);
            let time = if is_at_start { 0.0 } else { timed.time + delay };
            TimedEvent { event: Event { kind, travelled, bench_a, bench_b, place }, time }
        };
        let events = timeline.events().iter().map(numbered).collect();
        Timeline::new(events, timeline.searched_until().map(|until| until + delay))
    }

    /// Returns the first contact of boards of two dragons up to a time, and how far the search came.
    fn contact_between(&self, to: f64, progress: &mut dyn FnMut(f64)) -> Result<(Option<TimedEvent>, f64), NoFollower> {
        let found = self.singularities();
        let moving = self.moving(&found)?;
        let mut budget = Budget::new(CONTACT_BUDGET, progress);
        let (mut first, mut to, mut until): (Option<(Meeting, [usize; 2])>, _, _) = (None, to, f64::INFINITY);
        for pair in pairs(moving.len()) {
            let contact = between::first_contact(pair.map(|k| &moving[k]), (0.0, to), &mut budget)?;
            if contact.searched_until < to && contact.value.is_none() {
                until = until.min(contact.searched_until);
            }
            if let Some(meeting) = contact.value {
                // Of contacts at one time, as at the start, the deepest.
                let is_first = first.is_none_or(|(other, _)| {
                    meeting.time < other.time || (meeting.time == other.time && meeting.value < other.value)
                });
                if is_first {
                    first = Some((meeting, pair));
                    to = meeting.time;
                }
            }
        }
        Ok((first.map(|(meeting, pair)| self.contact_event(&meeting, pair)), until))
    }

    /// Returns the first contact of boards of two dragons up to a time of the show: its time, and a bench of each,
    /// counted within it; `None` if there is none, or the search gave up.
    pub fn first_contact_of(
        &self,
        pair: [usize; 2],
        to: f64,
        progress: &mut dyn FnMut(f64),
    ) -> Option<(f64, [usize; 2])> {
        let two: Vec<&Dragon> = pair.iter().map(|dragon| &self.dragons[*dragon]).collect();
        let found: Vec<_> = two.iter().map(|dragon| dragon.motion.singularities(&mut |_| ())).collect();
        let moving: Result<Vec<_>, _> = two.iter().zip(&found).map(|(dragon, found)| moving(dragon, found)).collect();
        let (moving, mut budget) = (moving.ok()?, Budget::new(CONTACT_BUDGET, progress));
        let contact = between::first_contact([&moving[0], &moving[1]], (0.0, to), &mut budget).ok()?;
        contact.value.map(|meeting| (meeting.time, meeting.benches))
    }

    fn contact_event(&self, meeting: &Meeting, pair: [usize; 2]) -> TimedEvent {
        let [a, b] = self.numbered(meeting, pair);
        let travelled = self.dragons[pair[0]].travelled_at(meeting.time);
        let (kind, place) = (EventKind::Contact, Some(meeting.place));
        TimedEvent { event: Event { kind, travelled, bench_a: Some(a), bench_b: Some(b), place }, time: meeting.time }
    }

    fn numbered(&self, meeting: &Meeting, pair: [usize; 2]) -> [u32; 2] {
        [0, 1].map(|k| (self.first_handles[pair[k]] + meeting.benches[k]) as u32)
    }

    fn singularities(&self) -> Vec<Singularities> {
        self.dragons.iter().map(|dragon| dragon.motion.singularities(&mut |_| ())).collect()
    }

    fn moving<'a>(&'a self, found: &'a [Singularities]) -> Result<Vec<MovingDragon<'a>>, NoFollower> {
        self.dragons.iter().zip(found).map(|(dragon, found)| moving(dragon, found)).collect()
    }

    /// Returns the least clearance of any two boards that share no handle, from the start until the show ends at
    /// `freeze`; `None` if there are no two, or the search failed.
    pub fn least_clearance(&self, freeze: &TimedEvent, progress: &mut dyn FnMut(f64)) -> Option<TimedClearance> {
        let share = 0.5 / self.dragons.len() as f64;
        let mut best: Option<TimedClearance> = None;
        for (k, dragon) in self.dragons.iter().enumerate() {
            let timeline = dragon.motion.timeline_without_contact();
            let end = self.own_freeze(dragon, freeze);
            let mut of_own = |part| progress(share * (k as f64 + part));
            let Some(mut own) = dragon.motion.least_clearance(&timeline, &end, &mut of_own) else { continue };
            let first = self.first_handles[k] as u32;
            (own.least.bench_a, own.least.bench_b) = (own.least.bench_a + first, own.least.bench_b + first);
            own.time += dragon.delay;
            own.searched_until = own.searched_until.map(|until| until + dragon.delay);
            best = Some(nearer(best, own));
        }
        let found = self.singularities();
        let moving = self.moving(&found).ok()?;
        let mut of_between = |part: f64| progress(0.5 + 0.5 * part);
        let mut budget = Budget::new(CONTACT_BUDGET, &mut of_between);
        for pair in pairs(moving.len()) {
            let below = best.map(|best| best.least.value);
            let span = (0.0, freeze.time);
            let found = between::least_clearance(pair.map(|k| &moving[k]), span, below, &mut budget).ok()?;
            let searched_until = (found.searched_until < freeze.time).then_some(found.searched_until);
            let Some(meeting) = found.value else {
                best = best.map(|best| TimedClearance {
                    searched_until: earlier(best.searched_until, searched_until),
                    ..best
                });
                continue;
            };
            let [bench_a, bench_b] = self.numbered(&meeting, pair);
            let travelled = self.dragons[pair[0]].travelled_at(meeting.time);
            let least = LeastClearance { value: meeting.value, travelled, bench_a, bench_b };
            best = Some(nearer(best, TimedClearance { least, time: meeting.time, searched_until }));
        }
        best
    }

    /// Returns the least clearance of each obstacle over all dragons, as [`Motion::obstacle_clearances`].
    pub fn obstacle_clearances(
        &self,
        freeze: &TimedEvent,
        progress: &mut dyn FnMut(f64),
    ) -> Vec<TimedObstacleClearance> {
        let share = 1.0 / self.dragons.len() as f64;
        let mut all: Vec<TimedObstacleClearance> = Vec::new();
        for (k, dragon) in self.dragons.iter().enumerate() {
            let end = self.own_freeze(dragon, freeze);
            for mut own in dragon.motion.obstacle_clearances(&end, &mut |part| progress(share * (k as f64 + part))) {
                own.least.bench += self.first_handles[k] as u32;
                own.time += dragon.delay;
                own.searched_until = own.searched_until.map(|until| until + dragon.delay);
                match all.iter_mut().find(|other| other.obstacle == own.obstacle) {
                    Some(other) => {
                        let until = earlier(other.searched_until, own.searched_until);
                        if own.least.value < other.least.value {
                            *other = own;
                        }
                        other.searched_until = until;
                    }
                    None => all.push(own),
                }
            }
        }
        all
    }

    /// Returns the end of the show as an event of one dragon's own motion.
    fn own_freeze(&self, dragon: &Dragon, freeze: &TimedEvent) -> TimedEvent {
        let time = dragon.own_time(freeze.time).0;
        TimedEvent { event: Event { travelled: dragon.motion.travelled_at(time), ..freeze.event }, time }
    }

    /// Makes a solver of all dragons, for the show's time. Its chains are placed on the stage.
    pub fn solver(&self, velocities: Velocities) -> EnsembleSolver {
        let dancer = |dragon: &Dragon| {
            let choice = dragon.motion.solver(velocities);
            (dragon.clone(), choice.solver, Chain::new(dragon.motion.team().handles()))
        };
        EnsembleSolver { dancers: self.dragons.iter().map(dancer).collect() }
    }
}

/// The solver of all dragons of a show.
pub struct EnsembleSolver {
    dancers: Vec<(Dragon, Box<dyn Solver>, Chain)>,
}

impl Solver for EnsembleSolver {
    fn name(&self) -> &'static str {
        "several"
    }

    fn solve(&mut self, time: f64, chain: &mut Chain) -> Result<(), NoFollower> {
        let mut first = 0;
        for (dragon, solver, own) in &mut self.dancers {
            let (own_time, moves) = dragon.own_time(time);
            solver.solve(own_time, own)?;
            if !moves {
                own.stand();
            }
            chain.put(first, own);
            first += own.handles();
        }
        Ok(())
    }
}

fn moving<'a>(
    Dragon { delay, motion, .. }: &'a Dragon,
    found: &'a Singularities,
) -> Result<MovingDragon<'a>, NoFollower> {
    let end = found.end.map_or(motion.path().length(), |end| end.travelled);
    MovingDragon::new(motion.advancement(found), *motion.placement(), (*delay, motion.head_speed(), end))
}

/// Returns all pairs of `count` dragons, in order.
pub fn pairs(count: usize) -> impl Iterator<Item = [usize; 2]> {
    (0..count).flat_map(move |a| (a + 1..count).map(move |b| [a, b]))
}

/// Returns the event with which a show of several ends: the first lock of any, or the last end of a path.
fn end_of(own: &[Timeline]) -> TimedEvent {
    let ends = || own.iter().map(|timeline| *timeline.end());
    let lock = ends().filter(|end| end.event.kind == EventKind::Lock).min_by(|a, b| a.time.total_cmp(&b.time));
    // There is a dragon, and each has an end.
    lock.or_else(|| ends().max_by(|a, b| a.time.total_cmp(&b.time))).expect("a show has a dragon")
}

/// Joins the timelines of all dragons, given the first contact.
fn collected(own: &[Timeline], end: TimedEvent, contact: Option<TimedEvent>, until: f64) -> Timeline {
    let (mut events, mut standing): (Vec<TimedEvent>, Vec<TimedEvent>) = (contact.into_iter().collect(), Vec::new());
    for timed in own.iter().flat_map(Timeline::events).filter(|timed| timed.time <= end.time) {
        match timed.event.kind {
            EventKind::Contact | EventKind::Lock => {}
            EventKind::PathEnd if *timed != end => standing.push(*timed),
            EventKind::PathEnd => {}
            EventKind::Stall => events.push(*timed),
            EventKind::Obstacle => {
                let same = events.iter_mut().find(|other| {
                    other.event.kind == EventKind::Obstacle && other.event.bench_b == timed.event.bench_b
                });
                match same {
                    Some(other) if timed.time < other.time => *other = *timed,
                    Some(_) => {}
                    None => events.push(*timed),
                }
            }
        }
    }
    events.retain(|timed| timed.time <= end.time);
    events.push(end);
    Timeline::new(events, (until < end.time).then_some(until)).with_standing(standing)
}

fn nearer(best: Option<TimedClearance>, other: TimedClearance) -> TimedClearance {
    let Some(best) = best else { return other };
    let searched_until = earlier(best.searched_until, other.searched_until);
    let nearer = if other.least.value < best.least.value { other } else { best };
    TimedClearance { searched_until, ..nearer }
}

fn earlier(one: Option<f64>, other: Option<f64>) -> Option<f64> {
    one.into_iter().chain(other).reduce(f64::min)
}
