//! diagnostic_msgs: the health of the loop, of the dragon and of a chase, once a second.

use serde::Serialize;

use super::{HasStamp, Header, Time, level_of};
use crate::settings::DiagnosticLimits;
use bench_dragon_messages::chase::{ChaseSource, ChaseState};
use bench_dragon_messages::sentence::{chase_sentence, keep_out, lost_files_sentence, name_in, number, obstacle_name};
use bench_dragon_messages::state::{EventKind, Severity};
use bench_dragon_messages::{ChaseStatus, CollisionAlert, LoopStatus, Stage};

/// diagnostic_msgs/KeyValue.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct KeyValue {
    /// The name of the figure.
    pub key: String,
    /// The figure.
    pub value: String,
}

/// diagnostic_msgs/DiagnosticStatus.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DiagnosticStatus {
    /// 0 OK, 1 WARN, 2 ERROR.
    pub level: u8,
    /// The subject.
    pub name: String,
    /// The finding in a few words.
    pub message: String,
    /// The publisher's name.
    pub hardware_id: String,
    /// The figures.
    pub values: Vec<KeyValue>,
}

/// diagnostic_msgs/DiagnosticArray.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DiagnosticArray {
    /// The time of the status.
    pub header: Header,
    /// The loop, the dragon and, where one runs or has died, the chase.
    pub status: Vec<DiagnosticStatus>,
}

/// DiagnosticStatus.OK, WARN and ERROR.
const OK: u8 = 0;
const WARN: u8 = 1;
const ERROR: u8 = 2;

/// The time without a status, in nanoseconds, after which a chase counts as dead. A chase sends five statuses a second.
const CHASE_SILENCE_NS: u64 = 2_000_000_000;

/// The input of a second's diagnostics besides the status.
#[derive(Debug, Clone, Copy)]
pub struct LoopSecond<'a> {
    /// The status one second before; the same status if that is unknown.
    pub before: &'a LoopStatus,
    /// Messages discarded by ROS 2 queues since the start.
    pub discarded: u64,
    /// The same, one second before.
    pub discarded_before: u64,
    /// The limits for warnings and errors.
    pub limits: DiagnosticLimits,
}

impl LoopSecond<'_> {
    /// Returns the level of the last second alone, and the reason.
    fn level(&self, status: &LoopStatus) -> (u8, String) {
        let Self { before, discarded, discarded_before, limits } = *self;
        let since = |now: u64, then: u64| now.saturating_sub(then);
        let skipped = since(status.skipped, before.skipped);
        let lateness = status.lateness_p99_second as f64 * 1e-9;
        let graded = |warn: bool, error: bool| if error { ERROR } else { u8::from(warn) * WARN };
        let findings = [
            (u8::from(status.lost_files > 0) * ERROR, lost_files_sentence(status.lost_files)),
            (
                u8::from(status.unforeseen_contacts > before.unforeseen_contacts) * ERROR,
                "a contact that no search had found".to_owned(),
            ),
            (
                u8::from(status.unsolved_frames > before.unsolved_frames) * ERROR,
                format!("{} frames without a solution", since(status.unsolved_frames, before.unsolved_frames)),
            ),
            (
                graded(skipped >= limits.skipped_warn, skipped >= limits.skipped_error_at(status.rate)),
                format!("{skipped} periods skipped"),
            ),
            (
                graded(lateness >= limits.lateness_warn, lateness >= limits.lateness_error),
                format!("wake-up lateness p99 {:.1} us", 1e6 * lateness),
            ),
            (
                u8::from(discarded > discarded_before) * WARN,
                format!("{} messages discarded", since(discarded, discarded_before)),
            ),
        ];
        let worst = findings.iter().map(|(level, _)| *level).max().unwrap_or(OK);
        let named: Vec<_> = findings.into_iter().filter(|(level, _)| *level > OK).map(|(_, finding)| finding).collect();
        (worst, if named.is_empty() { "on time".to_owned() } else { named.join(", ") })
    }
}

impl DiagnosticArray {
    /// Creates the diagnostics of the loop and of the dragons of a stage for the last second.
    pub fn of(
        name: &str,
        status: &LoopStatus,
        stage: &Stage,
        alert: Option<&CollisionAlert>,
        second: &LoopSecond,
    ) -> Self {
        let value = |key: &str, value: String| KeyValue { key: key.to_owned(), value };
        let level = level_of(alert);
        let (loop_level, message) = second.level(status);
        let the_loop = DiagnosticStatus {
            level: loop_level,
            name: format!("{name}: loop"),
            message,
            hardware_id: name.to_owned(),
            values: vec![
                value("rate", format!("{:.3}", status.measured_rate)),
                value("requested rate", status.rate.to_string()),
                value("overruns", status.overruns.to_string()),
                value("skipped periods", status.skipped.to_string()),
                value("wake-up lateness p99 (us)", format!("{:.1}", status.lateness_p99_second as f64 / 1e3)),
                value("step cost p99 (us)", format!("{:.1}", status.step_p99_second as f64 / 1e3)),
                value("messages discarded", second.discarded.to_string()),
            ],
        };
        let mut values = vec![
            value("level", level.name().to_owned()),
            value("sim_time (s)", format!("{:.3}", status.sim_time)),
            value("scene", status.scene.as_str().to_owned()),
        ];
        if let Some(alert) = alert {
            let keep_out = keep_out(stage, alert.bench_b);
            if keep_out > 0.0 {
                values.push(value("distance (m)", format!("{:.4}", alert.clearance + keep_out)));
                values.push(value("keep-out (m)", number(keep_out)));
            }
            values.push(value("clearance (m)", format!("{:.4}", alert.clearance)));
            values.push(value("time to event (s)", format!("{:.3}", alert.event_time - status.sim_time)));
            let from = if stage.dragons.len() > 1 { 1 } else { 0 };
            values.push(value(&format!("nearest benches (from {from})"), listed(alert.nearest_benches(), stage)));
            values.push(value("event", alert.event_kind().map_or("none", EventKind::name).to_owned()));
            values.push(value(&format!("event benches (from {from})"), listed(alert.event_benches(), stage)));
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

    /// Adds the latest status of a chase to the diagnostics of `loop_status`.
    pub fn with_chase(mut self, name: &str, loop_status: &LoopStatus, chase: &ChaseStatus) -> Self {
        let value = |key: &str, value: String| KeyValue { key: key.to_owned(), value };
        let state = chase.chase_state();
        let is_over = state == Some(ChaseState::Ended);
        let has_died = !is_over && loop_status.stamp_ns.saturating_sub(chase.stamp_ns) >= CHASE_SILENCE_NS;
        let is_locked = state == Some(ChaseState::Locked) && !has_died;
        let (level, message) = match state {
            _ if has_died => (ERROR, "has died; the show stays at its last rate".to_owned()),
            Some(ChaseState::Locked | ChaseState::Ended) => (OK, chase_sentence(chase)),
            Some(ChaseState::Lost) => (ERROR, chase_sentence(chase)),
            _ => (WARN, chase_sentence(chase)),
        };
        let mut values = vec![
            value("source", chase.chase_source().map_or("unknown", ChaseSource::name).to_owned()),
            value("locked", is_locked.to_string()),
            value("state", state.map_or("unknown", ChaseState::name).to_owned()),
            value("timecode", chase.label().unwrap_or_default()),
        ];
        let figures = [("error (s)", chase.error), ("rate", chase.rate), ("distance (m)", chase.distance)];
        let known = figures.into_iter().filter(|(_, figure)| !has_died && figure.is_finite());
        values.extend(known.map(|(key, figure)| value(key, format!("{figure:.6}"))));
        self.status.push(DiagnosticStatus {
            level,
            name: format!("{name}: chase"),
            message,
            hardware_id: name.to_owned(),
            values,
        });
        self
    }
}

impl HasStamp for DiagnosticArray {
    fn set_stamp(&mut self, stamp: Time) {
        self.header.stamp = stamp;
    }
}

/// Returns benches and obstacles in a list, or "none". Benches of one dragon are numbers from 0; benches of several
/// dragons have names, which count from 1 within their dragon.
fn listed(numbers: impl Iterator<Item = u32>, stage: &Stage) -> String {
    let listed = |number: u32| {
        let is_named = stage.dragons.len() > 1 || obstacle_name(stage, number).is_some();
        if is_named { name_in(stage, number) } else { number.to_string() }
    };
    let names: Vec<_> = numbers.map(listed).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench_dragon_messages::state::FrameState;
    use bench_dragon_messages::{List, SceneName, StageDragon, StageObstacle};

    fn level(before: LoopStatus, now: LoopStatus, limits: DiagnosticLimits, discarded: [u64; 2]) -> (u8, String) {
        let [discarded_before, discarded] = discarded;
        let second = LoopSecond { before: &before, discarded, discarded_before, limits };
        let [the_loop, _] = DiagnosticArray::of("d", &now, &Stage::default(), None, &second).status.try_into().unwrap();
        (the_loop.level, the_loop.message)
    }

    #[test]
    fn the_limits_of_the_scene_hold_for_the_last_second_alone() {
        let status = |skipped| LoopStatus { rate: 60.0, skipped, ..LoopStatus::default() };
        let default = DiagnosticLimits::default();
        let told = |before, now| level(status(before), status(now), default, [5, 5]);
        assert_eq!(told(900, 900), (OK, "on time".to_owned()));
        assert_eq!(told(900, 901), (WARN, "1 periods skipped".to_owned()));
        assert_eq!(told(900, 905), (WARN, "5 periods skipped".to_owned()));
        assert_eq!(told(900, 906), (ERROR, "6 periods skipped".to_owned()));

        let limits =
            DiagnosticLimits { skipped_warn: 3, skipped_error: Some(4), lateness_warn: 1e-3, lateness_error: 2e-3 };
        let late = |lateness_p99_second| LoopStatus { lateness_p99_second, ..status(2) };
        let told = |skipped: u64, lateness| level(status(2 - skipped), late(lateness), limits, [0, 0]);
        assert_eq!(told(2, 999_999), (OK, "on time".to_owned()));
        assert_eq!(told(0, 1_000_000), (WARN, "wake-up lateness p99 1000.0 us".to_owned()));
        assert_eq!(told(0, 2_000_000), (ERROR, "wake-up lateness p99 2000.0 us".to_owned()));
        assert_eq!(level(status(0), status(4), limits, [0, 0]).0, ERROR);

        assert_eq!(level(status(0), status(0), default, [5, 7]), (WARN, "2 messages discarded".to_owned()));
        let unsolved = LoopStatus { unsolved_frames: 3, ..status(1) };
        let both = "3 frames without a solution, 1 periods skipped".to_owned();
        assert_eq!(level(status(0), unsolved, default, [0, 0]), (ERROR, both));
        let contact = LoopStatus { unforeseen_contacts: 1, ..status(0) };
        assert_eq!(level(status(0), contact, default, [0, 0]).0, ERROR);
        assert_eq!(level(contact, contact, default, [0, 0]), (OK, "on time".to_owned()));
    }

    #[test]
    fn benches_of_several_dragons_and_obstacles_have_their_names() {
        let told = |dragons: &[(&str, u32)], alert: CollisionAlert| {
            let mut first_handle = 0;
            let dragons = dragons.iter().map(|&(name, benches)| {
                let dragon =
                    StageDragon { first_handle, benches, name: SceneName::new(name), ..StageDragon::default() };
                first_handle += benches + 1;
                dragon
            });
            let well = StageObstacle { name: SceneName::new("well"), ..StageObstacle::default() };
            let stage = Stage { dragons: List::of(dragons), obstacles: List::of([well]), ..Stage::default() };
            let status = LoopStatus::default();
            let limits = DiagnosticLimits::default();
            let second = LoopSecond { before: &status, discarded: 0, discarded_before: 0, limits };
            let [_, dragon] =
                DiagnosticArray::of("d", &status, &stage, Some(&alert), &second).status.try_into().unwrap();
            let benches = dragon.values.into_iter().filter(|value| value.key.contains("benches"));
            benches.map(|value| (value.key, value.value)).collect::<Vec<_>>()
        };
        let pairs = |nearest: [&str; 2], event: [&str; 2]| {
            [nearest, event].map(|[key, value]| (key.to_owned(), value.to_owned())).to_vec()
        };
        let alert = CollisionAlert {
            bench_a: 8,
            bench_b: 21,
            event: FrameState::Contact as u32,
            event_bench_a: 0,
            event_bench_b: 34,
            ..CollisionAlert::default()
        };
        assert_eq!(
            told(&[("gold", 20), ("jade", 12)], alert),
            pairs(
                ["nearest benches (from 1)", "bench 9 of gold, bench 1 (the head) of jade"],
                ["event benches (from 1)", "bench 1 (the head) of gold, the well"]
            )
        );
        assert_eq!(
            told(&[("", 33)], alert),
            pairs(["nearest benches (from 0)", "8, 21"], ["event benches (from 0)", "0, the well"])
        );
    }

    #[test]
    fn a_chase_is_judged_by_its_state_and_its_silence() {
        let told = |state: ChaseState, age_ns: u64| {
            let now = LoopStatus { stamp_ns: 9_000_000_000, ..LoopStatus::default() };
            let chase = ChaseStatus {
                state: state as u32,
                stamp_ns: now.stamp_ns - age_ns,
                error: 0.001,
                minutes: 5,
                frame_rate: 2,
                ..ChaseStatus::default()
            };
            let second =
                LoopSecond { before: &now, discarded: 0, discarded_before: 0, limits: DiagnosticLimits::default() };
            let array = DiagnosticArray::of("d", &now, &Stage::default(), None, &second).with_chase("d", &now, &chase);
            let [_, _, chase] = array.status.try_into().unwrap();
            assert_eq!(chase.name, "d: chase");
            let value = |key: &str| chase.values.iter().find(|of| of.key == key).map(|of| of.value.clone());
            assert_eq!(value("timecode").as_deref(), Some("00:05:00:00"));
            (chase.level, value("locked").unwrap(), value("error (s)"))
        };
        let error = || Some("0.001000".to_owned());
        assert_eq!(told(ChaseState::Locked, 200_000_000), (OK, "true".to_owned(), error()));
        assert_eq!(told(ChaseState::Freewheeling, 200_000_000), (WARN, "false".to_owned(), error()));
        assert_eq!(told(ChaseState::Lost, 200_000_000).0, ERROR);
        assert_eq!(told(ChaseState::Locked, 2_000_000_000), (ERROR, "false".to_owned(), None));
        assert_eq!(told(ChaseState::Ended, 8_000_000_000).0, OK);
    }
}
