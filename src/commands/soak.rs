//! `soak`: a publisher and subscribers as processes for hours, and a verdict. The command starts `soak-subscriber`.

use std::ffi::OsString;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use bench_dragon::client::clock::{monotonic_ns, realtime_ns};
use bench_dragon::client::connection::Wake;
use bench_dragon::client::feed::{Delivery, Feed, FeedOptions};
use bench_dragon::client::shared_memory::service_name;
use bench_dragon::messages::sentence::Expected;
use bench_dragon::show::scene::Accepted;
use bench_dragon::soak::causes::causes;
use bench_dragon::soak::figures;
use bench_dragon::soak::fleet::{Fleet, FleetError};
use bench_dragon::soak::history::History;
use bench_dragon::soak::limits::{Limits, bytes, nanoseconds, share};
use bench_dragon::soak::member::Role;
use bench_dragon::soak::observer::Observer;
use bench_dragon::soak::processes::{ConductPlan, Plan};
use bench_dragon::soak::report::{LoadAverage, Machine, Report, SCHEMA, SubscriberReport};
use bench_dragon::soak::verdict::SoakVerdict;
use indicatif::{FormattedDuration, ProgressBar};

use super::folded::{COLUMNS, folded};
use super::parent::Parent;
use super::realtime_scheduling::RealtimeScheduling;
use super::{CommandError, Common, Output, progress_bar, stop_on_signals, wall_seconds};

/// Sleep of a slow subscriber: longer than a queue of 64 frames lasts at 60 Hz.
const SLOW_PAUSE: Duration = Duration::from_millis(1500);

/// The name of a soak test without `--name`: a show may run under the usual name.
pub const NAME: &str = "soak";

/// Clients of the control service for which there is room beside the load generator.
const MOST_FLAKY_CLIENTS: usize = 8;

/// Arguments of `soak`.
#[derive(Debug, clap::Args)]
pub struct SoakArguments {
    /// Wall time after which to end: 60, 90s, 1:30, 1h30m
    #[arg(long, value_name = "TIME", value_parser = wall_seconds, default_value = "8h", help_heading = "The test")]
    duration: f64,
    /// The rate in frames per second; by default the scene's
    #[arg(long, value_name = "HZ", help_heading = "The test", allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Subscribers that keep up and must miss nothing
    #[arg(long, value_name = "N", default_value_t = 3, help_heading = "The test")]
    subscribers: usize,
    /// Subscribers that sleep longer than their queue lasts; their missed frames are reported, without limit
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "The test")]
    slow: usize,
    /// Subscribers that are killed with SIGKILL every 5 s and restarted; their missed frames are reported, without
    /// limit
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "The test")]
    flaky: usize,
    /// Conduct the show: ten random commands a second from this seed, each answer and every frame checked
    #[arg(long, value_name = "SEED", value_parser = seed, help_heading = "The test", allow_negative_numbers = true)]
    conduct: Option<u64>,
    /// With --conduct: further clients of the control service, killed with SIGKILL during a request every 5 s and
    /// restarted
    #[arg(long, value_name = "N", default_value_t = 0, requires = "conduct", help_heading = "The test")]
    flaky_clients: usize,
    /// Publish ROS 2 topics too
    #[arg(long, help_heading = "The test")]
    ros2: bool,
    /// Write the report to FILE.json and FILE.html, histograms to FILE.hgrm, the log of the show to FILE.log.jsonl
    #[arg(long, value_name = "FILE", help_heading = "The test")]
    report: Option<PathBuf>,
    /// Write the verdict to FILE as JUnit XML, a test case for each limit
    #[arg(long, value_name = "FILE", help_heading = "The test")]
    junit: Option<PathBuf>,
    #[command(flatten)]
    scheduling: RealtimeScheduling,
    /// The number of frames that the subscribers that keep up may miss in all
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Limits")]
    max_missed: u64,
    /// The share of the periods that may be skipped
    #[arg(long, value_name = "SHARE", value_parser = share, default_value = "0.01%", help_heading = "Limits")]
    max_skipped: f64,
    /// The wake-up lateness at the 99.9th percentile: 200us, 1ms
    #[arg(long, value_name = "TIME", value_parser = nanoseconds, default_value = "200us", help_heading = "Limits")]
    max_lateness_p999: u64,
    /// The growth of the publisher's resident memory after the first minute, and of that of the ROS 2 process: 500kB,
    /// 1MB
    #[arg(long, value_name = "SIZE", value_parser = bytes, default_value = "1MB", help_heading = "Limits")]
    max_rss_growth: u64,
}

/// Arguments of `soak-subscriber`.
#[derive(Debug, clap::Args)]
pub struct SoakSubscriberArguments {
    /// Sleep longer than the queue lasts between reads
    #[arg(long)]
    slow: bool,
    #[command(flatten)]
    parent: Parent,
}

/// Soaks until its duration is over or a signal comes, and prints the verdict.
pub fn soak(common: &Common, arguments: &SoakArguments) -> Result<(), CommandError> {
    arguments.check(common)?;
    let files = arguments.report.as_deref().map(ReportFiles::create).transpose()?;
    let junit = arguments.junit.as_deref().map(|file| created("--junit", file)).transpose()?;
    let stop = stop_on_signals()?;
    let began_at = realtime_ns() / 1_000_000_000;
    let mut fleet = Fleet::start(arguments.plan(common)?, &|| !stop.load(Ordering::Relaxed))?;
    let mut progress = Progress::new(arguments.duration, common);
    let mut load = LoadAverage::default();
    let mut history = History::new(figures::columns(&fleet));
    let began = Instant::now();
    let mut seconds = 0.0;
    while seconds < arguments.duration && !stop.load(Ordering::Relaxed) && !fleet.publisher_has_ended() {
        let next = began + Duration::from_secs_f64((seconds.floor() + 1.0).min(arguments.duration));
        while Instant::now() < next && !stop.load(Ordering::Relaxed) && !fleet.publisher_has_ended() {
            fleet.poll(next.saturating_duration_since(Instant::now()).min(Duration::from_millis(100)))?;
        }
        seconds = began.elapsed().as_secs_f64();
        history.push(seconds, figures::row(&mut fleet));
        load.sample();
        progress.show(&mut fleet, seconds);
    }
    fleet.finish()?;
    progress.bar.finish_and_clear();
    fleet.take_stderr().iter().for_each(|line| eprintln!("publisher: {line}"));
    let limits = arguments.limits();
    let verdict = SoakVerdict::of(&fleet, &limits);
    let report = Report {
        schema: SCHEMA,
        verdict: verdict.word(),
        causes: causes(&fleet),
        checks: verdict.checks,
        command: std::env::args().collect(),
        version: env!("CARGO_PKG_VERSION"),
        machine: Machine::this(),
        load,
        began_at,
        seconds,
        publisher: fleet.summary().cloned(),
        subscribers: SubscriberReport::all(&fleet),
        conducted: fleet.conducting().and_then(|conducting| conducting.conducted().cloned()),
        clients_killed: fleet.conducting().map_or(0, |conducting| conducting.clients_killed()),
        history,
    };
    drop(fleet);
    conclude(&report, common, files, junit)
}

/// The progress on standard error: a bar on a terminal, or else a line at times.
struct Progress {
    bar: ProgressBar,
    duration: f64,
    /// The seconds after which the next line is due; none on a terminal, and with `--quiet`.
    next_line: f64,
}

impl Progress {
    fn new(duration: f64, common: &Common) -> Self {
        let has_lines = !common.quiet && !std::io::stderr().is_terminal();
        if !common.quiet {
            eprintln!("Soaking \"{}\" for {}; Ctrl-C ends with a verdict.", common.name(), clock(duration));
        }
        let next_line = if has_lines { Self::interval(duration) } else { f64::INFINITY };
        Self { bar: progress_bar(duration.ceil() as u64, common), duration, next_line }
    }

    /// Returns the seconds between two lines: 20 lines a test, but one each ten minutes at least.
    fn interval(duration: f64) -> f64 {
        (duration / 20.0).clamp(5.0, 600.0)
    }

    fn show(&mut self, fleet: &mut Fleet, seconds: f64) {
        for line in fleet.take_stderr() {
            self.bar.suspend(|| eprintln!("publisher: {line}"));
        }
        let (rate, skipped) = fleet.status().map_or((0.0, 0), |status| (status.measured_rate, status.skipped));
        let so_far = format!("{rate:.1} Hz, {skipped} periods skipped, {} frames missed", fleet.missed());
        if seconds >= self.next_line && seconds < self.duration {
            self.next_line = seconds + Self::interval(self.duration);
            eprintln!(
                "{} of {}, {} left: {so_far}",
                clock(seconds),
                clock(self.duration),
                clock(self.duration - seconds)
            );
        }
        self.bar.set_message(so_far);
        self.bar.set_position(seconds as u64);
    }
}

/// Returns seconds as hours, minutes and seconds.
fn clock(seconds: f64) -> FormattedDuration {
    FormattedDuration(Duration::try_from_secs_f64(seconds.round()).unwrap_or_default())
}

fn conclude(
    report: &Report,
    common: &Common,
    files: Option<ReportFiles>,
    junit: Option<Output>,
) -> Result<(), CommandError> {
    // The Ctrl-C that ended the test, or a closed terminal, may have ended the reader of the output.
    if let Some(files) = files {
        files.write(report)?;
    }
    if let Some(mut output) = junit {
        report.write_junit(&mut output.writer)?;
        output.finish()?;
    }
    let printed = print(report, common);
    if report.verdict == "PASS" {
        return printed;
    }
    Err(CommandError::Failed(format!("the soak test failed: {}", report.failure())))
}

fn print(report: &Report, common: &Common) -> Result<(), CommandError> {
    let mut output = Output::standard();
    if common.json {
        output.json(report)?;
    } else {
        report.lines().iter().try_for_each(|line| output.line(&folded(line, COLUMNS)))?;
    }
    output.finish()
}

impl SoakArguments {
    fn check(&self, common: &Common) -> Result<(), CommandError> {
        let scene = common.load_scene()?;
        let admitted = scene.subscribers;
        service_name(common.name(), "poses")?;
        if let Some(rate) = self.rate {
            Accepted::RATE.check("--rate", rate)?;
        }
        if self.flaky_clients > MOST_FLAKY_CLIENTS {
            return Err(CommandError::BadInput(format!(
                "--flaky-clients is {}, expected at most {MOST_FLAKY_CLIENTS}",
                self.flaky_clients
            )));
        }
        // The load generator and the process of ROS 2 read the frames too.
        let (conducts, has_ros2) = (self.conduct.is_some(), self.ros2 || scene.ros2.is_some());
        let others = usize::from(conducts) + usize::from(has_ros2);
        let all = self.subscribers.saturating_add(self.slow).saturating_add(self.flaky).saturating_add(others);
        if self.subscribers == 0 || all > admitted {
            return Err(CommandError::BadInput(format!(
                "--subscribers, --slow and --flaky are {}, {} and {}, expected at least 1 and together at most \
                 {} subscribers, which is as many as the publisher admits (publish.subscribers in the scene){}",
                self.subscribers,
                self.slow,
                self.flaky,
                admitted.saturating_sub(others),
                match (conducts, has_ros2) {
                    (false, false) => "",
                    (true, false) => ", less one for --conduct",
                    (false, true) => ", less one for ROS 2",
                    (true, true) => ", less one each for --conduct and ROS 2",
                }
            )));
        }
        Ok(())
    }

    fn plan(&self, common: &Common) -> Result<Plan, CommandError> {
        let mut shared: Vec<OsString> = vec!["--name".into(), common.name().into()];
        if let Some(scene) = &common.scene {
            shared.extend(["--scene".into(), scene.into()]);
        }
        let mut publisher: Vec<OsString> = ["--loop", "--end-hold", "0"].map(OsString::from).to_vec();
        publisher.extend(self.conduct.map(|_| "--paused".into()));
        publisher.extend(self.ros2.then(|| "--ros2".into()));
        publisher.extend(self.rate.into_iter().flat_map(|rate| ["--rate".into(), rate.to_string().into()]));
        publisher.extend(self.scheduling.arguments());
        if let Some(stem) = &self.report {
            let options = [("--histograms", HISTOGRAMS), ("--log", LOG)];
            publisher.extend(options.into_iter().flat_map(|(option, end)| [option.into(), with_end(stem, end)]));
        }
        let role = |role, count| std::iter::repeat_n(role, count);
        let roles = role(Role::Steady, self.subscribers)
            .chain(role(Role::Slow, self.slow))
            .chain(role(Role::Flaky, self.flaky));
        let conduct = self.conduct.map(|seed| ConductPlan { seed, rate: self.rate, flaky_clients: self.flaky_clients });
        let ros2 = self.ros2 || common.load_scene()?.ros2.is_some();
        Ok(Plan { program: std::env::current_exe()?, common: shared, publisher, roles: roles.collect(), ros2, conduct })
    }

    fn limits(&self) -> Limits {
        Limits {
            missed: self.max_missed,
            skipped_share: self.max_skipped,
            lateness_p999_ns: self.max_lateness_p999,
            resident_growth_bytes: self.max_rss_growth,
        }
    }
}

impl From<FleetError> for CommandError {
    fn from(error: FleetError) -> Self {
        match error {
            FleetError::Refused(_) => Self::BadInput(error.to_string()),
            _ => Self::Failed(error.to_string()),
        }
    }
}

/// Ends of the names of files that the publisher writes beside a report.
const HISTOGRAMS: &str = ".hgrm";
const LOG: &str = ".log.jsonl";

/// Returns a report's file name with its end.
fn with_end(stem: &Path, end: &str) -> OsString {
    let mut name = stem.as_os_str().to_owned();
    name.push(end);
    name
}

/// Creates a file that an option names.
fn created(option: &str, file: &Path) -> Result<Output, CommandError> {
    Output::file(file).map_err(|error| match error {
        CommandError::BadInput(sentence) => CommandError::BadInput(format!("{option}: {sentence}")),
        other => other,
    })
}

/// Both files of a report, opened before the test: after eight hours a failure would be too late.
struct ReportFiles {
    json: Output,
    html: Output,
}

impl ReportFiles {
    fn create(stem: &Path) -> Result<Self, CommandError> {
        let create = |end: &str| created("--report", Path::new(&with_end(stem, end)));
        // The publisher creates these.
        [HISTOGRAMS, LOG].into_iter().try_for_each(|end| create(end).map(drop))?;
        Ok(Self { json: create(".json")?, html: create(".html")? })
    }

    fn write(mut self, report: &Report) -> Result<(), CommandError> {
        self.json.json(report)?;
        self.json.finish()?;
        self.html.line(&report.html())?;
        self.html.finish()
    }
}

/// Observes until a signal comes, and prints an observation each second.
pub fn subscribe(common: &Common, arguments: &SoakSubscriberArguments) -> Result<(), CommandError> {
    arguments.parent.watch()?;
    let stop = stop_on_signals()?;
    let mut feed = Feed::new(common.name(), FeedOptions { wake: Wake::OnFrame, frames: Delivery::All })?;
    let mut observer = Observer::new(common.load_scene()?.ensemble.link_tolerance());
    let mut output = std::io::stdout().lock();
    let mut print = |observer: &mut Observer| -> Result<(), CommandError> {
        serde_json::to_writer(&mut output, &observer.observation()).map_err(std::io::Error::from)?;
        writeln!(output)?;
        Ok(output.flush()?)
    };
    let mut next = Instant::now() + Duration::from_secs(1);
    while !stop.load(Ordering::Relaxed) {
        if arguments.slow {
            std::thread::sleep(SLOW_PAUSE);
        }
        let now = Instant::now();
        let timeout = next.saturating_duration_since(now);
        feed.poll(timeout, &mut |event| observer.handle(&event, monotonic_ns()))?;
        if now >= next {
            print(&mut observer)?;
            next = now + Duration::from_secs(1);
        }
    }
    feed.poll(Duration::from_millis(1), &mut |event| observer.handle(&event, monotonic_ns()))?;
    print(&mut observer)
}

/// The seed of random commands.
fn seed(text: &str) -> Result<u64, Expected> {
    text.trim().parse().map_err(|_| Expected(format!("a whole number from 0 to {}", u64::MAX).into()))
}
