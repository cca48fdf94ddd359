//! The ROS 2 topics and services of a scene: `[publish.ros2]`.
//!
//! In: the table of the file. Out: checked [`Ros2Settings`].

use std::collections::BTreeMap;

use bench_dragon_ros2_messages::settings::{
    DiagnosticLimits, Durability, Qos, Reliability, Ros2Settings, StampClock, Topic,
};
use serde::Deserialize;
use toml::Spanned;

use super::{Accepted, SceneError, Source};

/// The table of the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRos2 {
    rate: Option<Spanned<f64>>,
    topics: Option<Spanned<Vec<Topic>>>,
    #[serde(default)]
    control: bool,
    stamps: Option<Spanned<StampClock>>,
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
        let has_clock = topics.contains_key(&Topic::Clock);
        let stamps = match &self.stamps {
            Some(given) if *given.get_ref() == StampClock::Sim && !has_clock => {
                let sentence = "publish.ros2.stamps is \"sim\" but \"clock\" is not among publish.ros2.topics, expected both, \
                                or \"wall\"";
                return Err(source.field_error(given, sentence));
            }
            Some(given) => *given.get_ref(),
            None if has_clock => StampClock::Sim,
            None => StampClock::Wall,
        };
        Ok(Ros2Settings { rate, topics, control: self.control, stamps, diagnostics })
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
