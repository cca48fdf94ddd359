//! `watch`: the terminal monitor.

use std::io::{IsTerminal, Write, stdout};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use anstyle::{AnsiColor, Style};
use bench_dragon::messages::{CollisionAlert, LoopStatus, NO_BENCH, State};
use bench_dragon::subscribers::monitor::{Latency, Monitor, News, Presence, Second};
use crossterm::{cursor, execute, terminal};
use serde::Serialize;

use super::{CommandError, Common, stop_on_signals, wall_seconds};

/// Arguments of `watch`.
#[derive(Debug, clap::Args)]
pub struct WatchArguments {
    /// Wall time after which to end: 60, 90s, 5m, 8h
    #[arg(long, value_name = "TIME", value_parser = wall_seconds)]
    duration: Option<f64>,
}

/// One line of `watch --json`.
#[derive(Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum Line {
    Second {
        tick: Option<u64>,
        sim_time: Option<f64>,
        state: &'static str,
        rate: f64,
        received: u64,
        missed: u64,
        latency_ns: Option<Latency>,
    },
    Alert {
        run_id: u64,
        tick: u64,
        stamp_ns: u64,
        sim_time: f64,
        event_time: f64,
        time_to_event: f64,
        clearance: f64,
        x: f64,
        y: f64,
        level: &'static str,
        bench_a: Option<u32>,
        bench_b: Option<u32>,
    },
}

/// How the monitor shows itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Display {
    /// Redrawn in place.
    Terminal,
    /// A line a second.
    Lines,
    /// A JSON line a second.
    Json,
}

/// Watches until its duration is over or a signal comes.
pub fn watch(common: &Common, arguments: &WatchArguments) -> Result<(), CommandError> {
    let display = match (common.json, stdout().is_terminal()) {
        (true, _) => Display::Json,
        (false, true) => Display::Terminal,
        (false, false) => Display::Lines,
    };
    let mut monitor = Monitor::new(&common.name)?;
    let stop = stop_on_signals()?;
    let began = Instant::now();
    let over = |at: Instant| arguments.duration.is_some_and(|seconds| (at - began).as_secs_f64() >= seconds);
    let interval = Duration::from_secs(1);
    let mut next = began + interval;
    let mut screen = Screen { display, name: &common.name, time_scale: 1.0, drawn: 0 };
    if display != Display::Json {
        eprintln!("Watching \"{}\"; Ctrl-C ends.", common.name);
    }
    while !stop.load(Ordering::Relaxed) {
        let now = Instant::now();
        if now >= next || over(now) {
            let second = monitor.second();
            screen.show_second(&second)?;
            next = (next + interval).max(now);
        }
        if over(now) {
            break;
        }
        let mut news = Vec::new();
        let timeout = next.saturating_duration_since(now).min(Duration::from_millis(200));
        monitor.step(timeout, |item| news.push(item))?;
        for item in news {
            screen.tell(&item)?;
        }
    }
    Ok(())
}

struct Screen<'a> {
    display: Display,
    name: &'a str,
    time_scale: f64,
    /// Lines on the terminal that the next second overwrites.
    drawn: u16,
}

impl Screen<'_> {
    fn show_second(&mut self, second: &Second) -> Result<(), CommandError> {
        if let Some(header) = second.header {
            self.time_scale = header.time_scale;
        }
        let mut output = stdout().lock();
        match self.display {
            Display::Json => {
                let known = second.header.filter(|_| second.presence != Presence::Waiting);
                let line = Line::Second {
                    tick: known.map(|header| header.tick),
                    sim_time: known.map(|header| header.sim_time),
                    state: second.state().map_or("waiting", State::name),
                    rate: second.rate,
                    received: second.received,
                    missed: second.missed,
                    latency_ns: second.latency,
                };
                write_json(&mut output, &line)?;
            }
            Display::Lines => writeln!(output, "{}", self.lines(second).join("; "))?,
            Display::Terminal => {
                self.rub_out(&mut output)?;
                let lines = self.lines(second);
                for line in &lines {
                    writeln!(output, "{line}")?;
                }
                self.drawn = lines.len() as u16;
            }
        }
        Ok(output.flush()?)
    }

    /// Removes what the last second drew, so that news scroll up above the figures.
    fn rub_out(&mut self, output: &mut impl Write) -> std::io::Result<()> {
        if self.drawn > 0 {
            execute!(
                output,
                cursor::MoveToPreviousLine(self.drawn),
                terminal::Clear(terminal::ClearType::FromCursorDown)
            )?;
            self.drawn = 0;
        }
        Ok(())
    }

    fn tell(&mut self, news: &News) -> Result<(), CommandError> {
        let mut output = stdout().lock();
        if self.display == Display::Json {
            if let News::Alert(alert) = news {
                write_json(&mut output, &alert_line(alert))?;
            }
            return Ok(output.flush()?);
        }
        self.rub_out(&mut output)?;
        match news {
            News::Started { run_id } => {
                writeln!(output, "A publisher of \"{}\" is running (run {run_id:016x}).", self.name)?
            }
            News::Gone => writeln!(output, "The publisher of \"{}\" has ended; waiting for the next.", self.name)?,
            News::FellSilent => writeln!(output, "The publisher of \"{}\" is there but sends nothing.", self.name)?,
            News::Alert(alert) => writeln!(output, "{}", self.alert_sentence(alert))?,
        }
        Ok(output.flush()?)
    }

    fn lines(&self, second: &Second) -> Vec<String> {
        let Some(header) = second.header.filter(|_| second.presence != Presence::Waiting) else {
            return vec![format!("waiting for a publisher of \"{}\"", self.name)];
        };
        let state = second.state().unwrap_or(State::Moving);
        let style = self.style(state);
        let latency = second.latency.map_or("no frames".to_owned(), |latency| {
            let us = |ns: u64| ns as f64 / 1000.0;
            format!("p50 {:.1} p99 {:.1} max {:.1} us", us(latency.p50), us(latency.p99), us(latency.max))
        });
        let silent = if second.presence == Presence::Silent { " (silent)" } else { "" };
        let clearance = if header.min_clearance.is_nan() {
            "not computed".to_owned()
        } else {
            // Zero has no sign for people: a touch is solved to the last bits, on either side.
            format!("{:.4} m", (header.min_clearance * 1e4).round() / 1e4 + 0.0)
        };
        let mut lines = vec![
            format!(
                "t {:>10.3} s  tick {}  {style}{}{style:#}{silent}{}",
                header.sim_time,
                header.tick,
                state.name(),
                self.countdown(second, header.sim_time)
            ),
            format!("rate {:.1} Hz  received {}  missed {}", second.rate, second.received, second.missed),
            format!("latency {latency}"),
            format!(
                "head ({:.3}, {:.3}) m  {} handles  clearance {clearance}",
                second.head.x, second.head.y, header.handles
            ),
        ];
        lines.extend(second.status.as_ref().map(status_line));
        lines
    }

    /// Wall time to the event that the latest alert announced.
    fn countdown(&self, second: &Second, sim_time: f64) -> String {
        let ahead =
            second.alert.filter(|alert| alert.level == State::Approaching as u32 && alert.event_time > sim_time);
        ahead.map_or(String::new(), |alert| {
            format!("  next event in {:.1} s", (alert.event_time - sim_time) / self.time_scale)
        })
    }

    fn alert_sentence(&self, alert: &CollisionAlert) -> String {
        let level = State::from_wire(alert.level).unwrap_or(State::Moving);
        let style = self.style(level);
        let benches = match (alert.bench_a, alert.bench_b) {
            (NO_BENCH, _) => String::new(),
            _ if level == State::Moving => String::new(),
            (a, NO_BENCH) => format!(", bench {} (counting from 1)", a + 1),
            (a, b) => format!(", benches {} and {} (counting from 1)", a + 1, b + 1),
        };
        let when = match level {
            State::Approaching if alert.time_to_event.is_nan() => ": two boards are near each other".to_owned(),
            State::Approaching => format!(": next event in {:.1} s", alert.time_to_event / self.time_scale),
            State::Moving => ": nothing near".to_owned(),
            _ => format!(" at {:.6} s, ({:.3}, {:.3}) m", alert.event_time, alert.x, alert.y),
        };
        format!("{:>10.3} s  {style}{}{style:#}{when}{benches}", alert.sim_time, level.level_name())
    }

    fn style(&self, state: State) -> Style {
        let colour = match state {
            State::Moving => AnsiColor::Green,
            State::Approaching => AnsiColor::Yellow,
            _ => AnsiColor::Red,
        };
        match self.display {
            Display::Terminal => Style::new().bold().fg_color(Some(colour.into())),
            _ => Style::new(),
        }
    }
}

fn status_line(status: &LoopStatus) -> String {
    let us = |ns: u64| ns as f64 / 1000.0;
    format!(
        "publisher: scene {}  overruns {}  skipped {}  lateness p99 {:.1} us  step p99 {:.1} us  memory {:.1} MB",
        status.scene_name(),
        status.overruns,
        status.skipped,
        us(status.lateness_p99_total),
        us(status.step_p99_total),
        status.resident_bytes as f64 / 1e6
    )
}

fn alert_line(alert: &CollisionAlert) -> Line {
    let bench = |bench: u32| (bench != NO_BENCH).then_some(bench);
    let CollisionAlert { run_id, tick, stamp_ns, sim_time, event_time, time_to_event, clearance, x, y, .. } = *alert;
    let level = State::from_wire(alert.level).unwrap_or(State::Moving).level_name();
    let (bench_a, bench_b) = (bench(alert.bench_a), bench(alert.bench_b));
    Line::Alert {
        run_id,
        tick,
        stamp_ns,
        sim_time,
        event_time,
        time_to_event,
        clearance,
        x,
        y,
        level,
        bench_a,
        bench_b,
    }
}

fn write_json(output: &mut impl Write, line: &Line) -> Result<(), CommandError> {
    serde_json::to_writer(&mut *output, line).map_err(std::io::Error::from)?;
    Ok(writeln!(output)?)
}
