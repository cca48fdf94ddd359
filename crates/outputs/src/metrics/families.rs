//! The figures that are served, and their names. In: the report of a [`Monitor`](crate::monitor::Monitor).
//! Out: families of samples. Pure.
//!
//! Names and units follow Prometheus ("Metric and label naming"): seconds, bytes, metres, `_total` for counts. Every
//! sample has the publisher's name as its label `name`, and the name of one of several dragons as its label `dragon`.
//! Each new value of a label makes a new series. So only one sample has the run as a label, and an alert has labels
//! with dragons and obstacles, but none with the number of a bench.

use super::exposition::{Family, Kind};
use crate::monitor::{IntervalReport, Presence};
use bench_dragon_messages::chase::ChaseState;
use bench_dragon_messages::sentence::obstacle_name;
use bench_dragon_messages::state::{EventKind, FrameState, PlaybackState};
use bench_dragon_messages::{ChaseStatus, CollisionAlert, FrameHeader, HandlePose, LoopStatus, NO_BENCH, Stage};

/// Returns all families of the publisher `name`. Without a running publisher most of them have no samples.
pub fn families(name: &str, report: &IntervalReport) -> Vec<Family> {
    let families = Families { name };
    let mut all = families.of_this_process(report);
    if let Some(status) = &report.status {
        all.extend(families.of_status(status));
    }
    if let Some(header) = report.present_header() {
        all.extend(families.of_frame(&header));
        all.extend(report.stage.iter().flat_map(|stage| families.of_dragons(stage, &header, &report.heads)));
    }
    if let Some(alert) = &report.alert {
        all.push(families.of_alert(alert));
        let named = report.stage.iter().filter(|stage| stage.run_id == alert.run_id);
        all.extend(named.flat_map(|stage| families.of_alert_names(alert, stage)));
    }
    if let Some((status, has_died)) = &report.chase {
        all.extend(families.of_chase(status, *has_died));
    }
    all
}

/// Returns the families of several publishers as one list: each family once, with the samples of all publishers.
pub fn joined(publishers: impl IntoIterator<Item = Vec<Family>>) -> Vec<Family> {
    let mut all: Vec<Family> = Vec::new();
    for family in publishers.into_iter().flatten() {
        match all.iter_mut().find(|known| known.name == family.name) {
            Some(known) => known.samples.extend(family.samples),
            None => all.push(family),
        }
    }
    all
}

struct Families<'a> {
    name: &'a str,
}

impl Families<'_> {
    fn labels(&self, further: &[(&'static str, &str)]) -> Vec<(&'static str, String)> {
        let further = further.iter().map(|(label, value)| (*label, (*value).to_owned()));
        [("name", self.name.to_owned())].into_iter().chain(further).collect()
    }

    /// Returns a family of one sample.
    fn one(
        &self,
        name: &'static str,
        kind: Kind,
        unit: Option<&'static str>,
        help: &'static str,
        value: f64,
    ) -> Family {
        Family { name, kind, unit, help, samples: vec![(self.labels(&[]), value)] }
    }

    fn count(&self, name: &'static str, help: &'static str, count: u64) -> Family {
        self.one(name, Kind::Counter, None, help, count as f64)
    }

    fn gauge(&self, name: &'static str, help: &'static str, value: f64) -> Family {
        self.one(name, Kind::Gauge, None, help, value)
    }

    /// Returns one sample for each of several states, 1 for the present state.
    fn states<'a>(
        &self,
        name: &'static str,
        help: &'static str,
        all: impl Iterator<Item = &'a str>,
        present: Option<&str>,
    ) -> Family {
        let sample = |state: &str| (self.labels(&[("state", state)]), f64::from(u8::from(Some(state) == present)));
        Family { name, kind: Kind::Gauge, unit: None, help, samples: all.map(sample).collect() }
    }

    fn of_this_process(&self, report: &IntervalReport) -> Vec<Family> {
        let is = |holds: bool| f64::from(u8::from(holds));
        vec![
            self.gauge(
                "bench_dragon_up",
                "1 while a publisher of this name is alive, else 0.",
                is(report.presence != Presence::Waiting),
            ),
            self.gauge(
                "bench_dragon_silent",
                "1 while the publisher is alive and sends no frames, else 0.",
                is(report.presence == Presence::Silent),
            ),
            self.count(
                "bench_dragon_metrics_frames_received",
                "Frames that this process received, of all runs.",
                report.received,
            ),
            self.count(
                "bench_dragon_metrics_frames_missed",
                "Frames that this process missed, by the gaps between those that it received.",
                report.missed,
            ),
        ]
    }

    fn of_status(&self, status: &LoopStatus) -> Vec<Family> {
        let LoopStatus {
            run_id,
            tick: _,
            sequence,
            stamp_ns: _,
            sim_time: _,
            rate,
            measured_rate,
            overruns,
            skipped,
            shows_played,
            unforeseen_contacts,
            unsolved_frames,
            lateness_p50_second,
            lateness_p99_second,
            lateness_max_second,
            lateness_p50_total,
            lateness_p99_total,
            lateness_p999_total,
            lateness_max_total,
            step_p50_second,
            step_p99_second,
            step_max_second,
            step_p50_total,
            step_p99_total,
            step_p999_total,
            step_max_total,
            resident_bytes,
            lost_files,
            subscribers,
            file_descriptors,
            ref scene,
        } = *status;
        let run = format!("{:016x}", run_id);
        let run = self.labels(&[("run_id", run.as_str()), ("scene", scene.as_str())]);
        vec![
            Family {
                name: "bench_dragon_run",
                kind: Kind::Info,
                unit: None,
                help: "The present run and its scene.",
                samples: vec![(run, 1.0)],
            },
            self.count(
                "bench_dragon_frames_published",
                "Frames published in this run, as of its latest status.",
                sequence + 1,
            ),
            self.count("bench_dragon_periods_skipped", "Periods skipped in this run.", skipped),
            self.count(
                "bench_dragon_overruns",
                "Incidents in this run in which at least one period was skipped.",
                overruns,
            ),
            self.count("bench_dragon_shows_played", "Shows played to their end in this run.", shows_played),
            self.count(
                "bench_dragon_unforeseen_contacts",
                "Contacts that no search had found before the show.",
                unforeseen_contacts,
            ),
            self.count(
                "bench_dragon_unsolved_frames",
                "Frames without a solution, which repeated the frame before.",
                unsolved_frames,
            ),
            self.one("bench_dragon_requested_rate_hertz", Kind::Gauge, Some("hertz"), "The requested rate.", rate),
            self.one(
                "bench_dragon_measured_rate_hertz",
                Kind::Gauge,
                Some("hertz"),
                "Frames published in the last second.",
                measured_rate,
            ),
            self.summary(
                "bench_dragon_wakeup_lateness_seconds",
                "Wake-up lateness of the loop, in the last second and in the whole run; quantile 1 is the maximum.",
                [lateness_p50_second, lateness_p99_second, lateness_max_second],
                [lateness_p50_total, lateness_p99_total, lateness_p999_total, lateness_max_total],
            ),
            self.summary(
                "bench_dragon_step_seconds",
                "Cost of a step of the loop, in the last second and in the whole run; quantile 1 is the maximum.",
                [step_p50_second, step_p99_second, step_max_second],
                [step_p50_total, step_p99_total, step_p999_total, step_max_total],
            ),
            self.one(
                "bench_dragon_resident_memory_bytes",
                Kind::Gauge,
                Some("bytes"),
                "Resident memory of the publisher.",
                resident_bytes as f64,
            ),
            self.gauge(
                "bench_dragon_lost_files",
                "Files of the publisher in shared memory that another program has removed.",
                lost_files as f64,
            ),
            self.gauge(
                "bench_dragon_open_file_descriptors",
                "Open file descriptors of the publisher.",
                f64::from(file_descriptors),
            ),
            self.gauge(
                "bench_dragon_subscribers",
                "Subscribers of the frames over shared memory, this process included.",
                f64::from(subscribers),
            ),
        ]
    }

    /// Returns nanoseconds as quantiles: 0.5, 0.99, 1 of the last second; 0.5, 0.99, 0.999, 1 of the run.
    fn summary(&self, name: &'static str, help: &'static str, second: [u64; 3], run: [u64; 4]) -> Family {
        let sample =
            |window, quantile, ns: u64| (self.labels(&[("window", window), ("quantile", quantile)]), ns as f64 / 1e9);
        let second = ["0.5", "0.99", "1"].into_iter().zip(second).map(|(quantile, ns)| sample("second", quantile, ns));
        let run = ["0.5", "0.99", "0.999", "1"].into_iter().zip(run).map(|(quantile, ns)| sample("run", quantile, ns));
        Family { name, kind: Kind::Summary, unit: Some("seconds"), help, samples: second.chain(run).collect() }
    }

    fn of_frame(&self, header: &FrameHeader) -> Vec<Family> {
        let state = header.frame_state().map(FrameState::name);
        let playback = header.playback_state().map(PlaybackState::name);
        let mut families = vec![
            self.one(
                "bench_dragon_simulated_time_seconds",
                Kind::Gauge,
                Some("seconds"),
                "Simulated seconds since the start of the scene.",
                header.sim_time,
            ),
            self.gauge(
                "bench_dragon_time_scale",
                "Simulated seconds per second; 0 while paused or held.",
                header.time_scale,
            ),
            self.states(
                "bench_dragon_state",
                "State of the dragon: 1 for the present state.",
                FrameState::ALL.into_iter().map(FrameState::name),
                state,
            ),
            self.states(
                "bench_dragon_playback",
                "Playback state: 1 for the present state.",
                PlaybackState::ALL.into_iter().map(PlaybackState::name),
                playback,
            ),
        ];
        if !header.min_clearance.is_nan() {
            families.push(self.one(
                "bench_dragon_clearance_meters",
                Kind::Gauge,
                Some("meters"),
                "Least clearance of boards that share no handle, and of boards and obstacles; negative in an overlap.",
                header.min_clearance,
            ));
        }
        families
    }

    /// Returns a family of one sample for each dragon.
    fn of_each(&self, family: Family, stage: &Stage, values: impl Iterator<Item = f64>) -> Family {
        let sample = |(dragon, value): (&str, f64)| {
            let further = [("dragon", dragon)];
            (self.labels(if dragon.is_empty() { &[] } else { &further }), value)
        };
        let names = stage.dragons.iter().map(|dragon| dragon.name.as_str());
        Family { samples: names.zip(values).map(sample).collect(), ..family }
    }

    fn of_dragons(&self, stage: &Stage, header: &FrameHeader, heads: &[HandlePose]) -> Vec<Family> {
        let benches = self.gauge("bench_dragon_benches", "Benches of a dragon.", 0.0);
        let mut families =
            vec![self.of_each(benches, stage, stage.dragons.iter().map(|dragon| f64::from(dragon.benches)))];
        let speed = |head: &HandlePose| head.vx.hypot(head.vy) * header.time_scale;
        if heads.iter().all(|head| !speed(head).is_nan()) {
            let family = self.gauge(
                "bench_dragon_head_speed_meters_per_second",
                "Speed of the head of a dragon, per second of wall time; 0 while it stands.",
                0.0,
            );
            families.push(self.of_each(family, stage, heads.iter().map(speed)));
        }
        families
    }

    /// Returns the names of an alert: of the nearest boards or obstacle, and of its event. Empty for one dragon on
    /// empty ground, which has no names.
    fn of_alert_names(&self, alert: &CollisionAlert, stage: &Stage) -> Vec<Family> {
        if stage.dragons.len() <= 1 && stage.obstacles.is_empty() {
            return Vec::new();
        }
        let named = |name, help, event: Option<EventKind>, pair: [u32; 2]| {
            let dragon = |number: u32| stage.owner(number).map_or("", |(dragon, _)| dragon.name.as_str());
            let obstacle = obstacle_name(stage, pair[1]).unwrap_or_default();
            let event = event.map(|event| ("event", event.name()));
            let labels = [("dragon", dragon(pair[0])), ("other", dragon(pair[1])), ("obstacle", obstacle)];
            let labels: Vec<_> =
                event.into_iter().chain(labels.into_iter().filter(|(_, name)| !name.is_empty())).collect();
            Family { name, kind: Kind::Info, unit: None, help, samples: vec![(self.labels(&labels), 1.0)] }
        };
        let mut families = Vec::new();
        if alert.bench_a != NO_BENCH {
            families.push(named(
                "bench_dragon_nearest",
                "What is nearest in the latest alert: the dragons of two boards, or of a board, and an obstacle.",
                None,
                [alert.bench_a, alert.bench_b],
            ));
        }
        if let Some(event) = alert.event_kind() {
            families.push(named(
                "bench_dragon_alert_event",
                "The event of the latest alert: its kind, its dragons, its obstacle.",
                Some(event),
                [alert.event_bench_a, alert.event_bench_b],
            ));
        }
        families
    }

    fn of_chase(&self, status: &ChaseStatus, has_died: bool) -> Vec<Family> {
        let state = status.chase_state().filter(|_| !has_died).unwrap_or(ChaseState::Ended);
        let mut families = vec![
            self.states(
                "bench_dragon_chase_state",
                "State of the chase: 1 for the present state; ended for a chase that has died.",
                ChaseState::ALL.into_iter().map(ChaseState::name),
                Some(state.name()),
            ),
            self.count("bench_dragon_chase_readings", "Readings of the chased source.", status.readings),
            self.count("bench_dragon_chase_ignored", "Malformed and foreign messages to the chase.", status.ignored),
        ];
        if !status.error.is_nan() && !has_died {
            families.push(self.one(
                "bench_dragon_chase_error_seconds",
                Kind::Gauge,
                Some("seconds"),
                "Published simulated time minus the time that the chased source requests.",
                status.error,
            ));
        }
        families
    }

    fn of_alert(&self, alert: &CollisionAlert) -> Family {
        self.gauge(
            "bench_dragon_alert_level",
            "The level of the latest alert: 0 clear, 1 approaching, 2 contact, 3 stall, 4 lock, 6 obstacle.",
            f64::from(alert.level),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::exposition::{Format, render};
    use crate::monitor::Monitor;
    use bench_dragon_client::feed::FeedEvent;
    use bench_dragon_messages::state::Level;
    use bench_dragon_messages::{List, SceneName, StageDragon, StageObstacle};

    #[test]
    fn nothing_of_a_publisher_that_is_gone_is_served_but_that_it_is_down() {
        let mut monitor = Monitor::default();
        let value = |report: &IntervalReport, name| {
            let families = families("n", report);
            let found = families.iter().find(|family| family.name == name);
            found.map(|family| family.samples[0].1)
        };
        let waiting = monitor.report();
        assert_eq!(
            (value(&waiting, "bench_dragon_up"), value(&waiting, "bench_dragon_step_seconds")),
            (Some(0.0), None)
        );
        let header = FrameHeader::default();
        let frame = FeedEvent::Frame { header: &header, handles: &[], missed: 3 };
        let status = LoopStatus { step_p50_second: 1500, ..LoopStatus::default() };
        for event in
            [frame, FeedEvent::Status(&status), FeedEvent::Alert(&CollisionAlert::default()), FeedEvent::Silent]
        {
            monitor.handle(&event, 0);
        }
        let silent = monitor.report();
        assert_eq!(value(&silent, "bench_dragon_up"), Some(1.0));
        assert_eq!(value(&silent, "bench_dragon_silent"), Some(1.0));
        assert_eq!(value(&silent, "bench_dragon_step_seconds"), Some(1.5e-6));
        assert_eq!(value(&silent, "bench_dragon_alert_level"), Some(0.0));
        monitor.handle(&FeedEvent::Gone, 0);
        let gone = monitor.report();
        assert_eq!(families("n", &gone).len(), 4, "this process's own");
        assert_eq!(
            (value(&gone, "bench_dragon_up"), value(&gone, "bench_dragon_metrics_frames_missed")),
            (Some(0.0), Some(3.0))
        );
    }

    #[test]
    fn dragons_and_obstacles_are_labels() {
        let dragon = |name, first_handle| StageDragon {
            first_handle,
            benches: 60,
            name: SceneName::new(name),
            ..StageDragon::default()
        };
        let well = StageObstacle { name: SceneName::new("well"), ..StageObstacle::default() };
        let stage = Stage {
            dragons: List::of([dragon("gold", 0), dragon("jade", 61)]),
            obstacles: List::of([well]),
            ..Stage::default()
        };
        let header = FrameHeader { time_scale: 2.0, ..FrameHeader::default() };
        let mut handles = vec![HandlePose::default(); 122];
        handles[61] = HandlePose { vx: 0.6, vy: -0.8, ..HandlePose::default() };
        let alert = CollisionAlert {
            bench_a: 70,
            bench_b: 122,
            event: FrameState::Contact as u32,
            event_bench_a: 3,
            event_bench_b: 61,
            ..CollisionAlert::default()
        };
        let mut monitor = Monitor::default();
        for event in [
            FeedEvent::Stage { stage: &stage, segments: &[] },
            FeedEvent::Frame { header: &header, handles: &handles, missed: 0 },
            FeedEvent::Alert(&alert),
        ] {
            monitor.handle(&event, 0);
        }
        let text = render(&families("night", &monitor.report()), Format::OpenMetrics);
        for line in [
            "bench_dragon_benches{name=\"night\",dragon=\"jade\"} 60",
            "bench_dragon_head_speed_meters_per_second{name=\"night\",dragon=\"gold\"} 0",
            "bench_dragon_head_speed_meters_per_second{name=\"night\",dragon=\"jade\"} 2",
            "bench_dragon_nearest_info{name=\"night\",dragon=\"jade\",obstacle=\"well\"} 1",
            "bench_dragon_alert_event_info{name=\"night\",event=\"contact\",dragon=\"gold\",other=\"jade\"} 1",
        ] {
            assert!(text.lines().any(|printed| printed == line), "{line} in\n{text}");
        }
        monitor.handle(&FeedEvent::Gone, 0);
        assert!(!render(&families("night", &monitor.report()), Format::OpenMetrics).contains("jade"));
    }

    #[test]
    fn the_levels_are_listed() {
        let name = "n";
        let family = Families { name }.of_alert(&CollisionAlert::default());
        let levels = Level::ALL.map(|level| format!("{} {}", level as u32, level.name()));
        assert!(family.help.ends_with(&format!("{}.", levels.join(", "))), "{}", family.help);
    }
}
