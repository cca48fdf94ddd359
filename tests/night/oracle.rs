//! The oracle of a night compares the loop with models of the design's promises. The first broken promise ends the
//! test.
//!
//! Its input comes from the boundaries: the frames' source, the fake shared memory, the command queues and the
//! statistics. No model calls the code that it checks.

use std::cell::RefCell;
use std::rc::Rc;

use bench_dragon::messages::FrameHeader;
use bench_dragon::messages::control::Command;
use bench_dragon::messages::state::{FrameState, Level};
use bench_dragon::publisher::live::show_source::ShowSource;
use bench_dragon::publisher::live::{FrameSource, Outgoing, Period};
use bench_dragon::show::Outcome;
use bench_dragon::show::convert::Stamps;
use bench_dragon_testing::model::{Formula, Model};

use crate::collected::{Announced, Collected, Expected};
use crate::command_queues::QueueCheck;
use crate::levels::Levels;
use crate::pace::Pace;
use crate::world::{World, same};

/// Alerts or cues: the period, and the level or the number.
type Numbered = Vec<(u64, u32)>;

pub struct Oracle {
    pub run_id: u64,
    pub pace: Pace,
    pub show: Model<Formula>,
    pub levels: Option<Levels>,
    /// Every event, in order: the state depends on it.
    pub events: Vec<(f64, FrameState)>,
    pub queue_check: QueueCheck,
    pub collected: Rc<RefCell<Collected>>,
    /// Epoch of the frame before.
    epoch: u32,
    shows_played: u64,
    /// The latest and earliest start of the present frame, and the time at which the frame was sent.
    began_ns: (u64, u64),
    sent_ns: u64,
    sample: Option<(FrameHeader, Vec<Announced>)>,
}

impl Oracle {
    pub fn new(
        run_id: u64,
        (rate, show): (f64, Model<Formula>),
        levels: Option<Levels>,
        events: Vec<(f64, FrameState)>,
        queues: usize,
        collected: Rc<RefCell<Collected>>,
    ) -> Self {
        Self {
            run_id,
            pace: Pace::new(rate),
            show,
            levels,
            events,
            queue_check: QueueCheck::new(queues),
            collected,
            epoch: 0,
            shows_played: 0,
            began_ns: (0, 0),
            sent_ns: 0,
            sample: None,
        }
    }

    fn frame_begins(&mut self, world: &World, tick: u64) {
        self.began_ns = (world.awake_ns.get(), world.now_ns());
        self.pace.frame_begins(world, tick);
        // A step that a command cancels is answered before the command.
        same("a step that a command cancelled", self.show.step_outcome, None);
        self.queue_check.frame_begins(tick);
        self.show.count_to(tick);
    }

    /// Checks a frame before it is sent, complete except for the time of sending.
    pub fn frame_goes_out(&mut self, world: &World, outgoing: Outgoing<'_>) {
        let header = outgoing.header;
        world.note("frame", [header.tick as f64, header.sim_time]);
        self.pace.frame_goes_out(world, header, self.run_id);
        let show = &self.show;
        same("the time", header.sim_time.to_bits(), show.sim_time().to_bits());
        same("the time scale", header.time_scale, show.time_scale());
        same("playback", header.playback_state(), Some(show.playback()));
        same("the epoch and the cue", (header.epoch, header.cue), (show.epoch, show.passed as u32));
        let cues: Numbered = outgoing.cues.iter().map(|cue| (cue.tick, cue.number)).collect();
        let reached = announced(&mut self.show, self.shows_played);
        same("cues", &cues, &reached.iter().map(|cue| (header.tick, *cue as u32 + 1)).collect());
        let alerts: Numbered = outgoing.alerts.iter().map(|alert| (alert.tick, alert.level)).collect();
        same("alerts", &alerts, &self.expected_alerts(header));
        self.check_state(header);
        (self.epoch, self.shows_played) = (self.show.epoch, self.show.shows_played);
        let mut tally = world.tally.borrow_mut();
        (tally.alerts, tally.cues) = (tally.alerts + alerts.len() as u64, tally.cues + cues.len() as u64);
        let of = |what, list: Numbered| list.into_iter().map(move |(tick, number)| (tick, what, number));
        self.sample = Some((*header, of("alert", alerts).chain(of("cue", cues)).collect()));
    }

    fn expected_alerts(&mut self, header: &FrameHeader) -> Numbered {
        let by_command = std::mem::take(&mut self.show.jumped_by_command);
        let Some(levels) = &mut self.levels else { return Vec::new() };
        let expected = levels.expected(header, header.epoch != self.epoch, by_command);
        expected.into_iter().map(|level| (header.tick, level as u32)).collect()
    }

    /// Checks the state: the latest event passed, or else the level.
    fn check_state(&self, header: &FrameHeader) {
        let passed = self.events.iter().rfind(|(time, _)| *time <= header.sim_time);
        let near = self.levels.as_ref().is_some_and(|levels| levels.current() == Some(Level::Approaching));
        let expected = match passed {
            Some((_, state)) => *state,
            None if near => FrameState::Approaching,
            None => FrameState::Moving,
        };
        same("the state", header.frame_state(), Some(expected));
    }

    /// Records that the shared memory has the frame.
    pub fn frame_was_sent(&mut self, world: &World) {
        self.sent_ns = world.now_ns();
    }

    /// Checks the kept alert that a new subscriber gets.
    pub fn late_subscriber(&self, level: Option<u32>) {
        let now = self.levels.as_ref().and_then(Levels::current).map(|level| level as u32);
        same("the level that a late subscriber gets", level, now);
    }

    /// Records that every transport has taken the frame; the loop makes its sample.
    pub fn frame_is_out(&mut self, world: &World, subscribers: u32) {
        self.pace.frame_is_out();
        let (header, announcements) = self.sample.take().expect("a frame");
        let Pace { frames, skipped, overruns, lateness_ns, .. } = self.pace;
        let sample = Expected {
            tick: header.tick,
            sim_time: header.sim_time,
            frames,
            skipped,
            overruns,
            shows_played: self.shows_played,
            subscribers,
            lateness_ns,
            step_ns: (self.sent_ns - self.began_ns.1, world.now_ns() - self.began_ns.0),
        };
        self.collected.borrow_mut().frame(sample, announcements);
    }

    fn command(&mut self, tick: u64, command: Command) -> Option<bench_dragon::messages::control::Code> {
        self.queue_check.executed(tick, command);
        self.show.count_to(tick);
        self.show.execute(command)
    }

    fn assert_outcome(&self, tick: u64, outcome: &Outcome) {
        let Self { show, .. } = self;
        same("the tick of an answer", outcome.tick, tick);
        same("the time of an answer", outcome.sim_time.to_bits(), show.sim_time().to_bits());
        same("its rates", (outcome.time_scale, outcome.playing_rate), (show.time_scale(), show.playing_rate()));
        same("its playback and cue", (outcome.playback, outcome.cue), (show.playback(), show.passed as u32));
    }
}

/// Returns the cues reached since the last frame; cues of shows passed entirely in between are not announced.
fn announced(show: &mut Model<Formula>, first_show: u64) -> Vec<usize> {
    let last_show = show.shows_played;
    let shown = show.reached.drain(..).filter(|(number, _)| *number == first_show || *number == last_show);
    shown.map(|(_, cue)| cue).collect()
}

/// The real show, between the loop and the oracle.
pub struct Checked {
    pub show: ShowSource,
    pub world: Rc<World>,
    pub oracle: Rc<RefCell<Oracle>>,
}

impl FrameSource for Checked {
    fn frame(&mut self, tick: u64, stamps: Stamps) -> Period<'_> {
        self.oracle.borrow_mut().frame_begins(&self.world, tick);
        self.world.spend(self.world.cost_ns());
        self.show.frame(tick, stamps)
    }

    fn command(&mut self, tick: u64, command: Command) -> Option<Outcome> {
        let (number, value) = command.number_and_value();
        self.world.note("command", [f64::from(number), value]);
        let expected = self.oracle.borrow_mut().command(tick, command);
        let outcome = self.show.command(tick, command);
        let mut oracle = self.oracle.borrow_mut();
        same("the answer to a command", outcome.map(|outcome| outcome.code), expected);
        outcome.iter().for_each(|outcome| oracle.assert_outcome(tick, outcome));
        oracle.queue_check.answered(outcome);
        outcome
    }

    fn finished_step(&mut self, tick: u64) -> Option<Outcome> {
        let outcome = self.show.finished_step(tick);
        let mut oracle = self.oracle.borrow_mut();
        oracle.show.count_to(tick);
        let expected = oracle.show.step_outcome.take();
        same("the end of a step", outcome.map(|outcome| outcome.code), expected);
        if let Some(outcome) = outcome {
            oracle.assert_outcome(tick, &outcome);
            oracle.queue_check.step_is_over(outcome);
        }
        outcome
    }
}
