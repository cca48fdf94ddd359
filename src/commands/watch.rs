//! `watch`: the terminal monitor. `keys` has the commands of its keys, `terminal` reads them.

mod key_bytes;
mod keys;
pub mod terminal;

use std::io::{IsTerminal, Write, stdin, stdout};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use anstyle::Style;
use bench_dragon::client::clock::monotonic_ns;
use bench_dragon::client::connection::Wake;
use bench_dragon::client::feed::{Delivery, Feed, FeedEvent, FeedOptions};
use bench_dragon::client::polling::Obstacle;
use bench_dragon::client::shows;
use bench_dragon::messages::json::{AlertObject, ChaseObject, CueObject};
use bench_dragon::messages::sentence::{
    Figures, alert_sentence, chase_sentence, cue_sentence, lost_files_sentence, rounded, time_until,
};
use bench_dragon::messages::state::EventKind;
use bench_dragon::messages::state::{FrameState, Level, PlaybackState, Severity};
use bench_dragon::messages::{ChaseStatus, CollisionAlert, LoopStatus, Stage};
use bench_dragon::outputs::monitor::{IntervalReport, Latency, Monitor, Presence};
use keys::{KEY_INTERVAL, KeyOutcome, Keyboard};
use serde::Serialize;

use super::folded::{self, COLUMNS};
use super::{CommandError, Common, severity_colour, shows_colour, stop_on_signals, wall_seconds};

/// Arguments of `watch`.
#[derive(Debug, clap::Args)]
pub struct WatchArguments {
    /// Wall time after which to end: 60, 90s, 1:30, 1h30m
    #[arg(long, value_name = "TIME", value_parser = wall_seconds)]
    duration: Option<f64>,
}

/// The line of `watch --json` each second; the other kinds of line are [`AlertObject`] and [`CueObject`].
#[derive(Serialize)]
#[serde(tag = "type", rename = "second")]
struct IntervalLine {
    tick: Option<u64>,
    sim_time: Option<f64>,
    state: &'static str,
    rate: f64,
    received: u64,
    missed: u64,
    latency_ns: Option<Latency>,
    /// Files of the publisher that another program has removed, if any.
    #[serde(skip_serializing_if = "Option::is_none")]
    lost_files: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    chase: Option<ChaseLine>,
}

/// The chase in that line, where one runs or has died.
#[derive(Serialize)]
struct ChaseLine {
    #[serde(flatten)]
    status: ChaseObject,
    has_died: bool,
}

/// Escape sequences of a terminal (ECMA-48, and DEC's private mode 7).
const DISABLE_LINE_WRAP: &str = "\x1b[?7l";
const ENABLE_LINE_WRAP: &str = "\x1b[?7h";
const CLEAR_BELOW_CURSOR: &str = "\x1b[J";

/// The form of reports and events.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Display {
    /// Redrawn in place.
    Terminal,
    /// Some lines a report.
    Lines,
    /// A JSON line a report.
    Json,
}

/// Watches until its duration is over or a signal comes.
pub fn watch(common: &Common, arguments: &WatchArguments) -> Result<(), CommandError> {
    let display = match (common.json, stdout().is_terminal()) {
        (true, _) => Display::Json,
        (false, true) => Display::Terminal,
        (false, false) => Display::Lines,
    };
    let stop = stop_on_signals()?;
    let mut feed = Feed::new(common.name(), FeedOptions { wake: Wake::OnFrame, frames: Delivery::All })?;
    let mut monitor = Monitor::default();
    let began = Instant::now();
    let over = |at: Instant| arguments.duration.is_some_and(|seconds| (at - began).as_secs_f64() >= seconds);
    let interval = Duration::from_secs(1);
    let mut next = began + interval;
    let (mut has_come, mut obstacle) = (false, Obstacle::default());
    let mut screen = Screen {
        display,
        name: common.name(),
        time_scale: 1.0,
        stage: Box::default(),
        unnamed: None,
        drawn: Vec::new(),
        answer: None,
    };
    let has_keys = display == Display::Terminal && stdin().is_terminal();
    let mut keyboard = if has_keys { Some(Keyboard::new(common.name(), &stop)?) } else { None };
    if display != Display::Json {
        let keys = if has_keys { ", ? lists the keys" } else { "" };
        eprintln!("Watching \"{}\"; Ctrl-C ends{keys}.", common.name());
    }
    while !stop.load(Ordering::Relaxed) {
        let now = Instant::now();
        if now >= next || over(now) {
            screen.print_report(&monitor.report())?;
            next = (next + interval).max(now);
        }
        if over(now) {
            break;
        }
        for outcome in keyboard.iter_mut().flat_map(Keyboard::poll) {
            match outcome {
                KeyOutcome::Line(words) => screen.print_line(&words)?,
                KeyOutcome::Done(words) => screen.show_answer(words)?,
                KeyOutcome::Quit => return Ok(()),
            }
        }
        let patience = if has_keys { KEY_INTERVAL } else { interval };
        let mut printed = Ok(());
        let polled = feed.poll(next.saturating_duration_since(now).min(patience), &mut |event| {
            has_come = true;
            monitor.handle(&event, monotonic_ns());
            keyboard.iter_mut().for_each(|keyboard| keyboard.handle(&event));
            if printed.is_ok() {
                printed = screen.print_event(&event);
            }
        });
        // After the first event, `watch` waits while an obstacle hides a later publisher's services, as it waits for a
        // publisher.
        if !has_come {
            polled?;
        } else if obstacle.is_met(polled) {
            std::thread::sleep(Obstacle::RETRY_INTERVAL);
        }
        monitor.clock(feed.shares_clock());
        printed?;
    }
    Ok(())
}

struct Screen<'a> {
    display: Display,
    name: &'a str,
    time_scale: f64,
    /// The names; empty before the stage has come.
    stage: Box<Stage>,
    /// The latest alert that came before the stage of its run.
    unnamed: Option<CollisionAlert>,
    /// The lines of the last report on the terminal, which the next report replaces.
    drawn: Vec<String>,
    /// The playback state after the last key: the last line of the report.
    answer: Option<String>,
}

impl Screen<'_> {
    fn print_report(&mut self, report: &IntervalReport) -> Result<(), CommandError> {
        let mut output = stdout().lock();
        match self.display {
            Display::Json => {
                let known = report.present_header();
                let line = IntervalLine {
                    tick: known.map(|header| header.tick),
                    sim_time: known.map(|header| header.sim_time),
                    state: report.state().map_or("waiting", FrameState::name),
                    rate: report.rate,
                    received: report.received,
                    missed: report.missed,
                    latency_ns: report.latency,
                    lost_files: report.status.map(|status| status.lost_files).filter(|lost| *lost > 0),
                    chase: report.chase.map(|(status, has_died)| ChaseLine { status: (&status).into(), has_died }),
                };
                write_json(&mut output, &line)?;
            }
            Display::Lines => {
                let mut lines = folded(&self.lines(report)).into_iter();
                lines.try_for_each(|line| writeln!(output, "{}", folded::folded(&line, COLUMNS)))?;
            }
            Display::Terminal => {
                self.clear_previous(&mut output)?;
                self.drawn = self.lines(report);
                self.drawn.extend(self.answer.clone());
                self.draw(&mut output)?;
            }
        }
        Ok(output.flush()?)
    }

    /// Draws the last report below all events.
    fn draw(&self, output: &mut impl Write) -> std::io::Result<()> {
        // A wrapped line would take two rows, and the next report would clear one too few.
        write!(output, "{DISABLE_LINE_WRAP}")?;
        self.drawn.iter().try_for_each(|line| writeln!(output, "{line}"))?;
        write!(output, "{ENABLE_LINE_WRAP}")
    }

    /// Clears the last report from the terminal.
    fn clear_previous(&self, output: &mut impl Write) -> std::io::Result<()> {
        if self.drawn.is_empty() {
            return Ok(());
        }
        // To the start of the report's first row.
        write!(output, "\x1b[{}F{CLEAR_BELOW_CURSOR}", self.drawn.len())
    }

    /// Prints an event at once for people; with `--json` only alerts and cues.
    fn print_event(&mut self, event: &FeedEvent<'_>) -> Result<(), CommandError> {
        match event {
            FeedEvent::Frame { header, .. } => self.time_scale = header.time_scale,
            FeedEvent::Stage { stage, .. } => *self.stage = **stage,
            _ => (),
        }
        if self.display == Display::Json {
            let mut output = stdout().lock();
            match event {
                FeedEvent::Alert(alert) => write_json(&mut output, &AlertObject::from(*alert))?,
                FeedEvent::Cue(cue) => write_json(&mut output, &CueObject::from(*cue))?,
                _ => return Ok(()),
            }
            return Ok(output.flush()?);
        }
        let name = self.name;
        let line = match event {
            FeedEvent::Started { run_id } => format!("A publisher of \"{name}\" is running (run {run_id:016x})."),
            FeedEvent::Gone => format!("The publisher of \"{name}\" has ended; waiting for the next."),
            FeedEvent::Silent => format!("The publisher of \"{name}\" is running but sends nothing."),
            FeedEvent::Alert(alert) if alert.run_id != self.stage.run_id => {
                self.unnamed = Some(**alert);
                return Ok(());
            }
            FeedEvent::Alert(alert) => self.alert_line(alert),
            FeedEvent::Stage { stage, .. } => match self.unnamed.take().filter(|alert| alert.run_id == stage.run_id) {
                Some(alert) => self.alert_line(&alert),
                None => return Ok(()),
            },
            FeedEvent::Cue(cue) => format!("{:>10.3} s  {}", cue.sim_time, cue_sentence(cue)),
            FeedEvent::Frame { .. } | FeedEvent::Scene { .. } => return Ok(()),
            FeedEvent::Status(_) | FeedEvent::Chase(_) => return Ok(()),
        };
        if self.display == Display::Terminal && matches!(event, FeedEvent::Started { .. } | FeedEvent::Gone) {
            // The last report belongs to another publisher, or to none.
            self.clear_previous(&mut stdout().lock())?;
            self.drawn.clear();
            self.answer = None;
        }
        self.print_line(&line)
    }

    /// Prints a line above the last report.
    fn print_line(&self, line: &str) -> Result<(), CommandError> {
        let mut output = stdout().lock();
        if self.display == Display::Lines {
            writeln!(output, "{}", folded::folded(line, COLUMNS))?;
            return Ok(output.flush()?);
        }
        self.clear_previous(&mut output)?;
        // Some terminals have no known size.
        let columns = rustix::termios::tcgetwinsize(&output).map_or(0, |size| usize::from(size.ws_col));
        writeln!(output, "{}", folded::folded(line, if columns == 0 { 80 } else { columns }))?;
        self.draw(&mut output)?;
        Ok(output.flush()?)
    }

    /// Shows the playback state after a key at once, below the last report.
    fn show_answer(&mut self, words: String) -> Result<(), CommandError> {
        let mut output = stdout().lock();
        self.clear_previous(&mut output)?;
        if self.answer.is_some() {
            self.drawn.pop();
        }
        self.drawn.push(words.clone());
        self.answer = Some(words);
        self.draw(&mut output)?;
        Ok(output.flush()?)
    }

    fn lines(&self, report: &IntervalReport) -> Vec<String> {
        let Some(header) = report.present_header() else {
            let instead = shows::instead(self.name, &shows::running());
            return vec![format!("waiting for a publisher of \"{}\"", self.name), instead];
        };
        let state = report.state().unwrap_or(FrameState::Moving);
        let style = self.style(state.severity());
        let latency = match report.latency {
            Some(Latency { p50, p99, max }) => {
                let us = |ns: u64| ns as f64 / 1000.0;
                format!("p50 {:.1} p99 {:.1} max {:.1} us", us(p50), us(p99), us(max))
            }
            None if !report.shares_clock => "unknown: the frames were sent by another machine's clock".to_owned(),
            None => "no frames".to_owned(),
        };
        let playback = header.playback_state().filter(|playback| *playback != PlaybackState::Playing);
        let playback = playback.map_or(String::new(), |playback| format!(" ({})", playback.name()));
        let silent = if report.presence == Presence::Silent { " (silent)" } else { "" };
        let clearance = if header.min_clearance.is_nan() {
            "not computed".to_owned()
        } else {
            // No sign for zero: rounding puts a touch on either side.
            format!("{:.4} m", (header.min_clearance * 1e4).round() / 1e4 + 0.0)
        };
        let mut lines = vec![
            format!(
                "t {:>10.3} s  tick {}  {style}{}{style:#}{playback}{silent}{}",
                header.sim_time,
                header.tick,
                state.name(),
                self.countdown(report, header.sim_time)
            ),
            format!("rate {:.1} Hz  received {}  missed {}", report.rate, report.received, report.missed),
            format!("latency {latency}"),
            format!("{}  {} handles  clearance {clearance}", self.dancers(report), header.handles),
        ];
        lines.extend(report.status.iter().flat_map(status_lines));
        let lost = report.status.map_or(0, |status| status.lost_files);
        lines.extend((lost > 0).then(|| lost_files_sentence(lost)));
        lines.extend(report.chase.map(|(status, has_died)| chase_line(&status, has_died, header.time_scale)));
        lines
    }

    /// Returns the place of the head, or the names of several dragons.
    fn dancers(&self, report: &IntervalReport) -> String {
        match self.stage.dragons.len() {
            0 | 1 => format!("head ({:.3}, {:.3}) m", report.head.x, report.head.y),
            _ => self.stage.dragons.iter().map(|dragon| dragon.name.as_str()).collect::<Vec<_>>().join(", "),
        }
    }

    /// Returns the wall time to the event that the latest alert announced.
    fn countdown(&self, report: &IntervalReport, sim_time: f64) -> String {
        let warns = |level: Level| level.severity() > Severity::Ok && !level.has_happened();
        let ahead = report.alert.filter(|alert| alert.alert_level().is_some_and(warns) && alert.event_time > sim_time);
        ahead.map_or(String::new(), |alert| {
            let event = alert.event_kind().map_or("event", EventKind::name);
            format!("  {event} {}", time_until(alert.event_time - sim_time, self.time_scale))
        })
    }

    fn alert_line(&self, alert: &CollisionAlert) -> String {
        let level = alert.alert_level().unwrap_or(Level::Clear);
        let style = self.style(level.severity());
        let sentence = alert_sentence(alert, &self.stage, Figures::Shown { time_scale: self.time_scale });
        format!("{:>10.3} s  {style}{:<11}{style:#} {sentence}", alert.sim_time, level.name())
    }

    fn style(&self, severity: Severity) -> Style {
        match self.display {
            Display::Terminal if shows_colour(&stdout()) => {
                Style::new().bold().fg_color(Some(severity_colour(severity).into()))
            }
            _ => Style::new(),
        }
    }
}

/// Returns the parts of a report as lines that are not longer than [`COLUMNS`] unless a part is; the first of them
/// is not indented.
fn folded(parts: &[String]) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for part in parts {
        match lines.last_mut() {
            Some(line) if line.chars().count() + part.chars().count() + 2 <= COLUMNS => {
                line.push_str("; ");
                line.push_str(part);
            }
            None => lines.push(part.clone()),
            Some(_) => lines.push(format!("  {part}")),
        }
    }
    lines
}

/// Returns the line of a chase.
fn chase_line(status: &ChaseStatus, has_died: bool, time_scale: f64) -> String {
    match has_died {
        true => format!("chase: has died; the show stays at its last rate of {}", rounded(time_scale, 4)),
        false => format!("chase: {}", chase_sentence(status)),
    }
}

/// Returns the publisher's figures, in lines that fit a terminal of 80 columns.
fn status_lines(status: &LoopStatus) -> [String; 2] {
    let us = |ns: u64| ns as f64 / 1000.0;
    [
        format!("publisher: scene {}  overruns {}  skipped {}", status.scene.as_str(), status.overruns, status.skipped),
        format!(
            "lateness p99 {:.1} us  step p99 {:.1} us  memory {:.1} MB",
            us(status.lateness_p99_total),
            us(status.step_p99_total),
            status.resident_bytes as f64 / 1e6
        ),
    ]
}

fn write_json(output: &mut impl Write, line: &impl Serialize) -> Result<(), CommandError> {
    serde_json::to_writer(&mut *output, line).map_err(std::io::Error::from)?;
    Ok(writeln!(output)?)
}
