//! A row of figures a second of a soak test: of the publisher from its status and from /proc, of each subscriber from
//! its observation. In: a [`Fleet`]. Out: a row for the [`history`](super::history), whose columns the report plots.

use super::fleet::Fleet;
use super::observation::{Latencies, Status};
use super::resources::Resources;

/// The figures of the publisher in a row of the history.
const PUBLISHER_COLUMNS: [&str; 12] = [
    "lateness_p50_ns",
    "lateness_p99_ns",
    "lateness_max_ns",
    "step_p50_ns",
    "step_p99_ns",
    "step_max_ns",
    "overruns",
    "skipped",
    "shows_played",
    "resident_bytes",
    "file_descriptors",
    "shared_memory_bytes",
];
/// The figure of the process of ROS 2 in a row of the history.
pub const ROS2_COLUMN: &str = "ros2_resident_bytes";
/// The figures of each subscriber in a row of the history.
const SUBSCRIBER_COLUMNS: [&str; 5] =
    ["latency_p50_ns", "latency_p99_ns", "latency_max_ns", "latency_since_deadline_p99_ns", "missed"];

/// Returns the name of a subscriber's column.
pub fn column_of(label: &str, name: &str) -> String {
    format!("{label}: {name}")
}

/// Returns the names of the values of [`row`].
pub fn columns(fleet: &Fleet) -> Vec<String> {
    let publisher = PUBLISHER_COLUMNS.iter().map(|name| (*name).to_owned());
    let subscribers = fleet
        .members()
        .iter()
        .flat_map(|member| SUBSCRIBER_COLUMNS.iter().map(|name| column_of(&member.label, name)).collect::<Vec<_>>());
    let ros2 = fleet.has_ros2().then(|| ROS2_COLUMN.to_owned());
    publisher.chain(ros2).chain(subscribers).collect()
}

/// Returns the present figures in the order of [`columns`]; NaN for an unknown figure. The latencies of the subscribers
/// are those since the last call.
pub fn row(fleet: &mut Fleet) -> Vec<f64> {
    let status = fleet.status();
    let held = fleet.measure_publisher();
    let of_status = |value: fn(&Status) -> u64| status.as_ref().map_or(f64::NAN, |status| value(status) as f64);
    let of_process = |value: fn(&Resources) -> u64| held.as_ref().map_or(f64::NAN, |held| value(held) as f64);
    let mut figures = vec![
        of_status(|status| status.lateness_second[0]),
        of_status(|status| status.lateness_second[1]),
        of_status(|status| status.lateness_second[2]),
        of_status(|status| status.step_second[0]),
        of_status(|status| status.step_second[1]),
        of_status(|status| status.step_second[2]),
        of_status(|status| status.overruns),
        of_status(|status| status.skipped),
        of_status(|status| status.shows_played),
        of_process(|held| held.resident_bytes),
        of_process(|held| held.file_descriptors),
        of_process(|held| held.shared_memory_bytes),
    ];
    if fleet.has_ros2() {
        figures.push(fleet.measure_ros2().map_or(f64::NAN, |held| held.resident_bytes as f64));
    }
    for member in fleet.members_mut() {
        let fresh = member.take_fresh();
        let of = |value: fn(&Latencies) -> u64| fresh.as_ref().map_or(f64::NAN, |fresh| value(fresh) as f64);
        figures.extend([
            of(|fresh| fresh.since_sent.p50),
            of(|fresh| fresh.since_sent.p99),
            of(|fresh| fresh.since_sent.max),
            of(|fresh| fresh.since_deadline.p99),
            member.seen().missed as f64,
        ]);
    }
    figures
}
