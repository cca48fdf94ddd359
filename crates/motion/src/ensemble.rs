//! Several dragons in one show: their motions on the show's clock, and the events of all of them.
//!
//! In: named motions with delays, in the order of the scene. Out: one timeline, one chain, one least clearance. Handles
//! are numbered through: bench i joins handles i and i + 1, so the number of a dragon's last handle is not used as the
//! number of a bench. Obstacles follow the handles.

use std::ops::Range;

use bench_dragon_messages::Roster;
use bench_dragon_messages::state::EventKind;

use crate::clearance::{ClearanceMonitor, Pairs, Precision};
use crate::contact::LeastClearance;
use crate::contact::between::{self, Meeting, MovingDragon};
use crate::event::{Budget, Event};
use crate::ground::{Ground, Obstacle};
use crate::linkage::NoFollower;
use crate::model::team::Team;
use crate::singularities::Singularities;
use crate::solve::table::Instructions;
use crate::solve::{ChainMut, Solver, Velocities};
use crate::timeline::{TimedClearance, TimedEvent, TimedObstacleClearance, Timeline};
use crate::{CONTACT_BUDGET, Choice, Motion};

/// One of several dragons.
#[derive(Debug, Clone, PartialEq)]
pub struct Dragon {
    /// Its name, unique in the show.
    pub name: String,
    /// The time of the show, in seconds, during which it stands at its start.
    pub delay: f64,
    /// Its motion, in its own time.
    pub motion: Motion,
}

impl Dragon {
    /// Returns the time of the dragon's own motion at a time of the show, and true if the dragon moves then. The dragon
    /// stands at its start before its delay has passed, and at its path's end after its motion.
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
    /// The index of each dragon's first handle, and the number of all handles.
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

    /// Returns the first contact of boards of two dragons up to a time, and the time up to which the search came.
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
                // The first contact, or the deepest of contacts at one time, as at the start.
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

    /// Returns the first contact of boards of two dragons up to a time of the show. The contact has its time, and a
    /// bench of each dragon, counted within the dragon. Returns `None` if there is no contact, or the search gave up.
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

    /// Returns the least clearances of any two boards that share no handle, from the start until the show ends at
    /// `show_end`. `own` is for boards of one dragon, `between` for boards of two dragons.
    pub fn least_clearances(&self, show_end: &TimedEvent, progress: &mut dyn FnMut(f64)) -> LeastClearances {
        let share = 0.5 / self.dragons.len() as f64;
        let own = |k: usize| self.own_least_clearance(k, show_end, &mut |part| progress(share * (k as f64 + part)));
        let own = (0..self.dragons.len()).filter_map(own).fold(None, |best, own| Some(nearer(best, own)));
        let between = self.least_clearance_between(show_end.time, &mut |part| progress(0.5 + 0.5 * part));
        LeastClearances { own, between }
    }

    /// Returns the least clearance of two boards of one dragon, with the numbers and at the times of the show. Returns
    /// `None` if there are no two boards, or the search failed.
    fn own_least_clearance(
        &self,
        dragon: usize,
        show_end: &TimedEvent,
        progress: &mut dyn FnMut(f64),
    ) -> Option<TimedClearance> {
        let Dragon { delay, motion, .. } = &self.dragons[dragon];
        let end = self.own_end(&self.dragons[dragon], show_end);
        let mut own = motion.least_clearance(&motion.timeline_without_contact(), &end, progress)?;
        let first = self.first_handles[dragon] as u32;
        (own.least.bench_a, own.least.bench_b) = (own.least.bench_a + first, own.least.bench_b + first);
        own.time += delay;
        own.searched_until = own.searched_until.map(|until| until + delay);
        Some(own)
    }

    /// Returns the least clearance of boards of two dragons, from the start to a time; `None` if there are no two, or
    /// the search failed.
    fn least_clearance_between(&self, to: f64, progress: &mut dyn FnMut(f64)) -> Option<TimedClearance> {
        let found = self.singularities();
        let moving = self.moving(&found).ok()?;
        let mut budget = Budget::new(CONTACT_BUDGET, progress);
        let mut best: Option<(Meeting, [usize; 2])> = None;
        // The nearest guess leaves little to prove of the others.
        for pair in pairs(moving.len()) {
            let guess = between::guess_least_clearance(pair.map(|k| &moving[k]), (0.0, to), &mut budget).ok()?;
            best = guess.map(|meeting| (meeting, pair)).into_iter().chain(best).min_by(least);
        }
        let mut searched_until = None;
        for pair in pairs(moving.len()) {
            let below = best.map(|(meeting, _)| meeting);
            let found = between::least_clearance(pair.map(|k| &moving[k]), (0.0, to), below, &mut budget).ok()?;
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
    pub fn nearest_of(&self, pair: [usize; 2], to: f64) -> Option<(f64, [usize; 2])> {
        let two = pair.map(|dragon| &self.dragons[dragon]);
        let found = two.map(|dragon| dragon.motion.singularities(&mut |_| ()));
        let [one, other] = [0, 1].map(|k| moving(two[k], &found[k]).ok());
        let moving = [&one?, &other?];
        let mut unreported = |_| {};
        let mut budget = Budget::new(CONTACT_BUDGET, &mut unreported);
        let guess = between::guess_least_clearance(moving, (0.0, to), &mut budget).ok()?;
        let nearer = between::least_clearance(moving, (0.0, to), guess, &mut budget).ok()?.value;
        nearer.or(guess).map(|meeting| (meeting.time, meeting.benches))
    }

    /// Returns the least clearance of each obstacle over all dragons, as [`Motion::obstacle_clearances`].
    pub fn obstacle_clearances(
        &self,
        show_end: &TimedEvent,
        progress: &mut dyn FnMut(f64),
    ) -> Vec<TimedObstacleClearance> {
        let share = 1.0 / self.dragons.len() as f64;
        let mut all: Vec<TimedObstacleClearance> = Vec::new();
        for (k, dragon) in self.dragons.iter().enumerate() {
            let end = self.own_end(dragon, show_end);
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
    fn own_end(&self, dragon: &Dragon, show_end: &TimedEvent) -> TimedEvent {
        let time = dragon.own_time(show_end.time).0;
        TimedEvent { event: Event { travelled: dragon.motion.travelled_at(time), ..show_end.event }, time }
    }

    /// Makes the monitor of the live clearance of different dragons. `choices` has the solver of each dragon's frames,
    /// in its path's own coordinates; the chains are on the stage.
    pub fn between_monitor(&self, choices: &[Choice]) -> ClearanceMonitor {
        let teams: Vec<Team> = self.dragons.iter().map(|dragon| *dragon.motion.team()).collect();
        let of = self.dragons.iter().zip(choices).map(|(dragon, choice)| dragon.motion.precision(choice));
        let precision = of.reduce(|all, of| Precision {
            handle_error: all.handle_error.max(of.handle_error),
            seconds_per_link: all.seconds_per_link.min(of.seconds_per_link),
        });
        let precision = precision.expect("a show has a dragon");
        ClearanceMonitor::new(&teams, Pairs::Between, Ground::default(), precision)
    }

    /// Makes a solver of all dragons, for the show's time. Its chains are placed on the stage.
    pub fn solver(&self, velocities: Velocities) -> EnsembleSolver {
        let dancer = |(k, dragon): (usize, &Dragon)| {
            (dragon.clone(), dragon.motion.solver(velocities).solver, self.handles_of(k))
        };
        EnsembleSolver { dancers: self.dragons.iter().enumerate().map(dancer).collect() }
    }
}

/// The least clearances of a show of several dragons.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastClearances {
    /// The least clearance of two boards of one dragon; `None` if there are no two, or the search failed.
    pub own: Option<TimedClearance>,
    /// The least clearance of boards of two dragons; `None` likewise.
    pub between: Option<TimedClearance>,
}

impl LeastClearances {
    /// Returns the least clearance of the show.
    pub fn of_show(&self) -> Option<TimedClearance> {
        self.between.into_iter().fold(self.own, |best, other| Some(nearer(best, other)))
    }
}

/// The solver of all dragons of a show.
pub struct EnsembleSolver {
    dancers: Vec<(Dragon, Box<dyn Solver>, Range<usize>)>,
}

impl Solver for EnsembleSolver {
    fn name(&self) -> &'static str {
        "several"
    }

    fn solve_in(&mut self, time: f64, chain: &mut ChainMut) -> Result<(), NoFollower> {
        for (dragon, solver, handles) in &mut self.dancers {
            let (own_time, moves) = dragon.own_time(time);
            let mut own = chain.range_mut(handles.clone());
            solver.solve_in(own_time, &mut own)?;
            if !moves {
                own.stand();
            }
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

/// Compares clearances.
fn least((one, _): &(Meeting, [usize; 2]), (other, _): &(Meeting, [usize; 2])) -> std::cmp::Ordering {
    one.value.total_cmp(&other.value)
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
