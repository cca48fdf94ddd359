//! What `run` does about ROS 2: opens its topics where they are asked for, or says why this build has none.

use bench_dragon::live::statistics::TransportCounts;
use bench_dragon::live::{Publisher, StatusPublisher};
use bench_dragon::scene::Scene;
use bench_dragon::wire::Stage;

use crate::commands::CommandError;

/// The ends of an open ROS 2 transport.
pub struct Ros2 {
    /// For the loop.
    pub publisher: Box<dyn Publisher + Send>,
    /// For the statistics.
    pub status: Box<dyn StatusPublisher + Send>,
    /// Leaves the graph.
    pub end: Box<dyn FnOnce() -> TransportCounts>,
    /// Topics and network in one sentence.
    pub sentence: String,
}

/// Opens the topics of `scene` under `name`, for a loop of `loop_rate` frames per second.
#[cfg(feature = "ros2")]
pub fn open(scene: &Scene, name: &str, loop_rate: f64, stage: Stage) -> Result<Ros2, CommandError> {
    use bench_dragon::scene::ros2::Topic;
    use bench_dragon::transports::ros2::{Ros2Config, Ros2Error, environment, start};

    let settings = scene.ros2.clone().unwrap_or_default();
    let refused = |error: Ros2Error| match error {
        Ros2Error::Failed(_) => CommandError::Failed(error.to_string()),
        _ => CommandError::BadInput(error.to_string()),
    };
    if let Some(rate) = settings.rate.filter(|rate| *rate > loop_rate) {
        log::warn!("publish.ros2.rate is {rate}, more than the loop's {loop_rate}: ROS 2 gets {loop_rate} a second");
    }
    let variable = |name: &str| std::env::var(name).ok();
    let network = environment::Network::of(variable).map_err(refused)?;
    if let Some(warning) = environment::other_distribution(variable) {
        log::warn!("{warning}");
    }
    let alerts = scene.alerts.is_some();
    let topics: Vec<String> = (settings.topics.keys())
        .filter(|topic| alerts || **topic != Topic::Alerts)
        .map(|topic| topic.path(name))
        .collect();
    let sentence = format!(
        "ROS 2 topics ({}, at {} frames per second): {}.",
        network.sentence(),
        settings.rate_of(loop_rate),
        topics.join(", ")
    );
    let handles = scene.team().handles();
    let config = Ros2Config { name: name.to_owned(), handles, loop_rate, settings, alerts, stage };
    let (publisher, status, thread) = start(config, network).map_err(refused)?;
    let end = move || thread.end();
    Ok(Ros2 { publisher: Box::new(publisher), status: Box::new(status), end: Box::new(end), sentence })
}

/// Says that this build has no ROS 2.
#[cfg(not(feature = "ros2"))]
pub fn open(_: &Scene, _: &str, _: f64, _: Stage) -> Result<Ros2, CommandError> {
    Err(CommandError::BadInput(
        "ROS 2 is asked for and this program was built without it: build it with the feature \"jazzy\" or \"humble\""
            .to_owned(),
    ))
}
