//! The expected statistics: every sample once and in order, except those for which the queue had no room.

use std::collections::VecDeque;

use bench_dragon::messages::LoopStatus;
use bench_dragon::publisher::live::Announcement;
use bench_dragon::publisher::live::statistics::{Sample, Summary};

use crate::world::{SECOND_NS, same};

/// The longest duration that the statistics distinguish: a longer one counts as this one, or as itself.
const LONGEST_NS: u64 = 3_600_000_000_000;

/// A frame, as its sample must show it. Durations lie between two bounds.
#[derive(Clone, Copy)]
pub struct Expected {
    pub tick: u64,
    pub sim_time: f64,
    pub frames: u64,
    pub skipped: u64,
    pub overruns: u64,
    pub shows_played: u64,
    pub subscribers: u32,
    pub lateness_ns: (u64, u64),
    pub step_ns: (u64, u64),
}

/// An alert or a cue in flight to the terminal: its period, and its level or number.
pub type Announced = (u64, &'static str, u32);

/// The expected content of the queues to the statistics, and the samples that were taken from them.
pub struct Collected {
    samples: VecDeque<Expected>,
    announcements: VecDeque<Announced>,
    most: (usize, usize),
    pub lost: u64,
    taken: u64,
    latest: Option<Expected>,
    /// The bounds of the longest durations taken so far.
    worst_lateness_ns: (u64, u64),
    worst_step_ns: (u64, u64),
    /// The frames until the latest status, and the time at which this status was made.
    status: (u64, u64),
    began_ns: u64,
}

fn later(a: (u64, u64), b: (u64, u64)) -> (u64, u64) {
    (a.0.max(b.0), a.1.max(b.1))
}

/// Asserts that a duration, to three digits, lies between the bounds.
fn assert_between(what: &str, value: u64, (least, most): (u64, u64)) {
    let least = least.min(LONGEST_NS);
    let holds = value as f64 >= 0.998 * least as f64 - 3.0 && value as f64 <= 1.002 * most as f64 + 3.0;
    assert!(holds, "{what}: {value} ns, expected {least} to {most}");
}

impl Collected {
    /// Creates queues of `samples` samples, and `announcements` alerts and cues, of a run that begins now.
    pub fn new(samples: usize, announcements: usize, now_ns: u64) -> Self {
        Self {
            samples: VecDeque::new(),
            announcements: VecDeque::new(),
            most: (samples, announcements),
            lost: 0,
            taken: 0,
            latest: None,
            worst_lateness_ns: (0, 0),
            worst_step_ns: (0, 0),
            status: (0, now_ns),
            began_ns: now_ns,
        }
    }

    /// Records a sent frame.
    pub fn frame(&mut self, sample: Expected, announcements: impl IntoIterator<Item = Announced>) {
        if self.samples.len() < self.most.0 {
            self.samples.push_back(sample);
        } else {
            self.lost += 1;
        }
        let room = self.most.1 - self.announcements.len();
        self.announcements.extend(announcements.into_iter().take(room));
    }

    pub fn sample(&mut self, sample: &Sample) {
        let Some(expected) = self.samples.pop_front() else { panic!("{sample:?} of no frame") };
        same("the sample's period", (sample.tick, sample.sim_time), (expected.tick, expected.sim_time));
        let counts = sample.counts;
        let seen = (counts.frames, counts.skipped, counts.overruns, sample.shows_played, sample.subscribers);
        let Expected { frames, skipped, overruns, shows_played, subscribers, .. } = expected;
        same("the sample's counts", seen, (frames, skipped, overruns, shows_played, subscribers));
        same("contacts and frames that failed", (sample.unforeseen_contacts, sample.unsolved_frames), (0, 0));
        for (what, value, (least, most)) in
            [("lateness", sample.lateness_ns, expected.lateness_ns), ("step", sample.step_ns, expected.step_ns)]
        {
            assert!((least..=most).contains(&value), "{what} of {value} ns, expected {least} to {most}");
        }
        self.worst_lateness_ns = later(self.worst_lateness_ns, expected.lateness_ns);
        self.worst_step_ns = later(self.worst_step_ns, expected.step_ns);
        self.latest = Some(expected);
        self.taken += 1;
    }

    pub fn announcement(&mut self, announcement: &Announcement) {
        let seen = match announcement {
            Announcement::Alert { alert, .. } => (alert.tick, "alert", alert.level),
            Announcement::Cue(cue) => (cue.tick, "cue", cue.number),
        };
        same("the printed announcement", Some(seen), self.announcements.pop_front());
    }

    /// Asserts that the queues are empty.
    pub fn emptied(&self) {
        same("messages left in the queues", (self.samples.len(), self.announcements.len()), (0, 0));
    }

    /// Checks after a step of the thread that a status has been sent for every full second.
    pub fn reported(&self, now_ns: u64) {
        let second = |at_ns: u64| (at_ns - self.began_ns) / SECOND_NS;
        if self.latest.is_some() {
            same("the second of the latest status", second(self.status.1), second(now_ns));
        }
    }

    /// Checks a status that was made at `now_ns`.
    pub fn status(&mut self, status: &LoopStatus, now_ns: u64) {
        let Some(of) = self.latest else { panic!("{status:?} of no frame") };
        let seen = (status.tick, status.sequence, status.skipped, status.overruns, status.shows_played);
        same("the status", seen, (of.tick, of.frames - 1, of.skipped, of.overruns, of.shows_played));
        same("the status's time", (status.sim_time, status.subscribers), (of.sim_time, of.subscribers));
        assert_between("the longest lateness", status.lateness_max_total, self.worst_lateness_ns);
        assert_between("the longest step", status.step_max_total, self.worst_step_ns);
        let (frames, then_ns) = std::mem::replace(&mut self.status, (of.frames, now_ns));
        let rate = (of.frames - frames) as f64 / ((now_ns - then_ns) as f64 / 1e9);
        assert!((status.measured_rate - rate).abs() <= 1e-9 * rate, "{} Hz, expected {rate}", status.measured_rate);
    }

    pub fn ended(&self, summary: &Summary, frames: u64) {
        self.emptied();
        same("samples, and those that were lost", (summary.samples, frames), (self.taken, self.taken + self.lost));
        assert_between("the longest lateness of all", summary.wakeup_ns.max, self.worst_lateness_ns);
        assert_between("the longest step of all", summary.step_ns.max, self.worst_step_ns);
    }
}
