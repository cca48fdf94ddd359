//! `run`: the live publisher.

use std::collections::BTreeMap;
use std::collections::hash_map::RandomState;
use std::fs::File;
use std::hash::BuildHasher;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;

use anstyle::Style;
use bench_dragon::live::clock::{SystemClock, realtime_ns};
use bench_dragon::live::control::{Doors, door};
use bench_dragon::live::statistics::{self, Inbox, Run, RunSummary, Summary};
use bench_dragon::live::{Announcement, Counts, Deliveries, End, LoopOptions, Publisher, run_loop};
use bench_dragon::motion::event::EventKind;
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::recording::arithmetic::Arithmetic;
use bench_dragon::recording::histograms::HistogramLog;
use bench_dragon::recording::lines::ShowLine;
use bench_dragon::recording::log::{self as recording_log, LogOutcome};
use bench_dragon::scene::{Accepted, AtEnd, Scene, SceneText};
use bench_dragon::show::{Playback, ReachedCue, Show};
use bench_dragon::transports::iceoryx2::{OpenError, service_name};
use bench_dragon::transports::{self, Transport, TransportConfig, TransportError};
use bench_dragon::wire::convert;
use bench_dragon::wire::sentence::{Figures, alert_sentence, cue_sentence};

use super::events::sentence;
use super::realtime_scheduling::RealtimeScheduling;
use super::{
    CommandError, Common, Output, number, search_timeline, severity_colour, shows_colour, stop_on_signals, warn_of_gap,
};

/// Arguments of `run`.
#[derive(Debug, clap::Args)]
pub struct RunArguments {
    /// Frames per second; by default the scene's
    #[arg(long, value_name = "HZ", help_heading = "The show", allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Simulated seconds per second of wall time
    #[arg(long, value_name = "X", default_value_t = 1.0, help_heading = "The show", allow_negative_numbers = true)]
    time_scale: f64,
    /// Simulated seconds at which the show begins
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 0.0,
        help_heading = "The show",
        allow_negative_numbers = true
    )]
    start: f64,
    /// Wall time after which to end: 60, 90s, 5m, 8h
    #[arg(long, value_name = "TIME", value_parser = super::wall_seconds, help_heading = "The show")]
    duration: Option<f64>,
    /// Begin again whenever the show has ended
    #[arg(long = "loop", help_heading = "The show")]
    looping: bool,
    /// Wait at the start for the command `control go`
    #[arg(long, help_heading = "The show")]
    paused: bool,
    /// Wall time for which a looping show stands at its end, seconds; by default the scene's
    #[arg(long, value_name = "SECONDS", hide = true)]
    end_hold: Option<f64>,
    /// Record commands and a hash of the frames each second, for `bench-dragon verify`
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Record the distributions of wake-up lateness and step cost as an HdrHistogram interval log
    #[arg(long, value_name = "FILE", hide = true)]
    histograms: Option<PathBuf>,
    /// Publish ROS 2 topics too, those of the scene's [publish.ros2] or the default ones
    #[arg(long)]
    ros2: bool,
    /// Offer ROS 2 services that conduct the show, to everybody whom ROS 2 reaches; needs --ros2 or [publish.ros2]
    #[arg(long)]
    ros2_control: bool,
    #[command(flatten)]
    scheduling: RealtimeScheduling,
    /// End when the process that started this one ends
    #[arg(long, hide = true)]
    end_with_parent: bool,
}

/// Publishes the scene until its duration is over or a signal comes.
pub fn run(common: &Common, arguments: &RunArguments) -> Result<(), CommandError> {
    if arguments.end_with_parent {
        super::soak::end_with_parent()?;
    }
    let text = common.scene_text()?;
    let mut scene = text.parse()?;
    if arguments.ros2 {
        scene.ros2.get_or_insert_default();
    }
    if arguments.ros2_control {
        let Some(settings) = &mut scene.ros2 else {
            let sentence =
                "--ros2-control is given and ROS 2 is not requested, expected --ros2 or a scene with [publish.ros2]";
            return Err(CommandError::BadInput(sentence.to_owned()));
        };
        settings.control = true;
    }
    let playback = arguments.playback(&scene)?;
    service_name(&common.name, "poses")?;
    let timeline = if scene.alerts.is_some() {
        search_timeline(&scene, common)
    } else {
        let timeline = scene.motion.timeline_without_contact();
        warn_of_gap(&timeline);
        timeline
    };
    let show =
        Show::new(&scene, timeline, playback).map_err(|error| CommandError::BadInput(format!("--start: {error}")))?;
    let stop = stop_on_signals()?;
    let run_id = RandomState::new().hash_one(realtime_ns());
    for name in show.missing_cues() {
        log::warn!("cue \"{name}\" has no time in this show: its event does not happen, or too early");
    }
    let (timeline, solver) = (show.timeline().clone(), show.solver_reason().to_owned());
    let cues = show.cues().to_vec();
    let session =
        RunSession { common, arguments, text: &text, scene: &scene, playback, run_id, timeline, cues, solver };
    session.run(show, &stop)
}

/// What the loop's thread prepares: its publishers; the transports, for the other threads; and what keeps CPUs awake.
type LoopEnds = (Vec<Box<dyn Publisher>>, Vec<Box<dyn Transport>>, Option<File>);

/// The log as a transport, and how it fares.
type OpenedLog = (Box<dyn Transport>, LogOutcome);

/// All that the threads of a run have in common.
struct RunSession<'a> {
    common: &'a Common,
    arguments: &'a RunArguments,
    text: &'a SceneText,
    scene: &'a Scene,
    playback: Playback,
    run_id: u64,
    timeline: Timeline,
    cues: Vec<ReachedCue>,
    /// The solver and why it was chosen.
    solver: String,
}

impl RunSession<'_> {
    /// Runs the loop on one thread and the statistics on another.
    fn run(&self, mut show: Show, stop: &Arc<AtomicBool>) -> Result<(), CommandError> {
        let (mut transports, mut doors) = self.open_transports(&show)?;
        // The last of them: what reaches the log has been published.
        let log = self.open_log()?.map(|(transport, outcome)| {
            transports.push(transport);
            outcome
        });
        let mut histograms = self.open_histograms()?;
        let (reports, inbox) = statistics::queues();
        let done = AtomicBool::new(false);
        let (opened, opening) = mpsc::channel();
        let ended = std::thread::scope(|threads| {
            let looping = threads.spawn(|| {
                let (mut publishers, _awake) = match self.prepare_loop(transports) {
                    Ok((publishers, transports, awake)) => {
                        let _ = opened.send(Ok(transports));
                        (publishers, awake)
                    }
                    Err(error) => {
                        let _ = opened.send(Err(error));
                        return None;
                    }
                };
                Some(run_loop(&SystemClock, &mut show, &mut doors, &mut publishers, self.loop_options(), reports, stop))
            });
            // The thread sends exactly once; should it have died, nothing comes.
            let transports = opening.recv().unwrap_or_else(|_| Err(lost("loop's")));
            let collected = transports.and_then(|transports| {
                self.print_start(&transports);
                let collecting = threads.spawn(|| {
                    // Without statistics the loop would run unseen.
                    self.collect(inbox, transports, &mut histograms, &done)
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
        log.iter().for_each(|log| log.ended(counts));
        let deliveries = transports.into_iter().filter_map(|transport| transport.finish());
        let deliveries = deliveries.map(|(name, of)| (name.to_owned(), of)).collect();
        self.print_summary(&counts, &summary, deliveries)?;
        let log_failure = log.and_then(|outcome| outcome.failure());
        error
            .map(|error| error.to_string())
            .or(log_failure)
            .or(histograms.and_then(HistogramLog::finish))
            .map_or(Ok(()), |sentence| Err(CommandError::Failed(sentence)))
    }

    /// The log, where one is requested.
    fn open_log(&self) -> Result<Option<OpenedLog>, CommandError> {
        let Some(file) = &self.arguments.log else { return Ok(None) };
        let run = (self.run_id, realtime_ns());
        let show = ShowLine::new(self.text, &self.playback, Arithmetic::of(self.scene), &self.solver, run);
        Ok(Some(recording_log::open(file, show, self.scene.team().handles())?))
    }

    /// The log of distributions, where one is requested.
    fn open_histograms(&self) -> Result<Option<HistogramLog>, CommandError> {
        let Some(file) = &self.arguments.histograms else { return Ok(None) };
        let log = HistogramLog::create(file, self.playback.rate, realtime_ns());
        log.map(Some).map_err(|sentence| CommandError::BadInput(format!("--histograms: {sentence}")))
    }

    /// The transports, and the loop's ends of those that have a door for commands.
    fn open_transports(&self, show: &Show) -> Result<(Vec<Box<dyn Transport>>, Doors), CommandError> {
        let stage = convert::stage(self.run_id, realtime_ns(), &self.scene.motion, show);
        let (name, scene, loop_rate) = (&self.common.name, self.scene, self.playback.rate);
        let mut transports = transports::open(&TransportConfig { name, scene, loop_rate, stage })?;
        let mut ports = Vec::new();
        for transport in &mut transports {
            let (port, outer) = door();
            if transport.control(outer)?.is_none() {
                ports.push(port);
            }
        }
        Ok((transports, Doors::new(ports)))
    }

    /// What the loop's thread does first: it requests its scheduling from the system and opens its ends of the
    /// transports.
    fn prepare_loop(&self, mut transports: Vec<Box<dyn Transport>>) -> Result<LoopEnds, CommandError> {
        let awake = self.arguments.scheduling.prepare_thread()?;
        let publishers = transports.iter_mut().map(|transport| transport.publisher()).collect::<Result<_, _>>()?;
        Ok((publishers, transports, awake))
    }

    fn loop_options(&self) -> LoopOptions {
        let rate = self.playback.rate;
        let periods = self.arguments.duration.map(|seconds| LoopOptions::periods_of(seconds, rate));
        LoopOptions { run_id: self.run_id, rate, periods }
    }

    fn collect(
        &self,
        inbox: Inbox,
        mut transports: Vec<Box<dyn Transport>>,
        histograms: &mut Option<HistogramLog>,
        done: &AtomicBool,
    ) -> Result<(Summary, Vec<Box<dyn Transport>>), CommandError> {
        let run = Run {
            run_id: self.run_id,
            rate: self.playback.rate,
            scene: &self.scene.name,
            sinks: transports.iter_mut().map(|transport| transport.status()).collect::<Result<_, _>>()?,
            announce: Box::new(|announcement| self.print_announcement(announcement)),
            record: Box::new(|sample| histograms.iter_mut().for_each(|log| log.record(sample))),
        };
        Ok((statistics::collect(&SystemClock, inbox, run, done), transports))
    }

    /// What a person wants to know at the start, on standard error: standard output is for the summary.
    fn print_start(&self, transports: &[Box<dyn Transport>]) {
        if self.common.quiet || self.common.json {
            return;
        }
        let (scene, playback) = (self.scene, self.playback);
        eprintln!("Scene \"{}\": {} benches, {} handles.", scene.name, scene.team().benches, scene.team().handles());
        eprintln!("Solver {}.", self.solver);
        let scale = if playback.time_scale == 1.0 {
            String::new()
        } else {
            format!(", {} simulated seconds per second", number(playback.time_scale))
        };
        eprintln!("{} frames per second{scale}, from {} s.", number(playback.rate), number(playback.start));
        transports.iter().for_each(|transport| eprintln!("{}", transport.describe()));
        match scene.alerts {
            Some(_) => eprintln!("Ahead, in simulated time:"),
            None => eprintln!("No alerts: contact and stall are not computed. Ahead, in simulated time:"),
        }
        for timed in self.timeline.events() {
            eprintln!("{}", sentence(scene, timed));
        }
        for cue in &self.cues {
            let waits = if cue.pauses { ", waits there" } else { "" };
            eprintln!("  cue {} \"{}\" at {} s{waits}", cue.number, cue.name, number(cue.time));
        }
        if self.playback.paused {
            eprintln!("Waiting at the start: bench-dragon control go");
        }
        if self.timeline.find(EventKind::Contact).is_some_and(|contact| contact.time == 0.0) {
            log::warn!("boards overlap at the start of this scene");
        }
    }

    /// One line an alert, with the countdown in wall time, and one a cue.
    fn print_announcement(&self, announcement: &Announcement) {
        if self.common.quiet || self.common.json {
            return;
        }
        match announcement {
            Announcement::Alert { alert, time_scale } => {
                let Some(level) = alert.alert_level() else { return };
                let colour = Style::new().fg_color(Some(severity_colour(level.severity()).into()));
                let style = if shows_colour(&std::io::stderr()) { colour } else { Style::new() };
                let figures = Figures::Shown { time_scale: *time_scale };
                let sentence = alert_sentence(alert, self.scene.team().benches as u32, figures);
                eprintln!("{:>10.3} s  {style}{:<11}{style:#} {sentence}", alert.sim_time, level.name());
            }
            Announcement::Cue(cue) => {
                eprintln!("{:>10.3} s  {}", cue.sim_time, cue_sentence(cue));
            }
        }
    }

    fn print_summary(
        &self,
        counts: &Counts,
        summary: &Summary,
        deliveries: BTreeMap<String, Deliveries>,
    ) -> Result<(), CommandError> {
        let Counts { frames, overruns, skipped, end } = *counts;
        let Summary { wakeup_ns, step_ns, samples } = *summary;
        let lost_samples = frames - samples;
        let mut output = Output::standard();
        if lost_samples > 0 {
            log::warn!("{lost_samples} frames are missing from the percentiles: the machine left them no time");
        }
        if self.common.json {
            output.json(&RunSummary { frames, overruns, skipped, wakeup_ns, step_ns, end, deliveries })?;
        } else {
            output.line(&format!(
                "{frames} frames published, {overruns} overruns, {skipped} periods skipped (ended by {}).",
                match end {
                    End::Duration => "its duration",
                    End::Signal => "a signal",
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

impl RunArguments {
    fn playback(&self, scene: &Scene) -> Result<Playback, CommandError> {
        let checked = |accepted: Accepted, name, value| accepted.check(name, value).map_err(CommandError::BadInput);
        if let Some(rate) = self.rate {
            checked(Accepted::RATE, "--rate", rate)?;
        }
        checked(Accepted::TIME_SCALE, "--time-scale", self.time_scale)?;
        Ok(Playback {
            start: self.start,
            time_scale: self.time_scale,
            rate: self.rate.unwrap_or(scene.rate),
            at_end: if self.looping { AtEnd::Loop } else { scene.at_end },
            end_hold: self.end_hold.unwrap_or(scene.end_hold),
            paused: self.paused,
            ..Playback::of(scene)
        })
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
