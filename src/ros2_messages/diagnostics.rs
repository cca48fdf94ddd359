//! diagnostic_msgs: the health of the loop and of the dragon, once a second.

use serde::Serialize;

use super::{Header, level_of};
use crate::motion::event::EventKind;
use crate::show::state::Severity;
use crate::wire::{CollisionAlert, LoopStatus};

/// diagnostic_msgs/KeyValue.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct KeyValue {
    /// What.
    pub key: String,
    /// How much.
    pub value: String,
}

/// diagnostic_msgs/DiagnosticStatus.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DiagnosticStatus {
    /// 0 OK, 1 WARN, 2 ERROR.
    pub level: u8,
    /// What is diagnosed.
    pub name: String,
    /// In a few words.
    pub message: String,
    /// The publisher's name.
    pub hardware_id: String,
    /// The figures.
    pub values: Vec<KeyValue>,
}

/// diagnostic_msgs/DiagnosticArray.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DiagnosticArray {
    /// When this was so.
    pub header: Header,
    /// The loop and the dragon.
    pub status: Vec<DiagnosticStatus>,
}

/// DiagnosticStatus.OK, WARN and ERROR.
const OK: u8 = 0;
const WARN: u8 = 1;
const ERROR: u8 = 2;

impl DiagnosticArray {
    /// The loop's health and the dragon's, of the last second. `skipped_since` is how many periods have been skipped
    /// since the last message, `discarded` how many messages no ROS 2 queue would take since the start.
    pub fn of(
        name: &str,
        status: &LoopStatus,
        alert: Option<&CollisionAlert>,
        skipped_since: u64,
        discarded: u64,
    ) -> Self {
        let value = |key: &str, value: String| KeyValue { key: key.to_owned(), value };
        let level = level_of(alert);
        let the_loop = DiagnosticStatus {
            level: if skipped_since > 0 { WARN } else { OK },
            name: format!("{name}: loop"),
            message: if skipped_since > 0 { format!("{skipped_since} periods skipped") } else { "on time".to_owned() },
            hardware_id: name.to_owned(),
            values: vec![
                value("rate", format!("{:.3}", status.measured_rate)),
                value("requested rate", status.rate.to_string()),
                value("overruns", status.overruns.to_string()),
                value("skipped periods", status.skipped.to_string()),
                value("wake-up lateness p99 (us)", format!("{:.1}", status.lateness_p99_second as f64 / 1e3)),
                value("step cost p99 (us)", format!("{:.1}", status.step_p99_second as f64 / 1e3)),
                value("messages discarded", discarded.to_string()),
            ],
        };
        let mut values = vec![
            value("level", level.name().to_owned()),
            value("sim_time (s)", format!("{:.3}", status.sim_time)),
            value("scene", status.scene.as_str().to_owned()),
        ];
        if let Some(alert) = alert {
            values.push(value("clearance (m)", format!("{:.4}", alert.clearance)));
            values.push(value("time to event (s)", format!("{:.3}", alert.event_time - status.sim_time)));
            values.push(value("nearest benches (from 0)", listed(alert.nearest_benches())));
            values.push(value("event", alert.event_kind().map_or("none", EventKind::name).to_owned()));
            values.push(value("event benches (from 0)", listed(alert.event_benches())));
        }
        let dragon = DiagnosticStatus {
            level: match level.severity() {
                Severity::Ok => OK,
                Severity::Warning => WARN,
                Severity::Error => ERROR,
            },
            name: format!("{name}: dragon"),
            message: level.name().to_owned(),
            hardware_id: name.to_owned(),
            values,
        };
        Self { header: Header::of(status.stamp_ns), status: vec![the_loop, dragon] }
    }
}

/// Benches in a row, or "none".
fn listed(benches: impl Iterator<Item = u32>) -> String {
    let names: Vec<_> = benches.map(|bench| bench.to_string()).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
