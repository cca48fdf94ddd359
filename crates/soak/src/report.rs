//! The report of a soak test: JSON for machines, one page of HTML with its plots inside for people.

use std::collections::BTreeSet;
use std::fmt::Write;

use serde::Serialize;

use super::conduct::Conducted;
use super::figures::{ROS2_COLUMN, column_of};
use super::fleet::Fleet;
use super::history::History;
use super::member::{Member, Role};
use super::observation::{Latencies, Observation};
use super::plots::{PlotLine, Scale, plot};
use super::verdict::{ENDED, LATE, LimitCheck};
use bench_dragon_drawing::escaped;
use bench_dragon_drawing::palette::dark_rules;
use bench_dragon_publisher::live::TransportCounters;
use bench_dragon_publisher::live::statistics::RunSummary;

/// The name of the report's JSON, whose schema is docs/soak-report.schema.json. An incompatible change raises the
/// number.
pub const SCHEMA: &str = "bench_dragon/soak/1";

/// The results of a soak test.
#[derive(Debug, Serialize)]
pub struct Report {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// `PASS` or `FAIL`.
    pub verdict: &'static str,
    /// The processes that ended before their time, in words, the first one first.
    pub causes: Vec<String>,
    /// Each limit and its value.
    pub checks: Vec<LimitCheck>,
    /// The command line.
    pub command: Vec<String>,
    /// The version of this program.
    pub version: &'static str,
    /// The machine of the test.
    pub machine: Machine,
    /// The load average of the machine during the test.
    pub load: LoadAverage,
    /// CLOCK_REALTIME in seconds when the test began.
    pub began_at: u64,
    /// The wall time from the first frame of all subscribers to the end, in seconds.
    pub seconds: f64,
    /// The summary that the publisher printed at its end; null if the publisher did not end properly.
    pub publisher: Option<RunSummary>,
    /// The observation of each subscriber.
    pub subscribers: Vec<SubscriberReport>,
    /// The counts of commands and answers; null without `--conduct`.
    pub conducted: Option<Conducted>,
    /// Further clients of the control service that were killed during a request.
    pub clients_killed: u64,
    /// Figures over time. A row of several seconds has the greatest values of these seconds.
    pub history: History,
}

/// The observation of a subscriber, over all its starts.
#[derive(Debug, Serialize)]
pub struct SubscriberReport {
    /// Its name.
    pub label: String,
    /// Its role.
    pub role: Role,
    /// The number of its processes.
    #[serde(rename = "incarnations")]
    pub processes: u64,
    /// Frames of the publisher after the last one that it received, if it must keep up.
    pub missed_after_last: u64,
    /// Counts and latencies since the start; `second` is null.
    pub seen: Observation,
}

/// The load average of the machine over one minute, sampled each second.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct LoadAverage {
    /// The mean of the samples; 0 without any.
    pub mean: f64,
    /// The greatest sample.
    pub most: f64,
    #[serde(skip)]
    samples: u64,
}

impl LoadAverage {
    /// Takes a sample, if the system has one.
    pub fn sample(&mut self) {
        // Linux has this file; proc(5): the first number is of one minute.
        let text = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
        let Some(load) = text.split(' ').next().and_then(|load| load.parse::<f64>().ok()) else { return };
        self.samples += 1;
        self.mean += (load - self.mean) / self.samples as f64;
        self.most = self.most.max(load);
    }
}

/// The machine of a soak test.
#[derive(Debug, Clone, Serialize)]
pub struct Machine {
    /// The processor's name.
    pub processor: String,
    /// Logical processors.
    pub cores: usize,
    /// The kernel's release and version.
    pub kernel: String,
}

impl Machine {
    /// Returns this machine.
    pub fn this() -> Self {
        let processors = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let name = processors.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
        let kernel = nix::sys::utsname::uname()
            .map(|names| format!("{} {}", names.release().to_string_lossy(), names.version().to_string_lossy()));
        Self {
            processor: name.map_or_else(|| "unknown".to_owned(), |(_, name)| name.to_owned()),
            cores: std::thread::available_parallelism().map_or(0, usize::from),
            kernel: kernel.unwrap_or_default(),
        }
    }
}

impl SubscriberReport {
    /// Returns the reports of a fleet's subscribers.
    pub fn all(fleet: &Fleet) -> Vec<Self> {
        let report = |member: &Member| Self {
            label: member.label.clone(),
            role: member.role,
            processes: member.starts,
            missed_after_last: member.missed_after_last(fleet.summary()),
            seen: Observation { second: None, ..member.seen() },
        };
        fleet.members().iter().map(report).collect()
    }
}

impl Report {
    /// Returns lines of text: the verdict, the processes that ended early, each limit, each subscriber.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = vec![format!("{} after {:.1} s", self.verdict, self.seconds)];
        lines.extend(self.causes.iter().map(|cause| format!("  {cause}")));
        lines.extend(self.checks.iter().map(|check| format!("  {}", check.line())));
        lines.extend(self.subscribers.iter().map(|subscriber| {
            let seen = &subscriber.seen;
            let latency = seen.total.map_or_else(String::new, |Latencies { since_sent, since_deadline }| {
                let us = |ns: u64| ns as f64 / 1e3;
                format!(
                    ", latency p50 {:.1} p99 {:.1} max {:.1} us, since the deadline p99 {:.1} us",
                    us(since_sent.p50),
                    us(since_sent.p99),
                    us(since_sent.max),
                    us(since_deadline.p99)
                )
            });
            let processes = match subscriber.processes {
                1 => String::new(),
                several => format!(" by {several} processes"),
            };
            let missed = seen.missed + subscriber.missed_after_last;
            format!("  {}: {} received{processes}, {missed} missed{latency}", subscriber.label, seen.received)
        }));
        let others = self.transport_counters().chain(self.conducting()).chain([self.load_sentence()]);
        lines.extend(others.map(|sentence| format!("  {sentence}")));
        lines.extend(self.hints().into_iter().map(|hint| format!("  hint: {hint}")));
        lines
    }

    fn load_sentence(&self) -> String {
        let (LoadAverage { mean, most, .. }, cores) = (self.load, self.machine.cores);
        format!("load average {mean:.1}, at most {most:.1}, on {cores} logical processors")
    }

    /// Returns the error of a test that failed: the processes that ended early, and the broken limits with their values.
    pub fn failure(&self) -> String {
        let broken = self.checks.iter().filter(|check| !check.passed);
        // A process that ended explains a value that is unknown.
        let broken = broken.filter(|check| self.causes.is_empty() || !(check.value.is_nan() || check.name == ENDED));
        let found: Vec<_> = self.causes.iter().cloned().chain(broken.map(LimitCheck::sentence)).collect();
        found.join("; ")
    }

    /// Returns the ways to pass where frames or periods were lost or late.
    pub(super) fn hints(&self) -> Vec<String> {
        let is_late = |check: &LimitCheck| !check.passed && LATE.contains(&check.name);
        if !self.checks.iter().any(is_late) || !self.causes.is_empty() {
            return Vec::new();
        }
        let is_given = |option: &str| self.command.iter().any(|argument| argument.split('=').next() == Some(option));
        let priority = (!is_given("--realtime")).then(|| "--realtime 80 gives the loop a priority".to_owned());
        let busy = (self.load.mean > self.machine.cores as f64).then(|| {
            "other programs kept the processors busy: test without them, or give the limits of this machine \
             (--max-skipped, --max-lateness-p999, --max-missed)"
                .to_owned()
        });
        priority.into_iter().chain(busy).collect()
    }

    /// Returns sentences about the commands, and the first fault that each subscriber found.
    fn conducting(&self) -> impl Iterator<Item = String> {
        let conducted = self.conducted.iter().flat_map(Conducted::lines);
        let killed = (self.clients_killed > 0)
            .then(|| format!("{} clients of the control service were killed during a request", self.clients_killed));
        let disobedience =
            self.subscribers.iter().filter(|_| self.conducted.is_some()).filter_map(|subscriber| {
                Some(format!("{}: {}", subscriber.label, subscriber.seen.disobedience.as_ref()?))
            });
        conducted.chain(killed).chain(disobedience)
    }

    /// Returns a sentence for each transport of the publisher with counters.
    fn transport_counters(&self) -> impl Iterator<Item = String> {
        self.publisher.iter().flat_map(|summary| &summary.transport_counters).map(
            |(name, TransportCounters { frames, skipped, discarded })| {
                format!("{name}: {frames} frames sent, {skipped} not sent by its queue, {discarded} messages discarded")
            },
        )
    }

    /// Returns the report as one page without other files.
    pub fn html(&self) -> String {
        let mut page = String::new();
        let plots = self.plots();
        // Writing to a String cannot fail.
        let _ = write!(
            page,
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Soak test: {verdict}</title>\n\
             <meta name=\"viewport\" content=\"width=device-width\"><style>{STYLE}{dark}</style></head><body>\n<h1>Soak test: <span class=\"{verdict}\">{verdict}</span></h1>\n\
             <p><code>{command}</code></p>\n<p>{seconds:.1} s on {processor}, {cores} logical processors, Linux {kernel}; \
             bench-dragon {version}.</p>\n<p>{load}.</p>\n{causes}{limits}{subscribers}{transport_counters}{conducting}{plots}<p>Each point stands for {per_row} s and is the \
             greatest value of its seconds. All latencies are CLOCK_MONOTONIC; those since the deadline include the \
             periods that were skipped.</p>\n</body></html>\n",
            verdict = self.verdict,
            command = escaped(&self.command.join(" ")),
            seconds = self.seconds,
            processor = escaped(&self.machine.processor),
            cores = self.machine.cores,
            kernel = escaped(&self.machine.kernel),
            version = self.version,
            load = self.load_sentence(),
            causes = self
                .causes
                .iter()
                .chain(&self.hints())
                .map(|sentence| format!("<p>{}.</p>\n", escaped(sentence)))
                .collect::<String>(),
            limits = self.table_of_limits(),
            subscribers = self.table_of_subscribers(),
            transport_counters =
                self.transport_counters().map(|sentence| format!("<p>{sentence}.</p>\n")).collect::<String>(),
            conducting = self.section_on_conducting(),
            dark = dark_rules(&plots),
            per_row = self.history.seconds_per_row(),
        );
        page
    }

    fn table_of_limits(&self) -> String {
        let rows = self.checks.iter().map(|check| {
            let word = if check.passed { "PASS" } else { "FAIL" };
            let (value, limit) = (check.shown(), check.unit.show(check.limit));
            format!("<tr><td>{}<td>{value}<td>{limit}<td class=\"{word}\">{word}\n", check.name)
        });
        format!("<table><tr><th>limit<th>found<th>at most<th>\n{}</table>\n", rows.collect::<String>())
    }

    fn table_of_subscribers(&self) -> String {
        let us = |ns: u64| format!("{:.1}", ns as f64 / 1e3);
        let rows = self.subscribers.iter().map(|subscriber| {
            let SubscriberReport { label, processes, seen, .. } = subscriber;
            let latencies = seen.total.map_or_else(
                || "<td><td><td><td>".to_owned(),
                |total| {
                    let of = total.since_sent;
                    let figures = [of.p50, of.p99, of.max, total.since_deadline.p99].map(us);
                    figures.iter().map(|figure| format!("<td>{figure}")).collect()
                },
            );
            format!(
                "<tr><td>{label}<td>{processes}<td>{}<td>{}<td>{}<td>{:.1e}{latencies}\n",
                seen.received,
                seen.missed + subscriber.missed_after_last,
                seen.disordered,
                seen.worst_link_error
            )
        });
        format!(
            "<table><tr><th>subscriber<th>processes<th>received<th>missed<th>out of order<th>worst link, m<th>latency p50, \
             us<th>p99<th>max<th>since deadline p99\n{}</table>\n",
            rows.collect::<String>()
        )
    }

    /// Returns a table of the commands, a row for each; empty without `--conduct`.
    fn section_on_conducting(&self) -> String {
        let Some(conducted) = &self.conducted else { return String::new() };
        let codes: BTreeSet<_> = conducted.answers.values().flat_map(|codes| codes.keys()).collect();
        let header: String = codes.iter().map(|code| format!("<th>{code}")).collect();
        let rows = conducted.answers.iter().map(|(name, answers)| {
            let of_each = codes.iter().map(|code| format!("<td>{}", answers.get(*code).copied().unwrap_or(0)));
            format!("<tr><td>{name}<td>{}{}\n", answers.values().sum::<u64>(), of_each.collect::<String>())
        });
        let sentences = self.conducting().map(|sentence| format!("<p>{}.</p>\n", escaped(&sentence)));
        format!(
            "<table><tr><th>command<th>sent{header}\n{}</table>\n{}",
            rows.collect::<String>(),
            sentences.collect::<String>()
        )
    }

    fn plots(&self) -> String {
        let line = |label: &str, column: &str, scale: f64| PlotLine {
            label: label.to_owned(),
            points: self.history.column(column).into_iter().map(|(at, value)| (at, value / scale)).collect(),
        };
        let bands = |of: &str| {
            ["p50", "p99", "max"]
                .map(|band| line(band, &format!("{of}_{band}_ns"), 1e3))
                .into_iter()
                .collect::<Vec<_>>()
        };
        let of_each = |column: &str, scale: f64| -> Vec<PlotLine> {
            let labels = self.subscribers.iter().map(|subscriber| &subscriber.label);
            labels.map(|label| line(label, &column_of(label, column), scale)).collect()
        };
        let mut sections = vec![
            ("Wake-up lateness of the publisher".to_owned(), "us", Scale::Logarithmic, bands("lateness")),
            ("Cost of a step".to_owned(), "us", Scale::Logarithmic, bands("step")),
        ];
        for subscriber in &self.subscribers {
            let of = |band: &str, column: &str| line(band, &column_of(&subscriber.label, column), 1e3);
            let lines = vec![
                of("p50", "latency_p50_ns"),
                of("p99", "latency_p99_ns"),
                of("max", "latency_max_ns"),
                of("p99 since the deadline", "latency_since_deadline_p99_ns"),
            ];
            let title = format!("Latency from sending to receiving, {}", subscriber.label);
            sections.push((title, "us", Scale::Logarithmic, lines));
        }
        let mut memory = vec![line("resident", "resident_bytes", 1e6)];
        let ros2 = line("resident, the process of ROS 2", ROS2_COLUMN, 1e6);
        memory.extend((!ros2.points.is_empty()).then_some(ros2));
        let counts = vec![line("overruns", "overruns", 1.0), line("skipped", "skipped", 1.0)];
        sections.extend([
            ("Missed frames since the start".to_owned(), "frames", Scale::Linear, of_each("missed", 1.0)),
            ("Overruns and skipped periods since the start".to_owned(), "", Scale::Linear, counts),
            ("Resident memory".to_owned(), "MB", Scale::Linear, memory),
            (
                "Shared memory in /dev/shm in use".to_owned(),
                "MB",
                Scale::Linear,
                vec![line("in use", "shared_memory_bytes", 1e6)],
            ),
            ("Open file descriptors".to_owned(), "", Scale::Linear, vec![line("open", "file_descriptors", 1.0)]),
            ("Shows played".to_owned(), "", Scale::Linear, vec![line("shows", "shows_played", 1.0)]),
        ]);
        let section = |(title, unit, scale, lines): (String, &str, Scale, Vec<PlotLine>)| {
            let picture = plot(unit, scale, &lines).unwrap_or_else(|| "<p>Nothing was measured.</p>".to_owned());
            format!("<h2>{title}</h2>\n{picture}\n")
        };
        sections.into_iter().map(section).collect()
    }
}

/// Light, or dark if the browser prefers dark; elements wider than a phone scroll separately.
const STYLE: &str = ":root{color-scheme:light dark;--ground:#fbfaf7;--ink:#16181d;--line:#d9d5cb;--good:#00734f;--bad:#c2001f}\
                     @media(prefers-color-scheme:dark){:root{--ground:#0b0d11;--ink:#f2f0ea;--line:#2a2f39;--good:#1fb8a6;--bad:#ff4a5f}}\
                     body{font:15px/1.45 system-ui,sans-serif;max-width:960px;margin:2em auto;padding:0 1em;background:var(--ground);color:var(--ink)}\
                     code{overflow-wrap:anywhere}h2{font-size:1.05em;margin:1.6em 0 0}.legend{margin:.3em 0;font-size:.85em}.legend span{margin-right:1.2em;white-space:nowrap}\
                     table{border-collapse:collapse;margin:1em 0;display:block;overflow-x:auto}\
                     td,th{padding:.2em .8em .2em 0;text-align:left;border-bottom:1px solid var(--line)}\
                     td:not(:first-child){font-variant-numeric:tabular-nums}svg{max-width:100%;height:auto}\
                     .PASS{color:var(--good)}.FAIL{color:var(--bad);font-weight:bold}";
