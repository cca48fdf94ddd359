//! `send ros2`: publishes running shows on ROS 2, and on request offers services that control them.

use std::sync::atomic::Ordering;

use bench_dragon::client::feed::Delivery;
use bench_dragon::client::polling::poll_until;
use bench_dragon::publisher::live::TransportCounters;
use bench_dragon::ros2::Ros2Error;
use bench_dragon::ros2::bridge::{Bridge, BridgeConfig, BridgeCounters, Notice};

use super::super::ros2_process::Ros2Line;
use super::super::{CommandError, Common, Output, log_lines, stop_on_signals};
use super::Ros2Arguments;

/// Publishes until a signal comes.
pub(super) fn ros2(common: &Common, arguments: &Ros2Arguments) -> Result<(), CommandError> {
    arguments.parent.watch()?;
    let settings = common.scene.as_ref().map(|_| common.load_scene()).transpose()?;
    let settings = settings.map(|scene| scene.ros2.unwrap_or_default());
    let stop = stop_on_signals()?;
    if arguments.log_on_stdin {
        log_lines::receive();
    }
    let mut printed = Ok(());
    let mut notify = |publisher: usize, notice: Notice| {
        let name = common.names.get(publisher).map_or("", String::as_str);
        if printed.is_ok() {
            printed = print(common, name, notice);
            // The reader has closed the pipe, as `| head` does.
            stop.fetch_or(printed.is_err(), Ordering::Relaxed);
        }
    };
    let config = BridgeConfig {
        names: common.names.clone(),
        settings,
        control: arguments.control,
        stamps: arguments.use_sim_time.stamps(),
    };
    let mut bridge = Bridge::join(config, &stop, &mut notify)?;
    if !common.json && !common.quiet {
        eprintln!("Publishing {} on ROS 2; Ctrl-C ends.", common.quoted_names());
    }
    poll_until(&stop, &common.names, Delivery::All, &mut bridge)?;
    let counters = bridge.finish()?;
    printed?;
    let mut output = Output::standard();
    if common.json {
        output.json(&Ros2Line::Summary(of_transport(counters)))?;
    } else {
        let BridgeCounters { frames, skipped, discarded } = counters;
        output.line(&format!("{frames} frames sent, {skipped} skipped, {discarded} messages discarded"))?;
    }
    output.finish()
}

/// Prints a change of a show.
fn print(common: &Common, name: &str, notice: Notice) -> Result<(), CommandError> {
    let mut output = Output::standard();
    if common.json {
        let name = name.to_owned();
        output.json(&match notice {
            Notice::Connected => Ros2Line::Connected { name },
            Notice::Opened { topics } => Ros2Line::Opened { name, topics },
            Notice::Gone => Ros2Line::Gone { name },
            Notice::Counted(counters) => Ros2Line::Counters(of_transport(counters)),
        })?;
    } else {
        match notice {
            Notice::Connected | Notice::Counted(_) => return Ok(()),
            Notice::Opened { topics } => output.line(&format!("\"{name}\" runs: {}", topics.join(", ")))?,
            Notice::Gone => output.line(&format!("\"{name}\" has ended: its topics are closed"))?,
        }
    }
    output.finish()
}

fn of_transport(counters: BridgeCounters) -> TransportCounters {
    let BridgeCounters { frames, skipped, discarded } = counters;
    TransportCounters { frames, skipped, discarded }
}

impl From<Ros2Error> for CommandError {
    fn from(error: Ros2Error) -> Self {
        match error {
            Ros2Error::Failed(_) | Ros2Error::Ended => Self::Failed(error.to_string()),
            Ros2Error::Name(_) => Self::BadInput(format!("--name: {error}")),
            Ros2Error::Environment(_) => Self::BadInput(error.to_string()),
        }
    }
}
