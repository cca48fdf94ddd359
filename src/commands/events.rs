//! `events`: everything that ends the show, in order.

use bench_dragon::motion::event::EventKind;
use bench_dragon::motion::timeline::{TimedClearance, TimedEvent, Timeline};
use bench_dragon::scene::Scene;
use serde::Serialize;

use super::{CommandError, Common, Output, figure, progress_bar, search_timeline};

/// One line of `events --json`.
#[derive(Serialize)]
struct EventLine {
    event: &'static str,
    time: f64,
    bench_a: Option<u32>,
    bench_b: Option<u32>,
    x: Option<f64>,
    y: Option<f64>,
}

/// Prints the events of the scene.
pub fn events(common: &Common) -> Result<(), CommandError> {
    let scene = common.load_scene()?;
    let timeline = search_timeline(&scene, common);
    let mut output = Output::standard();
    for timed in timeline.events() {
        if common.json {
            let TimedEvent { event, time } = *timed;
            output.json(&EventLine {
                event: event.kind.name(),
                time,
                bench_a: event.bench_a,
                bench_b: event.bench_b,
                x: event.place.map(|place| place.x),
                y: event.place.map(|place| place.y),
            })?;
        } else {
            output.line(&sentence(&scene, timed))?;
        }
    }
    if !common.json {
        for kind in [EventKind::Contact, EventKind::Stall] {
            if timeline.find(kind).is_none() {
                output.line(&format!("There is no {} before the motion ends.", kind.name()))?;
            }
        }
        output.line(&least_clearance(&scene, &timeline, common))?;
    }
    output.finish()
}

/// An event for people; benches are counted from 1, and the sentence states it.
pub fn sentence(scene: &Scene, timed: &TimedEvent) -> String {
    let TimedEvent { event, time } = *timed;
    let bench = |bench: Option<u32>| bench.map_or("no bench".to_owned(), |bench| bench_name(scene, bench));
    let place = event.place.map_or(String::new(), |place| format!(" at ({:.6}, {:.6}) m", place.x, place.y));
    let (first, second) = (bench(event.bench_a), bench(event.bench_b));
    let what = match event.kind {
        EventKind::Contact if time == 0.0 => format!("{first} and {second} overlap from the start, most deeply{place}"),
        EventKind::Contact => format!("{first} and {second} touch{place}"),
        EventKind::Stall => format!("{first} stalls: from the handle{place} on, the team is pushed backwards"),
        EventKind::Lock => format!("{first} locks, its rear handle{place}: the motion cannot continue"),
        EventKind::PathEnd => "the head reaches the end of the path".to_owned(),
    };
    format!("{:>9}  t = {} s: {what} (counting from 1).", event.kind.name(), figure(time))
        .replace("path (counting from 1)", "path")
}

/// The least clearance of the whole show, for people.
pub fn least_clearance(scene: &Scene, timeline: &Timeline, common: &Common) -> String {
    let bar = progress_bar(1000, common).with_message("searching for the least clearance");
    let freeze = timeline.freeze(scene.stops_at_contact());
    let mut progress = |share| bar.set_position((1000.0 * share) as u64);
    let found = scene.motion.least_clearance(timeline, freeze, &mut progress);
    bar.finish_and_clear();
    let Some(TimedClearance { least, time, searched_until }) = found else {
        return "The least clearance of the show is not computed: there are no two benches that could meet, or the search gave up.".to_owned();
    };
    let (first, second) = (bench_name(scene, least.bench_a), bench_name(scene, least.bench_b));
    let (value, time) = (figure(least.value), figure(time));
    let of = searched_until
        .map_or("of the show".to_owned(), |until| format!("up to t = {} s, where the search gave up,", figure(until)));
    format!("The least clearance {of} is {value} m, at t = {time} s, between {first} and {second} (counting from 1).")
}

/// A bench as people call it, counted from 1.
pub fn bench_name(scene: &Scene, bench: u32) -> String {
    bench_dragon::wire::sentence::bench_name(bench, scene.team().benches as u32)
}
