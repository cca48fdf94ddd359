//! ROS 2 topics, by ros2-client on RustDDS, on their own thread and at their own rate. On another thread the services of
//! the node: its parameter services and, if a scene requests them, those that control the show.
//!
//! In: a scene with `[publish.ros2]` and the process's environment. Out: a [`Transport`]. Called by the list of
//! transports.

mod control;
pub mod environment;
mod matching;
mod node;
pub mod rosout;
mod topic_writer;

use std::net::{IpAddr, Ipv4Addr};

use ros2_client::Context;
use rustdds::DomainParticipantBuilder;

use bench_dragon_messages::Stage;
use bench_dragon_publisher::live::control::CommandSender;
use bench_dragon_publisher::live::{Publisher, StatusPublisher, TransportCounters};
use bench_dragon_ros2_messages::settings::Ros2Settings;

use bench_dragon_publisher::transports::background::{
    self, BackgroundConfig, BackgroundError, BackgroundPublisher, BackgroundStatus,
};
use bench_dragon_publisher::transports::{Transport, TransportConfig, TransportError};
pub use control::mappings_of;
use control::{ControlThread, Endpoints};
use environment::{Network, Range, check_name, other_distribution};
use matching::Matches;

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
}

impl From<Ros2Error> for TransportError {
    fn from(error: Ros2Error) -> Self {
        match error {
            Ros2Error::Failed(_) => Self::Failed(error.to_string()),
            Ros2Error::Name(_) => Self::IllegalName(error.to_string()),
            Ros2Error::Environment(_) => Self::BadInput(error.to_string()),
        }
    }
}

/// The settings of the topics.
#[derive(Debug, Clone)]
struct Ros2Config {
    /// The namespace of the topics.
    name: String,
    /// Handles in a frame.
    handles: usize,
    /// Frames per second.
    rate: f64,
    /// The scene's settings.
    settings: Ros2Settings,
    /// True if there are alerts.
    alerts: bool,
    /// The cues of the scene.
    cues: usize,
    /// The stage.
    stage: Stage,
}

/// The open topics.
struct Ros2 {
    description: String,
    /// The services until their thread starts.
    services: Option<(Endpoints, Matches)>,
    /// True if services conduct the show.
    conducting: bool,
    control: Option<ControlThread>,
    publisher: Option<BackgroundPublisher>,
    status: Option<BackgroundStatus>,
    thread: background::BackgroundThread,
}

/// Opens the topics that the scene requests, on the network that the environment names.
///
/// # Errors
/// [`TransportError`]
pub fn open(config: &TransportConfig) -> Result<Option<Box<dyn Transport>>, TransportError> {
    let Some(settings) = config.ros2 else { return Ok(None) };
    let variable = |name: &str| std::env::var(name).ok();
    let network = Network::of(variable)?;
    if let Some(warning) = other_distribution(variable) {
        log::warn!("{warning}");
    }
    Ok(Some(open_on(network, config, settings)?))
}

/// Opens the topics and services of `settings` on a network.
///
/// # Errors
/// [`Ros2Error`]
pub fn open_on(
    network: Network,
    config: &TransportConfig,
    settings: &Ros2Settings,
) -> Result<Box<dyn Transport>, Ros2Error> {
    let TransportConfig {
        name,
        handles,
        alerts,
        cues,
        single_precision: _,
        queue: _,
        subscribers: _,
        ros2: _,
        loop_rate,
        stage,
    } = *config;
    check_name(name)?;
    if let Some(rate) = settings.rate.filter(|rate| *rate > loop_rate) {
        log::warn!("publish.ros2.rate is {rate}, more than the loop's {loop_rate}: ROS 2 gets {loop_rate} a second");
    }
    let rate = settings.rate_of(loop_rate);
    let topics: Vec<String> = settings.offered(alerts, cues > 0).map(|topic| topic.path(name)).collect();
    let conducting = settings.control;
    let services =
        if conducting { format!("\nROS 2 services that conduct the show: /{name}/...") } else { String::new() };
    let description =
        format!("ROS 2 topics ({}, at {rate} frames per second): {}.{services}", network.sentence(), topics.join(", "));
    let background = BackgroundConfig { name: "ros2", handles, cues, loop_rate, rate };
    let context = context(network)?;
    let matches = Matches::new(&context);
    let mut node = node::open(&context, name)?;
    let services = Some((Endpoints::open(name, &context, &mut node, conducting)?, matches.clone()));
    let config = Ros2Config { name: name.to_owned(), handles, rate, settings: settings.clone(), alerts, cues, stage };
    let started = background::start(background, move || node::Topics::open(context, node, matches, config));
    let (publisher, status, thread) = started.map_err(|error| match error {
        BackgroundError::Open(error) => error,
        BackgroundError::Thread(reason) => Ros2Error::Failed(reason),
    })?;
    let (publisher, status) = (Some(publisher), Some(status));
    Ok(Box::new(Ros2 { description, services, conducting, control: None, publisher, status, thread }))
}

/// Creates a participant of the network.
fn context(network: Network) -> Result<Context, Ros2Error> {
    let failed = |error: &dyn std::fmt::Display| Ros2Error::Failed(error.to_string());
    let mut builder = DomainParticipantBuilder::new(network.domain);
    if network.range == Range::Localhost {
        builder = builder.with_only_networks([IpAddr::V4(Ipv4Addr::LOCALHOST)]);
    }
    let participant = builder.build().map_err(|error| failed(&error))?;
    Context::from_domain_participant(participant).map_err(|error| failed(&error))
}

impl Transport for Ros2 {
    fn describe(&self) -> String {
        self.description.clone()
    }

    fn publisher(&mut self) -> Result<Box<dyn Publisher>, TransportError> {
        match self.publisher.take() {
            Some(publisher) => Ok(Box::new(publisher)),
            None => Err(TransportError::Failed("the ROS 2 publisher is taken".to_owned())),
        }
    }

    fn status(&mut self) -> Result<Box<dyn StatusPublisher>, TransportError> {
        match self.status.take() {
            Some(status) => Ok(Box::new(status)),
            None => Err(TransportError::Failed("the ROS 2 status is taken".to_owned())),
        }
    }

    fn control(&mut self, commands: CommandSender) -> Result<Option<CommandSender>, TransportError> {
        let Some((endpoints, matches)) = self.services.take() else { return Ok(Some(commands)) };
        let (of_services, rest) = if self.conducting { (Some(commands), None) } else { (None, Some(commands)) };
        self.control = Some(ControlThread::start(endpoints, matches, of_services)?);
        Ok(rest)
    }

    fn finish(mut self: Box<Self>) -> Option<(&'static str, TransportCounters)> {
        // The participant leaves the network with its last owner, the thread.
        drop((self.control.take(), self.services.take()));
        Some(("ros2", self.thread.finish()))
    }
}
