//! The show: from a scene and a tick to one [`Frame`], always with the same bits.
//!
//! In: a scene, its timeline, and ticks. Out: frames. The show uses the solver, the events and the alert rules, but no
//! wall clock and no transport. So the live loop, the verification of logs and the stage page all get the same frames.

pub mod alerts;
pub mod clock;
pub mod convert;
pub mod curve;
mod dancer;
mod dancers;
pub mod moments;
mod playback;
pub mod requirements;
pub mod results;
pub mod scene;
pub mod second_solver;
pub mod table;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use crate::scene::cue::CueAction;
use crate::scene::{OnContact, Scene};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::clearance::PairClearance;
use bench_dragon_motion::event::Event;
use bench_dragon_motion::solve::Chain;
use bench_dragon_motion::timeline::{TimedEvent, Timeline};

use dancer::Closest;
pub use dancer::solve_at_or_just_before;
use dancers::Dancers;

use alerts::{Alert, LevelTracker};
use bench_dragon_messages::control::{COMMANDS_PER_FRAME, Code, Command, CommandRecord};
use bench_dragon_messages::state::{FrameState, PlaybackState};
use clock::{CueTime, ShowClock, ShowTime};
pub use playback::{Playback, StartError};

/// The state of the show in one period.
#[derive(Debug, Clone)]
pub struct Frame {
    /// The number of the period.
    pub tick: u64,
    /// Simulated seconds since the start of the scene.
    pub sim_time: f64,
    /// Simulated seconds per second of wall time in force: 0 while paused or held, unchanged after the end of the show.
    pub time_scale: f64,
    /// The latest event passed, or `Approaching`, or `Moving`.
    pub state: FrameState,
    /// The playback state: simulated time advances or stands still.
    pub playback: PlaybackState,
    /// The pose of every handle.
    pub chain: Chain,
    /// The least clearance, in metres: of two boards that share no handle, or of a board and an obstacle; NaN if it is
    /// not computed.
    pub min_clearance: f64,
    /// The alerts that go with this frame, in order. Its capacity is reserved in advance.
    pub alerts: Vec<Alert>,
    /// Jumps of simulated time so far: loops, seeks, restarts.
    pub epoch: u32,
    /// The latest cue passed, counted from 1 in the order of times; 0 if none.
    pub cue: u32,
    /// The cues reached since the previous frame, in order. Its capacity is reserved in advance.
    pub cues: Vec<ReachedCue>,
    /// The commands at the beginning of this period and a finished step, in order. Its capacity is reserved in advance.
    pub commands: Vec<CommandRecord>,
    /// The number of times that the show has ended and started again.
    pub shows_played: u64,
    /// The number of contacts that no search had found: boards that overlapped each other, or the keep-out of an
    /// obstacle, before the timeline's event.
    pub unforeseen_contacts: u64,
    /// The number of frames without a solution: the chain is the latest solution.
    pub unsolved_frames: u64,
}

impl Frame {
    /// Creates a frame of `handles` handles, all at the origin, before the first period.
    pub fn new(handles: usize) -> Self {
        Self {
            tick: 0,
            sim_time: 0.0,
            time_scale: 1.0,
            state: FrameState::Moving,
            playback: PlaybackState::Playing,
            chain: Chain::new(handles),
            min_clearance: f64::NAN,
            alerts: Vec::with_capacity(alerts::MOST_PER_FRAME),
            epoch: 0,
            cue: 0,
            cues: Vec::new(),
            commands: Vec::with_capacity(COMMANDS_PER_FRAME),
            shows_played: 0,
            unforeseen_contacts: 0,
            unsolved_frames: 0,
        }
    }
}

/// A cue that a frame has reached.
#[derive(Debug, Clone, PartialEq)]
pub struct ReachedCue {
    /// The cue's number, from 1 in the order of times.
    pub number: u32,
    /// The cue's time, in simulated seconds.
    pub time: f64,
    /// True if the show waits at the cue for [`Command::Go`].
    pub pauses: bool,
    /// The cue's name.
    pub name: Arc<str>,
}

/// The result of a command, and the state of the show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// The result code.
    pub code: Code,
    /// The period at whose beginning the command was executed, or in which a step ended.
    pub tick: u64,
    /// Simulated seconds of that period.
    pub sim_time: f64,
    /// Simulated seconds per second of wall time in force.
    pub time_scale: f64,
    /// Simulated seconds per second while the show plays. A pause keeps this rate.
    pub playing_rate: f64,
    /// The playback state.
    pub playback: PlaybackState,
    /// The latest cue passed, from 1; 0 if none.
    pub cue: u32,
}

/// A scene in play.
pub struct Show {
    clock: ShowClock,
    dancers: Dancers,
    solver_reason: String,
    timeline: Timeline,
    level: Option<LevelTracker>,
    /// True if boards are measured against obstacles.
    has_obstacles: bool,
    /// The greatest overlap in metres that rounding explains before a contact; `None` if the solver does not follow the
    /// searched motion.
    overlap_tolerance: Option<f64>,
    /// The time requested for the chain, and true if the chain moves then.
    solved: Option<(f64, bool)>,
    /// The nearest boards of the solution.
    closest: Closest,
    /// The cues in the order of their times.
    cues: Vec<ReachedCue>,
    missing_cues: Vec<String>,
    /// The command records of the next frame.
    commands: Vec<CommandRecord>,
    /// True after the beginning of a step until a frame reports its end.
    stepping: bool,
    frame: Frame,
}

/// Overlap before the contact that rounding explains in an exact frame, as a share of the longest link.
const ROUNDING_OVERLAP: f64 = 1e-9;

impl Show {
    /// Creates a show of `scene` with the events of `timeline`.
    ///
    /// # Errors
    /// The start is before the scene's start or not before the motion's end.
    pub fn new(scene: &Scene, timeline: Timeline, playback: Playback) -> Result<Self, StartError> {
        let end = timeline.end();
        if !(playback.start >= 0.0 && playback.start < end.time) {
            return Err(StartError { start: playback.start, end: end.time, kind: end.event.kind });
        }
        let mut timeline = if scene.alerts.is_some() { timeline } else { timeline.end_only() };
        timeline.reserve_touch();
        let stops = scene.alerts.is_some() && playback.on_contact == OnContact::Stop;
        let freeze_time = timeline.show_end(stops).time;
        let level = scene.alerts.map(|rules| LevelTracker::new(rules, playback.rate));
        let dancers = Dancers::new(scene);
        let exact = scene.ensemble.is_exact();
        let (cues, missing_cues) = timed_cues(scene, &timeline);
        let cue_times = cues.iter().map(|cue| CueTime { time: cue.time, pauses: cue.pauses }).collect();
        let mut frame = Frame { cues: Vec::with_capacity(2 * cues.len()), ..Frame::new(scene.ensemble.handles()) };
        // Each event announces at most one alert.
        frame.alerts.reserve(timeline.events().len() + 1);
        Ok(Self {
            clock: ShowClock::new(&playback, freeze_time, cue_times),
            overlap_tolerance: exact.then(|| ROUNDING_OVERLAP * dancers.longest_link() + dancers.clearance_error()),
            solver_reason: dancers.reason(),
            dancers,
            timeline,
            level,
            has_obstacles: !scene.ensemble.ground().is_empty(),
            solved: None,
            closest: Closest { boards: None, any: None },
            cues,
            missing_cues,
            commands: Vec::with_capacity(COMMANDS_PER_FRAME),
            stepping: false,
            frame,
        })
    }

    /// Returns the cues of this show in the order of their times.
    pub fn cues(&self) -> &[ReachedCue] {
        &self.cues
    }

    /// Returns the names of the cues without a time: before an event that does not happen, or before the scene's start.
    pub fn missing_cues(&self) -> &[String] {
        &self.missing_cues
    }

    /// Returns the name of this show's solver and the reason for its choice, for people.
    pub fn solver_reason(&self) -> &str {
        &self.solver_reason
    }

    /// Returns the events of this show in order.
    pub fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// Returns the simulated time at which the show ends, in seconds.
    pub fn freeze_time(&self) -> f64 {
        self.clock.freeze_time()
    }

    /// Returns the number of pairs of boards tested so far: 0 for a scene without alerts.
    pub fn pairs_tested(&self) -> u64 {
        self.dancers.pairs_tested()
    }

    /// Executes a command at the beginning of the period `tick`, before its frame. Returns `None` for a step:
    /// [`finished_step`](Self::finished_step) returns its result later.
    pub fn command(&mut self, tick: u64, command: Command) -> Option<Outcome> {
        // A step that has ended precedes the command.
        self.clock.advance(tick);
        self.record_finished_step();
        let code = self.clock.apply(tick, command);
        self.record_finished_step();
        self.commands.push(CommandRecord::Given { command, code });
        self.stepping |= code.is_none();
        let code = code?;
        if code == Code::Done && matches!(command, Command::Seek(_) | Command::Restart) {
            // The next level is published even if it is the same as before.
            self.level.iter_mut().for_each(LevelTracker::forget);
        }
        Some(self.outcome(tick, code))
    }

    /// Returns the result of the step that ended, or was interrupted, at `tick`. Must be called after the frame and
    /// before a command, which may be the next step.
    pub fn finished_step(&mut self, tick: u64) -> Option<Outcome> {
        self.clock.advance(tick);
        self.record_finished_step();
        let code = self.clock.take_step_outcome()?;
        Some(self.outcome(tick, code))
    }

    /// Records the end of a step once, for the next frame.
    fn record_finished_step(&mut self) {
        if self.stepping
            && let Some(code) = self.clock.step_outcome()
        {
            self.stepping = false;
            self.commands.push(CommandRecord::StepFinished { code });
        }
    }

    fn outcome(&mut self, tick: u64, code: Code) -> Outcome {
        let ShowTime { sim_time, time_scale, playback, cues_passed, .. } = self.clock.advance(tick);
        let playing_rate = self.clock.playing_rate();
        Outcome { code, tick, sim_time, time_scale, playing_rate, playback, cue: cues_passed as u32 }
    }

    /// Computes the frame of a tick: time, chain, clearance, state, alerts, cues.
    ///
    /// Ticks must increase; some may be skipped. The same ticks with the same commands give the same bits.
    pub fn frame(&mut self, tick: u64) -> &Frame {
        let ShowTime { sim_time, time_scale, playback, epoch, shows_played, cues_passed } = self.clock.advance(tick);
        let jumped = epoch != self.frame.epoch;
        self.record_finished_step();
        let frame = &mut self.frame;
        frame.commands.clear();
        frame.commands.append(&mut self.commands);
        frame.cues.clear();
        frame.cues.extend(self.clock.reached().iter().map(|cue| self.cues[*cue].clone()));
        self.clock.clear_reached();
        (frame.tick, frame.sim_time, frame.time_scale, frame.playback) = (tick, sim_time, time_scale, playback);
        (frame.epoch, frame.shows_played, frame.cue) = (epoch, shows_played, cues_passed as u32);
        self.solve(sim_time);
        self.record_unforeseen_touch(self.closest.boards);
        if self.has_obstacles {
            self.record_unforeseen_touch(self.closest.any);
        }
        self.update_state(jumped, self.closest.any);
        &self.frame
    }

    /// Solves the chain for a time, measures its clearance and places it on the stage. A show that stands still is
    /// solved once.
    fn solve(&mut self, sim_time: f64) {
        let moves = self.frame.playback == PlaybackState::Playing;
        if self.solved == Some((sim_time, moves)) {
            return;
        }
        self.solved = Some((sim_time, moves));
        match self.dancers.solve(sim_time, moves, &mut self.frame.chain) {
            Ok(closest) => {
                self.closest = closest;
                self.frame.min_clearance = closest.any.map_or(f64::NAN, |least| least.value);
            }
            Err(_) => self.frame.unsolved_frames += 1,
        }
    }

    /// Records a contact, or the touch of an obstacle, that the searches missed: boards overlap although no such event
    /// has happened.
    fn record_unforeseen_touch(&mut self, closest: Option<PairClearance>) {
        let (Some(tolerance), Some(closest)) = (self.overlap_tolerance, closest) else { return };
        let time = self.frame.sim_time;
        let bench_b = closest.bench_b as u32;
        let is_obstacle = closest.bench_b >= self.frame.chain.handles();
        let kind = if is_obstacle { EventKind::Obstacle } else { EventKind::Contact };
        let is_same = |event: &Event| event.kind == kind && (!is_obstacle || event.bench_b == Some(bench_b));
        let happened = self.timeline.events().iter().any(|timed| timed.time <= time && is_same(&timed.event));
        if closest.value >= -tolerance || happened {
            return;
        }
        self.frame.unforeseen_contacts += 1;
        let event = Event {
            kind,
            travelled: f64::NAN,
            bench_a: Some(closest.bench_a as u32),
            bench_b: Some(bench_b),
            place: Some(nalgebra::center(&closest.point_a, &closest.point_b)),
        };
        self.timeline.record_touch(TimedEvent { event, time });
    }

    fn update_state(&mut self, jumped: bool, closest: Option<PairClearance>) {
        let frame = &mut self.frame;
        frame.alerts.clear();
        let passed = self.timeline.latest_passed(frame.sim_time);
        frame.state = passed.map_or(FrameState::Moving, |passed| passed.event.kind.into());
        let Some(level) = &mut self.level else { return };
        if jumped {
            level.restart();
        }
        let moves = frame.playback == PlaybackState::Playing;
        level.update(frame.tick, frame.sim_time, moves, &self.timeline, closest, &mut frame.alerts);
        if passed.is_none() {
            frame.state = level.current().into();
        }
    }
}

/// Returns the cues of a scene in the order of their times, and the names of the cues without a time.
pub fn timed_cues(scene: &Scene, timeline: &Timeline) -> (Vec<ReachedCue>, Vec<String>) {
    let (mut cues, mut missing) = (Vec::new(), Vec::new());
    for cue in &scene.cues {
        match cue.time(&scene.ensemble, timeline) {
            Some(time) => {
                let pauses = cue.then == CueAction::Pause;
                cues.push(ReachedCue { number: 0, time, pauses, name: cue.name.as_str().into() });
            }
            None => missing.push(cue.name.clone()),
        }
    }
    cues.sort_by(|a, b| a.time.total_cmp(&b.time));
    cues.iter_mut().zip(1..).for_each(|(cue, number)| cue.number = number);
    (cues, missing)
}
