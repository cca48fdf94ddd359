//! What a scene may state about its ROS 2 topics and services: `[publish.ros2]`.
//!
//! In: the table as written. Out: [`Ros2Settings`], checked. Called by the scene; read by the ROS 2 transport.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

use super::{Accepted, SceneError, Source};

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
    /// What is published by default.
    pub const DEFAULT: [Self; 7] =
        [Self::Handles, Self::Poses, Self::Alerts, Self::Stage, Self::Diagnostics, Self::Path, Self::Cues];

    /// Every one.
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

    /// The name in the scene, and the last part of the topic's.
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

    /// The topic's full name, where the publisher is called `publisher`.
    pub fn path(self, publisher: &str) -> String {
        match self {
            // Where every tool looks.
            Self::Diagnostics | Self::Clock | Self::Tf => format!("/{}", self.name()),
            _ => format!("/{publisher}/{}", self.name()),
        }
    }

    /// The default quality of service.
    ///
    /// Reliable throughout, since a default subscription is reliable and gets nothing from a best-effort publisher; a
    /// best-effort subscription gets what a reliable publisher sends. What is sent seldom is kept for late subscribers.
    pub fn default_qos(self) -> Qos {
        match self {
            Self::Alerts | Self::Stage | Self::Path | Self::Cues => {
                Qos { reliability: Reliability::Reliable, durability: Durability::TransientLocal, depth: 1 }
            }
            _ => Qos { reliability: Reliability::Reliable, durability: Durability::Volatile, depth: 10 },
        }
    }
}

/// Whether lost messages are sent again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reliability {
    /// They are.
    Reliable,
    /// They are not.
    BestEffort,
}

/// Whether late subscribers get what was sent before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Durability {
    /// They do not.
    Volatile,
    /// They get the last message. (More, up to the depth, only while others subscribe at the same time.)
    TransientLocal,
}

/// The quality of service of a topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Qos {
    /// Whether lost messages are sent again.
    pub reliability: Reliability,
    /// Whether late subscribers get what was sent before.
    pub durability: Durability,
    /// The last messages that are kept.
    pub depth: u32,
}

/// From when on the diagnostics of the loop's last second are a warning, and from when on an error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DiagnosticLimits {
    /// Periods skipped, at least 1.
    pub skipped_warn: u64,
    /// The same; by default a tenth of the loop's rate.
    pub skipped_error: Option<u64>,
    /// Wake-up lateness, 99th percentile, seconds; infinite by default: what is late but in time has no consequence.
    pub lateness_warn: f64,
    /// The same.
    pub lateness_error: f64,
}

impl Default for DiagnosticLimits {
    fn default() -> Self {
        Self { skipped_warn: 1, skipped_error: None, lateness_warn: f64::INFINITY, lateness_error: f64::INFINITY }
    }
}

impl DiagnosticLimits {
    /// Periods skipped in a second that are an error at a rate of the loop.
    pub fn skipped_error_at(&self, rate: f64) -> u64 {
        self.skipped_error.unwrap_or(((0.1 * rate).ceil() as u64).max(2)).max(self.skipped_warn)
    }
}

/// What a scene states about its ROS 2 topics.
#[derive(Debug, Clone, PartialEq)]
pub struct Ros2Settings {
    /// Frames per second on ROS 2; by default the smaller of 60 and the loop's rate.
    pub rate: Option<f64>,
    /// The topics and how each is published.
    pub topics: BTreeMap<Topic, Qos>,
    /// Whether there are services that conduct the show.
    pub control: bool,
    /// The limits of the diagnostics.
    pub diagnostics: DiagnosticLimits,
}

impl Default for Ros2Settings {
    fn default() -> Self {
        let topics = Topic::DEFAULT.into_iter().map(|topic| (topic, topic.default_qos())).collect();
        Self { rate: None, topics, control: false, diagnostics: DiagnosticLimits::default() }
    }
}

impl Ros2Settings {
    /// The topics that a scene fills: one without `[alerts]` has no alerts, one without `[[cues]]` no cues.
    pub fn offered(&self, alerts: bool, cues: bool) -> impl Iterator<Item = Topic> {
        let filled = move |topic: &Topic| match topic {
            Topic::Alerts => alerts,
            Topic::Cues => cues,
            _ => true,
        };
        self.topics.keys().copied().filter(filled)
    }

    /// Frames per second on ROS 2 where the loop makes `loop_rate`.
    pub fn rate_of(&self, loop_rate: f64) -> f64 {
        self.rate.unwrap_or(60.0).min(loop_rate)
    }
}

/// The table as written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRos2 {
    rate: Option<Spanned<f64>>,
    topics: Option<Spanned<Vec<Topic>>>,
    #[serde(default)]
    control: bool,
    #[serde(default)]
    qos: BTreeMap<Topic, Spanned<RawQos>>,
    diagnostics: Option<Spanned<RawDiagnostics>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawDiagnostics {
    skipped_warn: Option<Spanned<i64>>,
    skipped_error: Option<Spanned<i64>>,
    lateness_warn: Option<Spanned<f64>>,
    lateness_error: Option<Spanned<f64>>,
}

impl RawDiagnostics {
    fn validated(&self, source: &Source) -> Result<DiagnosticLimits, SceneError> {
        let count = |field: &str, given: &Option<Spanned<i64>>| {
            let field = format!("publish.ros2.diagnostics.{field}");
            let given = given.as_ref().map(|given| source.check_count(&field, given, Accepted::SKIPPED));
            given.transpose().map(|count| count.map(|count| count as u64))
        };
        let seconds = |field: &str, given: &Option<Spanned<f64>>| {
            let field = format!("publish.ros2.diagnostics.{field}");
            given.as_ref().map(|given| source.check(&field, given, Accepted::LATENESS)).transpose()
        };
        let default = DiagnosticLimits::default();
        let limits = DiagnosticLimits {
            skipped_warn: count("skipped_warn", &self.skipped_warn)?.unwrap_or(default.skipped_warn),
            skipped_error: count("skipped_error", &self.skipped_error)?,
            lateness_warn: seconds("lateness_warn", &self.lateness_warn)?.unwrap_or(default.lateness_warn),
            lateness_error: seconds("lateness_error", &self.lateness_error)?.unwrap_or(default.lateness_error),
        };
        let order = "expected the warning first: publish.ros2.diagnostics.";
        if let (Some(given), Some(error)) = (&self.skipped_error, limits.skipped_error)
            && error < limits.skipped_warn
        {
            let warn = limits.skipped_warn;
            let sentence = format!("{order}skipped_error is {error}, below skipped_warn, which is {warn}");
            return Err(source.field_error(given, &sentence));
        }
        if let (Some(given), true) =
            (&self.lateness_error, self.lateness_warn.is_some() && limits.lateness_error < limits.lateness_warn)
        {
            let DiagnosticLimits { lateness_warn: warn, lateness_error: error, .. } = limits;
            let sentence = format!("{order}lateness_error is {error}, below lateness_warn, which is {warn}");
            return Err(source.field_error(given, &sentence));
        }
        Ok(limits)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawQos {
    reliability: Option<Reliability>,
    durability: Option<Durability>,
    depth: Option<Spanned<i64>>,
}

impl RawRos2 {
    pub(super) fn validated(&self, source: &Source) -> Result<Ros2Settings, SceneError> {
        let rate =
            self.rate.as_ref().map(|rate| source.check("publish.ros2.rate", rate, Accepted::RATE)).transpose()?;
        let named = match &self.topics {
            None => Topic::DEFAULT.to_vec(),
            Some(topics) if topics.get_ref().is_empty() => {
                let sentence = "publish.ros2.topics is empty, expected at least one topic, or no [publish.ros2]";
                return Err(source.field_error(topics, sentence));
            }
            Some(topics) => topics.get_ref().clone(),
        };
        let mut topics: BTreeMap<Topic, Qos> = named.into_iter().map(|topic| (topic, topic.default_qos())).collect();
        for (topic, raw) in &self.qos {
            let Some(qos) = topics.get_mut(topic) else {
                let sentence = format!(
                    "publish.ros2.qos.{name} is given but \"{name}\" is not among publish.ros2.topics, expected both \
                     or neither",
                    name = topic.name()
                );
                return Err(source.field_error(raw, &sentence));
            };
            *qos = raw.get_ref().validated(*topic, source)?;
        }
        let diagnostics = match &self.diagnostics {
            None => DiagnosticLimits::default(),
            Some(raw) if !topics.contains_key(&Topic::Diagnostics) => {
                let sentence = "publish.ros2.diagnostics is given but \"diagnostics\" is not among publish.ros2.topics, \
                                expected both or neither";
                return Err(source.field_error(raw, sentence));
            }
            Some(raw) => raw.get_ref().validated(source)?,
        };
        Ok(Ros2Settings { rate, topics, control: self.control, diagnostics })
    }
}

impl RawQos {
    fn validated(&self, topic: Topic, source: &Source) -> Result<Qos, SceneError> {
        let default = topic.default_qos();
        let field = format!("publish.ros2.qos.{}.depth", topic.name());
        let depth = self.depth.as_ref().map(|depth| source.check_count(&field, depth, Accepted::DEPTH)).transpose()?;
        Ok(Qos {
            reliability: self.reliability.unwrap_or(default.reliability),
            durability: self.durability.unwrap_or(default.durability),
            depth: depth.map_or(default.depth, |depth| depth as u32),
        })
    }
}
