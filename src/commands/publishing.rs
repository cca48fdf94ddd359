//! What the commands that publish have in common: the threads of the loop and of its statistics, the lines for alerts and cues,
//! the summary. `run` brings a show, `replay` a recording.

use std::collections::BTreeMap;
use std::collections::hash_map::RandomState;
use std::fs::File;
use std::hash::BuildHasher;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use anstyle::Style;
use bench_dragon::client::clock::{SystemClock, realtime_ns};
use bench_dragon::client::shared_memory::OpenError;
use bench_dragon::messages::sentence::{Figures, alert_sentence, cue_sentence};
use bench_dragon::publisher::live::control::{Doors, door};
use bench_dragon::publisher::live::statistics::{self, Inbox, Run, RunSummary, Sample, Summary};
use bench_dragon::publisher::live::{
    Announcement, Counts, Deliveries, End, FrameSource, LoopOptions, PublishError, Publisher, run_loop,
};
use bench_dragon::publisher::transports::{self, Transport, TransportConfig, TransportError};

use super::lines::Lines;
use super::realtime_scheduling::RealtimeScheduling;
use super::{CommandError, Common, Output, severity_colour, shows_colour};

/// How often subscribers are let in before the first frame.
const LEAD_INTERVAL: Duration = Duration::from_millis(10);

/// A run's number that no other has.
pub fn new_run_id() -> u64 {
    RandomState::new().hash_one(realtime_ns())
}

/// Every transport that this program has.
const TRANSPORTS: [transports::Open; 2] = [transports::iceoryx2::open, ros2_if_built];

#[cfg(feature = "ros2")]
use bench_dragon::ros2::open as ros2_if_built;

#[cfg(not(feature = "ros2"))]
fn ros2_if_built(config: &TransportConfig) -> Result<Option<Box<dyn Transport>>, TransportError> {
    match config.ros2 {
        None => Ok(None),
        Some(_) => Err(TransportError::BadInput(
            "ROS 2 is requested and this program was built without it: build it with the feature \"jazzy\" or \
             \"humble\""
                .to_owned(),
        )),
    }
}

/// The transports, and the loop's ends of those that have a door for commands.
pub fn open_transports(config: &TransportConfig) -> Result<(Vec<Box<dyn Transport>>, Doors), CommandError> {
    let mut transports = transports::open(config, &TRANSPORTS)?;
    let mut ports = Vec::new();
    for transport in &mut transports {
        let (port, outer) = door();
        if transport.control(outer)?.is_none() {
            ports.push(port);
        }
    }
    Ok((transports, Doors::new(ports)))
}

/// What is published, and how the loop runs.
pub struct Publishing<'a> {
    /// What stands before every command.
    pub common: &'a Common,
    /// What is requested from the operating system.
    pub scheduling: &'a RealtimeScheduling,
    /// The run's number.
    pub run_id: u64,
    /// Frames per second.
    pub rate: f64,
    /// Seconds of wall time after which the loop ends.
    pub duration: Option<f64>,
    /// The scene's name in the status.
    pub scene: &'a str,
    /// Benches, of which alerts tell.
    pub benches: u32,
    /// How long subscribers that wait are given to connect before the first frame.
    pub lead: Duration,
}

/// The transports of a run.
type OpenTransports = [Box<dyn Transport>];

/// What a command does at certain moments.
pub struct Hooks<'a> {
    /// Once all is open.
    pub opened: Box<dyn FnOnce(&OpenTransports) + 'a>,
    /// With each period that was measured, on the statistics thread.
    pub sample: Box<dyn FnMut(&Sample) + Send + 'a>,
    /// Once the loop has ended, before the transports take leave.
    pub ended: Box<dyn FnOnce(Counts) + 'a>,
}

/// What has been published.
pub struct Published {
    /// What the loop has counted.
    pub counts: Counts,
    /// Lateness and step cost.
    pub summary: Summary,
    /// What each transport with a queue of its own has delivered.
    pub deliveries: BTreeMap<String, Deliveries>,
    /// The transport's failure that ended the loop.
    pub error: Option<PublishError>,
}

/// What the loop's thread prepares: its publishers; the transports, for the other threads; and what keeps CPUs awake.
type LoopEnds = (Vec<Box<dyn Publisher>>, Vec<Box<dyn Transport>>, Option<File>);

impl Publishing<'_> {
    /// Runs the loop on one thread and the statistics on another.
    ///
    /// # Errors
    /// What cannot be opened, or a thread that panicked.
    pub fn run(
        &self,
        frames: &mut (dyn FrameSource + Send),
        transports: Vec<Box<dyn Transport>>,
        mut doors: Doors,
        stop: &AtomicBool,
        hooks: Hooks,
    ) -> Result<Published, CommandError> {
        let Hooks { opened: when_open, mut sample, ended: when_ended } = hooks;
        let (reports, inbox) = statistics::queues();
        let done = AtomicBool::new(false);
        let (opened, opening) = mpsc::channel();
        let ended = std::thread::scope(|threads| {
            let looping = threads.spawn(|| {
                let (mut publishers, _awake) = match self.prepare_loop(transports) {
                    Ok((mut publishers, transports, awake)) => {
                        self.let_subscribers_in(&mut publishers, stop);
                        let _ = opened.send(Ok(transports));
                        (publishers, awake)
                    }
                    Err(error) => {
                        let _ = opened.send(Err(error));
                        return None;
                    }
                };
                Some(run_loop(&SystemClock, frames, &mut doors, &mut publishers, self.loop_options(), reports, stop))
            });
            // The thread sends exactly once; should it have died, nothing comes.
            let transports = opening.recv().unwrap_or_else(|_| Err(lost("loop's")));
            let collected = transports.and_then(|transports| {
                when_open(&transports);
                let collecting = threads.spawn(|| {
                    // Without statistics the loop would run unseen.
                    self.collect(inbox, transports, &mut sample, &done)
                        .inspect_err(|_| stop.store(true, Ordering::Relaxed))
                });
                let outcome = looping.join();
                done.store(true, Ordering::Release);
                let collected = collecting.join().map_err(|_| lost("statistics"))??;
                Ok((outcome.map_err(|_| lost("loop's"))?, collected))
            });
            match collected? {
                (Some(Ok(counts)), collected) => Ok((counts, collected, None)),
                (Some(Err((counts, error))), collected) => Ok((counts, collected, Some(error))),
                (None, _) => Err(lost("loop's")),
            }
        });
        let (counts, (summary, transports), error) = ended?;
        when_ended(counts);
        let deliveries = transports.into_iter().filter_map(|transport| transport.finish());
        let deliveries = deliveries.map(|(name, of)| (name.to_owned(), of)).collect();
        Ok(Published { counts, summary, deliveries, error })
    }

    /// What the loop's thread does first: it requests its scheduling from the system and opens its ends of the
    /// transports.
    fn prepare_loop(&self, mut transports: Vec<Box<dyn Transport>>) -> Result<LoopEnds, CommandError> {
        let awake = self.scheduling.prepare_thread()?;
        let publishers = transports.iter_mut().map(|transport| transport.publisher()).collect::<Result<_, _>>()?;
        Ok((publishers, transports, awake))
    }

    /// Waits for [`lead`](Self::lead).
    fn let_subscribers_in(&self, publishers: &mut [Box<dyn Publisher>], stop: &AtomicBool) {
        let began = Instant::now();
        while began.elapsed() < self.lead && !stop.load(Ordering::Relaxed) {
            publishers.iter_mut().for_each(|publisher| publisher.maintain());
            std::thread::sleep(LEAD_INTERVAL);
        }
    }

    fn loop_options(&self) -> LoopOptions {
        let Self { run_id, rate, duration, .. } = *self;
        LoopOptions { run_id, rate, periods: duration.map(|seconds| LoopOptions::periods_of(seconds, rate)) }
    }

    fn collect(
        &self,
        inbox: Inbox,
        mut transports: Vec<Box<dyn Transport>>,
        sample: &mut (dyn FnMut(&Sample) + Send),
        done: &AtomicBool,
    ) -> Result<(Summary, Vec<Box<dyn Transport>>), CommandError> {
        let lines = if self.common.quiet || self.common.json { None } else { Some(Lines::start()?) };
        let announce = |announcement: &Announcement| {
            lines.iter().zip(self.announced(announcement)).for_each(|(lines, line)| lines.print(line));
        };
        let run = Run {
            run_id: self.run_id,
            rate: self.rate,
            scene: self.scene,
            sinks: transports.iter_mut().map(|transport| transport.status()).collect::<Result<_, _>>()?,
            announce: Box::new(announce),
            record: Box::new(sample),
        };
        let summary = statistics::collect(&SystemClock, inbox, run, done);
        lines.into_iter().for_each(Lines::finish);
        Ok((summary, transports))
    }

    /// The line of an alert, with the countdown in wall time, or of a cue.
    fn announced(&self, announcement: &Announcement) -> Option<String> {
        match announcement {
            Announcement::Alert { alert, time_scale } => {
                let level = alert.alert_level()?;
                let colour = Style::new().fg_color(Some(severity_colour(level.severity()).into()));
                let style = if shows_colour(&std::io::stderr()) { colour } else { Style::new() };
                let figures = Figures::Shown { time_scale: *time_scale };
                let sentence = alert_sentence(alert, self.benches, figures);
                Some(format!("{:>10.3} s  {style}{:<11}{style:#} {sentence}", alert.sim_time, level.name()))
            }
            Announcement::Cue(cue) => Some(format!("{:>10.3} s  {}", cue.sim_time, cue_sentence(cue))),
        }
    }
}

impl Published {
    /// Prints the summary.
    ///
    /// # Errors
    /// Standard output takes no more.
    pub fn print(&self, common: &Common) -> Result<(), CommandError> {
        let Counts { frames, overruns, skipped, end } = self.counts;
        let Summary { wakeup_ns, step_ns, samples } = self.summary;
        let deliveries = self.deliveries.clone();
        let lost_samples = frames - samples;
        let mut output = Output::standard();
        if lost_samples > 0 {
            log::warn!("{lost_samples} frames are missing from the percentiles: the machine left them no time");
        }
        if common.json {
            output.json(&RunSummary { frames, overruns, skipped, wakeup_ns, step_ns, end, deliveries })?;
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
            for (name, Deliveries { frames, skipped, discarded }) in deliveries {
                output.line(&format!(
                    "  {name}: {frames} frames sent, {skipped} skipped, {discarded} messages discarded."
                ))?;
            }
        }
        output.finish()
    }
}

/// A thread of this program panicked, which it has reported itself.
fn lost(thread: &str) -> CommandError {
    CommandError::Failed(format!("the {thread} thread ended early"))
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
