//! `run`: the live publisher.

mod ros2;

use std::collections::hash_map::RandomState;
use std::hash::BuildHasher;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;

use anstyle::Style;
use bench_dragon::live::clock::realtime_ns;
use bench_dragon::live::statistics::{self, Inbox, Run, RunSummary, Summary, TransportCounts};
use bench_dragon::live::{Counts, End, LoopOptions, Publisher, StatusPublisher, run_loop};
use bench_dragon::motion::event::EventKind;
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::scene::{Accepted, AtEnd, Scene};
use bench_dragon::show::{Playback, Show};
use bench_dragon::transports::iceoryx2::{self, OpenError, PublisherConfig, SharedMemoryPublisher, StatusSender};
use bench_dragon::wire::sentence::{Figures, alert_sentence};
use bench_dragon::wire::{CollisionAlert, Stage, convert};

use self::ros2::Ros2;

use super::events::sentence;
use super::realtime_scheduling::RealtimeScheduling;
use super::{
    CommandError, Common, Output, level_colour, number, search_timeline, shows_colour, stop_on_signals, warn_of_gap,
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
    /// Publish ROS 2 topics too, as the scene's [publish.ros2] says or the usual ones
    #[arg(long)]
    ros2: bool,
    #[command(flatten)]
    scheduling: RealtimeScheduling,
    /// End when the process that started this one ends
    #[arg(long, hide = true)]
    end_with_parent: bool,
}

/// Publishes the scene until its duration is over or a signal comes.
pub fn run(common: &Common, arguments: &RunArguments) -> Result<(), CommandError> {
    let scene = common.load_scene()?;
    let playback = arguments.playback(&scene)?;
    iceoryx2::service_name(&common.name, "poses")?;
    let timeline = if scene.alerts.is_some() {
        search_timeline(&scene, common)
    } else {
        let timeline = scene.motion.timeline_without_contact();
        warn_of_gap(&timeline);
        timeline
    };
    let show = Show::new(&scene, timeline, playback).map_err(|error| CommandError::BadInput(error.to_string()))?;
    let stop = stop_on_signals()?;
    if arguments.end_with_parent {
        super::soak::end_with_parent()?;
    }
    let run_id = RandomState::new().hash_one(realtime_ns());
    let (timeline, solver) = (show.timeline().clone(), show.solver_reason().to_owned());
    let session = RunSession { common, arguments, scene: &scene, playback, run_id, timeline, solver };
    session.run(show, &stop)
}

/// All that the threads of a run have in common.
struct RunSession<'a> {
    common: &'a Common,
    arguments: &'a RunArguments,
    scene: &'a Scene,
    playback: Playback,
    run_id: u64,
    timeline: Timeline,
    /// The solver and why it was chosen.
    solver: String,
}

impl RunSession<'_> {
    /// Runs the loop on one thread and the statistics on another.
    fn run(&self, mut show: Show, stop: &Arc<AtomicBool>) -> Result<(), CommandError> {
        iceoryx2::stale_files::spawn_reaper();
        let ros2 = self.open_ros2()?;
        let (reports, inbox) = statistics::queues();
        let done = AtomicBool::new(false);
        let (opened, opening) = mpsc::channel();
        let (over_ros2, ros2_status, end_ros2, ros2_sentence) = match ros2 {
            Some(Ros2 { publisher, status, end, sentence }) => {
                (Some(publisher), Some(status), Some(end), Some(sentence))
            }
            None => (None, None, None, None),
        };
        let ended = std::thread::scope(|threads| {
            let looping = threads.spawn(|| {
                let prepared = self.arguments.scheduling.prepare_thread();
                let ready = prepared.and_then(|awake| Ok((self.open_shared_memory()?, awake)));
                let (publisher, _awake) = match ready {
                    Ok(ready) => ready,
                    Err(error) => {
                        let _ = opened.send(Err(error));
                        return None;
                    }
                };
                let _ = opened.send(Ok(()));
                let mut publishers: Vec<Box<dyn Publisher>> = vec![Box::new(publisher)];
                if let Some(publisher) = over_ros2 {
                    publishers.push(publisher);
                }
                Some(run_loop(&mut show, &mut publishers, self.loop_options(), reports, stop))
            });
            // The thread sends exactly once; should it have died, joining it tells.
            let ready = opening.recv().unwrap_or(Ok(()));
            let summary = ready.and_then(|()| {
                self.print_start(ros2_sentence.as_deref())?;
                let collecting = threads.spawn(|| {
                    // Without statistics the loop would run unseen.
                    self.collect(inbox, ros2_status, &done).inspect_err(|_| stop.store(true, Ordering::Relaxed))
                });
                let outcome = looping.join();
                done.store(true, Ordering::Release);
                let summary = collecting.join().map_err(|_| lost("statistics"))??;
                Ok((outcome.map_err(|_| lost("loop's"))?, summary))
            });
            match summary? {
                (Some(Ok(counts)), summary) => Ok((counts, summary, None)),
                (Some(Err((counts, error))), summary) => Ok((counts, summary, Some(error))),
                (None, _) => Err(lost("loop's")),
            }
        });
        let ros2 = end_ros2.map(|end| end());
        let (counts, summary, error) = ended?;
        self.print_summary(&counts, &summary, ros2)?;
        error.map_or(Ok(()), |error| Err(CommandError::Failed(error.to_string())))
    }

    /// The ROS 2 topics, where the scene or the command line asks for them.
    fn open_ros2(&self) -> Result<Option<Ros2>, CommandError> {
        if !self.arguments.ros2 && self.scene.ros2.is_none() {
            return Ok(None);
        }
        ros2::open(self.scene, &self.common.name, self.playback.rate, self.stage()).map(Some)
    }

    fn stage(&self) -> Stage {
        let scene = self.scene;
        convert::stage(self.run_id, realtime_ns(), &scene.motion)
    }

    fn open_shared_memory(&self) -> Result<SharedMemoryPublisher, CommandError> {
        let scene = self.scene;
        let handles = scene.team().handles();
        Ok(SharedMemoryPublisher::open(&PublisherConfig {
            name: self.common.name.clone(),
            handles,
            queue: self.queue(),
            subscribers: scene.subscribers,
            alerts: scene.alerts.is_some(),
            stage: self.stage(),
        })?)
    }

    fn queue(&self) -> usize {
        self.scene.queue.unwrap_or_else(|| iceoryx2::default_queue(self.scene.team().handles(), self.scene.subscribers))
    }

    fn loop_options(&self) -> LoopOptions {
        let rate = self.playback.rate;
        let periods = self.arguments.duration.map(|seconds| LoopOptions::periods_of(seconds, rate));
        LoopOptions { run_id: self.run_id, rate, periods }
    }

    fn collect(
        &self,
        inbox: Inbox,
        ros2: Option<Box<dyn StatusPublisher + Send>>,
        done: &AtomicBool,
    ) -> Result<Summary, CommandError> {
        let mut sinks: Vec<Box<dyn StatusPublisher>> =
            vec![Box::new(StatusSender::open(&self.common.name, self.scene.subscribers)?)];
        if let Some(status) = ros2 {
            sinks.push(status);
        }
        let run = Run {
            run_id: self.run_id,
            rate: self.playback.rate,
            scene: &self.scene.name,
            sinks,
            announce: Box::new(|alert| self.print_alert(alert)),
        };
        Ok(statistics::collect(inbox, run, done))
    }

    /// What a person wants to know at the start, on standard error: standard output is for the summary.
    fn print_start(&self, ros2: Option<&str>) -> Result<(), CommandError> {
        if self.common.quiet || self.common.json {
            return Ok(());
        }
        let (scene, name, playback) = (self.scene, &self.common.name, self.playback);
        eprintln!("Scene \"{}\": {} benches, {} handles.", scene.name, scene.team().benches, scene.team().handles());
        eprintln!("Solver {}.", self.solver);
        let scale = if playback.time_scale == 1.0 {
            String::new()
        } else {
            format!(", {} simulated seconds per second", number(playback.time_scale))
        };
        eprintln!("{} frames per second{scale}, from {} s.", number(playback.rate), number(playback.start));
        let alerts = if scene.alerts.is_some() { ", /alerts" } else { "" };
        eprintln!(
            "iceoryx2 services: {name}/poses{alerts}, /status, /stage, /tick (queues of {} frames for {} subscribers).",
            self.queue(),
            scene.subscribers
        );
        if let Some(sentence) = ros2 {
            eprintln!("{sentence}");
        }
        match scene.alerts {
            Some(_) => eprintln!("Ahead, in simulated time:"),
            None => eprintln!("No alerts: contact and stall are not computed. Ahead, in simulated time:"),
        }
        for timed in self.timeline.events() {
            eprintln!("{}", sentence(scene, timed));
        }
        if self.timeline.find(EventKind::Contact).is_some_and(|contact| contact.time == 0.0) {
            log::warn!("boards overlap at the start of this scene");
        }
        Ok(())
    }

    /// One line an alert, with the countdown in wall time.
    fn print_alert(&self, alert: &CollisionAlert) {
        let Some(level) = alert.alert_level().filter(|_| !self.common.quiet && !self.common.json) else { return };
        let colour = Style::new().fg_color(Some(level_colour(level.into()).into()));
        let style = if shows_colour(&std::io::stderr()) { colour } else { Style::new() };
        let figures = Figures::Shown { time_scale: self.playback.time_scale };
        let said = alert_sentence(alert, self.scene.team().benches as u32, figures);
        eprintln!("{:>10.3} s  {style}{:<11}{style:#} {said}", alert.sim_time, level.name());
    }

    fn print_summary(
        &self,
        counts: &Counts,
        summary: &Summary,
        ros2: Option<TransportCounts>,
    ) -> Result<(), CommandError> {
        let Counts { frames, overruns, skipped, end } = *counts;
        let Summary { wakeup_ns, step_ns, lost_samples } = *summary;
        let mut output = Output::standard();
        if lost_samples > 0 {
            log::warn!("{lost_samples} frames are missing from the percentiles: the machine left them no time");
        }
        if self.common.json {
            output.json(&RunSummary { frames, overruns, skipped, wakeup_ns, step_ns, end, ros2 })?;
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
            if let Some(TransportCounts { frames, skipped, discarded }) = ros2 {
                output.line(&format!(
                    "  ROS 2: {frames} frames published, {skipped} skipped, {discarded} messages discarded."
                ))?;
            }
        }
        output.finish()
    }
}

/// A thread of this program panicked, which it says itself.
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
            ..Playback::of(scene)
        })
    }
}

impl From<OpenError> for CommandError {
    fn from(error: OpenError) -> Self {
        match error {
            OpenError::Name { .. } => Self::BadInput(error.to_string()),
            _ => Self::Failed(error.to_string()),
        }
    }
}
