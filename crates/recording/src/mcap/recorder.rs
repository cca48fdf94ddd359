//! Records a show into files: the messages of each topic, the splitting, the counts.
//!
//! In: the messages of a subscriber, in the order of reception. Out: files of one run each.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use super::file::McapFile;
use super::messages::Messages;
use super::run::{Event, Run};
use bench_dragon_messages::{CollisionAlert, Cue, FrameHeader, HandlePose, LoopStatus, StageMessage};
use bench_dragon_ros2_messages::settings::{StampClock, Topic};
use bench_dragon_show::scene::Scene;

/// The topics recorded by default: the topics of a replay, and the topics that tools show without this program's
/// message types.
pub const DEFAULT_TOPICS: [Topic; 8] = [
    Topic::Handles,
    Topic::Poses,
    Topic::Alerts,
    Topic::Stage,
    Topic::Status,
    Topic::Diagnostics,
    Topic::Path,
    Topic::Cues,
];
/// Messages of a run that are kept until its first frame.
const MOST_EARLY: usize = 256;

/// The condition for the next file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Split {
    /// The most bytes of a file, unless one frame, or the messages before the first frame, have more.
    Bytes(u64),
    /// The nanoseconds of a file, by the publisher's monotonic clock.
    Nanoseconds(u64),
}

/// The settings of a recording.
#[derive(Debug, Clone)]
pub struct RecorderConfig {
    /// The publisher's name, which is the namespace of the topics.
    pub name: String,
    /// The first file; the others are numbered after it.
    pub file: PathBuf,
    /// True to replace files that exist.
    pub replace: bool,
    /// The topics.
    pub topics: Vec<Topic>,
    /// The condition for the next file, besides the next run.
    pub split: Option<Split>,
}

/// The recording so far.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Recorded {
    /// The files, in the order of time.
    pub files: Vec<PathBuf>,
    /// The counts of all files.
    pub counts: RecordedCounts,
}

/// The counts of a recording.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RecordedCounts {
    /// Messages of all topics.
    pub messages: u64,
    /// Frames recorded.
    pub frames: u64,
    /// Frames dropped between the received frames of a run.
    pub missed: u64,
    /// The number of bytes of all files.
    pub bytes: u64,
    /// The sum over all runs of the nanoseconds from first to last frame.
    pub nanoseconds: u64,
}

/// The reason for the early end of a recording, in one sentence.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {error}: the recording ends there, {state}")]
pub struct RecordError {
    file: String,
    error: io::Error,
    state: &'static str,
}

/// Records the messages of a publisher.
pub struct Recorder {
    config: RecorderConfig,
    /// The first file until the first frame; true to remove the file without frames.
    first: Option<(File, bool)>,
    run: Option<Run>,
    early: Vec<Event>,
    recorded: Recorded,
    /// The number of bytes of the files that are finished.
    finished_bytes: u64,
    number: u64,
    messages: Messages,
    /// The latest run whose scene is known, and the clock of its stamps.
    clock: Option<(u64, StampClock)>,
}

impl Recorder {
    /// Creates a recorder and its first file. A file that exists keeps its content until the first frame.
    ///
    /// # Errors
    /// The file cannot be created, or exists and must not be replaced.
    pub fn new(config: RecorderConfig) -> io::Result<Self> {
        let is_new = !config.file.exists();
        let file = create(&config.file, config.replace)?;
        let messages = Messages::new(&config.name, &config.topics);
        Ok(Self {
            config,
            first: Some((file, is_new)),
            run: None,
            early: Vec::new(),
            recorded: Recorded::default(),
            finished_bytes: 0,
            number: 1,
            messages,
            clock: None,
        })
    }

    /// Returns the recording so far.
    pub fn recorded(&self) -> &Recorded {
        &self.recorded
    }

    /// Records a frame, before which `missed` frames of its run were dropped.
    ///
    /// # Errors
    /// [`RecordError`], after the files are finished.
    pub fn frame(&mut self, frame: &FrameHeader, handles: &[HandlePose], missed: u64) -> Result<(), RecordError> {
        self.recorded.counts.missed += missed;
        match &self.run {
            Some(run) if run.run_id == frame.run_id => {
                let since = frame.deadline_ns.saturating_sub(run.file_began_ns);
                if matches!(self.config.split, Some(Split::Nanoseconds(most)) if since >= most) {
                    self.next_file(frame)?;
                }
            }
            _ => self.begin(frame)?,
        }
        self.fill_frame(frame, handles);
        // A file without frames cannot be played.
        let is_first = self.run.as_ref().is_some_and(|run| run.file_began_ns == frame.deadline_ns);
        if !is_first && !self.has_room()? {
            self.next_file(frame)?;
            self.fill_frame(frame, handles);
        }
        let written = self.append_batch(None)?;
        self.recorded.counts.frames += u64::from(written > 0);
        if let Some(run) = &mut self.run {
            self.recorded.counts.nanoseconds += frame.deadline_ns.saturating_sub(run.latest_deadline_ns);
            run.latest_deadline_ns = frame.deadline_ns;
        }
        Ok(())
    }

    /// Records a stage.
    ///
    /// # Errors
    /// As [`Recorder::frame`].
    pub fn stage(&mut self, stage: &StageMessage) -> Result<(), RecordError> {
        self.event(Event::Stage(Box::new(stage.clone())))
    }

    /// Reads the clock of a run's stamps from the text of its scene, for all messages that are recorded later.
    pub fn set_clock(&mut self, run_id: u64, text: &str) {
        if self.clock.is_some_and(|(known, _)| known == run_id) {
            return;
        }
        // The publisher has checked the scene; a publisher of a later version may know more.
        let scene = Scene::parse(text, "the scene of the show", "scene").ok();
        let settings = scene.and_then(|scene| scene.ros2);
        let stamps = settings.map_or_else(StampClock::default, |settings| settings.stamps);
        self.clock = Some((run_id, stamps));
        if self.run.as_ref().is_some_and(|run| run.run_id == run_id) {
            self.messages.stamps = stamps;
        }
    }

    /// Attaches the text of a run's scene, and reads its clock. An empty text is not known.
    ///
    /// # Errors
    /// As [`Recorder::frame`].
    pub fn scene(&mut self, run_id: u64, text: &str) -> Result<(), RecordError> {
        self.set_clock(run_id, text);
        self.event(Event::Scene { run_id, text: text.into() })
    }

    /// Records an alert.
    ///
    /// # Errors
    /// As [`Recorder::frame`].
    pub fn alert(&mut self, alert: &CollisionAlert) -> Result<(), RecordError> {
        self.event(Event::Alert(*alert))
    }

    /// Records a cue.
    ///
    /// # Errors
    /// As [`Recorder::frame`].
    pub fn cue(&mut self, cue: &Cue) -> Result<(), RecordError> {
        self.event(Event::Cue(*cue))
    }

    /// Records a status.
    ///
    /// # Errors
    /// As [`Recorder::frame`].
    pub fn status(&mut self, status: &LoopStatus) -> Result<(), RecordError> {
        self.event(Event::Status(*status))
    }

    /// Does the periodic work. Must be called several times a second.
    ///
    /// # Errors
    /// As [`Recorder::frame`].
    pub fn maintain(&mut self) -> Result<(), RecordError> {
        let Some(run) = &mut self.run else { return Ok(()) };
        let done = run.file.maintain();
        self.recorded.counts.bytes = self.finished_bytes + run.file.bytes();
        done.or_else(|error| self.fail(error))
    }

    /// Finishes the file of the run, if there is one.
    ///
    /// # Errors
    /// As [`Recorder::frame`].
    pub fn finish_run(&mut self) -> Result<(), RecordError> {
        let Some(mut run) = self.run.take() else { return Ok(()) };
        let attached = run.attach(&self.config.name);
        let finished = run.file.finish();
        let bytes = *finished.as_ref().unwrap_or_else(|(bytes, _)| bytes);
        self.finished_bytes += bytes;
        self.recorded.counts.bytes = self.finished_bytes;
        match (attached, finished) {
            (Err(error), _) | (_, Err((_, error))) => {
                Err(self.error(error, "the file has no end: mend it with record --recover"))
            }
            _ => Ok(()),
        }
    }

    /// Ends the recording. A new file without frames is removed.
    ///
    /// # Errors
    /// As [`Recorder::frame`].
    pub fn finish(&mut self) -> Result<(), RecordError> {
        if let Some((_, is_new)) = self.first.take()
            && is_new
        {
            // Another process may have removed the file.
            let _ = std::fs::remove_file(&self.config.file);
        }
        self.finish_run()
    }

    /// Starts the first file of a run with the messages before its first frame.
    fn begin(&mut self, frame: &FrameHeader) -> Result<(), RecordError> {
        self.finish_run()?;
        let file = self.make_file()?;
        self.run = Some(Run::new(file, frame));
        let of_run = self.clock.filter(|(run_id, _)| *run_id == frame.run_id);
        self.messages.stamps = of_run.map_or_else(StampClock::default, |(_, stamps)| stamps);
        for early in std::mem::take(&mut self.early) {
            if early.run_id() == frame.run_id {
                self.event(early)?;
            }
        }
        Ok(())
    }

    /// Starts the next file of a run with the latest messages, as a subscriber that joins now gets them.
    fn next_file(&mut self, frame: &FrameHeader) -> Result<(), RecordError> {
        let Some(run) = &self.run else { return Ok(()) };
        let Run { status, diagnosed, events, latest_deadline_ns, .. } = *run;
        let stage = run.stage.clone().map(Event::Stage);
        let run_id = run.run_id;
        let scene = run.scene.clone().map(|text| Event::Scene { run_id, text });
        let held = [stage, scene, run.alert.map(Event::Alert), run.cue.map(Event::Cue)];
        self.finish_run()?;
        let file = self.make_file()?;
        self.run = Some(Run { latest_deadline_ns, status, diagnosed, events, ..Run::new(file, frame) });
        held.into_iter().flatten().try_for_each(|held| self.event(held))
    }

    /// Creates the next file, or empties it.
    fn make_file(&mut self) -> Result<McapFile, RecordError> {
        let (path, file) = match self.first.take() {
            Some((file, _)) => (self.config.file.clone(), Ok(file)),
            None => loop {
                self.number += 1;
                let path = numbered(&self.config.file, self.number);
                let file = create(&path, self.config.replace);
                // During a show, an existing file does not end the recording: the next number is tried.
                if !matches!(&file, Err(error) if error.kind() == io::ErrorKind::AlreadyExists) {
                    break (path, file);
                }
            },
        };
        self.recorded.files.push(path);
        let limit = match self.config.split {
            Some(Split::Bytes(most)) => Some(most),
            _ => None,
        };
        let RecorderConfig { name, topics, .. } = &self.config;
        let emptied = file.and_then(|file| file.set_len(0).or_else(no_regular_file).map(|()| file));
        let made = emptied.and_then(|file| McapFile::new(file, name, topics, limit));
        made.map_err(|error| self.error(error, "nothing is in it"))
    }

    /// Records an event-driven message.
    fn event(&mut self, message: Event) -> Result<(), RecordError> {
        let Some(run) = self.run.as_mut().filter(|run| run.run_id == message.run_id()) else {
            // Kept until the first frame of its run.
            if self.early.len() < MOST_EARLY {
                self.early.push(message);
            }
            return Ok(());
        };
        if let Event::Scene { text, .. } = message {
            return run.attach_scene(text).or_else(|error| self.fail(error));
        }
        let log_time = run.log_time(&message);
        let sequence = run.events;
        run.events = sequence.wrapping_add(1);
        match message {
            Event::Stage(stage) => {
                self.messages.stage(sequence, &stage);
                run.stage = Some(stage);
            }
            Event::Alert(alert) => {
                run.alert = Some(alert);
                self.messages.alert(sequence, alert);
            }
            Event::Cue(cue) => {
                run.cue = Some(cue);
                self.messages.cue(sequence, cue);
            }
            Event::Status(status) => {
                run.status = Some(status);
                let before = run.diagnosed.replace(status).unwrap_or(status);
                let stage = run.stage.as_deref().map(|message| &message.stage);
                self.messages.status(sequence, &status, stage, run.alert.as_ref(), &before);
            }
            Event::Scene { .. } => return Ok(()),
        }
        let attached = if run.attached || run.stage.is_none() || run.status.is_none() {
            Ok(())
        } else {
            run.attach(&self.config.name)
        };
        attached.or_else(|error| self.fail(error))?;
        // Only frames start the next file.
        self.append_batch(Some(log_time)).map(drop)
    }

    fn fill_frame(&mut self, frame: &FrameHeader, handles: &[HandlePose]) {
        let run = self.run.as_ref();
        let (stage, alert) = (run.and_then(|run| run.stage.as_deref()), run.and_then(|run| run.alert.as_ref()));
        self.messages.frame(frame, handles, stage.map(|message| &message.stage), alert);
    }

    /// Returns true if the batch fits into this file.
    fn has_room(&mut self) -> Result<bool, RecordError> {
        let room = self.run.as_mut().map_or(Ok(true), |run| run.file.has_room(&self.messages.batch));
        room.or_else(|error| self.fail(error))
    }

    /// Writes the batch, with its messages' times or `log_time`. Returns the number of messages.
    fn append_batch(&mut self, log_time: Option<u64>) -> Result<u64, RecordError> {
        let appended = self.run.as_mut().map_or(Ok(0), |run| run.file.append(&self.messages.batch, log_time));
        let written = appended.or_else(|error| self.fail(error))?;
        self.recorded.counts.messages += written;
        Ok(written)
    }

    /// Finishes the file as far as possible, and returns the error.
    fn fail<Done>(&mut self, error: io::Error) -> Result<Done, RecordError> {
        let state = match self.finish_run() {
            Ok(()) => "the file is whole up to there",
            Err(_) => "the file has no end: mend it with record --recover",
        };
        Err(self.error(error, state))
    }

    fn error(&self, error: io::Error, state: &'static str) -> RecordError {
        let file = self.recorded.files.last().unwrap_or(&self.config.file).display().to_string();
        RecordError { file, error, state }
    }
}

/// Creates a file, or with `replace` opens one that exists, without changing it.
///
/// # Errors
/// The file cannot be created, or exists and must not be replaced.
fn create(path: &Path, replace: bool) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.write(true);
    if replace {
        options.create(true).truncate(false)
    } else {
        options.create_new(true)
    };
    options.open(path)
}

/// Accepts the error of a device, which has no length to set.
fn no_regular_file(error: io::Error) -> io::Result<()> {
    if error.raw_os_error() == Some(nix::libc::EINVAL) { Ok(()) } else { Err(error) }
}

/// Returns the name of a further file: `show-2.mcap` for `show.mcap`.
fn numbered(path: &Path, number: u64) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().map_or(String::new(), |extension| format!(".{}", extension.to_string_lossy()));
    path.with_file_name(format!("{stem}-{number}{extension}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_has_a_frame_though_a_frame_is_larger_than_the_limit() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("show.mcap");
        let split = Some(Split::Bytes(1000));
        let config =
            RecorderConfig { name: "show".to_owned(), file, replace: false, topics: vec![Topic::Handles], split };
        let mut recorder = Recorder::new(config).unwrap();
        let handles = vec![HandlePose::default(); 224];
        for sequence in 0..3 {
            let deadline_ns = 1_000_000 * (1 + sequence);
            let frame = FrameHeader { run_id: 1, sequence, deadline_ns, handles: 224, ..FrameHeader::default() };
            recorder.frame(&frame, &handles, 0).unwrap();
        }
        recorder.finish().unwrap();
        let Recorded { files, counts } = recorder.recorded();
        let frames_of = |file: &PathBuf| {
            let bytes = std::fs::read(file).unwrap();
            mcap::MessageStream::new(&bytes).unwrap().count()
        };
        assert_eq!(files.iter().map(frames_of).collect::<Vec<_>>(), [1, 1, 1]);
        assert_eq!(counts.frames, 3);
    }
}
