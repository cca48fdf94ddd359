//! The parameters of a night, drawn from its seed before it begins.

use bench_dragon::messages::state::EventKind;
use bench_dragon::messages::state::{FrameState, Level};
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::publisher::live::LoopOptions;
use bench_dragon::show::Playback;
use bench_dragon::show::scene::{AtEnd, OnContact, Scene};

use crate::levels::Rules;
use crate::random::Random;
use crate::world::SECOND_NS;

const TEAM: &str = "[team]\nbenches = 12\nhead_length = 3.41\nbody_length = 2.2\nwidth = 0.3\nhole_inset = 0.275\n";
const SPIRAL: &str = "[path]\nkind = \"spiral\"\npitch = 0.55\nstart_turn = 4\n\
                      [motion]\nhead_speed = 1.0\naccuracy = 1e-4\n";
const ALERTS: &str = "[alerts]\napproach_time = 10.0\napproach_clearance = 0.05\n";
const CUES: &str = "[[cues]]\nname = \"begin\"\nat = 0.0\n[[cues]]\nname = \"early\"\ntravelled = 1.5\n\
                    [[cues]]\nname = \"wait\"\nat = 9.0\nthen = \"pause\"\n\
                    [[cues]]\nname = \"close\"\nbefore = \"path_end\"\nseconds = 0.5\n";
const CONTACT_CUES: &str = "[[cues]]\nname = \"one\"\nat = 2.0\n[[cues]]\nname = \"two\"\nat = 2.0\n\
                            [[cues]]\nname = \"closing\"\nbefore = \"contact\"\nseconds = 5.0\n";
const PIECES: &str = include_str!("../scenes/alertloop.toml");

/// A scene, and the data that its models need.
pub struct Stage {
    pub scene: Scene,
    pub timeline: Timeline,
    rules: Option<Rules>,
    events: Vec<(f64, FrameState)>,
}

impl Stage {
    fn of(text: &str) -> Self {
        let scene = Scene::parse(text, "night.toml", "night").expect("a scene");
        let timeline = scene.ensemble.timeline(&mut unreported);
        let events: Vec<(f64, EventKind)> =
            timeline.events().iter().map(|timed| (timed.time, timed.event.kind)).collect();
        let level = |kind| match kind {
            EventKind::Contact => Some(Level::Contact),
            EventKind::Obstacle => Some(Level::Obstacle),
            EventKind::Stall => Some(Level::Stall),
            EventKind::Lock => Some(Level::Lock),
            EventKind::PathEnd => None,
        };
        let rules = scene.alerts.map(|alerts| Rules {
            approach_time: alerts.approach_time,
            approach_clearance: alerts.approach_clearance,
            events: events.iter().filter_map(|(time, kind)| Some((*time, level(*kind)?))).collect(),
        });
        let state = |kind: &EventKind| match kind {
            EventKind::Contact => FrameState::Contact,
            EventKind::Obstacle => FrameState::Obstacle,
            EventKind::Stall => FrameState::Stall,
            EventKind::Lock => FrameState::Lock,
            EventKind::PathEnd => FrameState::PathEnd,
        };
        let end = timeline.end().time;
        // Without alerts only the end is known.
        let known = |time: f64| scene.alerts.is_some() || time == end;
        let events = events.iter().filter(|(time, _)| known(*time)).map(|(time, kind)| (*time, state(kind))).collect();
        Self { scene, timeline, rules, events }
    }

    /// Returns every scene of the nights.
    pub fn all() -> Vec<Self> {
        [
            format!("{TEAM}{SPIRAL}{ALERTS}{CONTACT_CUES}"),
            format!("{TEAM}{SPIRAL}on_contact = \"continue\"\n{ALERTS}{CONTACT_CUES}"),
            format!("{TEAM}{SPIRAL}{CUES}"),
            format!("{PIECES}\n{CUES}"),
            PIECES.to_owned(),
        ]
        .iter()
        .map(|text| Self::of(text))
        .collect()
    }

    /// Returns the simulated time at which a show of it ends, seconds.
    pub fn show_end(&self, playback: &Playback) -> f64 {
        let contact = self.events.iter().find(|(_, state)| *state == FrameState::Contact);
        let stops = self.scene.alerts.is_some() && playback.on_contact == OnContact::Stop;
        contact.filter(|_| stops).map_or(self.timeline.end().time, |(time, _)| *time)
    }

    pub fn rules(&self) -> Option<Rules> {
        self.rules.clone()
    }

    pub fn events(&self) -> Vec<(f64, FrameState)> {
        self.events.clone()
    }
}

/// A subscriber's queue, its reading interval, and the mean number of reads until it dies.
#[derive(Debug, Clone, Copy)]
pub struct Reader {
    pub depth: usize,
    pub every_ns: u64,
    pub lives: u64,
}

#[derive(Debug)]
pub struct Plan {
    pub stage: usize,
    pub begin_ns: u64,
    pub rate: f64,
    pub periods: Option<u64>,
    /// Time of a signal.
    pub stop_ns: Option<u64>,
    /// Frames until the shared memory is full.
    pub room: u64,
    pub playback: Playback,
    /// Mean number of sleeps, or frames, between two faults.
    pub faults_every: f64,
    /// Mean time between two commands at each queue.
    pub command_queues: Vec<f64>,
    pub readers: Vec<Reader>,
    /// Room of the statistics: samples, and alerts and cues.
    pub queues: (usize, usize),
    pub statistics_every_ns: u64,
    pub wall_clock_every_ns: f64,
}

impl Plan {
    pub fn draw(random: &mut Random, stages: &[Stage]) -> Self {
        let stage = random.below(stages.len() as u64) as usize;
        // Hours are cheap at a low rate; threads interfere at a high one.
        let fast = random.once_in(3);
        let rate = if fast {
            random.pick(&[10.0, 24.0, 25.0, 29.97, 50.0, 59.94, 60.0, 100.0, 144.0, 240.0, 1000.0, 20_000.0])
        } else {
            random.pick(&[0.1, 0.1, 0.1, 0.1, 0.1, 0.125, 0.15, 0.3, 1.0])
        };
        let period_ns = 1e9 / rate;
        let length = if fast { random.magnitude(20.0, 4000.0) } else { random.magnitude(2000.0, 60_000.0) };
        let begin_ns = random.below(1000 * SECOND_NS);
        let mut stop_ns = None;
        let mut room = u64::MAX;
        let mut periods = Some(length as u64);
        match random.below(8) {
            0 | 1 => (periods, stop_ns) = (None, Some(begin_ns + 1 + (random.share() * length * period_ns) as u64)),
            2 => room = random.below(length as u64),
            3 => periods = Some(LoopOptions::periods_of(length / rate, rate)),
            _ => (),
        }
        let playback = Self::playback(random, &stages[stage], rate);
        let often = |random: &mut Random, least: f64, most: f64| (random.magnitude(least, most) * period_ns) as u64 + 1;
        let reader = |random: &mut Random| Reader {
            depth: 1 + random.below(64) as usize,
            every_ns: often(random, 0.5, 50.0),
            lives: random.magnitude(50.0, 1e5) as u64,
        };
        Self {
            stage,
            begin_ns,
            rate,
            periods,
            stop_ns,
            room,
            playback,
            faults_every: random.magnitude(5.0, 3000.0) * if fast { 1.0 } else { 10.0 / rate },
            command_queues: (0..random.below(4)).map(|_| random.magnitude(0.5, 300.0) * period_ns).collect(),
            readers: (0..random.below(4)).map(|_| reader(random)).collect(),
            queues: random.pick(&[(1, 1), (300, 20), (1 << 12, 1 << 8), (1 << 14, 1 << 10), (1 << 14, 1 << 10)]),
            statistics_every_ns: if fast { SECOND_NS / 50 } else { often(random, 200.0, 8000.0) },
            wall_clock_every_ns: random.magnitude(30.0, 30_000.0) * period_ns,
        }
    }

    fn playback(random: &mut Random, stage: &Stage, rate: f64) -> Playback {
        let Scene { on_contact, .. } = stage.scene;
        let playback = Playback {
            start: 0.0,
            time_scale: random.pick(&[1.0, 1.0, 0.1, 2.0, 7.3]),
            rate,
            on_contact,
            at_end: random.pick(&[AtEnd::Hold, AtEnd::Loop, AtEnd::Loop, AtEnd::Loop]),
            end_hold: random.pick(&[0.0, 5.0, 0.3]),
            paused: random.once_in(6),
        };
        let end = stage.show_end(&playback);
        Playback { start: if random.once_in(3) { random.share() * 0.99 * end } else { 0.0 }, ..playback }
    }
}
