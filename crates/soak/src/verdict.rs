//! The verdict of a soak test: each limit, the value found, and the result.

use serde::Serialize;

use super::conduct::Conducted;
use super::conducting::Conducting;
use super::fleet::Fleet;
use super::limits::Limits;
use super::member::{Member, Role};
use super::observation::Observation;
use bench_dragon_publisher::live::statistics::RunSummary;

/// A deadline may be this far from first deadline + tick / rate: both are rounded to whole nanoseconds.
const ROUNDING_NS: f64 = 2.0;

/// The check of processes that ended early, whose [causes](super::causes) stand before all checks.
pub(super) const ENDED: &str = "processes that ended by themselves or hung";

/// The checks that a busy machine fails.
pub(super) const LATE: [&str; 3] =
    ["frames missed by steady subscribers", "periods skipped", "wake-up lateness, 99.9th percentile"];

/// The unit of a value, for its notation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Unit {
    /// A number of something.
    Count,
    /// A share, 0 to 1; for people in percent.
    Share,
    /// Nanoseconds; for people in microseconds.
    Nanoseconds,
    /// Bytes; for people in megabytes.
    Bytes,
}

impl Unit {
    /// Returns a value as text.
    pub fn show(self, value: f64) -> String {
        match self {
            Self::Count => format!("{value}"),
            Self::Share => format!("{:.4} %", 100.0 * value),
            Self::Nanoseconds => format!("{:.3} us", value / 1e3),
            Self::Bytes => format!("{:.3} MB", value / 1e6),
        }
    }
}

/// One limit and the value found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LimitCheck {
    /// The name of the limited value.
    pub name: &'static str,
    /// The greatest allowed value.
    pub limit: f64,
    /// The value found; NaN (null in JSON) for an unknown value: without a summary, a last status or any command.
    pub value: f64,
    /// The unit of both.
    pub unit: Unit,
    /// True if the limit was kept.
    pub passed: bool,
}

impl LimitCheck {
    fn new(name: &'static str, unit: Unit, limit: f64, value: f64) -> Self {
        // An unknown value does not pass.
        Self { name, limit, value, unit, passed: value <= limit }
    }

    /// Returns the value with its limit, as a sentence.
    pub fn sentence(&self) -> String {
        format!("{}: {} (at most {})", self.name, self.shown(), self.unit.show(self.limit))
    }

    /// Returns the value found as text.
    pub fn shown(&self) -> String {
        if self.value.is_nan() { "not known".to_owned() } else { self.unit.show(self.value) }
    }

    /// Returns the check as a line of text.
    pub fn line(&self) -> String {
        let mark = if self.passed { "pass" } else { "FAIL" };
        format!("{mark}  {:<54} {:>14}   at most {}", self.name, self.shown(), self.unit.show(self.limit))
    }
}

/// The checks of all limits.
#[derive(Debug, Clone, PartialEq)]
pub struct SoakVerdict {
    /// The checks.
    pub checks: Vec<LimitCheck>,
}

impl SoakVerdict {
    /// Returns the verdict on a fleet that has finished.
    pub fn of(fleet: &Fleet, limits: &Limits) -> Self {
        let steady: Vec<_> = fleet.members().iter().filter(|member| member.role == Role::Steady).collect();
        let of_all = |count: fn(&Observation) -> u64| {
            fleet.members().iter().map(|member| count(&member.seen())).sum::<u64>() as f64
        };
        let count = |name, limit, value| LimitCheck::new(name, Unit::Count, limit, value);
        let summary = fleet.summary();
        let of_summary = |value: fn(&RunSummary) -> f64| summary.map_or(f64::NAN, value);
        let phase = fleet.members().iter().map(|member| member.seen().phase_error_ns).fold(0.0, f64::max);
        let mut checks = vec![
            count(LATE[0], limits.missed as f64, missed(fleet, &steady)),
            LimitCheck::new(
                LATE[1],
                Unit::Share,
                limits.skipped_share,
                of_summary(|summary| summary.skipped as f64 / (summary.frames + summary.skipped) as f64),
            ),
            LimitCheck::new(
                LATE[2],
                Unit::Nanoseconds,
                limits.lateness_p999_ns as f64,
                of_summary(|summary| summary.wakeup_ns.p999 as f64),
            ),
        ];
        // A test of less than a minute does not measure growth.
        checks.extend(fleet.resident_growth().map(|growth| {
            let limit = limits.resident_growth_bytes as f64;
            LimitCheck::new("growth of resident memory after the first minute", Unit::Bytes, limit, growth as f64)
        }));
        checks.extend(fleet.ros2_growth().map(|growth| {
            let limit = limits.resident_growth_bytes as f64;
            let name = "growth of the ROS 2 process's resident memory after the first minute";
            LimitCheck::new(name, Unit::Bytes, limit, growth as f64)
        }));
        checks.extend([
            count("frames out of order, or with inconsistent timestamps", 0.0, of_all(|seen| seen.disordered)),
            count("frames with a link of a wrong length", 0.0, of_all(|seen| seen.wrong_links)),
            LimitCheck::new("drift of the tick against CLOCK_MONOTONIC", Unit::Nanoseconds, ROUNDING_NS, phase),
            count("counts that publisher and subscribers disagree on", 0.0, disagreements(fleet, &steady)),
            count(ENDED, 0.0, lost(fleet)),
        ]);
        if let Some(conducting) = fleet.conducting() {
            let of_load = |value: fn(&Conducted) -> u64| {
                // Without commands nothing was tested.
                let conducted = conducting.conducted().filter(|conducted| conducted.sent > 0);
                conducted.map_or(f64::NAN, |conducted| value(conducted) as f64)
            };
            checks.extend([
                count("frames that disobey the commands", 0.0, of_all(|seen| seen.disobedient)),
                count("jumps of simulated time too many or too few", 0.0, wrong_jumps(&steady, conducting)),
                count("answers that the command table does not allow", 0.0, of_load(|conducted| conducted.wrong)),
                count("answers that their frames contradict", 0.0, of_load(|conducted| conducted.contradicted)),
                count("commands that were not answered", 0.0, of_load(|conducted| conducted.lost)),
            ]);
        }
        Self { checks }
    }

    /// Returns true if every limit was kept.
    pub fn passed(&self) -> bool {
        self.checks.iter().all(|check| check.passed)
    }

    /// Returns `PASS` or `FAIL`.
    pub fn word(&self) -> &'static str {
        if self.passed() { "PASS" } else { "FAIL" }
    }
}

/// Returns the number of frames that did not come, with the frames after the last received frame.
fn missed(fleet: &Fleet, steady: &[&Member]) -> f64 {
    let Some(summary) = fleet.summary() else { return f64::NAN };
    let of = |member: &&Member| member.seen().missed + member.missed_after_last(Some(summary));
    steady.iter().map(of).sum::<u64>() as f64
}

/// Returns the number of steady subscribers that disagree with the publisher. One reason is that frames and skipped
/// periods do not add up to the last received tick. Others are a number of runs other than one, and more than a
/// second's frames that were not compared with the stage.
fn disagreements(fleet: &Fleet, steady: &[&Member]) -> f64 {
    let Some(summary) = fleet.summary() else { return f64::NAN };
    let disagrees = |member: &&&Member| {
        let seen = member.seen();
        // Periods that passed between the last frame and the stop are in the summary, and in no frame.
        let last_status = seen.status.filter(|status| status.frames == seen.last_sequence + 1);
        let skipped = last_status.map_or(summary.skipped, |status| status.skipped);
        let whole = seen.last_sequence + 1 < summary.frames
            || skipped <= summary.skipped && seen.last_tick + 1 == summary.frames + skipped;
        let second = seen.status.map_or(0.0, |status| status.rate);
        !whole || seen.runs != 1 || (seen.received - seen.links_checked) as f64 > second
    };
    steady.iter().filter(disagrees).count() as f64
}

/// Returns the difference between the jumps that steady subscribers counted and the expected jumps. The expected jumps
/// are the commanded jumps, and the jumps by which the show began again. Unknown without the last status.
fn wrong_jumps(steady: &[&Member], conducting: &Conducting) -> f64 {
    let Some(conducted) = conducting.conducted() else { return f64::NAN };
    let of = |member: &&Member| {
        let seen = member.seen();
        let status = seen.status.filter(|status| status.frames == seen.last_sequence + 1);
        status.map_or(f64::NAN, |status| u64::from(seen.epoch).abs_diff(status.shows_played + conducted.jumps) as f64)
    };
    steady.iter().map(of).sum()
}

fn lost(fleet: &Fleet) -> f64 {
    let conducting = fleet.conducting().map_or(0, Conducting::failed);
    let subscribers: u64 = fleet.members().iter().map(Member::failed).sum();
    (conducting + subscribers + u64::from(fleet.publisher_failed())) as f64
}
