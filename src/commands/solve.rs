//! `solve`: the show's own solver offline, as a table.

use std::path::PathBuf;

use bench_dragon::messages::state::EventKind;
use bench_dragon::motion::solve::Chain;
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::show::{solve_at_or_just_before, table};

use super::signals::{are_searches_stopped, report, stop_searches_on_signals, unstopped};
use super::{CommandError, Common, Output, figure, make_solver, number, progress_bar, search_timeline, seconds};

/// Arguments of `solve`.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("times").required(true))]
pub struct SolveArguments {
    /// Simulated times (60, 1:30), or contact, obstacle, stall, lock, path_end; several separated by commas
    #[arg(long, value_name = "TIMES", value_delimiter = ',', group = "times", allow_negative_numbers = true)]
    at: Vec<String>,
    /// Simulated time between two rows; with --until
    #[arg(long, value_name = "TIME", value_parser = seconds, group = "times", requires = "until", allow_negative_numbers = true)]
    every: Option<f64>,
    /// The first time of --every
    #[arg(long, value_name = "TIME", value_parser = seconds, default_value_t = 0.0, requires = "every", allow_negative_numbers = true)]
    from: f64,
    /// The last time of --every, inclusive
    #[arg(long, value_name = "TIME", value_parser = seconds, requires = "every", allow_negative_numbers = true)]
    until: Option<f64>,
    /// Write to a file instead of standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Solves the scene at the requested times and prints the table.
pub fn solve(common: &Common, arguments: &SolveArguments) -> Result<(), CommandError> {
    let scene = common.load_scene()?;
    let searched = [EventKind::Contact, EventKind::Obstacle];
    let wants_contact = arguments.at.iter().any(|time| searched.iter().any(|kind| time.trim() == kind.name()));
    stop_searches_on_signals()?;
    let timeline = if wants_contact {
        search_timeline(&scene, common)
    } else {
        let bar = progress_bar(1000, common).with_message("searching for the end");
        let timeline = scene.ensemble.timeline_without_contact(&mut |share| report(&bar, share));
        bar.finish_and_clear();
        timeline
    };
    unstopped()?;
    let (count, times) = arguments.times(&timeline)?;
    let mut solver = make_solver(&scene, scene.velocities, common)?;
    let mut chain = Chain::new(scene.ensemble.handles());
    let mut output = match &arguments.output {
        Some(file) => Output::file(file)?,
        None => Output::standard(),
    };
    if !common.json {
        output.text(table::CSV_HEADER)?;
    }
    let bar = progress_bar(count, common);
    let mut text = String::new();
    for time in times.take_while(|_| !are_searches_stopped()) {
        if solve_at_or_just_before(solver.as_mut(), time, &mut chain).is_err() {
            return Err(CommandError::Failed(format!("there is no solution at {} s", figure(time))));
        }
        text.clear();
        if common.json {
            table::json_line(time, &chain, &mut text)
        } else {
            table::csv_rows(time, &chain, &mut text)
        }
        output.text(&text)?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    if arguments.output.is_some() {
        // A file with a part of the table would look complete.
        unstopped()?;
    }
    output.finish().and(unstopped())
}

impl SolveArguments {
    /// Returns the number of requested times, and the times in order, all within the motion.
    fn times(&self, timeline: &Timeline) -> Result<Times, CommandError> {
        match (self.every, self.until) {
            (Some(every), Some(until)) => self.regular_times(every, until, timeline),
            _ => {
                let times: Vec<f64> =
                    self.at.iter().map(|text| time_of("--at", text, timeline)).collect::<Result<_, _>>()?;
                Ok((times.len() as u64, Box::new(times.into_iter())))
            }
        }
    }

    fn regular_times(&self, every: f64, until: f64, timeline: &Timeline) -> Result<Times, CommandError> {
        let from = self.from;
        if !(every.is_finite() && every > 0.0) {
            return Err(CommandError::BadInput(format!(
                "--every is {}, expected a number of seconds above 0",
                number(every)
            )));
        }
        if !(from.is_finite() && from >= 0.0) {
            return Err(CommandError::BadInput(format!(
                "--from is {}, expected a number of seconds, at least 0",
                number(from)
            )));
        }
        if !(until.is_finite() && until >= from) {
            return Err(CommandError::BadInput(format!(
                "--until is {}, expected a number of seconds from {} on",
                number(until),
                number(from)
            )));
        }
        // A last row that rounding puts past --until by less than a part in 10^9 of a step still counts.
        let steps = ((until - from) / every + 1e-9).floor();
        if steps >= 1e9 {
            return Err(CommandError::BadInput(format!(
                "--every {} gives {steps:e} rows, expected fewer than 1e9",
                number(every)
            )));
        }
        let end = timeline.end();
        let steps = steps as u64;
        let time = move |step: u64| from + step as f64 * every;
        let within = if time(steps) <= end.time {
            steps + 1
        } else {
            eprintln!(
                "The motion ends at {} s ({}): the table ends at its last row before that.",
                figure(end.time),
                end.event.kind.name()
            );
            // The first row past the end, by bisection, since there may be a billion rows.
            let (mut within, mut past) = (0, steps);
            while within < past {
                let middle = within.midpoint(past);
                if time(middle) <= end.time { within = middle + 1 } else { past = middle }
            }
            within
        };
        Ok((within, Box::new((0..within).map(time))))
    }
}

/// The number of times, and the times in order.
type Times = (u64, Box<dyn Iterator<Item = f64>>);

/// Parses a time of an option such as `--at`: seconds, or the name of an event.
///
/// # Errors
/// Bad input: not a number, an event that does not happen, or a time after the motion's end.
pub fn time_of(option: &str, text: &str, timeline: &Timeline) -> Result<f64, CommandError> {
    let text = text.trim();
    let named = [EventKind::Contact, EventKind::Obstacle, EventKind::Stall, EventKind::Lock, EventKind::PathEnd]
        .into_iter()
        .find(|kind| kind.name() == text);
    if let Some(kind) = named {
        return timeline.find(kind).map(|timed| timed.time).ok_or_else(|| {
            CommandError::BadInput(format!("{option} {text}: this scene has no {text}; `events` lists its events"))
        });
    }
    let time = seconds(text).map_err(|sentence| {
        CommandError::BadInput(format!(
            "{option} {text}: {sentence}, or one of contact, obstacle, stall, lock, path_end"
        ))
    })?;
    let end = timeline.end();
    if !(time.is_finite() && time >= 0.0) {
        return Err(CommandError::BadInput(format!("{option} {text}: expected a number of seconds, at least 0")));
    }
    // Minus zero is zero.
    let time = time + 0.0;
    // The time of the end, rounded for people and read back, is the end.
    if time > end.time && time <= (end.time + 1e-9).max(end.time * (1.0 + 4.0 * f64::EPSILON)) {
        return Ok(end.time);
    }
    if time > end.time {
        return Err(CommandError::BadInput(format!(
            "{option} {text}: the motion ends at {} s ({}), expected a time up to that",
            figure(end.time),
            end.event.kind.name()
        )));
    }
    Ok(time)
}
