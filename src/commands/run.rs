//! `run`: the live publisher.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use bench_dragon::client::clock::realtime_ns;
use bench_dragon::client::shared_memory::service_name;
use bench_dragon::messages::sentence;
use bench_dragon::messages::state::EventKind;
use bench_dragon::motion::event::unreported;
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::publisher::live::show_source::ShowSource;
use bench_dragon::publisher::live::statistics::histogram_log::HistogramLog;
use bench_dragon::publisher::log::arithmetic::Arithmetic;
use bench_dragon::publisher::log::lines::ShowLine;
use bench_dragon::publisher::log::{self as recording_log, LogOutcome};
use bench_dragon::publisher::run::{Hooks, Publishing, open_transports};
use bench_dragon::publisher::transports::{Transport, TransportConfig};
use bench_dragon::show::convert;
use bench_dragon::show::results::event_sentence;
use bench_dragon::show::scene::{Accepted, AtEnd, Scene, SceneText};
use bench_dragon::show::{Playback, ReachedCue, Show};

use super::parent::Parent;
use super::publishing::{Ends, new_run_id, print_summary, publish};
use super::realtime_scheduling::RealtimeScheduling;
use super::ros_args::UseSimTime;
use super::ros2_process::{Ros2Process, Ros2Request, Ros2Show};
use super::{CommandError, Common, number, search_timeline, stop_on_signals, warn_of_doubts, warn_of_gap};

/// The time, in nanoseconds, that waiting subscribers have before the first frame: each tries to connect every 20 ms.
const LEAD_NS: u64 = 100_000_000;

/// Arguments of `run`.
#[derive(Debug, clap::Args)]
pub struct RunArguments {
    /// The rate in frames per second; by default the scene's
    #[arg(long, value_name = "HZ", help_heading = "The show", allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Simulated seconds per second of wall time
    #[arg(long, value_name = "X", default_value_t = 1.0, help_heading = "The show", allow_negative_numbers = true)]
    time_scale: f64,
    /// Simulated time at which the show begins
    #[arg(
        long,
        value_name = "TIME",
        value_parser = super::seconds,
        default_value_t = 0.0,
        help_heading = "The show",
        allow_negative_numbers = true
    )]
    start: f64,
    /// Wall time after which to end: 60, 90s, 1:30, 1h30m
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
    /// Offer ROS 2 services that conduct the show, to every node that discovers this one; needs --ros2 or [publish.ros2]
    #[arg(long)]
    ros2_control: bool,
    #[command(flatten)]
    use_sim_time: UseSimTime,
    #[command(flatten)]
    scheduling: RealtimeScheduling,
    #[command(flatten)]
    parent: Parent,
}

/// Publishes the scene until its duration is over or a signal comes.
pub fn run(common: &Common, arguments: &RunArguments) -> Result<(), CommandError> {
    arguments.parent.watch()?;
    let text = common.scene_text()?;
    let mut scene = text.parse()?;
    warn_of_doubts(&scene);
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
    arguments.use_sim_time.apply(scene.ros2.as_mut())?;
    let playback = arguments.playback(&scene)?;
    service_name(common.name(), "poses")?;
    let show = Ros2Show { loop_rate: playback.rate, alerts: scene.alerts.is_some(), cues: scene.cues.len() };
    let ros2 = scene.ros2.as_ref().map(|settings| Ros2Request::of(common, settings, show, false)).transpose()?;
    let timeline = if scene.alerts.is_some() {
        search_timeline(&scene, common)
    } else {
        let timeline = scene.ensemble.timeline_without_contact(&mut unreported);
        warn_of_gap(&timeline);
        timeline
    };
    let show =
        Show::new(&scene, timeline, playback).map_err(|error| CommandError::BadInput(format!("--start: {error}")))?;
    let stop = stop_on_signals()?;
    let run_id = new_run_id();
    for name in show.missing_cues() {
        log::warn!("cue \"{name}\" has no time in this show: its event does not happen, or too early");
    }
    let (timeline, solver) = (show.timeline().clone(), show.solver_reason().to_owned());
    let cues = show.cues().to_vec();
    let session =
        RunSession { common, arguments, text: &text, scene: &scene, playback, run_id, timeline, cues, solver, ros2 };
    session.run(show, &stop)
}

/// The log as a transport, and its result.
type OpenedLog = (Box<dyn Transport>, LogOutcome);

/// The settings of a run.
struct RunSession<'a> {
    common: &'a Common,
    arguments: &'a RunArguments,
    text: &'a SceneText,
    scene: &'a Scene,
    playback: Playback,
    run_id: u64,
    timeline: Timeline,
    cues: Vec<ReachedCue>,
    /// The solver and the reason for its choice.
    solver: String,
    /// The process of ROS 2, if requested.
    ros2: Option<Ros2Request>,
}

impl RunSession<'_> {
    /// Opens the transports, publishes, and prints the summary.
    fn run(&self, show: Show, stop: &AtomicBool) -> Result<(), CommandError> {
        let scene_hash = bench_dragon::proof::scene_hash(&self.text.text);
        let stage = convert::stage(self.run_id, realtime_ns(), scene_hash, &self.scene.ensemble, &show);
        let config =
            TransportConfig { scene: &self.text.text, ..TransportConfig::of(self.common.name(), self.scene, &stage) };
        let (mut transports, queues) = open_transports(&config)?;
        // The last transport, so that the log has only published frames.
        let log = self.open_log()?.map(|(transport, outcome)| {
            transports.push(transport);
            outcome
        });
        let mut histograms = self.open_histograms()?;
        let ros2 = self.ros2.as_ref().map(Ros2Process::start).transpose()?;
        let publishing = Publishing {
            scheduling: self.arguments.scheduling.scheduling(),
            run_id: self.run_id,
            rate: self.playback.rate,
            duration: self.arguments.duration,
            scene: &self.scene.name,
            lead_ns: LEAD_NS,
            awaited: ros2.as_ref().map(Ros2Process::connected),
        };
        let mut source = ShowSource::new(show);
        let hooks = Hooks {
            opened: Box::new(|transports| self.print_start(transports)),
            announce: Box::new(|_| ()),
            sample: Box::new(|sample| histograms.iter_mut().for_each(|log| log.record(sample))),
            alive: Box::new(|| ()),
            ended: Box::new(|counts| log.iter().for_each(|log| log.ended(counts))),
        };
        let ends = Ends { transports, queues };
        let mut published = publish(self.common, &stage.stage, &publishing, &mut source, ends, stop, hooks)?;
        published.transport_counters.extend(ros2.and_then(Ros2Process::finish).map(|of| ("ros2".to_owned(), of)));
        print_summary(&published, self.common)?;
        let log_failure = log.and_then(|outcome| outcome.failure());
        let failure = published.error.map(|error| error.to_string()).or(log_failure);
        let failure = failure.or(histograms.and_then(HistogramLog::finish));
        failure.map_or(Ok(()), |sentence| Err(CommandError::Failed(sentence)))
    }

    /// Opens the log, if requested.
    fn open_log(&self) -> Result<Option<OpenedLog>, CommandError> {
        let Some(file) = &self.arguments.log else { return Ok(None) };
        let (arithmetic, stamp_ns) = (Arithmetic::of(self.scene), realtime_ns());
        let show = ShowLine::new(self.text, &self.playback, arithmetic, &self.solver, self.run_id, stamp_ns);
        Ok(Some(recording_log::open(file, show, self.scene.ensemble.handles())?))
    }

    /// Opens the log of distributions, if requested.
    fn open_histograms(&self) -> Result<Option<HistogramLog>, CommandError> {
        let Some(file) = &self.arguments.histograms else { return Ok(None) };
        let log = HistogramLog::create(file, self.playback.rate, realtime_ns());
        let refused =
            |error| CommandError::BadInput(format!("--histograms: {}", sentence::not_writable(file.display(), &error)));
        log.map(Some).map_err(refused)
    }

    /// Prints the description of the run on standard error: standard output is for the summary.
    fn print_start(&self, transports: &[Box<dyn Transport>]) {
        if self.common.quiet || self.common.json {
            return;
        }
        let (scene, playback) = (self.scene, self.playback);
        eprintln!(
            "Scene \"{}\": {} benches, {} handles.",
            scene.name,
            scene.ensemble.benches(),
            scene.ensemble.handles()
        );
        eprintln!("Solver {}.", self.solver);
        let scale = if playback.time_scale == 1.0 {
            String::new()
        } else {
            format!(", {} simulated seconds per second", number(playback.time_scale))
        };
        eprintln!("{} frames per second{scale}, from {} s.", number(playback.rate), number(playback.start));
        transports.iter().for_each(|transport| eprintln!("{}", transport.describe()));
        self.ros2.iter().for_each(|ros2| eprintln!("{}", ros2.description));
        match scene.alerts {
            Some(_) => eprintln!("Ahead, in simulated time:"),
            None => eprintln!("No alerts: contact and stall are not computed. Ahead, in simulated time:"),
        }
        for timed in &self.timeline.all() {
            eprintln!("{}", event_sentence(scene, timed));
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
        if self.timeline.find(EventKind::Obstacle).is_some_and(|touch| touch.time == 0.0) {
            log::warn!("a board is within the keep-out of an obstacle at the start of this scene");
        }
    }
}

impl RunArguments {
    fn playback(&self, scene: &Scene) -> Result<Playback, CommandError> {
        if let Some(rate) = self.rate {
            Accepted::RATE.check("--rate", rate)?;
        }
        Accepted::TIME_SCALE.check("--time-scale", self.time_scale)?;
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
