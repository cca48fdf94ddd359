//! Reads a recording: checks that it can be played, reads its contents, and its chunks one by one.
//!
//! In: an MCAP file with an end, of `record` or of another recorder of the same ROS 2 topics, or a bag of several. Out:
//! a [`Recording`], which has frames of a known type; then [`Item`]s, chunk by chunk, in the order of the files. That
//! is the order of reception, which can differ from the order of log times if the recording machine's clock was set
//! back.

use std::collections::HashMap;
use std::fmt::Display;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use byteorder::LittleEndian;
use mcap::records::{AttachmentIndex, ChunkIndex, Record, op};
use mcap::{Channel, parse_record};
use serde::de::DeserializeOwned;

use super::bag::recordings_of;
use super::chunk::records_of_chunk;
use super::error::ReadError;
use super::index::{Index, index, told};
use super::layout_history::layouts;
use super::lengths::is_attachment;
use super::run::SCENE_ATTACHMENT;
use bench_dragon_messages::{CollisionAlert, Cue, FrameHeader, LoopStatus, StageMessage};
use bench_dragon_ros2_messages::settings::Topic;
use bench_dragon_ros2_messages::{HandlePoses, Header, MessageType, Stamped, fields};

/// The topics that a replay reads.
const TOPICS: [Topic; 5] = [Topic::Handles, Topic::Alerts, Topic::Cues, Topic::Status, Topic::Stage];
/// The first bytes of a message: CDR, little-endian.
const ENCAPSULATION: [u8; 2] = [0, 1];

/// A message of a chunk.
#[derive(Debug)]
pub enum Item {
    /// The bytes of a frame, for [`frame_of`] and [`header_of`].
    Frame(Vec<u8>),
    /// An alert.
    Alert(CollisionAlert),
    /// A cue.
    Cue(Cue),
    /// A status.
    Status(Box<LoopStatus>),
    /// A stage.
    Stage(Box<StageMessage>),
}

/// A file, or the files of a bag, that can be played.
pub struct Recording {
    files: Vec<OpenFile>,
    /// The chunks in the order of the files, each with the index of its file.
    chunks: Vec<(usize, ChunkIndex)>,
    channels: HashMap<ChannelKey, Topic>,
    contents: Contents,
}

/// The index of a file, and the number of a channel in it.
type ChannelKey = (usize, u16);

/// An open file.
struct OpenFile {
    file: File,
    length: u64,
    /// Its name in errors; `None` outside of a bag.
    name: Option<String>,
}

impl OpenFile {
    fn open(path: &Path, is_in_bag: bool) -> Result<Self, ReadError> {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let name = is_in_bag.then_some(name);
        let opened = File::open(path).and_then(|mut file| Ok((file.seek(SeekFrom::End(0))?, file)));
        let (length, file) = opened.map_err(|error| named(error.into(), name.as_deref()))?;
        Ok(Self { file, length, name })
    }
}

/// Adds the name of its file to an error.
fn named(error: ReadError, file: Option<&str>) -> ReadError {
    match file {
        Some(file) => ReadError::InFile { file: file.to_owned(), error: Box::new(error) },
        None => error,
    }
}

/// The contents of a recording.
#[derive(Debug, Clone)]
pub struct Contents {
    /// The publisher's name.
    pub name: String,
    /// The scene's name, if there is a status.
    pub scene: Option<String>,
    /// The played topics with messages, in order.
    pub topics: Vec<Topic>,
    /// The rate of the publisher's loop, in frames per second.
    pub rate: f64,
    /// The number of frames; `None` if the file does not count them.
    pub frames: Option<u64>,
    /// The first and the last frame.
    pub ends: [FrameHeader; 2],
    /// The stage.
    pub stage: StageMessage,
    /// The text of the scene, if the recording has it.
    pub scene_text: Option<String>,
}

impl Contents {
    /// Returns the seconds of wall time from the start of the first frame's period to the end of the last frame's.
    pub fn seconds(&self) -> f64 {
        let [first, last] = self.ends;
        (last.tick.saturating_sub(first.tick) as f64 + 1.0) / self.rate
    }
}

impl Recording {
    /// Opens a file, or the files of a directory that `ros2 bag record` wrote. Reads their indexes and the first
    /// message of each topic.
    ///
    /// # Errors
    /// [`ReadError`]
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let is_bag = path.is_dir();
        let paths: Vec<PathBuf> = if is_bag { recordings_of(path)? } else { vec![path.to_owned()] };
        let (mut files, mut chunks, mut channels) = (Vec::new(), Vec::new(), HashMap::new());
        let (mut counts, mut scene_text) = (Some(HashMap::new()), None);
        for (number, path) in paths.iter().enumerate() {
            let mut opened = OpenFile::open(path, is_bag)?;
            let (index, text) = opened.read_index().map_err(|error| named(error, opened.name.as_deref()))?;
            channels.extend(index.channels.into_iter().map(|(id, channel)| ((number, id), channel)));
            let mut of_file = index.chunks;
            of_file.sort_by_key(|chunk| chunk.chunk_start_offset);
            chunks.extend(of_file.into_iter().map(|chunk| (number, chunk)));
            // The frames of a bag are counted if each of its files counts its own.
            counts = counts.zip(index.counts).map(|(mut all, of_file)| {
                all.extend(of_file.into_iter().map(|(id, count)| ((number, id), count)));
                all
            });
            scene_text = scene_text.or(text);
            files.push(opened);
        }
        let (channels, name) = played(&channels)?;
        let handles = || channels.iter().filter(|(_, topic)| **topic == Topic::Handles).map(|(key, _)| key);
        let frames = counts.map(|counts| handles().filter_map(|key| counts.get(key)).sum());
        // Filled below.
        let contents = Contents {
            name,
            scene: None,
            topics: Vec::new(),
            rate: 0.0,
            frames,
            ends: [FrameHeader::default(); 2],
            stage: StageMessage::default(),
            scene_text,
        };
        let mut recording = Self { files, chunks, channels, contents };
        recording.read_contents()?;
        recording.check_order()?;
        Ok(recording)
    }

    /// Returns the contents.
    pub fn contents(&self) -> &Contents {
        &self.contents
    }

    /// Returns the number of chunks.
    pub fn chunks(&self) -> usize {
        self.chunks.len()
    }

    /// Calls `handle` with the messages of a chunk.
    ///
    /// # Errors
    /// [`ReadError::Damaged`], after the messages before it, or [`ReadError::File`].
    pub fn read_chunk(&mut self, chunk: usize, handle: &mut dyn FnMut(Item)) -> Result<(), ReadError> {
        let Some((file, index)) = self.chunks.get(chunk) else { return Ok(()) };
        let (file, index) = (*file, index.clone());
        let of_file = &mut self.files[file];
        let channels = &self.channels;
        let read = of_file.read_chunk(&index, &|id| channels.get(&(file, id)).copied(), handle);
        read.map_err(|error| named(error, self.files[file].name.as_deref()))
    }

    /// Reads the first message of each topic, and the last frame.
    fn read_contents(&mut self) -> Result<(), ReadError> {
        let frame = |item| if let Item::Frame(bytes) = item { Some(bytes) } else { None };
        let first = self.first(Topic::Handles, frame)?.ok_or(ReadError::NoFrames)?;
        let last = self.last_frame()?;
        // Read as a whole, since its number of handles holds for all frames.
        let first = frame_of(&first)?.frame;
        let last = last.map_or(Ok(first), |bytes| header_of(&bytes))?;
        let stage = self.first(Topic::Stage, |item| if let Item::Stage(stage) = item { Some(*stage) } else { None })?;
        let status =
            self.first(Topic::Status, |item| if let Item::Status(status) = item { Some(*status) } else { None })?;
        let alert = self.first(Topic::Alerts, |item| matches!(item, Item::Alert(_)).then_some(()))?;
        let cue = self.first(Topic::Cues, |item| matches!(item, Item::Cue(_)).then_some(()))?;
        let contents = &mut self.contents;
        contents.stage = stage.ok_or(ReadError::NoTopic("stage"))?;
        contents.ends = [first, last];
        contents.scene = status.map(|status| status.scene.as_str().to_owned());
        contents.rate = status.map_or_else(|| rate_between(&first, &last), |status| status.rate);
        contents.topics = vec![Topic::Handles, Topic::Stage];
        contents.topics.extend([alert.map(|()| Topic::Alerts), cue.map(|()| Topic::Cues)].into_iter().flatten());
        contents.topics.sort_unstable();
        Ok(())
    }

    /// Checks that each file of a bag begins after the one before it, with frames of the same run.
    fn check_order(&mut self) -> Result<(), ReadError> {
        let mut before = self.contents.ends[0];
        for file in 1..self.files.len() {
            let chunks =
                self.chunks.partition_point(|(of, _)| *of < file)..self.chunks.partition_point(|(of, _)| *of <= file);
            let frame = |item| if let Item::Frame(bytes) = item { Some(bytes) } else { None };
            let Some(bytes) = self.first_within(chunks, Topic::Handles, frame)? else { continue };
            let header = header_of(&bytes)?;
            let reason = match (header.run_id == before.run_id, header.tick > before.tick) {
                (true, true) => None,
                (true, false) => Some(format!("of period {} after that of {}", header.tick, before.tick)),
                (false, _) => Some("of another run than the first".to_owned()),
            };
            if let Some(reason) = reason {
                let error = ReadError::Frame(format!("{reason}, expected the files of one bag in their order"));
                return Err(named(error, self.files[file].name.as_deref()));
            }
            before = header;
        }
        Ok(())
    }

    /// Returns the first message of a topic for which `pick` returns a value.
    fn first<T>(&mut self, topic: Topic, pick: impl Fn(Item) -> Option<T>) -> Result<Option<T>, ReadError> {
        self.first_within(0..self.chunks.len(), topic, pick)
    }

    fn first_within<T>(
        &mut self,
        chunks: Range<usize>,
        topic: Topic,
        pick: impl Fn(Item) -> Option<T>,
    ) -> Result<Option<T>, ReadError> {
        for chunk in chunks {
            let mut found = None;
            if self.may_hold(chunk, topic) {
                self.read_chunk(chunk, &mut |item| found = found.take().or_else(|| pick(item)))?;
            }
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }

    fn last_frame(&mut self) -> Result<Option<Vec<u8>>, ReadError> {
        for chunk in (0..self.chunks.len()).rev() {
            let mut last = None;
            if self.may_hold(chunk, Topic::Handles) {
                self.read_chunk(chunk, &mut |item| {
                    if let Item::Frame(bytes) = item {
                        last = Some(bytes);
                    }
                })?;
            }
            if last.is_some() {
                return Ok(last);
            }
        }
        Ok(None)
    }

    /// Returns true if a chunk can have messages of a topic, as one without an index of its messages can.
    fn may_hold(&self, chunk: usize, topic: Topic) -> bool {
        let (file, index) = &self.chunks[chunk];
        let offsets = &index.message_index_offsets;
        let is_held = |(of, id): &ChannelKey| of == file && offsets.contains_key(id);
        offsets.is_empty() || self.channels.iter().any(|(key, of)| *of == topic && is_held(key))
    }
}

impl OpenFile {
    /// Reads the index, and the text of the scene.
    fn read_index(&mut self) -> Result<(Index, Option<String>), ReadError> {
        let index = index(&mut self.file, self.length)?;
        let text = scene_text(&mut self.file, self.length, &index.attachments)?;
        Ok((index, text))
    }

    /// Calls `handle` with the messages of a chunk whose channel has a topic.
    fn read_chunk(
        &mut self,
        index: &ChunkIndex,
        topic_of: &dyn Fn(u16) -> Option<Topic>,
        handle: &mut dyn FnMut(Item),
    ) -> Result<(), ReadError> {
        let at = index.chunk_start_offset;
        let damaged = |reason: &dyn Display| ReadError::Damaged { at, reason: reason.to_string() };
        let bytes = usize::try_from(index.chunk_length).ok().filter(|_| {
            let end = at.checked_add(index.chunk_length);
            end.is_some_and(|end| end <= self.length)
        });
        let mut record = vec![0; bytes.ok_or_else(|| damaged(&"a chunk beyond the file's end"))?];
        self.file.seek(SeekFrom::Start(at))?;
        self.file.read_exact(&mut record)?;
        let Some(([op::CHUNK, _, _, _, _, _, _, _, _], body)) = record.split_first_chunk() else {
            return Err(damaged(&"no chunk is where the index has one"));
        };
        for record in records_of_chunk(body).map_err(|error| damaged(&told(&error)))? {
            let Record::Message { header, data } = record else { continue };
            let Some(topic) = topic_of(header.channel_id) else { continue };
            let item = match topic {
                Topic::Handles => Some(Item::Frame(data.into_owned())),
                Topic::Alerts => decoded(&data).map(|Stamped { header: _, layout }| Item::Alert(layout)),
                Topic::Cues => decoded(&data).map(|Stamped { header: _, layout }| Item::Cue(layout)),
                Topic::Status => decoded(&data).map(|Stamped { header: _, layout }| Item::Status(Box::new(layout))),
                _ => decoded(&data).map(|Stamped { header: _, layout }| Item::Stage(Box::new(layout))),
            };
            handle(item.ok_or_else(|| damaged(&format_args!("a message of {} cannot be read", topic.name())))?);
        }
        Ok(())
    }
}

/// Reads the attachment with the text of the scene.
fn scene_text(file: &mut File, length: u64, attachments: &[AttachmentIndex]) -> Result<Option<String>, ReadError> {
    let Some(index) = attachments.iter().find(|attachment| attachment.name == SCENE_ATTACHMENT) else {
        return Ok(None);
    };
    let at = index.offset;
    let damaged = |reason: &str| ReadError::Damaged { at, reason: reason.to_owned() };
    let bytes = usize::try_from(index.length).ok().filter(|_| {
        let end = at.checked_add(index.length);
        end.is_some_and(|end| end <= length)
    });
    let mut record = vec![0; bytes.ok_or_else(|| damaged("an attachment beyond the file's end"))?];
    file.seek(SeekFrom::Start(at))?;
    file.read_exact(&mut record)?;
    let Some(([op::ATTACHMENT, _, _, _, _, _, _, _, _], body)) = record.split_first_chunk() else {
        return Err(damaged("no attachment is where the index has one"));
    };
    if !is_attachment(body) {
        return Err(damaged("the lengths of an attachment do not agree"));
    }
    match parse_record(op::ATTACHMENT, body) {
        Ok(Record::Attachment { data, .. }) => match String::from_utf8(data.into_owned()) {
            Ok(text) => Ok(Some(text)),
            Err(_) => Err(damaged("the text of the scene is not UTF-8")),
        },
        Ok(_) => Err(damaged("the scene cannot be read")),
        Err(error) => Err(damaged(&told(&error))),
    }
}

/// Reads the header of a frame without its handles.
///
/// # Errors
/// [`ReadError::Frame`]
pub fn header_of(bytes: &[u8]) -> Result<FrameHeader, ReadError> {
    let read: Option<(Header, FrameHeader)> = decoded(bytes);
    read.map(|(_, header)| header).ok_or_else(unreadable)
}

/// Reads a frame with its handles.
///
/// # Errors
/// [`ReadError::Frame`]
pub fn frame_of(bytes: &[u8]) -> Result<HandlePoses, ReadError> {
    let read: Option<HandlePoses> = decoded(bytes);
    let whole = read.filter(|read| read.poses.len() == read.frame.handles as usize && !read.poses.is_empty());
    whole.ok_or_else(unreadable)
}

fn unreadable() -> ReadError {
    ReadError::Frame("that cannot be read".to_owned())
}

/// Returns the frames per second of a loop, from two of its frames.
fn rate_between(first: &FrameHeader, last: &FrameHeader) -> f64 {
    let nanoseconds = last.deadline_ns.saturating_sub(first.deadline_ns) as f64;
    let ticks = last.tick.saturating_sub(first.tick) as f64;
    // The default rate of a scene.
    if ticks > 0.0 && nanoseconds > 0.0 { 1e9 * ticks / nanoseconds } else { 60.0 }
}

/// Reads a message from its bytes.
fn decoded<Message: DeserializeOwned>(bytes: &[u8]) -> Option<Message> {
    let (encapsulation, body) = bytes.split_at_checked(4)?;
    if encapsulation[..2] != ENCAPSULATION {
        return None;
    }
    cdr_encoding::from_bytes::<Message, LittleEndian>(body).ok().map(|(message, _)| message)
}

/// Returns the played channels and the name of their publisher.
fn played(channels: &HashMap<ChannelKey, Arc<Channel<'_>>>) -> Result<(HashMap<ChannelKey, Topic>, String), ReadError> {
    let handles = format!("/{}", Topic::Handles.name());
    let own = MessageType::of(Topic::Handles).ros_name();
    let is_own = |channel: &Channel<'_>| channel.schema.as_ref().is_some_and(|schema| schema.name == own);
    let all = channels.values();
    let mut names: Vec<&str> = all.clone().filter_map(|channel| channel.topic.strip_suffix(&handles)).collect();
    names.sort_unstable();
    names.dedup();
    if names.len() > 1 {
        // Another program's topic may have the same ending.
        names = all.filter(|channel| is_own(channel)).filter_map(|it| it.topic.strip_suffix(&handles)).collect();
    }
    names.sort_unstable();
    names.dedup();
    let name = match names[..] {
        [] => return Err(ReadError::NoTopic("handles")),
        [name] => name,
        _ => return Err(ReadError::Publishers(names.join(", "))),
    };
    let mut played = HashMap::new();
    for (key, channel) in channels {
        let last = channel.topic.strip_prefix(name).and_then(|rest| rest.strip_prefix('/'));
        if let Some(topic) = TOPICS.into_iter().find(|topic| Some(topic.name()) == last) {
            check_type(channel, topic)?;
            played.insert(*key, topic);
        }
    }
    Ok((played, name.trim_start_matches('/').to_owned()))
}

/// Checks that a channel has the topic's message type of this version.
fn check_type(channel: &Channel<'_>, topic: Topic) -> Result<(), ReadError> {
    let of = MessageType::of(topic);
    let schema = channel.schema.as_ref();
    let found = schema.map_or("no type", |schema| &schema.name);
    let (encoding, language) = (&*channel.message_encoding, schema.map_or("", |schema| &schema.encoding));
    if found != of.ros_name() || encoding != "cdr" || language != "ros2msg" {
        return Err(ReadError::Type {
            topic: channel.topic.clone(),
            found: format!("{found} ({encoding}, {language})"),
            expected: format!("{} (cdr, ros2msg)", of.ros_name()),
        });
    }
    let text = schema.map(|schema| String::from_utf8_lossy(&schema.data)).unwrap_or_default();
    // The name in definitions.
    let name = of.ros_name().replace("/msg/", "/");
    let found = fields(&name, &text);
    if found == fields(&name, &of.schema()) {
        return Ok(());
    }
    let (found, own) = layouts(topic, found.values().flatten());
    Err(ReadError::Fields { topic: channel.topic.clone(), found, own })
}

#[cfg(test)]
mod tests {
    use std::borrow::Cow;
    use std::io::Cursor;

    use mcap::{Attachment, Summary, Writer};

    use super::*;

    /// The index has a check, but a file may have an index without one.
    #[test]
    fn an_attachment_that_is_shorter_than_its_lengths_is_damaged() {
        let mut writer = Writer::new(Cursor::new(Vec::new())).unwrap();
        let (name, media_type) = (SCENE_ATTACHMENT.to_owned(), String::new());
        let attachment = Attachment { log_time: 0, create_time: 0, name, media_type, data: Cow::Borrowed(b"text") };
        writer.attach(&attachment).unwrap();
        writer.finish().unwrap();
        let mut bytes = writer.into_inner().into_inner();
        let index = Summary::read(&bytes).unwrap().unwrap().attachment_indexes[0].clone();
        let place = [index.offset, index.length].map(u64::to_le_bytes).concat();
        let at = bytes.windows(place.len()).rposition(|window| window == place).unwrap();
        // Without the text and the check of the attachment, and then without the check of the index.
        bytes[at + 8..at + 16].copy_from_slice(&(index.length - 8).to_le_bytes());
        let check = bytes.len() - 12;
        bytes[check..check + 4].fill(0);
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), &bytes).unwrap();
        let read = Recording::open(file.path()).map(drop);
        assert!(matches!(&read, Err(ReadError::Damaged { at, .. }) if *at == index.offset), "{read:?}");
    }

    /// Behind a record of an unknown kind the index would be read without its check.
    #[test]
    fn an_index_that_does_not_follow_the_end_of_the_data_is_damaged() {
        let mut writer = Writer::new(Cursor::new(Vec::new())).unwrap();
        writer.finish().unwrap();
        let mut bytes = writer.into_inner().into_inner();
        // The footer has 37 bytes and begins with its opcode and its length.
        let begins = bytes.len() - 37 + 9;
        let index = u64::from_le_bytes(bytes[begins..begins + 8].try_into().unwrap()) as usize;
        // The last record of the data has 13 bytes.
        assert_eq!(bytes[index - 13], mcap::records::op::DATA_END);
        bytes[index - 13] |= 0x80;
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), &bytes).unwrap();
        let read = Recording::open(file.path()).map(drop);
        assert!(matches!(&read, Err(ReadError::Damaged { .. })), "{read:?}");
    }
}
