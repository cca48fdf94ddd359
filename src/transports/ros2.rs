//! ROS 2 topics, by ros2-client on RustDDS: on a thread of their own, at a rate of their own.
//!
//! In: a scene with `[publish.ros2]` and the process's environment. Out: a [`Transport`]. Called by the list of transports.

pub mod environment;
pub mod messages;
mod node;

use crate::live::{Deliveries, Publisher, StatusPublisher};
use crate::scene::ros2::{Ros2Settings, Topic};
use crate::wire::Stage;

use super::background::{self, BackgroundConfig, BackgroundError, BackgroundPublisher, BackgroundStatus};
use super::{Transport, TransportConfig, TransportError};
use environment::{Network, check_name, other_distribution};

/// Why there are no ROS 2 topics.
#[derive(Debug, thiserror::Error)]
pub enum Ros2Error {
    /// ROS 2 takes no such name.
    #[error(
        "the name is \"{0}\", which ROS 2 cannot take: expected words of letters, digits and single underscores, not \
         beginning with a digit, joined by slashes"
    )]
    Name(String),
    /// An environment variable cannot be honoured.
    #[error("{0}")]
    Environment(String),
    /// RustDDS or ros2-client refused.
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

/// What is offered on ROS 2.
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
    /// Whether there are alerts.
    alerts: bool,
    /// The stage.
    stage: Stage,
    /// Where to be found.
    network: Network,
}

/// The open topics.
struct Ros2 {
    description: String,
    publisher: Option<BackgroundPublisher>,
    status: Option<BackgroundStatus>,
    thread: background::BackgroundThread,
}

/// Opens the topics that the scene requests, on the network that the environment names.
///
/// # Errors
/// [`TransportError`]
pub fn open(config: &TransportConfig) -> Result<Option<Box<dyn Transport>>, TransportError> {
    let Some(settings) = &config.scene.ros2 else { return Ok(None) };
    let variable = |name: &str| std::env::var(name).ok();
    let network = Network::of(variable)?;
    if let Some(warning) = other_distribution(variable) {
        log::warn!("{warning}");
    }
    Ok(Some(open_on(network, config, settings)?))
}

/// Opens the topics of `settings` on a network.
///
/// # Errors
/// [`Ros2Error`]
pub fn open_on(
    network: Network,
    config: &TransportConfig,
    settings: &Ros2Settings,
) -> Result<Box<dyn Transport>, Ros2Error> {
    let TransportConfig { name, scene, loop_rate, stage } = *config;
    check_name(name)?;
    if let Some(rate) = settings.rate.filter(|rate| *rate > loop_rate) {
        log::warn!("publish.ros2.rate is {rate}, more than the loop's {loop_rate}: ROS 2 gets {loop_rate} a second");
    }
    let (alerts, rate, handles) = (scene.alerts.is_some(), settings.rate_of(loop_rate), scene.team().handles());
    let topics = settings.topics.keys().filter(|topic| alerts || **topic != Topic::Alerts);
    let topics: Vec<String> = topics.map(|topic| topic.path(name)).collect();
    let description =
        format!("ROS 2 topics ({}, at {rate} frames per second): {}.", network.sentence(), topics.join(", "));
    let background = BackgroundConfig { name: "ros2", handles, loop_rate, rate };
    let settings = settings.clone();
    let config = Ros2Config { name: name.to_owned(), handles, rate, settings, alerts, stage, network };
    let started = background::start(background, move || node::Topics::open(&config));
    let (publisher, status, thread) = started.map_err(|error| match error {
        BackgroundError::Open(error) => error,
        BackgroundError::Thread(reason) => Ros2Error::Failed(reason),
    })?;
    Ok(Box::new(Ros2 { description, publisher: Some(publisher), status: Some(status), thread }))
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

    fn finish(self: Box<Self>) -> Option<(&'static str, Deliveries)> {
        Some(("ros2", self.thread.finish()))
    }
}
