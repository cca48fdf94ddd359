//! `record`: records a running show as MCAP.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, IsTerminal};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use bench_dragon::client::connection::Wake;
use bench_dragon::client::feed::{Delivery, Feed, FeedEvent, FeedOptions};
use bench_dragon::client::polling::Obstacle;
use bench_dragon::client::shows;
use bench_dragon::messages::sentence::{Expected, rounded};
use bench_dragon::recording::mcap::recorder::{
    DEFAULT_TOPICS, Recorded, RecordedCounts, Recorder, RecorderConfig, Split,
};
use bench_dragon::recording::mcap::recover::{RecoverError, Recovered, check_magic, recover};
use bench_dragon::recording::record::{self, RecordQueue, RecordThread};
use bench_dragon::ros2_messages::settings::Topic;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use super::new_file::NewFile;
use super::{CommandError, Common, Output, not_writable, progress_bar, stop_on_signals, wall_seconds};

/// Frames that may wait in the shared memory between two polls, for the shortest queue.
const UNREAD_FRAMES: f64 = 2.0;
/// The shortest and the longest time between two polls.
const POLL_INTERVAL: (Duration, Duration) = (Duration::from_millis(1), Duration::from_millis(20));
/// The interval of the progress on the terminal.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(200);
/// The longest wait for stage and scene after the first frame: a publisher detects a new subscriber within a second.
const STAGE_TIMEOUT: Duration = Duration::from_secs(2);
/// The least size for `--split`.
const LEAST_SPLIT: u64 = 1_000_000;

/// Arguments of `record`.
#[derive(Debug, clap::Args)]
pub struct RecordArguments {
    /// The file to write; further ones are numbered after it
    #[arg(short, long, value_name = "FILE", required_unless_present = "recover")]
    output: Option<PathBuf>,
    /// The topics to record, of handles, poses, alerts, stage, status, diagnostics, path, cues (all of which are
    /// recorded by default), markers, clock, tf
    #[arg(long, value_name = "TOPICS", value_delimiter = ',', value_parser = topic, conflicts_with = "recover")]
    topics: Vec<Topic>,
    /// Size or duration (1GB, 500MB, 1h, 90s) at which the next file begins; each run of the publisher
    /// begins another file too
    #[arg(long, value_name = "SIZE|TIME", value_parser = split, conflicts_with = "recover")]
    split: Option<Split>,
    /// Wall time after which to end: 60, 90s, 1:30, 1h30m
    #[arg(long, value_name = "TIME", value_parser = wall_seconds, conflicts_with = "recover")]
    duration: Option<f64>,
    /// Replace files that exist
    #[arg(long)]
    force: bool,
    /// Repair a recording that was cut: keep every finished chunk, in FILE-recovered.mcap or the --output
    #[arg(long, value_name = "FILE")]
    recover: Option<PathBuf>,
}

/// The line of `record --json`.
#[derive(Serialize)]
struct Summary {
    files: Vec<String>,
    messages: u64,
    frames: u64,
    missed: u64,
    bytes: u64,
    seconds: f64,
}

/// Records until the duration is over, a signal comes or a write fails; or repairs a recording.
pub fn record(common: &Common, arguments: &RecordArguments) -> Result<(), CommandError> {
    if let Some(damaged) = &arguments.recover {
        return mend(common, damaged, arguments);
    }
    let Some(file) = &arguments.output else {
        return Err(CommandError::BadInput("expected -o FILE".to_owned()));
    };
    let mut topics = if arguments.topics.is_empty() { DEFAULT_TOPICS.to_vec() } else { arguments.topics.clone() };
    topics.sort_unstable();
    topics.dedup();
    let stop = stop_on_signals()?;
    let mut feed = Feed::new(common.name(), FeedOptions { wake: Wake::Never, frames: Delivery::All })?;
    // A file size limit is then a failed write, not a signal that ends the process.
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::new(AtomicBool::new(false)))?;
    let config = RecorderConfig {
        name: common.name().to_owned(),
        file: file.clone(),
        replace: arguments.force,
        topics,
        split: arguments.split,
    };
    let recorder = Recorder::new(config).map_err(|error| refused(file, &error))?;
    let (queue, thread) = record::start(recorder)?;
    if !common.quiet {
        eprintln!("Recording \"{}\" to {}; Ctrl-C ends.", common.name(), file.display());
    }
    let over = || stop.load(Ordering::Relaxed);
    let fed = follow(&mut feed, common.name(), &queue, &thread, arguments.duration, over, &progress(common));
    let (recorded, failure) = thread.finish(queue);
    print(common, &recorded)?;
    fed?;
    match failure {
        Some(error) => Err(CommandError::Failed(error.to_string())),
        None if recorded.files.is_empty() => {
            let (name, instead) = (common.name(), shows::instead(common.name(), &shows::running()));
            Err(CommandError::Failed(format!("nothing came from \"{name}\" ({instead}): there is no recording")))
        }
        None => Ok(()),
    }
}

/// Passes the feed's events to the thread until the end. After the first frame, obstacles of a later publisher's
/// services do not end the recording. The end waits for a stage and a scene that follow the first frames, because a
/// replay needs the stage, and `verify` the scene.
fn follow(
    feed: &mut Feed,
    name: &str,
    queue: &RecordQueue,
    thread: &RecordThread,
    duration: Option<f64>,
    over: impl Fn() -> bool,
    bar: &ProgressBar,
) -> Result<(), CommandError> {
    let began = Instant::now();
    let (shortest, longest) = POLL_INTERVAL;
    let (mut interval, mut shown) = (shortest, began);
    let (mut first_frame, mut has_stage, mut has_scene) = (None, false, false);
    let mut obstacle = Obstacle::default();
    let over =
        || over() || thread.has_ended() || duration.is_some_and(|seconds| began.elapsed().as_secs_f64() >= seconds);
    let waits_for_stage = |first: Option<Instant>| first.is_some_and(|first| first.elapsed() < STAGE_TIMEOUT);
    while !over() || !(has_stage && has_scene) && waits_for_stage(first_frame) && !thread.has_ended() {
        let polled = feed.poll(interval, &mut |event| {
            match event {
                FeedEvent::Frame { .. } => drop(first_frame.get_or_insert_with(Instant::now)),
                FeedEvent::Stage { .. } => has_stage = true,
                FeedEvent::Scene { .. } => has_scene = true,
                FeedEvent::Status(status) => {
                    let seconds = Duration::try_from_secs_f64(UNREAD_FRAMES / status.rate);
                    interval = seconds.unwrap_or(longest).clamp(shortest, longest);
                }
                _ => (),
            }
            queue.handle(&event, over);
        });
        if first_frame.is_none() {
            polled?;
        } else if obstacle.is_met(polled) {
            std::thread::sleep(Obstacle::RETRY_INTERVAL);
        }
        if shown.elapsed() >= PROGRESS_INTERVAL && !bar.is_hidden() {
            shown = Instant::now();
            let recorded = thread.recorded();
            bar.set_message(if recorded.files.is_empty() { waiting(name) } else { sentence(&recorded) });
            bar.tick();
        }
    }
    bar.finish_and_clear();
    Ok(())
}

/// Creates the progress line on standard error, hidden without a terminal.
fn progress(common: &Common) -> ProgressBar {
    if common.quiet || common.json || !io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    // The template is a constant of known keys: the fallback is never used.
    let style = ProgressStyle::with_template("{spinner} {msg}").unwrap_or_else(|_| ProgressStyle::default_spinner());
    ProgressBar::new_spinner().with_style(style)
}

/// Returns the words while there is no publisher.
fn waiting(name: &str) -> String {
    format!("waiting for a publisher of \"{name}\"; {}", shows::instead(name, &shows::running()))
}

/// Returns the recording's progress in words.
fn sentence(recorded: &Recorded) -> String {
    let RecordedCounts { messages, frames, missed, bytes, .. } = recorded.counts;
    format!("{}, {}, {messages} messages, {frames} frames, {missed} missed", time(recorded), size(bytes))
}

/// Returns the recorded time, such as 1:02:03.4.
fn time(recorded: &Recorded) -> String {
    let tenths = recorded.counts.nanoseconds / 100_000_000;
    let (seconds, minutes, hours) = (tenths / 10 % 60, tenths / 600 % 60, tenths / 36_000);
    format!("{hours}:{minutes:02}:{seconds:02}.{}", tenths % 10)
}

fn size(bytes: u64) -> String {
    format!("{} MB", rounded(bytes as f64 / 1e6, 1))
}

fn print(common: &Common, recorded: &Recorded) -> Result<(), CommandError> {
    let mut output = Output::standard();
    let files: Vec<String> = recorded.files.iter().map(|file| file.display().to_string()).collect();
    let RecordedCounts { messages, frames, missed, bytes, nanoseconds } = recorded.counts;
    if common.json {
        output.json(&Summary { files, messages, frames, missed, bytes, seconds: nanoseconds as f64 / 1e9 })?;
    } else if !files.is_empty() {
        output.line(&format!("Recorded {}: {}", sentence(recorded), files.join(", ")))?;
    }
    output.finish()
}

/// The line of `record --recover --json`.
#[derive(Serialize)]
struct MendedLine {
    file: String,
    output: String,
    #[serde(flatten)]
    recovered: Recovered,
}

/// Repairs a recording: writes its complete records into another file.
fn mend(common: &Common, file: &Path, arguments: &RecordArguments) -> Result<(), CommandError> {
    let shown = file.display().to_string();
    let bad = |error: RecoverError| CommandError::BadInput(format!("{shown}: {error}"));
    let unread = |error: io::Error| bad(RecoverError::Read(error));
    let input = File::open(file).map_err(unread)?;
    let metadata = input.metadata().map_err(unread)?;
    if !metadata.is_file() {
        return Err(CommandError::BadInput(format!(
            "{shown} is no regular file, expected a recording whose length is known"
        )));
    }
    let length = metadata.len();
    let path = arguments.output.clone().unwrap_or_else(|| {
        let stem = file.file_stem().unwrap_or_default().to_string_lossy();
        file.with_file_name(format!("{stem}-recovered.mcap"))
    });
    if path.canonicalize().is_ok_and(|output| file.canonicalize().is_ok_and(|input| input == output)) {
        return Err(CommandError::BadInput(format!("{shown} is to be mended, expected another --output")));
    }
    // Checked before the output is created.
    let mut input = BufReader::new(input);
    check_magic(&mut input).map_err(bad)?;
    if !arguments.force && path.symlink_metadata().is_ok() {
        return Err(refused(&path, &io::ErrorKind::AlreadyExists.into()));
    }
    let mut output = BufWriter::new(NewFile::create(&path)?);
    let bar = progress_bar(length, common).with_message("mending");
    let mended = recover(bar.wrap_read(input), length, &mut output);
    bar.finish_and_clear();
    let recovered = mended.map_err(|error| match error {
        RecoverError::Write(error) => error.into(),
        other => bad(other),
    })?;
    output.into_inner().map_err(io::Error::from)?.finish()?;
    let mut lines = Output::standard();
    let output = path.display().to_string();
    let Recovered { chunks, messages, damaged, lost_messages, unknown, lost_bytes, whole, .. } = recovered;
    if common.json {
        lines.json(&MendedLine { file: shown.clone(), output, recovered })?;
    } else {
        lines.line(&format!("{output} has the {messages} messages of {chunks} finished chunks of {shown}."))?;
        if damaged > 0 {
            lines.line(&format!("Left out: {damaged} damaged records, with at least {lost_messages} messages."))?;
        }
        if unknown > 0 {
            lines.line(&format!("Left out: {unknown} messages whose channel cannot be read."))?;
        }
        if lost_bytes > 0 {
            lines.line(&format!("Lost: {lost_bytes} bytes after invalid lengths."))?;
        }
        lines.line(if whole { "The file has its end." } else { "The file was cut before its end." })?;
    }
    lines.finish()?;
    if messages == 0 {
        return Err(CommandError::Failed(format!("no message of {shown} could be read")));
    }
    Ok(())
}

/// Returns the error for a file that cannot be created.
fn refused(file: &Path, error: &io::Error) -> CommandError {
    let shown = file.display();
    if error.kind() == io::ErrorKind::AlreadyExists {
        CommandError::BadInput(format!("{shown} exists, expected another file, or --force to replace it"))
    } else {
        not_writable(shown, error)
    }
}

/// Parses a topic's name, for clap.
fn topic(text: &str) -> Result<Topic, Expected> {
    let found = Topic::ALL.into_iter().find(|topic| topic.name() == text.trim());
    found.ok_or_else(|| Expected(format!("topics of {}", Topic::ALL.map(Topic::name).join(", ")).into()))
}

/// Parses the size or time of a file, for clap.
fn split(text: &str) -> Result<Split, Expected> {
    let text = text.trim();
    let units = [("KB", 1e3), ("MB", 1e6), ("GB", 1e9), ("TB", 1e12)];
    let upper = text.to_uppercase();
    let size =
        units.iter().find_map(|(unit, bytes)| Some(upper.strip_suffix(unit)?.trim().parse::<f64>().ok()? * bytes));
    if let Some(bytes) = size.filter(|bytes| *bytes >= LEAST_SPLIT as f64 && *bytes <= 1e18) {
        return Ok(Split::Bytes(bytes as u64));
    }
    let has_unit = text.ends_with(['s', 'm', 'h']);
    match wall_seconds(text).ok().filter(|seconds| has_unit && *seconds >= 1.0) {
        Some(seconds) => Ok(Split::Nanoseconds((seconds * 1e9) as u64)),
        None => Err(Expected(
            "a size of at least 1MB, such as 500MB or 1GB, or a time of at least 1s, such as 90s or 1h".into(),
        )),
    }
}
