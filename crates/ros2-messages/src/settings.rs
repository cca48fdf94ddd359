//! The topics that a scene can request, their quality of service, and the limits of the diagnostics.
//!
//! A scene file states these settings, and the ROS 2 transport reads them. A recording has the default settings.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::Time;

/// A topic that a scene can request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Topic {
    /// `/<name>/handles`, bench_dragon_msgs/HandlePoses.
    Handles,
    /// `/<name>/poses`, geometry_msgs/PoseArray.
    Poses,
    /// `/<name>/alerts`, bench_dragon_msgs/CollisionAlert.
    Alerts,
    /// `/<name>/stage`, bench_dragon_msgs/Stage.
    Stage,
    /// `/diagnostics`, diagnostic_msgs/DiagnosticArray.
    Diagnostics,
    /// `/<name>/markers`, visualization_msgs/MarkerArray.
    Markers,
    /// `/<name>/status`, bench_dragon_msgs/LoopStatus.
    Status,
    /// `/<name>/path`, nav_msgs/Path.
    Path,
    /// `/<name>/cues`, bench_dragon_msgs/Cue.
    Cues,
    /// `/clock`, rosgraph_msgs/Clock.
    Clock,
    /// `/tf`, tf2_msgs/TFMessage.
    Tf,
}

impl Topic {
    /// The topics published by default.
    pub const DEFAULT: [Self; 7] =
        [Self::Handles, Self::Poses, Self::Alerts, Self::Stage, Self::Diagnostics, Self::Path, Self::Cues];

    /// All topics.
    pub const ALL: [Self; 11] = [
        Self::Handles,
        Self::Poses,
        Self::Alerts,
        Self::Stage,
        Self::Diagnostics,
        Self::Markers,
        Self::Status,
        Self::Path,
        Self::Cues,
        Self::Clock,
        Self::Tf,
    ];

    /// Returns the name in the scene, which is the last part of the topic's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Handles => "handles",
            Self::Poses => "poses",
            Self::Alerts => "alerts",
            Self::Stage => "stage",
            Self::Diagnostics => "diagnostics",
            Self::Markers => "markers",
            Self::Status => "status",
            Self::Path => "path",
            Self::Cues => "cues",
            Self::Clock => "clock",
            Self::Tf => "tf",
        }
    }

    /// Returns the topic's full name for the publisher `publisher`.
    pub fn path(self, publisher: &str) -> String {
        match self {
            // The names that tools expect.
            Self::Diagnostics | Self::Clock | Self::Tf => format!("/{}", self.name()),
            _ => format!("/{publisher}/{}", self.name()),
        }
    }

    /// Returns the default quality of service.
    ///
    /// All topics are reliable, because a default subscription is reliable and gets nothing from a best-effort
    /// publisher. A best-effort subscription also gets the messages of a reliable publisher. Event-driven messages are
    /// kept for late subscribers.
    pub fn default_qos(self) -> Qos {
        match self {
            Self::Alerts | Self::Stage | Self::Path | Self::Cues => {
                Qos { reliability: Reliability::Reliable, durability: Durability::TransientLocal, depth: 1 }
            }
            _ => Qos { reliability: Reliability::Reliable, durability: Durability::Volatile, depth: 10 },
        }
    }
}

/// The retransmission of lost messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reliability {
    /// Lost messages are retransmitted.
    Reliable,
    /// Lost messages are not retransmitted.
    BestEffort,
}

/// The history for late subscribers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Durability {
    /// No history.
    Volatile,
    /// The last message, whatever the depth.
    TransientLocal,
}

/// The quality of service of a topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Qos {
    /// The retransmission of lost messages.
    pub reliability: Reliability,
    /// The history for late subscribers.
    pub durability: Durability,
    /// The number of last messages that are kept.
    pub depth: u32,
}

/// The clock of the stamps in ROS 2 headers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StampClock {
    /// The publisher's CLOCK_REALTIME.
    #[default]
    Wall,
    /// Simulated time, as on `/clock`.
    Sim,
}

impl StampClock {
    /// Returns the stamp of a message of the wall time `stamp_ns`, in nanoseconds, and `sim_time`, in seconds.
    pub fn at(self, stamp_ns: u64, sim_time: f64) -> Time {
        match self {
            Self::Wall => Time::of(stamp_ns),
            Self::Sim => Time::of_seconds(sim_time),
        }
    }
}

/// The limits of the loop's last second for a warning and for an error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DiagnosticLimits {
    /// Skipped periods for a warning, at least 1.
    pub skipped_warn: u64,
    /// Skipped periods for an error; by default a tenth of the loop's rate, at least 2 and at least `skipped_warn`.
    pub skipped_error: Option<u64>,
    /// Wake-up lateness for a warning, 99th percentile, in seconds; infinite by default: lateness within a period is
    /// harmless.
    pub lateness_warn: f64,
    /// The same for an error.
    pub lateness_error: f64,
}

impl Default for DiagnosticLimits {
    fn default() -> Self {
        Self { skipped_warn: 1, skipped_error: None, lateness_warn: f64::INFINITY, lateness_error: f64::INFINITY }
    }
}

impl DiagnosticLimits {
    /// Returns the skipped periods of a second that are an error at a rate of the loop.
    pub fn skipped_error_at(&self, rate: f64) -> u64 {
        self.skipped_error.unwrap_or(((0.1 * rate).ceil() as u64).max(2)).max(self.skipped_warn)
    }
}

/// The ROS 2 settings of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Ros2Settings {
    /// The rate on ROS 2, in frames per second; by default the smaller of 60 and the loop's rate.
    pub rate: Option<f64>,
    /// The topics and the quality of service of each.
    pub topics: BTreeMap<Topic, Qos>,
    /// True for services that control the show.
    pub control: bool,
    /// The clock of the stamps; simulated time only with [`Topic::Clock`].
    pub stamps: StampClock,
    /// The limits of the diagnostics.
    pub diagnostics: DiagnosticLimits,
}

impl Default for Ros2Settings {
    fn default() -> Self {
        let topics = Topic::DEFAULT.into_iter().map(|topic| (topic, topic.default_qos())).collect();
        Self { rate: None, topics, control: false, stamps: StampClock::Wall, diagnostics: DiagnosticLimits::default() }
    }
}

impl Ros2Settings {
    /// Returns the topics that have messages: a scene without `[alerts]` has no alerts, one without `[[cues]]` no cues.
    pub fn offered(&self, alerts: bool, cues: bool) -> impl Iterator<Item = Topic> {
        let filled = move |topic: &Topic| match topic {
            Topic::Alerts => alerts,
            Topic::Cues => cues,
            _ => true,
        };
        self.topics.keys().copied().filter(filled)
    }

    /// Returns the greatest number of frames per second on ROS 2, whatever the rate of the loop.
    pub fn greatest_rate(&self) -> f64 {
        self.rate.unwrap_or(60.0)
    }

    /// Returns the frames per second on ROS 2 for a loop at `loop_rate`.
    pub fn rate_of(&self, loop_rate: f64) -> f64 {
        self.greatest_rate().min(loop_rate)
    }
}
