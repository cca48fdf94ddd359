//! The results of the searches, as `events` and `check` print them and as the design page shows them.
//!
//! In: a scene, its timeline, and its least clearances. Out: lines of JSON, and sentences for people, in which benches
//! count from 1.

use serde::Serialize;

use crate::scene::{Scene, printable};
use bench_dragon_messages::sentence::rounded;
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::ensemble::LeastClearances;
use bench_dragon_motion::ground::Obstacle;
use bench_dragon_motion::timeline::{TimedClearance, TimedEvent, TimedObstacleClearance, Timeline};

/// A line of `events --json`, without the proof of the event.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EventLine {
    event: &'static str,
    time: f64,
    bench_a: Option<u32>,
    bench_b: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    obstacle: Option<String>,
    x: Option<f64>,
    y: Option<f64>,
}

impl EventLine {
    /// Creates the line of an event.
    pub fn new(scene: &Scene, timed: &TimedEvent) -> Self {
        let TimedEvent { event, time } = *timed;
        Self {
            event: event.kind.name(),
            time,
            bench_a: event.bench_a,
            bench_b: event.bench_b,
            obstacle: scene.ensemble.obstacle_of(&event).map(|obstacle| obstacle.name.clone()),
            x: event.place.map(|place| place.x),
            y: event.place.map(|place| place.y),
        }
    }
}

/// A line of `check --json`: the least clearance of two boards, or of an obstacle.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum ClearanceLine {
    /// Of two boards.
    Boards {
        /// The name of the line.
        check: &'static str,
        /// The least clearance, in metres; `None` if there are no two boards, or the search failed.
        clearance: Option<f64>,
        /// The time of the least clearance, in simulated seconds.
        time: Option<f64>,
        /// One of the two benches.
        bench_a: Option<u32>,
        /// The other bench.
        bench_b: Option<u32>,
        /// Simulated seconds up to which the clearance is the least: the end of the motion, or where the search gave
        /// up.
        until: f64,
    },
    /// Of an obstacle.
    Obstacle {
        /// The name of the line.
        check: &'static str,
        /// The obstacle's name.
        obstacle: String,
        /// The least clearance beyond the keep-out, in metres.
        clearance: f64,
        /// The time of the least clearance, in simulated seconds.
        time: f64,
        /// The nearest bench.
        bench: u32,
        /// As for boards.
        until: f64,
    },
}

/// Returns the least clearances of the whole route as lines of `check --json`.
pub fn clearance_lines(
    scene: &Scene,
    timeline: &Timeline,
    found: &LeastClearances,
    beside: &[TimedObstacleClearance],
) -> Vec<ClearanceLine> {
    let until = |searched: Option<f64>| searched.unwrap_or(timeline.end().time);
    let boards = |check, found: Option<TimedClearance>| ClearanceLine::Boards {
        check,
        clearance: found.map(|found| found.least.value),
        time: found.map(|found| found.time),
        bench_a: found.map(|found| found.least.bench_a),
        bench_b: found.map(|found| found.least.bench_b),
        until: until(found.and_then(|found| found.searched_until)),
    };
    let between = scene.ensemble.only().is_none().then(|| boards("clearance_between_dragons", found.between));
    let obstacles = beside.iter().map(|found| ClearanceLine::Obstacle {
        check: "obstacle",
        obstacle: scene.ensemble.ground().obstacles()[found.obstacle].name.clone(),
        clearance: found.least.value,
        time: found.time,
        bench: found.least.bench,
        until: until(found.searched_until),
    });
    [boards("clearance", found.of_show)].into_iter().chain(between).chain(obstacles).collect()
}

/// Returns a sentence for people on an event; benches count from 1, as the sentence states.
pub fn event_sentence(scene: &Scene, timed: &TimedEvent) -> String {
    let TimedEvent { event, time } = *timed;
    let bench = |bench: Option<u32>| bench.map_or("no bench".to_owned(), |bench| bench_name(scene, bench));
    let place = event.place.map_or(String::new(), |place| format!(" at ({:.6}, {:.6}) m", place.x, place.y));
    let (first, second) = (bench(event.bench_a), bench(event.bench_b));
    let what = match event.kind {
        EventKind::Contact if time == 0.0 => format!("{first} and {second} overlap from the start, most deeply{place}"),
        EventKind::Contact => format!("{first} and {second} touch{place}"),
        EventKind::Obstacle => {
            let obstacle = scene.ensemble.obstacle_of(&event).map_or(second, obstacle_label);
            let how = if time == 0.0 { "is at" } else { "meets" };
            format!("{first} {how} {obstacle}{}{place}", if time == 0.0 { " from the start," } else { "" })
        }
        EventKind::Stall => format!("{first} stalls: from the handle{place} on, the team is pushed backwards"),
        EventKind::Lock => format!("{first} locks: its rear handle{place} would need unbounded speed"),
        EventKind::PathEnd => {
            let dragon = event.bench_a.and_then(|head| scene.ensemble.owner(head as usize));
            let head = dragon.map(|(dragon, _)| scene.ensemble.dragons()[dragon].titled("the head"));
            format!("{} reaches the end of the path", head.unwrap_or_else(|| "the head".to_owned()))
        }
    };
    format!("{:>9}  t = {} s: {what} (counting from 1).", event.kind.name(), figure(time))
        .replace("path (counting from 1)", "path")
}

/// Returns the name of an obstacle in a sentence.
pub fn obstacle_label(obstacle: &Obstacle) -> String {
    format!("the {}", printable(&obstacle.name))
}

/// Returns a bench's name for people, counted from 1.
pub fn bench_name(scene: &Scene, bench: u32) -> String {
    scene.ensemble.roster().bench(bench)
}

/// Formats a number for people: to a billionth, rounding errors as zero, very large and very small numbers with an
/// exponent.
pub fn figure(value: f64) -> String {
    match value.abs() {
        size if size < 1e-12 => "0".to_owned(),
        size if (1e-6..1e9).contains(&size) => rounded(value, 9),
        _ => format!("{value:.3e}"),
    }
}
