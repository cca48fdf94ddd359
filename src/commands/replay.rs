//! `replay`: plays a recording like a live publisher.

use std::path::PathBuf;

use bench_dragon::client::clock::realtime_ns;
use bench_dragon::client::shared_memory::service_name;
use bench_dragon::messages::sentence::rounded;
use bench_dragon::messages::{Stage, StageMessage};
use bench_dragon::publisher::live::End;
use bench_dragon::publisher::run::{Hooks, Publishing, open_transports};
use bench_dragon::publisher::transports::{Transport, TransportConfig};
use bench_dragon::recording::mcap::ReadError;
use bench_dragon::recording::replay::{Pace, Prepared, ReplayOptions};
use bench_dragon::ros2_messages::settings::Topic;
use bench_dragon::show::scene::{Accepted, Scene};
use jiff::{Timestamp, Unit};

use super::publishing::{Ends, new_run_id, print_summary, publish};
use super::realtime_scheduling::RealtimeScheduling;
use super::ros_args::UseSimTime;
use super::ros2_process::{Ros2Process, Ros2Request, Ros2Show};
use super::{CommandError, Common, number, stop_on_signals};

/// The time, in nanoseconds, that waiting subscribers have before the first frame, which, unlike a show's, is not sent
/// again.
const LEAD_NS: u64 = 500_000_000;
/// The most cues for which memory is reserved, whatever a damaged stage states.
const MOST_CUES: usize = 1000;

/// Arguments of `replay`.
#[derive(Debug, clap::Args)]
pub struct ReplayArguments {
    /// The recording (MCAP) to play, or the directory that `ros2 bag record` wrote
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Send the frames evenly at this rate, instead of at their recorded times
    #[arg(
        long,
        value_name = "HZ",
        help_heading = "The show",
        conflicts_with = "time_scale",
        allow_negative_numbers = true
    )]
    rate: Option<f64>,
    /// Playback speed, as a factor of the recorded speed
    #[arg(long, value_name = "X", default_value_t = 1.0, help_heading = "The show", allow_negative_numbers = true)]
    time_scale: f64,
    /// Begin with the first frame of the recording at or after this simulated time
    #[arg(
        long,
        value_name = "TIME",
        value_parser = super::seconds,
        help_heading = "The show",
        allow_negative_numbers = true
    )]
    start: Option<f64>,
    /// Wall time after which to end: 60, 90s, 1:30, 1h30m
    #[arg(long, value_name = "TIME", value_parser = super::wall_seconds, help_heading = "The show")]
    duration: Option<f64>,
    /// Begin again whenever the recording has ended
    #[arg(long = "loop", help_heading = "The show")]
    looping: bool,
    /// Publish ROS 2 topics too, those of --scene's [publish.ros2], or of the recorded scene, or the default ones
    #[arg(long)]
    ros2: bool,
    #[command(flatten)]
    use_sim_time: UseSimTime,
    #[command(flatten)]
    scheduling: RealtimeScheduling,
}

/// Plays the recording until it is over, its duration is, or a signal comes.
pub fn replay(common: &Common, arguments: &ReplayArguments) -> Result<(), CommandError> {
    let options = arguments.options()?;
    let mut scene = common.load_scene()?;
    if arguments.ros2 {
        scene.ros2.get_or_insert_default();
    }
    // A recording executes no commands.
    scene.ros2.iter_mut().for_each(|settings| settings.control = false);
    arguments.use_sim_time.apply(scene.ros2.as_mut())?;
    service_name(common.name(), "poses")?;
    let shown = arguments.file.display().to_string();
    let refused = |error: ReadError| CommandError::BadInput(format!("{shown}: {error}"));
    let prepared = Prepared::open(&arguments.file, options).map_err(refused)?;
    let rate = Accepted::RATE
        .check("the rate of the replay", prepared.rate())
        .map_err(|error| CommandError::BadInput(format!("{shown}: {error}: choose another --rate or --time-scale")))?;
    let show = Ros2Show {
        loop_rate: prepared.rate(),
        alerts: prepared.contents().topics.contains(&Topic::Alerts),
        cues: prepared.contents().stage.stage.cues as usize,
    };
    let ros2 = scene.ros2.as_ref().map(|settings| Ros2Request::of(common, settings, show, true)).transpose()?;
    let stop = stop_on_signals()?;
    let run_id = new_run_id();
    let stem = || arguments.file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let of = prepared.contents().scene.clone().unwrap_or_else(stem);
    let StageMessage { stage: recorded, segments } = prepared.contents().stage.clone();
    let stage = StageMessage { stage: Stage { run_id, stamp_ns: realtime_ns(), ..recorded }, segments };
    let (transports, queues) = open_transports(&config(common, &scene, &prepared, &stage))?;
    let start = start_lines(&shown, &of, &prepared);
    let (mut frames, reading) = prepared.begin()?;
    let process = ros2.as_ref().map(Ros2Process::start).transpose()?;
    let publishing = Publishing {
        scheduling: arguments.scheduling.scheduling(),
        run_id,
        rate,
        duration: arguments.duration,
        scene: &format!("replay of {of}"),
        lead_ns: LEAD_NS,
        awaited: process.as_ref().map(Ros2Process::connected),
    };
    let print_start = |transports: &[Box<dyn Transport>]| {
        if !common.quiet && !common.json {
            eprintln!("{start}");
            transports.iter().for_each(|transport| eprintln!("{}", transport.describe()));
            ros2.iter().for_each(|ros2| eprintln!("{}", ros2.description));
        }
    };
    let hooks = Hooks {
        opened: Box::new(print_start),
        announce: Box::new(|_| ()),
        sample: Box::new(|_| ()),
        alive: Box::new(|| ()),
        ended: Box::new(|_| ()),
    };
    let ends = Ends { transports, queues };
    let mut published = publish(common, &stage.stage, &publishing, &mut frames, ends, &stop, hooks)?;
    published.transport_counters.extend(process.and_then(Ros2Process::finish).map(|of| ("ros2".to_owned(), of)));
    let (waited, failure) = reading.finish();
    if waited > 0 {
        log::warn!("in {waited} periods a frame was due that had not been read from the disk: it went out later");
    }
    if failure.is_some() && published.counts.end == End::Recording {
        published.counts.end = End::Error;
    }
    print_summary(&published, common)?;
    match (published.error, failure) {
        (Some(error), _) => Err(CommandError::Failed(error.to_string())),
        (None, Some(error)) => Err(refused(error)),
        (None, None) => Ok(()),
    }
}

impl ReplayArguments {
    fn options(&self) -> Result<ReplayOptions, CommandError> {
        let pace = match self.rate {
            Some(rate) => Pace::Even(Accepted::RATE.check("--rate", rate)?),
            None => Pace::Recorded(Accepted::TIME_SCALE.check("--time-scale", self.time_scale)?),
        };
        if let Some(start) = self.start.filter(|start| !start.is_finite()) {
            return Err(CommandError::BadInput(format!("--start is {}, expected simulated seconds", number(start))));
        }
        Ok(ReplayOptions { pace, start: self.start, looping: self.looping })
    }
}

/// Returns the transports' settings: the topics of the recording, with the scene's settings.
fn config<'a>(
    common: &'a Common,
    scene: &'a Scene,
    prepared: &'a Prepared,
    stage: &'a StageMessage,
) -> TransportConfig<'a> {
    let contents = prepared.contents();
    TransportConfig {
        handles: contents.ends[0].handles as usize,
        alerts: contents.topics.contains(&Topic::Alerts),
        cues: (stage.stage.cues as usize).min(MOST_CUES),
        scene: contents.scene_text.as_deref().unwrap_or(""),
        ..TransportConfig::of(common.name(), scene, stage)
    }
}

/// Returns the description of the recording.
fn start_lines(file: &str, scene: &str, prepared: &Prepared) -> String {
    let contents = prepared.contents();
    let [first, _] = contents.ends;
    let recorded = i128::from(first.stamp_ns);
    let recorded = Timestamp::from_nanosecond(recorded).and_then(|stamp| stamp.round(Unit::Second));
    let recorded = recorded.map_or(String::new(), |stamp| format!(" of {stamp}"));
    let frames = contents.frames.map_or(String::new(), |frames| format!("{frames} frames in "));
    let topics: Vec<_> = contents.topics.iter().map(|topic| topic.name()).collect();
    format!(
        "Replay of \"{scene}\" from {file}, the recording of \"{}\"{recorded}: {frames}{} s, {} handles; {}.\n\
         {} periods per second, from {} s.",
        contents.name,
        rounded(contents.seconds(), 3),
        first.handles,
        topics.join(", "),
        rounded(prepared.rate(), 6),
        number(prepared.start()),
    )
}
