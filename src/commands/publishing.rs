//! The part that `run` and `replay` share: the lines for alerts and cues, the summary.

use std::collections::hash_map::RandomState;
use std::hash::BuildHasher;
use std::sync::atomic::AtomicBool;

use anstyle::Style;
use bench_dragon::client::clock::{SystemClock, realtime_ns};
use bench_dragon::client::shared_memory::OpenError;
use bench_dragon::messages::Stage;
use bench_dragon::messages::sentence::{Figures, alert_sentence, cue_sentence};
use bench_dragon::publisher::live::control::CommandQueues;
use bench_dragon::publisher::live::statistics::{RunSummary, Sample, Summary};
use bench_dragon::publisher::live::{Announcement, End, FrameSource, LoopCounts, TransportCounters};
use bench_dragon::publisher::run::{Hooks, Published, Publishing, RunError};
use bench_dragon::publisher::transports::{Transport, TransportError};

use super::lines::Lines;
use super::service_manager::{self, ServiceManager};
use super::{CommandError, Common, Output, severity_colour, shows_colour};

/// Returns a new run number.
pub fn new_run_id() -> u64 {
    RandomState::new().hash_one(realtime_ns())
}

/// The ends of the publisher: those of its frames and those of its commands.
pub struct Ends {
    /// The open transports.
    pub transports: Vec<Box<dyn Transport>>,
    /// The loop's end of the command queues.
    pub queues: CommandQueues,
}

/// Publishes, and prints alerts and cues with the names of `stage` on standard error.
///
/// # Errors
/// [`RunError`], or no thread for the lines.
pub fn publish(
    common: &Common,
    stage: &Stage,
    publishing: &Publishing,
    source: &mut (dyn FrameSource + Send),
    ends: Ends,
    stop: &AtomicBool,
    hooks: Hooks,
) -> Result<Published, CommandError> {
    let lines = if common.quiet || common.json { None } else { Some(Lines::start()?) };
    let print = lines.as_ref().map(Lines::printer);
    let stage = Box::new(*stage);
    let announce = move |announcement: &Announcement| {
        print.iter().zip(announced(announcement, &stage)).for_each(|(print, line)| print(line));
    };
    let hooks = managed(Hooks { announce: Box::new(announce), ..hooks });
    let published = publishing.run(&SystemClock, source, ends.transports, ends.queues, stop, hooks);
    lines.into_iter().for_each(Lines::finish);
    Ok(published?)
}

/// Returns `hooks` that also report to the service manager, if one has started this process.
fn managed(hooks: Hooks) -> Hooks {
    let Some(mut manager) = ServiceManager::of_this_process() else { return hooks };
    let Hooks { opened, announce, mut sample, mut alive, ended } = hooks;
    let mut is_ready = false;
    let sampled = move |of: &Sample| {
        if !is_ready {
            is_ready = true;
            service_manager::ready();
        }
        sample(of);
    };
    let living = move || {
        manager.alive();
        alive();
    };
    let stopped = move |counts| {
        service_manager::stopping();
        ended(counts);
    };
    Hooks { opened, announce, sample: Box::new(sampled), alive: Box::new(living), ended: Box::new(stopped) }
}

/// Returns the line of an alert, with the countdown in wall time, or of a cue.
fn announced(announcement: &Announcement, stage: &Stage) -> Option<String> {
    match announcement {
        Announcement::Alert { alert, time_scale } => {
            let level = alert.alert_level()?;
            let colour = Style::new().fg_color(Some(severity_colour(level.severity()).into()));
            let style = if shows_colour(&std::io::stderr()) { colour } else { Style::new() };
            let figures = Figures::Shown { time_scale: *time_scale };
            let sentence = alert_sentence(alert, stage, figures);
            Some(format!("{:>10.3} s  {style}{:<11}{style:#} {sentence}", alert.sim_time, level.name()))
        }
        Announcement::Cue(cue) => Some(format!("{:>10.3} s  {}", cue.sim_time, cue_sentence(cue))),
    }
}

/// Prints the summary.
///
/// # Errors
/// Standard output takes no more.
pub fn print_summary(published: &Published, common: &Common) -> Result<(), CommandError> {
    let LoopCounts { frames, overruns, skipped, end } = published.counts;
    let Summary { wakeup_ns, step_ns, samples } = published.summary;
    let transport_counters = published.transport_counters.clone();
    let lost_samples = frames - samples;
    let mut output = Output::standard();
    if lost_samples > 0 {
        log::warn!("{lost_samples} frames are missing from the percentiles: the machine left them no time");
    }
    if common.json {
        output.json(&RunSummary { frames, overruns, skipped, wakeup_ns, step_ns, end, transport_counters })?;
    } else {
        output.line(&format!(
            "{frames} frames published, {overruns} overruns, {skipped} periods skipped (ended by {}).",
            match end {
                End::Duration => "its duration",
                End::Signal => "a signal",
                End::Recording => "the end of the recording",
                End::Error => "an error",
            }
        ))?;
        for (name, of) in [("wake-up lateness", wakeup_ns), ("step cost", step_ns)] {
            let us = |ns: u64| ns as f64 / 1000.0;
            output.line(&format!(
                "  {name:<17} p50 {:>9.1} us   p99 {:>9.1} us   p99.9 {:>9.1} us   max {:>9.1} us",
                us(of.p50),
                us(of.p99),
                us(of.p999),
                us(of.max)
            ))?;
        }
        for (name, TransportCounters { frames, skipped, discarded }) in transport_counters {
            output
                .line(&format!("  {name}: {frames} frames sent, {skipped} skipped, {discarded} messages discarded."))?;
        }
    }
    output.finish()
}

impl From<RunError> for CommandError {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Transport(error) => error.into(),
            RunError::Cpu(error) => Self::BadInput(format!("--cpu: {error}")),
            RunError::Thread(_) => Self::Failed(error.to_string()),
        }
    }
}

impl From<TransportError> for CommandError {
    fn from(error: TransportError) -> Self {
        match error {
            TransportError::BadInput(sentence) => Self::BadInput(sentence),
            TransportError::IllegalName(sentence) => Self::BadInput(format!("--name: {sentence}")),
            TransportError::NameInUse(sentence) => Self::Failed(format!("{sentence} (--name)")),
            TransportError::Failed(sentence) => Self::Failed(sentence),
        }
    }
}

impl From<OpenError> for CommandError {
    fn from(error: OpenError) -> Self {
        TransportError::from(error).into()
    }
}
