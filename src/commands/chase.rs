//! `chase`: makes a running show follow timecode, or a performer with a tracker.

use std::cell::RefCell;
use std::net::{Ipv4Addr, SocketAddrV4};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::Duration;

use bench_dragon::chase::artnet;
use bench_dragon::chase::live::{Chase, ChaseError, Leader, Notice, TimecodeLeader, TrackerLeader};
use bench_dragon::chase::psn::USUAL_GROUP;
use bench_dragon::chase::schedule::Schedule;
use bench_dragon::chase::sources::{self, Input, SourceError};
use bench_dragon::chase::status::ChaseStatusError;
use bench_dragon::chase::timecode::{FrameRate, Label};
use bench_dragon::chase::track::Track;
use bench_dragon::client::connection::Wake;
use bench_dragon::client::feed::{Delivery, Feed, FeedEvent, FeedOptions};
use bench_dragon::client::polling::poll_until;
use bench_dragon::messages::ChaseStatus;
use bench_dragon::messages::chase::{ChaseSource, ChaseState};
use bench_dragon::messages::json::ChaseObject;
use bench_dragon::messages::sentence::{Expected, chase_sentence};
use bench_dragon::motion::Motion;
use bench_dragon::outputs::send::axes::Axes;
use bench_dragon::proof::scene_hash;
use bench_dragon::show::scene::{Scene, SceneText};

use super::scene_argument::scene_argument;
use super::{CommandError, Common, Output, expect_exact_motion, stop_on_signals, wall_seconds};

/// The interval of polls for the scene of a show.
const SCENE_INTERVAL: Duration = Duration::from_millis(50);

/// Arguments of `chase`.
#[derive(Debug, Clone, clap::Args)]
pub struct ChaseArguments {
    #[command(subcommand)]
    kind: Kind,
}

#[derive(Debug, Clone, clap::Subcommand)]
enum Kind {
    /// Timecode over the network: ArtTimeCode of Art-Net
    Artnet {
        /// The address to listen at; other programs of this machine may listen too
        #[arg(long, value_name = "ADDR:PORT", default_value_t = SocketAddrV4::new(Ipv4Addr::UNSPECIFIED, artnet::PORT))]
        listen: SocketAddrV4,
        /// The StreamId to follow; without it 0, or the first stream that comes if there is no stream 0
        #[arg(long, value_name = "N")]
        stream: Option<u8>,
        #[command(flatten)]
        timecode: TimecodeArguments,
    },
    /// MIDI timecode: quarter frames and full frames
    Mtc {
        /// A raw MIDI device such as /dev/snd/midiC1D0, or - for standard input
        device: PathBuf,
        #[command(flatten)]
        timecode: TimecodeArguments,
    },
    /// Linear timecode as sound, as arecord or a file has it
    Ltc {
        /// A WAV file, or - for standard input
        file: PathBuf,
        /// The channel with timecode, counted from 1; without it, the channel that has it is found
        #[arg(long, value_name = "N")]
        channel: Option<usize>,
        #[command(flatten)]
        timecode: TimecodeArguments,
    },
    /// A performer with a tracker, by PosiStageNet; without --scene the show's own scene gives the path
    #[command(arg = scene_argument())]
    Psn(PsnArguments),
}

/// The options of every timecode.
#[derive(Debug, Clone, clap::Args)]
struct TimecodeArguments {
    #[command(flatten)]
    schedule: ScheduleArguments,
    /// The time for which the show continues when timecode stops, before it is paused
    #[arg(long, value_name = "TIME", default_value = "2s", value_parser = wall_seconds)]
    freewheel: f64,
    /// The frame rate: auto, 23.976, 24, 25, 29.97, 29.97df or 30
    #[arg(long, value_name = "RATE", default_value = "auto", value_parser = fps)]
    fps: Fps,
}

/// The options of every timecode, followed or sent.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct ScheduleArguments {
    /// The label of simulated time 0
    #[arg(long, value_name = "HH:MM:SS:FF", default_value = "00:00:00:00")]
    offset: Label,
    /// Simulated seconds per second of timecode
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = speed, allow_negative_numbers = true)]
    speed: f64,
}

impl ScheduleArguments {
    /// Returns the schedule, whose offset is a label of the rate.
    ///
    /// # Errors
    /// Bad input: the offset names no frame.
    pub fn schedule(self, rate: Option<FrameRate>) -> Result<Schedule, CommandError> {
        let Self { offset, speed } = self;
        if let Some(rate) = rate.filter(|rate| rate.frame(offset).is_none()) {
            let sentence =
                format!("--offset {offset} is no label at {rate} frames per second, expected one that exists");
            return Err(CommandError::BadInput(sentence));
        }
        Ok(Schedule { offset, speed })
    }
}

/// A frame rate, or that of the source.
#[derive(Debug, Clone, Copy)]
struct Fps(Option<FrameRate>);

/// Arguments of `chase psn`.
#[derive(Debug, Clone, clap::Args)]
struct PsnArguments {
    /// The number of the tracker that the head follows
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..))]
    tracker: u16,
    /// The multicast group, or an address of this machine; the default port is 56565
    #[arg(long, value_name = "ADDR[:PORT]", default_value_t = usual_group(), value_parser = group)]
    group: SocketAddrV4,
    /// The address of this machine's interface to listen at; without it, the machine's routes decide
    #[arg(long, value_name = "IP")]
    interface: Option<Ipv4Addr>,
    /// The stage's axes for the sender's x, y and z, written as in `send psn --axes`
    #[arg(long, value_name = "X,Y,Z", default_value_t = Axes::default(), allow_hyphen_values = true)]
    axes: Axes,
    /// The dragon whose head follows the tracker, in a show of several
    #[arg(long, value_name = "NAME")]
    dragon: Option<String>,
    /// The time for which the show continues when the tracker is not seen, before it is paused
    #[arg(long, value_name = "TIME", default_value = "2s", value_parser = wall_seconds)]
    freewheel: f64,
}

fn usual_group() -> SocketAddrV4 {
    SocketAddrV4::new(USUAL_GROUP.0, USUAL_GROUP.1)
}

fn group(text: &str) -> Result<SocketAddrV4, Expected> {
    let address = text.parse().or_else(|_| text.parse().map(|address| SocketAddrV4::new(address, USUAL_GROUP.1)));
    address.map_err(|_| Expected("an IPv4 address such as 236.10.10.10 or 127.0.0.1:56565".into()))
}

fn speed(text: &str) -> Result<f64, Expected> {
    let speed = text.trim().parse::<f64>().ok().filter(|speed| (1e-3..=1e3).contains(speed));
    speed.ok_or(Expected("simulated seconds a second of timecode, from 0.001 to 1000".into()))
}

fn fps(text: &str) -> Result<Fps, Expected> {
    if text == "auto" { Ok(Fps(None)) } else { text.parse().map(|rate| Fps(Some(rate))) }
}

/// Chases until a signal comes, or until the source has ended.
pub fn chase(common: &Common, arguments: &ChaseArguments) -> Result<(), CommandError> {
    let stop = stop_on_signals()?;
    match &arguments.kind {
        Kind::Artnet { listen, stream, timecode } => {
            let inputs = sources::artnet(*listen, &stop)?;
            let leader = Leader::Timecode(timecode.leader(ChaseSource::ArtNet)?.of_stream(*stream));
            follow(common, &stop, ChaseSource::ArtNet, leader, inputs, &format!("ArtTimeCode at {listen}"))
        }
        Kind::Mtc { device, timecode } => {
            let leader = Leader::Timecode(timecode.leader(ChaseSource::Mtc)?);
            let inputs = sources::mtc(device)?;
            follow(common, &stop, ChaseSource::Mtc, leader, inputs, &format!("MIDI timecode of {}", device.display()))
        }
        Kind::Ltc { file, channel, timecode } => {
            let leader = Leader::Timecode(timecode.leader(ChaseSource::Ltc)?);
            let inputs = sources::ltc(file, *channel)?;
            follow(common, &stop, ChaseSource::Ltc, leader, inputs, &format!("LTC of {}", file.display()))
        }
        Kind::Psn(arguments) => psn(common, arguments, &stop),
    }
}

impl TimecodeArguments {
    fn leader(&self, source: ChaseSource) -> Result<TimecodeLeader, CommandError> {
        let Self { schedule, freewheel, fps: Fps(rate) } = *self;
        Ok(TimecodeLeader::new(source, schedule.schedule(rate)?, rate, freewheel))
    }
}

/// Returns the text of --scene, or else of the show's own scene, for which a publisher is waited for; `None` if a
/// signal comes first.
fn scene_text(common: &Common, stop: &AtomicBool) -> Result<Option<SceneText>, CommandError> {
    if common.scene.is_some() {
        return common.scene_text().map(Some);
    }
    let mut feed = Feed::new(common.name(), FeedOptions { wake: Wake::Never, frames: Delivery::Newest })?;
    let mut found = None;
    while found.is_none() && !stop.load(Ordering::Relaxed) {
        feed.poll(SCENE_INTERVAL, &mut |event| {
            if let FeedEvent::Scene { text, .. } = event {
                found = Some(text.to_owned());
            }
        })?;
    }
    if found.as_ref().is_some_and(String::is_empty) {
        let sentence = format!(
            "the show \"{}\" does not send its scene, expected --scene with the scene of the show: its path is needed",
            common.name()
        );
        return Err(CommandError::BadInput(sentence));
    }
    let file = format!("the scene of \"{}\"", common.name());
    Ok(found.map(|text| SceneText { text, file, stem: common.name().to_owned() }))
}

/// Returns the motion of the head that the tracker is at, and its delay in the show.
fn followed(scene: &Scene, dragon: Option<&str>) -> Result<(Motion, f64), CommandError> {
    let refused = |sentence: String| Err(CommandError::BadInput(sentence));
    let dragons = scene.ensemble.dragons();
    match (scene.ensemble.only(), dragon) {
        (Some(motion), None) => Ok((motion.clone(), 0.0)),
        (Some(_), Some(name)) => {
            refused(format!("--dragon names {name} and the scene has one dragon, expected no --dragon"))
        }
        (None, name) => match dragons.iter().find(|dragon| Some(dragon.name.as_str()) == name) {
            Some(dragon) => Ok((dragon.motion.clone(), dragon.delay)),
            None => {
                let names: Vec<&str> = dragons.iter().map(|dragon| dragon.name.as_str()).collect();
                let names = names.join(", ");
                refused(format!(
                    "the scene has several dragons, expected --dragon with one of {names}: a tracker is at one head"
                ))
            }
        },
    }
}

fn psn(common: &Common, arguments: &PsnArguments, stop: &Arc<AtomicBool>) -> Result<(), CommandError> {
    let PsnArguments { tracker, group, interface, axes, ref dragon, freewheel } = *arguments;
    let Some(text) = scene_text(common, stop)? else { return Ok(()) };
    let scene_hash = scene_hash(&text.text);
    let scene = text.parse()?;
    expect_exact_motion(&scene)?;
    let (motion, delay) = followed(&scene, dragon.as_deref())?;
    let inputs = sources::psn(group, interface, tracker, stop)?;
    let to_stage = Box::new(move |position| {
        let [x, y, _up] = axes.stage(position);
        [x, y]
    });
    let leader = TrackerLeader { tracker, track: Track::new(motion, delay, freewheel), to_stage, scene_hash };
    let what = format!("tracker {tracker} of PosiStageNet at {group}");
    follow(common, stop, ChaseSource::Psn, Leader::Tracker(leader), inputs, &what)
}

fn follow(
    common: &Common,
    stop: &AtomicBool,
    source: ChaseSource,
    leader: Leader,
    inputs: Receiver<Input>,
    what: &str,
) -> Result<(), CommandError> {
    // True once the source has ended, and the latest state.
    let state = RefCell::new((false, ChaseState::Silent));
    let (mut printed, mut other_scene) = (Ok(()), false);
    let mut notify = |notice: Notice| {
        let (has_ended, latest) = &mut *state.borrow_mut();
        match notice {
            Notice::Changed(status) => {
                *latest = status.chase_state().unwrap_or(ChaseState::Silent);
                if printed.is_ok() {
                    printed = print(common, &status);
                }
            }
            Notice::End => *has_ended = true,
            Notice::OtherScene => other_scene = true,
        }
        // A source that has ended steers nothing: neither a show that has been paused at its end, nor one for which the
        // chase waits.
        let steers = match latest {
            ChaseState::Locked | ChaseState::Freewheeling | ChaseState::Standing | ChaseState::Backward => true,
            ChaseState::Silent | ChaseState::Locking | ChaseState::Lost => false,
            ChaseState::Held | ChaseState::Paused | ChaseState::Sought | ChaseState::Ended => false,
        };
        let is_over = *has_ended && !steers;
        stop.fetch_or(is_over || other_scene || printed.is_err(), Ordering::Relaxed);
    };
    let mut chase = Chase::new(common.name(), source, leader, inputs, &mut notify)?;
    if !common.json {
        let mut output = Output::standard();
        output.line(&format!("\"{}\" follows {what}. Ctrl-C ends.", common.name()))?;
        output.finish()?;
    }
    let polled = poll_until(stop, &common.names, Delivery::Newest, &mut chase);
    let last = chase.finish();
    polled?;
    printed?;
    if other_scene {
        let sentence = format!(
            "the show \"{}\" plays another scene than --scene, expected the scene of the show: its path is needed",
            common.name()
        );
        return Err(CommandError::BadInput(sentence));
    }
    print(common, &last)
}

/// Prints a status.
fn print(common: &Common, status: &ChaseStatus) -> Result<(), CommandError> {
    let mut output = Output::standard();
    if common.json {
        output.json(&ChaseObject::from(status))?;
    } else {
        output.line(&chase_sentence(status))?;
    }
    output.finish()
}

impl From<SourceError> for CommandError {
    fn from(error: SourceError) -> Self {
        match error {
            SourceError::Listen { ref source, .. } if source.kind() != std::io::ErrorKind::AddrNotAvailable => {
                Self::Failed(error.to_string())
            }
            _ => Self::BadInput(error.to_string()),
        }
    }
}

impl From<ChaseError> for CommandError {
    fn from(error: ChaseError) -> Self {
        match error {
            ChaseError::Status(ChaseStatusError::Open(error)) => error.into(),
            other => Self::Failed(other.to_string()),
        }
    }
}
