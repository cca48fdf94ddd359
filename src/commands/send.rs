//! `send`: sends a running publisher's dragon to other machines. Each kind is a separate process.

#[cfg(feature = "ros2")]
mod ros2;
mod timecode;

use std::net::{Ipv4Addr, SocketAddrV4};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use bench_dragon::client::feed::Delivery;
use bench_dragon::client::polling::poll_until;
use bench_dragon::messages::sentence::Expected;
use bench_dragon::outputs::send::axes::Axes;
use bench_dragon::outputs::send::network::{DestinationError, NetworkError, Outlet, Route, destination};
use bench_dragon::outputs::send::osc::{Addresses, Packing};
use bench_dragon::outputs::send::osc_map::OscMap;
use bench_dragon::outputs::send::osc_sender::{MOST_RATE, OscOptions, OscSender, OscSenders};
use bench_dragon::outputs::send::psn_sender::{Notice, PsnOptions, PsnSender, USUAL_ADDRESS, USUAL_PORT, USUAL_RATE};
use bench_dragon::outputs::send::trackers::{Numbers, Selection};

use super::parent::Parent;
use super::ros_args::UseSimTime;
use super::scene_argument::scene_argument;
use super::{CommandError, Common, Output, number, stop_on_signals};

/// Arguments of `send`.
#[derive(Debug, Clone, clap::Args)]
pub struct SendArguments {
    #[command(subcommand)]
    kind: Kind,
}

#[derive(Debug, Clone, clap::Subcommand)]
enum Kind {
    /// PosiStageNet 2.03 for lighting desks and media servers: handles as trackers
    Psn(PsnArguments),
    /// OSC messages for show control: alerts, countdown, state, cues, the head
    Osc(OscArguments),
    /// Timecode of which the show is the master: over the network, by MIDI, or as sound
    Timecode(timecode::TimecodeArguments),
    /// ROS 2 topics, and with --control services that conduct the show; the settings are those of the show's scene, or
    /// of --scene
    #[command(arg = scene_argument())]
    Ros2(Ros2Arguments),
}

/// Arguments of `send psn`.
#[derive(Debug, Clone, clap::Args)]
struct PsnArguments {
    /// The multicast group, or one desk; the default port is 56565
    #[arg(long, value_name = "ADDR[:PORT]", default_value = USUAL_ADDRESS, value_parser = psn_destination)]
    to: SocketAddrV4,
    /// The address of this machine's interface to send by; without it, the machine's routes decide
    #[arg(long, value_name = "IP")]
    interface: Option<Ipv4Addr>,
    /// The handles of each dragon to send, counted from 1: all, head, tail, 1,2,9 or head,20-40
    #[arg(long, value_name = "WHICH", default_value = "all")]
    trackers: Selection,
    /// The stage's axes for the desk's x, y and z: x, y (into the depth) and up, in any order; a minus reverses one
    #[arg(long, value_name = "X,Y,Z", default_value_t = Axes::default(), allow_hyphen_values = true)]
    axes: Axes,
    /// The number of networks that multicast may pass, including this one
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=255))]
    ttl: u32,
    /// The greatest rate in frames per second, up to 250; a slower publisher is sent at its own rate
    #[arg(long, value_name = "HZ", default_value_t = USUAL_RATE, value_parser = rate::<250>)]
    rate: f64,
    /// The tracker number of the head, of the first dragon if there are several
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..))]
    first_id: u16,
    /// The distance between the tracker numbers of the heads of several publishers, or of several dragons of one
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u16).range(1..))]
    id_step: u16,
    /// The name under which desks list this sender; without it, the publisher's, or bench-dragon for several
    #[arg(long, value_name = "S", value_parser = system_name)]
    system_name: Option<String>,
}

/// Arguments of `send osc`.
#[derive(Debug, Clone, clap::Args)]
struct OscArguments {
    /// The destinations: any number of hosts
    #[arg(long, value_name = "HOST:PORT", required = true, num_args = 1.., value_parser = osc_destination)]
    to: Vec<SocketAddrV4>,
    /// The address of this machine's interface to send by; without it, the machine's routes decide
    #[arg(long, value_name = "IP")]
    interface: Option<Ipv4Addr>,
    /// The greatest rate in bundles of frames per second, up to 60; a slower publisher is sent at its own rate
    #[arg(long, value_name = "HZ", default_value_t = f64::from(MOST_RATE), value_parser = rate::<MOST_RATE>)]
    rate: f64,
    /// Send each message by itself in place of bundles, for receivers that read none; both would start a cue twice
    #[arg(long)]
    messages: bool,
    /// A file (TOML) with addresses and arguments of cues, levels and events, which are sent in place of all others
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
}

/// Arguments of `send ros2`.
#[derive(Debug, Clone, clap::Args)]
struct Ros2Arguments {
    /// Offer services that conduct the show, to every node that discovers this one
    #[arg(long)]
    control: bool,
    #[command(flatten)]
    use_sim_time: UseSimTime,
    /// Publish the log lines of the process that started this one, from standard input
    #[arg(long, hide = true)]
    log_on_stdin: bool,
    #[command(flatten)]
    parent: Parent,
}

fn osc_destination(text: &str) -> Result<SocketAddrV4, DestinationError> {
    destination(text, None)
}

fn psn_destination(text: &str) -> Result<SocketAddrV4, DestinationError> {
    destination(text, Some(USUAL_PORT))
}

/// Parses a rate of 0.01 to `MOST` frames per second.
fn rate<const MOST: u32>(text: &str) -> Result<f64, Expected> {
    let rate = text.trim().parse::<f64>().ok().filter(|rate| *rate >= 0.01 && *rate <= f64::from(MOST));
    rate.ok_or_else(|| Expected(format!("frames per second from 0.01 to {MOST}").into()))
}

fn system_name(text: &str) -> Result<String, Expected> {
    if (1..=128).contains(&text.len()) { Ok(text.to_owned()) } else { Err(Expected("1 to 128 bytes".into())) }
}

/// Sends until a signal comes.
pub fn send(common: &Common, arguments: &SendArguments) -> Result<(), CommandError> {
    match &arguments.kind {
        Kind::Psn(arguments) => psn(common, arguments),
        Kind::Osc(arguments) => osc(common, arguments),
        Kind::Timecode(arguments) => timecode::timecode(common, arguments),
        #[cfg(feature = "ros2")]
        Kind::Ros2(arguments) => ros2::ros2(common, arguments),
        #[cfg(not(feature = "ros2"))]
        Kind::Ros2(_) => Err(super::ros2_process::not_built()),
    }
}

fn psn(common: &Common, arguments: &PsnArguments) -> Result<(), CommandError> {
    let stop = stop_on_signals()?;
    let PsnArguments { to, interface, ttl, rate, axes, .. } = *arguments;
    let names = &common.names;
    let numbers = numbers(names, arguments)?;
    let outlet = Outlet::open(&[to], Route { interface, multicast_ttl: ttl })?;
    print(common, || {
        let by = interface.map_or(String::new(), |interface| format!(" by {interface}"));
        let ttl = if to.ip().is_multicast() { format!(", TTL {ttl}") } else { String::new() };
        format!(
            "Sending {} as PosiStageNet 2.03 to {to}{by}{ttl}: at most {} frames per second, x,y,z = {axes}. Ctrl-C ends.",
            common.quoted_names(),
            number(rate)
        )
    })?;
    let options = PsnOptions {
        trackers: arguments.trackers.clone(),
        axes,
        rate,
        numbers,
        system_name: arguments.system_name.clone().unwrap_or_else(|| match &names[..] {
            [only] => only.clone(),
            _ => "bench-dragon".to_owned(),
        }),
    };
    let mut printed = Ok(());
    let mut notify = |publisher: usize, notice: Notice| {
        if let Notice::LeftOut(sentence) = notice {
            log::warn!("{sentence}");
        } else if printed.is_ok() {
            printed = print(common, || notice_line(names.get(publisher).map_or("", String::as_str), &notice));
            // The reader has closed the pipe, as `| head` does.
            stop.fetch_or(printed.is_err(), Ordering::Relaxed);
        }
    };
    let mut sender = PsnSender::new(options, outlet, &mut notify);
    poll_until(&stop, names, Delivery::Newest, &mut sender)?;
    let summary = sender.finish();
    printed?;
    let mut output = Output::standard();
    if common.json {
        output.json(&summary)?;
    } else {
        output.line(&format!(
            "{} frames sent in {} packets; {} passed over, {} packets could not be sent",
            summary.frames, summary.packets, summary.passed_over, summary.unsent_packets
        ))?;
    }
    output.finish()
}

/// Returns the numbers of each publisher's trackers.
fn numbers(names: &[String], arguments: &PsnArguments) -> Result<Vec<Numbers>, CommandError> {
    let PsnArguments { first_id, id_step, .. } = *arguments;
    if names.len() == 1 {
        return Ok(vec![Numbers::from(first_id, id_step)]);
    }
    Numbers::of_several(names, first_id, id_step).ok_or_else(|| {
        CommandError::BadInput(format!(
            "--first-id {first_id} and --id-step {id_step} leave no tracker numbers for {} publishers, expected the last \
             head's at most {}",
            names.len(),
            u16::MAX
        ))
    })
}

fn osc(common: &Common, arguments: &OscArguments) -> Result<(), CommandError> {
    let stop = stop_on_signals()?;
    let OscArguments { to, interface, rate, messages, map } = arguments;
    let packing = if *messages { Packing::Messages } else { Packing::Bundles };
    let map = map.as_deref().map(osc_map).transpose()?;
    let addresses: Vec<_> = common.names.iter().map(|name| Addresses::new(name)).collect();
    let prefixes: Vec<_> = addresses.iter().map(|addresses| addresses.prefix().to_owned()).collect();
    if let Some(twice) = prefixes.iter().enumerate().find(|(at, prefix)| prefixes[..*at].contains(prefix)) {
        let sentence =
            format!("two of the names have the OSC address {}, expected names with different addresses", twice.1);
        return Err(CommandError::BadInput(sentence));
    }
    let sender = |addresses| {
        let outlet = Outlet::open(to, Route { interface: *interface, multicast_ttl: 1 })?;
        Ok(OscSender::new(addresses, OscOptions { rate: *rate, packing, map: map.clone() }, outlet))
    };
    let senders = addresses.into_iter().map(sender).collect::<Result<_, NetworkError>>()?;
    let mut senders = OscSenders::new(senders);
    print(common, || {
        let to = to.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        let by = interface.map_or(String::new(), |interface| format!(" by {interface}"));
        let names = common.quoted_names();
        if map.is_some() {
            return format!("Sending {names} as OSC to {to}{by}: the messages of --map alone. Ctrl-C ends.");
        }
        format!(
            "Sending {names} as OSC to {to}{by}: {}/alert, countdown, state, cue, head, sim_time; at most {} frames per \
             second. Ctrl-C ends.",
            prefixes.join(", "),
            number(*rate)
        )
    })?;
    poll_until(&stop, &common.names, Delivery::Newest, &mut senders)?;
    let summary = senders.finish();
    let mut output = Output::standard();
    if common.json {
        output.json(&summary)?;
    } else {
        output.line(&format!(
            "{} frames, {} alerts and {} cues sent in {} packets; {} packets could not be sent",
            summary.frames, summary.alerts, summary.cues, summary.packets, summary.unsent_packets
        ))?;
    }
    output.finish()
}

/// Reads the user's messages.
fn osc_map(file: &Path) -> Result<OscMap, CommandError> {
    let refused = |sentence: String| CommandError::BadInput(sentence);
    let text = std::fs::read_to_string(file)
        .map_err(|error| refused(format!("{}: {error}, expected a TOML file with [[messages]]", file.display())))?;
    OscMap::parse(&text, &file.display().to_string()).map_err(|error| refused(error.to_string()))
}

fn notice_line(name: &str, notice: &Notice) -> String {
    match notice {
        Notice::Team { handles, trackers, packets, name_packets } => {
            let plural = |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
            let numbers = match &trackers[..] {
                [] => String::new(),
                [only] => format!(" ({} = {})", only.id, only.name),
                [first, .., last] => format!(" ({} = {} to {} = {})", first.id, first.name, last.id, last.name),
            };
            format!(
                "{} of {handles} handles{numbers}: {} a frame, and {} of names a second",
                plural(trackers.len(), "tracker"),
                plural(*packets, "packet"),
                plural(*name_packets, "packet")
            )
        }
        Notice::LeftOut(sentence) => sentence.clone(),
        Notice::Stopped => format!("No frames come from \"{name}\": the trackers have status 0."),
        Notice::Resumed => format!("Frames come from \"{name}\" again."),
    }
}

/// Prints a line for people at once; `--json` has the summary only.
fn print(common: &Common, line: impl FnOnce() -> String) -> Result<(), CommandError> {
    if common.json {
        return Ok(());
    }
    let mut output = Output::standard();
    output.line(&line())?;
    output.finish()
}

impl From<NetworkError> for CommandError {
    fn from(error: NetworkError) -> Self {
        match error {
            NetworkError::Interface(_) => Self::BadInput(error.to_string()),
            NetworkError::Socket(_) => Self::Failed(error.to_string()),
        }
    }
}
