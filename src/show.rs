//! The show: from a scene and a tick to one [`Frame`], the same bits every time.
//!
//! In: a scene, its timeline, and ticks. Out: frames. Knows the solver, the events and the alert rules; knows no wall
//! clock and no transport. The live loop calls it.

pub mod alerts;
pub mod clock;
pub mod state;

use crate::linkage::NoFollower;
use crate::motion::clearance::{ClearanceMonitor, PairClearance};
use crate::motion::event::{Event, EventKind};
use crate::motion::timeline::{TimedEvent, Timeline};
use crate::motion::{Choice, Method};
use crate::scene::{AtEnd, OnContact, Scene};
use crate::solve::{Chain, Solver, Velocities};

use alerts::{Alert, LevelTracker};
use clock::{ShowClock, ShowTime};
use state::{FrameState, PlaybackState};

/// One moment of the show.
#[derive(Debug, Clone)]
pub struct Frame {
    /// The number of the period.
    pub tick: u64,
    /// Simulated seconds since the start of the scene.
    pub sim_time: f64,
    /// Simulated seconds per second of wall time, as in force; unchanged once the show has ended.
    pub time_scale: f64,
    /// The latest event passed, or `Approaching`, or `Moving`.
    pub state: FrameState,
    /// `Ended` once the show has frozen, else `Playing`.
    pub playback: PlaybackState,
    /// Where every handle is.
    pub chain: Chain,
    /// Metres between the nearest two boards that share no handle; NaN where none is computed.
    pub min_clearance: f64,
    /// The alerts that go with this frame, in order. Its memory is reserved once.
    pub alerts: Vec<Alert>,
    /// Times the show has been played to its end and begun again.
    pub shows_played: u64,
    /// Contacts so far that no search had found: boards that overlapped before any contact was due.
    pub unforeseen_contacts: u64,
    /// Frames so far for whose time there was no solution, so that the one before was shown again.
    pub unsolved_frames: u64,
}

/// How a scene is played: what the command line may override.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Playback {
    /// Simulated seconds at which the show begins.
    pub start: f64,
    /// Simulated seconds per second of wall time.
    pub time_scale: f64,
    /// Frames per second.
    pub rate: f64,
    /// What happens at a contact.
    pub on_contact: OnContact,
    /// What happens once the show has frozen.
    pub at_end: AtEnd,
}

impl Playback {
    /// The playback that a scene states: from its start, in real time.
    pub fn of(scene: &Scene) -> Self {
        Self { start: 0.0, time_scale: 1.0, rate: scene.rate, on_contact: scene.on_contact, at_end: scene.at_end }
    }
}

/// A start that is not before the motion's end.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "{start} s is outside the motion, expected at least 0 and less than {end} s, at which it ends ({})",
    kind.name()
)]
pub struct StartError {
    /// Simulated seconds at which the show was to begin.
    pub start: f64,
    /// Simulated seconds at which the motion ends.
    pub end: f64,
    /// What ends it.
    pub kind: EventKind,
}

/// A scene being played.
pub struct Show {
    clock: ShowClock,
    solver: Box<dyn Solver>,
    solver_reason: String,
    velocities: Velocities,
    /// What the head travels in a simulated second; not a number where the method does not follow the path exactly.
    metres_per_second: f64,
    timeline: Timeline,
    clearance: Option<ClearanceMonitor>,
    level: Option<LevelTracker>,
    /// Metres of overlap that no search has let pass; `None` where the solver does not follow the searched motion.
    overlap_tolerance: Option<f64>,
    solved_time: Option<f64>,
    frame: Frame,
}

/// Metres of overlap before the contact, as a share of the longest link, that rounding explains in an exact frame.
const ROUNDING_OVERLAP: f64 = 1e-9;

impl Show {
    /// A show of `scene`, whose events `timeline` holds.
    ///
    /// # Errors
    /// A start before the scene's own or after the motion's end.
    pub fn new(scene: &Scene, timeline: Timeline, playback: Playback) -> Result<Self, StartError> {
        let end = timeline.end();
        if !(playback.start >= 0.0 && playback.start < end.time) {
            return Err(StartError { start: playback.start, end: end.time, kind: end.event.kind });
        }
        let mut timeline = if scene.alerts.is_some() { timeline } else { timeline.end_only() };
        timeline.reserve_contact();
        let stops = scene.alerts.is_some() && playback.on_contact == OnContact::Stop;
        let freeze_time = timeline.freeze(stops).time;
        let level = scene.alerts.map(|rules| LevelTracker::new(rules, playback.rate));
        let choice = scene.motion.solver(scene.velocities);
        let clearance = scene.alerts.map(|_| scene.motion.clearance_monitor(&choice));
        let rounding = ROUNDING_OVERLAP * scene.team().longest_link() + choice.clearance_error(scene.team());
        let Choice { solver, reason, .. } = choice;
        let exact = !matches!(scene.motion.method(), Method::Paper(_));
        let frame = Frame {
            tick: 0,
            sim_time: playback.start,
            time_scale: playback.time_scale,
            state: FrameState::Moving,
            playback: PlaybackState::Playing,
            chain: Chain::new(scene.team().handles()),
            min_clearance: f64::NAN,
            alerts: Vec::with_capacity(alerts::MOST_PER_FRAME),
            shows_played: 0,
            unforeseen_contacts: 0,
            unsolved_frames: 0,
        };
        Ok(Self {
            clock: ShowClock::new(&playback, freeze_time),
            solver,
            solver_reason: reason,
            velocities: scene.velocities,
            metres_per_second: scene.motion.travelled_at(1.0),
            timeline,
            clearance,
            level,
            overlap_tolerance: exact.then_some(rounding),
            solved_time: None,
            frame,
        })
    }

    /// The solver of this show and why it was chosen, for people.
    pub fn solver_reason(&self) -> &str {
        &self.solver_reason
    }

    /// The events of this show, in order.
    pub fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// Simulated seconds at which the show freezes.
    pub fn freeze_time(&self) -> f64 {
        self.clock.freeze_time()
    }

    /// Pairs of boards tested for their separation so far: none where the scene has no alerts.
    pub fn pairs_tested(&self) -> u64 {
        self.clearance.as_ref().map_or(0, |monitor| monitor.counters().pairs)
    }

    /// The frame of a tick: time, chain, clearance, state, alerts.
    ///
    /// Ticks are given in increasing order; some may be left out. The same sequence of ticks gives the same bits.
    pub fn frame(&mut self, tick: u64) -> &Frame {
        let ShowTime { sim_time, shows_played, ended } = self.clock.at(tick);
        let restarted = shows_played != self.frame.shows_played;
        self.frame.tick = tick;
        self.frame.shows_played = shows_played;
        self.frame.sim_time = sim_time;
        self.frame.playback = if ended { PlaybackState::Ended } else { PlaybackState::Playing };
        self.solve(sim_time);
        let closest = self.measure_clearance();
        self.record_unforeseen_contact(closest);
        self.update_state(restarted, closest);
        &self.frame
    }

    /// Brings the chain to a time. A frozen show is solved once.
    fn solve(&mut self, sim_time: f64) {
        if self.solved_time == Some(sim_time) {
            return;
        }
        self.solved_time = Some(sim_time);
        if solve_at_or_just_before(self.solver.as_mut(), sim_time, &mut self.frame.chain).is_err() {
            self.frame.unsolved_frames += 1;
        }
        if self.frame.playback == PlaybackState::Ended && self.velocities == Velocities::Computed {
            let Chain { speed, vx, vy, .. } = &mut self.frame.chain;
            [speed, vx, vy].into_iter().for_each(|numbers| numbers.fill(0.0));
        }
    }

    fn measure_clearance(&mut self) -> Option<PairClearance> {
        let travelled = self.metres_per_second * self.frame.sim_time;
        let least = self.clearance.as_mut()?.least_clearance(&self.frame.chain, travelled);
        self.frame.min_clearance = least.map_or(f64::NAN, |least| least.value);
        least
    }

    /// Boards that overlap while no contact has happened are a contact now, whatever the searches found.
    fn record_unforeseen_contact(&mut self, closest: Option<PairClearance>) {
        let (Some(tolerance), Some(closest)) = (self.overlap_tolerance, closest) else { return };
        let time = self.frame.sim_time;
        let happened = self.timeline.find(EventKind::Contact).is_some_and(|contact| contact.time <= time);
        if closest.value >= -tolerance || happened {
            return;
        }
        self.frame.unforeseen_contacts += 1;
        let event = Event {
            kind: EventKind::Contact,
            travelled: f64::NAN,
            bench_a: Some(closest.bench_a as u32),
            bench_b: Some(closest.bench_b as u32),
            place: Some(nalgebra::center(&closest.point_a, &closest.point_b)),
        };
        self.timeline.record_contact(TimedEvent { event, time });
    }

    fn update_state(&mut self, restarted: bool, closest: Option<PairClearance>) {
        let frame = &mut self.frame;
        frame.alerts.clear();
        let passed = self.timeline.latest_passed(frame.sim_time);
        frame.state = passed.map_or(FrameState::Moving, |passed| passed.event.kind.into());
        let Some(level) = &mut self.level else { return };
        if restarted {
            level.restart();
        }
        level.update(frame.tick, frame.sim_time, &self.timeline, closest, &mut frame.alerts);
        if passed.is_none() {
            frame.state = level.current().into();
        }
    }
}

/// Solves at `time`, or at the latest moment before it at which there is a solution.
///
/// The time of a lock, multiplied by the speed again, can lie past the lock by the last digit; the paper's solver is
/// one of its own time steps ahead. Nothing else steps back, and nothing does so by more than 1e-4 of the time.
///
/// # Errors
/// [`NoFollower`] where there is none as near; `chain` is then unspecified.
pub fn solve_at_or_just_before(solver: &mut dyn Solver, time: f64, chain: &mut Chain) -> Result<(), NoFollower> {
    let mut back = f64::EPSILON * time;
    let mut at = time;
    while let Err(none) = solver.solve(at, chain) {
        at = time - back;
        back *= 2.0;
        // Not a number, and a time of 0, end it too.
        if !(back > 0.0 && back <= 1e-4 * time) {
            return Err(none);
        }
    }
    Ok(())
}
