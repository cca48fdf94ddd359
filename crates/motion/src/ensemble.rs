//! The ensemble: the dragons of a show, one or several. Their motions on the show's clock, and the events of all.
//!
//! In: motions with names and delays, in the order of the scene. Out: one timeline, one chain, one least clearance.
//! Handles are numbered through: bench i joins handles i and i + 1, so the number of a dragon's last handle is not used
//! as the number of a bench. Obstacles follow the handles. Only this file makes times and numbers of the show.

mod clearances;

use std::ops::{ControlFlow, Range};

use bench_dragon_messages::Roster;
use bench_dragon_messages::state::EventKind;

use crate::clearance::{ClearanceMonitor, Pairs, Precision};
use crate::contact::between::{self, Meeting, MovingDragon};
use crate::event::{Budget, Event, Progress};
use crate::ground::{Ground, Obstacle};
use crate::linkage::NoFollower;
use crate::model::team::Team;
use crate::singularities::Singularities;
use crate::solve::table::Instructions;
use crate::solve::{ChainMut, Solver, Velocities};
use crate::timeline::{TimedEvent, Timeline};
use crate::{CONTACT_BUDGET, Choice, Method, Motion, MotionEvents};
pub use clearances::LeastClearances;

/// A dragon of a show.
#[derive(Debug, Clone, PartialEq)]
pub struct Dragon {
    /// Its name, unique in the show. A dragon without a name is alone, and its show ends with its motion.
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
        if self.name.is_empty() {
            return (show_time, true);
        }
        let own = show_time - self.delay;
        let end = self.motion.time_at(self.motion.bare_path().length());
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

    /// Returns the words with the dragon's name after them, as in "Solver of gold"; without a name the words alone.
    pub fn titled(&self, words: &str) -> String {
        if self.name.is_empty() { words.to_owned() } else { format!("{words} of {}", self.name) }
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

    /// Creates the ensemble of one dragon without a name.
    pub fn alone(motion: Motion) -> Self {
        Self::new(vec![Dragon { name: String::new(), delay: 0.0, motion }])
    }

    /// Returns the motion of a dragon without a name; `None` for dragons with names.
    pub fn only(&self) -> Option<&Motion> {
        let [Dragon { name, motion, .. }] = self.dragons.as_slice() else { return None };
        name.is_empty().then_some(motion)
    }

    /// Returns the same ensemble with other motions.
    ///
    /// # Errors
    /// The first error of `change`.
    pub fn try_map<E>(&self, mut change: impl FnMut(&Motion) -> Result<Motion, E>) -> Result<Self, E> {
        let of = |dragon: &Dragon| Ok(Dragon { motion: change(&dragon.motion)?, ..dragon.clone() });
        self.dragons.iter().map(of).collect::<Result<_, _>>().map(Self::new)
    }

    /// Returns the same dragons, whose tables are read with these instructions, one set for each dragon, or `None` if
    /// this processor lacks them.
    pub fn with_instructions(&self, sets: &[Instructions]) -> Option<Self> {
        let mut sets = sets.iter();
        self.try_map(|motion| sets.next().and_then(|set| motion.clone().with_instructions(*set)).ok_or(())).ok()
    }

    /// Returns the dragons in the order of the scene.
    pub fn dragons(&self) -> &[Dragon] {
        &self.dragons
    }

    /// Returns true if every head follows its path exactly: none by the paper's rules.
    pub fn is_exact(&self) -> bool {
        self.dragons.iter().all(|dragon| !matches!(dragon.motion.method(), Method::Paper(_)))
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

    /// Returns the events of all dragons, contacts included. If `progress` stops the search, the timeline says so.
    pub fn timeline(&self, progress: Progress<'_>) -> Timeline {
        let (own_share, share) = self.shares();
        let mut is_stopped = false;
        let mut progress = |share| noted(progress(share), &mut is_stopped);
        let own = |(k, dragon): (usize, &Dragon)| {
            let events = dragon.motion.events(&mut |part| progress(share * (k as f64 + part)));
            self.on_the_shows_clock(k, events)
        };
        let own: Vec<Timeline> = self.dragons.iter().enumerate().map(own).collect();
        let end = end_of(&own);
        let contacts = own.iter().flat_map(|timeline| before(timeline, &end));
        let mut first = contacts.filter(|timed| timed.event.kind == EventKind::Contact).min_by(by_time).copied();
        let to = first.map_or(end.time, |contact| contact.time);
        let until = match self.contact_between(to, &mut |part| progress(own_share + (1.0 - own_share) * part)) {
            Ok((between, reached)) => {
                first = between.as_ref().into_iter().chain(&first).min_by(by_time).copied();
                reached
            }
            Err(_) if is_stopped => 0.0,
            Err(stuck) => {
                log::warn!("the search for a contact of two dragons stopped at a place without a solution: {stuck}");
                0.0
            }
        };
        collected(&own, end, first, until).stopped(is_stopped)
    }

    /// Returns the events without contacts and obstacles, which cost a longer search. If `progress` stops it, the
    /// timeline says so.
    pub fn timeline_without_contact(&self, progress: Progress<'_>) -> Timeline {
        let mut is_stopped = false;
        let (_, share) = self.shares();
        let own = |(k, dragon): (usize, &Dragon)| {
            let mut of_all = |part| noted(progress(share * (k as f64 + part)), &mut is_stopped);
            self.on_the_shows_clock(k, dragon.motion.events_without_contact(&mut of_all))
        };
        let own: Vec<Timeline> = self.dragons.iter().enumerate().map(own).collect();
        collected(&own, end_of(&own), None, f64::INFINITY).stopped(is_stopped)
    }

    /// Returns the share of a search that is spent on the dragons alone, and the share of one dragon.
    fn shares(&self) -> (f64, f64) {
        let own = if self.dragons.len() > 1 { 0.5 } else { 1.0 };
        (own, own / self.dragons.len() as f64)
    }

    /// Returns the timeline of a dragon's own events at the times of the show, with the numbers of the show.
    fn on_the_shows_clock(&self, dragon: usize, own: MotionEvents) -> Timeline {
        let Dragon { name, delay, motion } = &self.dragons[dragon];
        let first = self.first_handles[dragon] as u32;
        let timed = |own: Event| {
            let bench_b = match own.kind {
                EventKind::Obstacle => {
                    own.bench_b.map(|number| number + (self.handles() - motion.team().handles()) as u32)
                }
                _ => own.bench_b.map(|bench| bench + first),
            };
            // With names, the head of the dragon that reaches its path's end.
            let head = (own.kind == EventKind::PathEnd && !name.is_empty()).then_some(first);
            let bench_a = own.bench_a.map_or(head, |bench| Some(bench + first));
            // A dragon that stands on itself or at an obstacle does so from the show's start on.
            let time = motion.time_of(&own);
            let is_at_start = time == 0.0 && matches!(own.kind, EventKind::Contact | EventKind::Obstacle);
            let time = if is_at_start { 0.0 } else { time + delay };
            TimedEvent { event: Event { bench_a, bench_b, ..own }, time }
        };
        let until = own.searched_until.map(|until| motion.time_at(until) + delay);
        Timeline::new(own.events.into_iter().map(timed).collect(), until)
    }

    /// Returns the first contact of boards of two dragons up to a time, and the time up to which the search came.
    fn contact_between(&self, to: f64, progress: Progress<'_>) -> Result<(Option<TimedEvent>, f64), NoFollower> {
        if self.dragons.len() < 2 {
            return Ok((None, f64::INFINITY));
        }
        let found = self.singularities(progress);
        let known = self.known_to(&found, to);
        let mut budget = Budget::new(CONTACT_BUDGET, progress);
        let moving = self.moving(&found, &mut budget)?;
        let until = if known < to { known } else { f64::INFINITY };
        let (mut first, mut to, mut until): (Option<(Meeting, [usize; 2])>, _, _) = (None, known, until);
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
    pub fn first_contact_of(&self, pair: [usize; 2], to: f64, progress: Progress<'_>) -> Option<(f64, [usize; 2])> {
        let two = self.pair(pair);
        let TimedEvent { time, event } = two.contact_between(to, progress).ok()?.0?;
        Some((time, two.within([event.bench_a?, event.bench_b?])))
    }

    /// Returns two of the dragons as an ensemble.
    fn pair(&self, pair: [usize; 2]) -> Self {
        Self::new(pair.map(|dragon| self.dragons[dragon].clone()).into())
    }

    /// Returns the numbers of a bench of each of two dragons within its dragon.
    fn within(&self, benches: [u32; 2]) -> [usize; 2] {
        [0, 1].map(|k| benches[k] as usize - self.first_handles[k])
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

    fn singularities(&self, progress: Progress<'_>) -> Vec<Singularities> {
        self.dragons.iter().map(|dragon| dragon.motion.singularities(&mut |_| progress(0.0))).collect()
    }

    /// Returns the time of the show, at most `to`, up to which the turns of all dragons are known.
    fn known_to(&self, found: &[Singularities], to: f64) -> f64 {
        let incomplete = self.dragons.iter().zip(found).filter(|(_, found)| found.end.is_none());
        incomplete.map(|(dragon, found)| dragon.motion.time_at(found.searched_until) + dragon.delay).fold(to, f64::min)
    }

    fn moving<'a>(
        &'a self,
        found: &'a [Singularities],
        budget: &mut Budget,
    ) -> Result<Vec<MovingDragon<'a>>, NoFollower> {
        let moving = |(Dragon { delay, motion, .. }, found): (&'a Dragon, &'a Singularities)| {
            let end = found.end.map_or(motion.bare_path().length(), |end| end.travelled);
            let (chain, placement) = (motion.advancement(found), *motion.placement());
            MovingDragon::new(chain, placement, *delay, motion.head_speed(), end, budget)
        };
        self.dragons.iter().zip(found).map(moving).collect()
    }

    /// Makes the monitor of the live clearance of different dragons; `None` if there is one dragon. `choices` has the
    /// solver of each dragon's frames, in its path's own coordinates.
    pub fn between_monitor(&self, choices: &[Choice]) -> Option<ClearanceMonitor> {
        if self.dragons.len() < 2 {
            return None;
        }
        let teams: Vec<Team> = self.dragons.iter().map(|dragon| *dragon.motion.team()).collect();
        let of = self.dragons.iter().zip(choices).map(|(dragon, choice)| dragon.motion.precision(choice));
        let precision = of.reduce(|all, of| Precision {
            handle_error: all.handle_error.max(of.handle_error),
            seconds_per_link: all.seconds_per_link.min(of.seconds_per_link),
        })?;
        Some(ClearanceMonitor::new(&teams, Pairs::Between, Ground::default(), precision))
    }

    /// Makes a solver of all dragons, for the show's time. Its chains are placed on the stage.
    pub fn solver(&self, velocities: Velocities) -> Box<dyn Solver> {
        self.of_choices(self.dragons.iter().map(|dragon| dragon.motion.solver(velocities)))
    }

    /// Makes the same solver, unless `progress`, whose share stays 0, stops the making.
    pub fn solver_unless_stopped(&self, velocities: Velocities, progress: Progress<'_>) -> Option<Box<dyn Solver>> {
        let choice = |dragon: &Dragon| dragon.motion.solver_unless_stopped(velocities, progress);
        let choices: Vec<Choice> = self.dragons.iter().map(choice).collect::<Option<_>>()?;
        Some(self.of_choices(choices))
    }

    fn of_choices(&self, choices: impl IntoIterator<Item = Choice>) -> Box<dyn Solver> {
        let dancers = self.dragons.iter().zip(choices).enumerate();
        let dancers = dancers.map(|(k, (dragon, choice))| (dragon.clone(), choice.solver, self.handles_of(k)));
        Box::new(EnsembleSolver { dancers: dancers.collect() })
    }
}

/// The solver of all dragons of a show.
struct EnsembleSolver {
    dancers: Vec<(Dragon, Box<dyn Solver>, Range<usize>)>,
}

impl Solver for EnsembleSolver {
    fn name(&self) -> &'static str {
        "ensemble"
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

/// Returns what the receiver of a search's progress has answered, and notes a stop.
fn noted(answer: ControlFlow<()>, is_stopped: &mut bool) -> ControlFlow<()> {
    *is_stopped |= answer.is_break();
    answer
}

/// Returns all pairs of `count` dragons, in order.
pub fn pairs(count: usize) -> impl Iterator<Item = [usize; 2]> {
    (0..count).flat_map(move |a| (a + 1..count).map(move |b| [a, b]))
}

/// Returns the event with which a show ends: the first lock of any dragon, or the last end of a path.
fn end_of(own: &[Timeline]) -> TimedEvent {
    let ends = || own.iter().map(Timeline::end);
    let lock = ends().filter(|end| end.event.kind == EventKind::Lock).min_by(by_time);
    // There is a dragon, and each has an end.
    *lock.or_else(|| ends().max_by(by_time)).expect("a show has a dragon")
}

/// Returns the events of a dragon up to the end of the show. If the dragon ends the show, these are all its events: the
/// time of a lock can be rounded to before an event at the same place.
fn before<'a>(own: &'a Timeline, end: &TimedEvent) -> impl Iterator<Item = &'a TimedEvent> {
    let (ends_show, end) = (own.end() == end, end.time);
    own.events().iter().filter(move |timed| ends_show || timed.time <= end)
}

/// Joins the timelines of all dragons, given the first contact, and the time up to which the contacts of two are known.
fn collected(own: &[Timeline], end: TimedEvent, contact: Option<TimedEvent>, until: f64) -> Timeline {
    let until = own.iter().filter_map(Timeline::searched_until).fold(until, f64::min);
    let (mut events, mut standing): (Vec<TimedEvent>, Vec<TimedEvent>) = (contact.into_iter().collect(), Vec::new());
    for timed in own.iter().flat_map(|timeline| before(timeline, &end)) {
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
    events.push(end);
    Timeline::new(events, (until < end.time).then_some(until)).with_standing(standing)
}

/// Compares times.
fn by_time(one: &&TimedEvent, other: &&TimedEvent) -> std::cmp::Ordering {
    one.time.total_cmp(&other.time)
}
