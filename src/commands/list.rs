//! `list`: the shows that run on this machine. In: the running shows, each one's frames and status. Out: a line for
//! each.

use std::time::{Duration, Instant};

use bench_dragon::client::connection::Wake;
use bench_dragon::client::feed::{Delivery, Feed, FeedEvent, FeedOptions};
use bench_dragon::client::shows;
use bench_dragon::messages::state::PlaybackState;
use bench_dragon::outputs::monitor::{IntervalReport, Monitor};
use serde::Serialize;

use super::{CommandError, Common, Output, number};

/// The longest wait for a show's status, which comes once a second, and for its first frame.
const PATIENCE: Duration = Duration::from_secs(2);
/// The interval of polls.
const POLL_INTERVAL: Duration = Duration::from_millis(5);

/// Arguments of `list`.
#[derive(Debug, Clone, clap::Args)]
pub struct ListArguments {}

/// The line of `list --json`. What has not come within two seconds is null: a paused or slow show may send no frame.
#[derive(Serialize)]
#[serde(tag = "type", rename = "show")]
struct ShowLine {
    name: String,
    scene: Option<String>,
    state: Option<&'static str>,
    playback: Option<&'static str>,
    sim_time: Option<f64>,
    rate: Option<f64>,
    subscribers: Option<usize>,
}

/// A show, and what has come of it.
struct Show {
    name: String,
    subscribers: Option<usize>,
    feed: Option<Feed>,
    monitor: Monitor,
    /// True once a frame has come, and once a status has come.
    has_come: (bool, bool),
}

/// Prints the shows that run in this shared memory.
pub fn list(common: &Common, ListArguments {}: &ListArguments) -> Result<(), CommandError> {
    let mut shows: Vec<Show> = shows::running().into_iter().map(Show::new).collect();
    let began = Instant::now();
    while shows.iter().any(|show| !show.is_complete()) && began.elapsed() < PATIENCE {
        shows.iter_mut().for_each(Show::poll);
        std::thread::sleep(POLL_INTERVAL);
    }
    let lines: Vec<ShowLine> = shows.into_iter().map(Show::line).collect();
    let mut output = Output::standard();
    if common.json {
        lines.iter().try_for_each(|line| output.json(line))?;
    } else if lines.is_empty() {
        let sentence = "No show runs on this machine: \"bench-dragon run\" starts one.";
        output.line(sentence)?;
    } else {
        table(&lines).iter().try_for_each(|line| output.line(line))?;
    }
    output.finish()
}

impl Show {
    fn new(name: String) -> Self {
        // Before this process subscribes.
        let subscribers = shows::subscribers(&name).ok();
        let feed = Feed::new(&name, FeedOptions { wake: Wake::Never, frames: Delivery::Newest }).ok();
        Self { name, subscribers, feed, monitor: Monitor::default(), has_come: (false, false) }
    }

    fn is_complete(&self) -> bool {
        self.has_come == (true, true) || self.feed.is_none()
    }

    fn poll(&mut self) {
        let Self { feed, monitor, has_come: (frame, status), .. } = self;
        let polled = feed.as_mut().map(|feed| {
            feed.poll(Duration::ZERO, &mut |event| {
                *frame |= matches!(event, FeedEvent::Frame { .. });
                *status |= matches!(event, FeedEvent::Status(_));
                monitor.handle(&event, 0);
            })
        });
        if let Some(Err(error)) = polled {
            log::warn!("{error}");
            self.feed = None;
        }
    }

    fn line(mut self) -> ShowLine {
        let report: IntervalReport = self.monitor.report();
        let header = report.present_header();
        let status = report.status;
        ShowLine {
            name: self.name,
            scene: status.map(|status| status.scene.as_str().to_owned()),
            state: report.state().map(|state| state.name()),
            playback: header.and_then(|header| header.playback_state()).map(PlaybackState::name),
            sim_time: header.map(|header| header.sim_time),
            rate: status.map(|status| status.rate),
            subscribers: self.subscribers,
        }
    }
}

/// Returns the lines of a table with a heading.
fn table(shows: &[ShowLine]) -> Vec<String> {
    let heading = ["name", "scene", "state", "time", "rate", "subscribers"].map(str::to_owned);
    let rows: Vec<[String; 6]> = std::iter::once(heading).chain(shows.iter().map(cells)).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..6).map(width).collect();
    let line = |row: &[String; 6]| {
        let cells = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:<width$}"));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    rows.iter().map(line).collect()
}

fn cells(show: &ShowLine) -> [String; 6] {
    let or_unknown = |text: Option<String>| text.unwrap_or_else(|| "?".to_owned());
    let playback = show.playback.filter(|playback| *playback != PlaybackState::Playing.name());
    let playback = playback.map_or(String::new(), |playback| format!(" ({playback})"));
    [
        show.name.clone(),
        or_unknown(show.scene.clone()),
        or_unknown(show.state.map(|state| format!("{state}{playback}"))),
        or_unknown(show.sim_time.map(|time| format!("{time:.3} s"))),
        or_unknown(show.rate.map(|rate| format!("{} Hz", number(rate)))),
        or_unknown(show.subscribers.map(|count| count.to_string())),
    ]
}
