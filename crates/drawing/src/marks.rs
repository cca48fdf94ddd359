//! The events that have happened by a time, and the overlaps at that time, as marks and sentences. The present tense is
//! for events at that time, the past tense for earlier ones.

use svg::node::element::{Circle, Group, Path};

use super::camera::Camera;
use super::palette::Palette;
use super::rounded;
use bench_dragon_messages::Roster;
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::model::Point;
use bench_dragon_motion::timeline::{TimedEvent, Timeline};

/// The time about an event that counts as its time, in seconds, so that a time typed with six decimals still matches.
const NOW: f64 = 1e-6;

/// The tense of an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tense {
    /// The event is now.
    Present,
    /// The event was before.
    Past,
}

/// An event that has happened by the time of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Happened {
    /// The event.
    pub timed: TimedEvent,
    /// Its tense.
    pub tense: Tense,
}

/// Returns the events that have happened by a time, in order.
pub fn happened(timeline: &Timeline, time: f64) -> Vec<Happened> {
    let passed = timeline.events().iter().filter(|timed| timed.time <= time + NOW);
    let tense = |timed: &TimedEvent| if timed.time < time - NOW { Tense::Past } else { Tense::Present };
    passed.map(|timed| Happened { timed: *timed, tense: tense(timed) }).collect()
}

impl Happened {
    /// Returns the benches of the event, from 0.
    pub fn benches(&self) -> impl Iterator<Item = u32> + use<> {
        let other = self.timed.event.bench_b.filter(|_| self.timed.event.kind != EventKind::Obstacle);
        [self.timed.event.bench_a, other].into_iter().flatten()
    }

    /// Returns the sentence of the event, with benches counted from 1 in words.
    pub fn sentence(&self, place: &str, roster: &Roster) -> String {
        let who: Vec<String> = self.benches().map(|bench| roster.bench(bench)).collect();
        let obstacle = self.timed.event.bench_b.map_or(String::new(), |number| roster.bench(number));
        let who = who.join(" and ");
        let time = rounded(self.timed.time, 3);
        let sentence = match (self.timed.event.kind, self.tense) {
            (EventKind::Contact, Tense::Present) => format!("contact: {who} touch {place}"),
            (EventKind::Contact, Tense::Past) => format!("contact: {who} touched {place} at {time} s"),
            (EventKind::Obstacle, Tense::Present) => format!("obstacle: {who} meets {obstacle} {place}"),
            (EventKind::Obstacle, Tense::Past) => {
                format!("obstacle: {who} met {obstacle} {place} at {time} s")
            }
            (EventKind::Stall, Tense::Present) => format!("stall: {who} stalls, its rear handle {place}"),
            (EventKind::Stall, Tense::Past) => format!("stall: {who} stalled at {time} s, its rear handle {place}"),
            (EventKind::Lock, Tense::Present) => format!("lock: {who} locks, its rear handle {place}"),
            (EventKind::Lock, Tense::Past) => format!("lock: {who} locked at {time} s, its rear handle {place}"),
            (EventKind::PathEnd, Tense::Present) if who.is_empty() => {
                return "the head is at the end of the path".to_owned();
            }
            (EventKind::PathEnd, Tense::Past) if who.is_empty() => {
                return format!("the head reached the end of the path at {time} s");
            }
            (EventKind::PathEnd, Tense::Present) => format!("{who} is at the end of its path"),
            (EventKind::PathEnd, Tense::Past) => format!("{who} reached the end of its path at {time} s"),
        };
        sentence + " (counting from 1)"
    }

    /// Returns the mark of the event. A contact or an obstacle has a ring and a cross, a stall a diamond, a lock a
    /// square. The mark has the colour of danger if the event is now, and a quiet colour if it was before.
    pub fn sign(&self, (x, y): (f64, f64), palette: &Palette) -> Group {
        let colour = match self.tense {
            Tense::Present => palette.danger,
            Tense::Past => palette.quiet,
        };
        let mut group = Group::new().set("fill", "none").set("stroke-linejoin", "round");
        for (colour, width) in [(palette.ground, 6.0), (colour, 2.5)] {
            let lines = |data: &str| {
                let moved = format!("translate({} {})", rounded(x, 3), rounded(y, 3));
                let path = Path::new().set("d", data).set("transform", moved);
                path.set("stroke", colour).set("stroke-width", width)
            };
            group = match self.timed.event.kind {
                EventKind::Contact | EventKind::Obstacle => group
                    .add(
                        Circle::new()
                            .set("cx", rounded(x, 3))
                            .set("cy", rounded(y, 3))
                            .set("r", 13)
                            .set("stroke", colour)
                            .set("stroke-width", width),
                    )
                    .add(lines("M7 0H20M-7 0H-20M0 7V20M0 -7V-20")),
                EventKind::Stall => group.add(lines("M14 0L0 14L-14 0L0 -14Z")),
                EventKind::Lock | EventKind::PathEnd => group.add(lines("M-11 -11H11V11H-11Z")),
            };
        }
        group
    }

    /// Returns the place of the event, if it is in the picture.
    pub fn place(&self, camera: &Camera) -> Option<Point> {
        self.timed.event.place.filter(|place| camera.view().contains(*place))
    }
}

/// Returns the pairs that overlap now, in words; `None` without any.
pub fn overlap_sentence(pairs: &[(usize, usize, f64)], roster: &Roster) -> Option<String> {
    let deepest = pairs.iter().copied().max_by(|a, b| a.2.total_cmp(&b.2))?;
    let name = |bench: usize| roster.bench(bench as u32);
    let (one, other, depth) = deepest;
    let depth = rounded(depth, 3);
    let deepest = format!("{} and {}", name(one), name(other));
    Some(match pairs.len() {
        1 => format!("{deepest} overlap now, by {depth} m (counting from 1)"),
        count => format!("{count} pairs of boards overlap now, {deepest} most, by {depth} m (counting from 1)"),
    })
}
