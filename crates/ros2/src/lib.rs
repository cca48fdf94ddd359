//! ROS 2 topics, by ros2-client on RustDDS, of shows in other processes. On another thread the services of the node:
//! its parameter services and, on request, those that control the show.
//!
//! In: the feed of a show and the process's environment. Out: a [`bridge`].

pub mod bridge;
mod commands;
mod control;
mod copies;
mod departures;
pub mod environment;
#[cfg(test)]
mod interfaces;
mod matching;
mod node;
mod ports;
mod rate;
mod readers;
mod relief;
mod repeated;
pub mod rosout;
mod topic_writer;
mod wire;

use std::net::{IpAddr, Ipv4Addr};

use ros2_client::Context;
use rustdds::{DomainParticipant, DomainParticipantBuilder};

use bench_dragon_messages::StageMessage;
use bench_dragon_ros2_messages::settings::Ros2Settings;

pub use control::mappings_of;
use environment::{Network, Range, check_name};

/// The most messages that a writer keeps for its subscribers, RustDDS's own limit.
const UNACKNOWLEDGED_MESSAGES: u32 = 8192;

/// The most participants that are created: another program may take a port in between.
const MOST_ATTEMPTS: u32 = 5;

/// The reason why there are no ROS 2 topics.
#[derive(Debug, thiserror::Error)]
pub enum Ros2Error {
    /// The name is illegal in ROS 2.
    #[error(
        "the name is \"{0}\", which ROS 2 cannot take: expected words of letters, digits and single underscores, not \
         beginning with a digit, joined by slashes"
    )]
    Name(String),
    /// An environment variable cannot be honoured.
    #[error("{0}")]
    Environment(String),
    /// RustDDS or ros2-client failed.
    #[error("ROS 2 could not be started: {0}")]
    Failed(String),
    /// RustDDS has ended its threads.
    #[error(
        "RustDDS has ended, as it does when its process stood still, in a debugger or while the machine slept: the \
         process has to be started again"
    )]
    Ended,
}

/// The settings of the topics.
#[derive(Debug, Clone)]
struct Ros2Config {
    /// The namespace of the topics.
    name: String,
    /// Handles in a frame.
    handles: usize,
    /// The scene's settings.
    settings: Ros2Settings,
    /// True if there are alerts.
    alerts: bool,
    /// The cues of the scene.
    cues: usize,
    /// The stage.
    stage: StageMessage,
}

/// The facts of a show for [`describe`].
#[derive(Debug, Clone, Copy)]
pub struct ShowFacts {
    /// Frames per second of the loop.
    pub loop_rate: f64,
    /// True if there are alerts.
    pub alerts: bool,
    /// The cues of the scene.
    pub cues: usize,
}

/// Tests that a show can be published on ROS 2 under `name` in the network that the environment names. Returns the
/// topics and services in words.
///
/// # Errors
/// [`Ros2Error`]
pub fn describe(name: &str, settings: &Ros2Settings, show: ShowFacts) -> Result<String, Ros2Error> {
    let variable = |name: &str| std::env::var(name).ok();
    let network = Network::of(variable)?;
    check_name(name)?;
    let ShowFacts { loop_rate, alerts, cues } = show;
    if let Some(rate) = settings.rate.filter(|rate| *rate > loop_rate) {
        log::warn!("publish.ros2.rate is {rate}, more than the loop's {loop_rate}: ROS 2 gets {loop_rate} a second");
    }
    let rate = settings.rate_of(loop_rate);
    let topics = topic_names(name, settings, alerts, cues).join(", ");
    let services = match settings.control {
        true => format!("\nROS 2 services that conduct the show: /{name}/..."),
        false => String::new(),
    };
    Ok(format!("ROS 2 topics ({}, at {rate} frames per second): {topics}.{services}", network.sentence()))
}

/// Returns the names of the topics that are offered.
fn topic_names(name: &str, settings: &Ros2Settings, alerts: bool, cues: usize) -> Vec<String> {
    settings.offered(alerts, cues > 0).map(|topic| topic.path(name)).collect()
}

/// Joins the network.
fn context(network: Network) -> Result<Context, Ros2Error> {
    Context::from_domain_participant(participant(network)?).map_err(|error| Ros2Error::Failed(error.to_string()))
}

/// Creates a participant that listens where it is announced ([`ports`]).
fn participant(Network { domain, range }: Network) -> Result<DomainParticipant, Ros2Error> {
    let mut attempts = 0;
    loop {
        let mut builder = DomainParticipantBuilder::new(domain);
        if range == Range::Localhost {
            builder = builder.with_only_networks([IpAddr::V4(Ipv4Addr::LOCALHOST)]);
        }
        let occupied = ports::occupy(domain);
        let participant = builder.build().map_err(|error| Ros2Error::Failed(error.to_string()))?;
        drop(occupied);
        attempts += 1;
        if ports::is_own(domain, participant.participant_id()) {
            return Ok(participant);
        }
        if attempts == MOST_ATTEMPTS {
            log::warn!("ROS 2: other programs have the ports of this one: reliable subscribers may get no messages");
            return Ok(participant);
        }
    }
}
