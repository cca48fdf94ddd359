//! Recordings as the tests read them: the bytes of each message, by the offsets of its CDR, with the crate `mcap`
//! alone.

use std::borrow::Cow;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

use mcap::records::MessageHeader;
use mcap::{Channel, Message, MessageStream, Summary, WriteOptions, Writer};

/// The encapsulation, and a header whose frame is `stage`.
const LAYOUT: usize = 28;

/// The data of a message.
#[derive(Debug, Clone, PartialEq)]
pub struct Bytes(pub Vec<u8>);

impl Bytes {
    pub fn u64(&self, at: usize) -> u64 {
        u64::from_le_bytes(self.0[LAYOUT + at..LAYOUT + at + 8].try_into().unwrap())
    }

    pub fn u32(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.0[LAYOUT + at..LAYOUT + at + 4].try_into().unwrap())
    }

    pub fn f64(&self, at: usize) -> f64 {
        f64::from_bits(self.u64(at))
    }

    /// Returns the run id, a field of every message.
    pub fn run_id(&self) -> u64 {
        self.u64(0)
    }

    /// Returns all bytes from a field of the layout on.
    pub fn from(&self, at: usize) -> &[u8] {
        &self.0[LAYOUT + at..]
    }
}

/// Fields of a frame.
impl Bytes {
    pub fn sequence(&self) -> u64 {
        self.u64(8)
    }

    pub fn tick(&self) -> u64 {
        self.u64(16)
    }

    pub fn deadline_ns(&self) -> u64 {
        self.u64(40)
    }

    pub fn sim_time(&self) -> f64 {
        self.f64(48)
    }

    pub fn time_scale(&self) -> f64 {
        self.f64(56)
    }

    pub fn epoch(&self) -> u32 {
        self.u32(88)
    }

    /// Returns state, playback and cue, and the handles.
    pub fn standing(&self) -> (&[u8], &[u8]) {
        (&self.from(64)[..24], self.from(92))
    }
}

/// A recording.
#[derive(Debug, Default)]
pub struct Kept {
    pub frames: Vec<Bytes>,
    pub alerts: Vec<Bytes>,
    pub cues: Vec<Bytes>,
    pub stages: Vec<Bytes>,
    pub statuses: Vec<Bytes>,
}

pub fn read(file: &Path) -> Kept {
    let bytes = std::fs::read(file).unwrap();
    let mut kept = Kept::default();
    for message in MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        let list = match message.channel.topic.rsplit('/').next().unwrap() {
            "handles" => &mut kept.frames,
            "alerts" => &mut kept.alerts,
            "cues" => &mut kept.cues,
            "stage" => &mut kept.stages,
            "status" => &mut kept.statuses,
            _ => continue,
        };
        list.push(Bytes(message.data.into_owned()));
    }
    kept
}

/// Writes a recording again with its attachments and with each message as `change` returns it: removed, changed, or
/// several messages.
pub fn rewrite<'a>(file: &'a [u8], to: &Path, change: impl Fn(Message<'a>) -> Vec<Message<'a>>) {
    let options = WriteOptions::new().profile("ros2").chunk_size(Some(50_000));
    let mut writer: Writer<_> = options.create(BufWriter::new(File::create(to).unwrap())).unwrap();
    for message in MessageStream::new(file).unwrap() {
        for changed in change(message.unwrap()) {
            let Message { channel, sequence, log_time, publish_time, data } = changed;
            let schema = channel.schema.as_ref().unwrap();
            let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
            let Channel { topic, message_encoding, metadata, .. } = &*channel;
            let channel_id = writer.add_channel(schema, topic, message_encoding, metadata).unwrap();
            let header = MessageHeader { channel_id, sequence, log_time, publish_time };
            writer.write_to_known_channel(&header, &data).unwrap();
        }
    }
    for index in &Summary::read(file).unwrap().unwrap().attachment_indexes {
        writer.attach(&mcap::read::attachment(file, index).unwrap()).unwrap();
    }
    writer.finish().unwrap();
}

/// Returns the message on a changed channel.
pub fn on_channel<'a>(message: &Message<'a>, change: impl Fn(&mut Channel<'a>)) -> Message<'a> {
    let mut channel = (*message.channel).clone();
    change(&mut channel);
    Message { channel: Arc::new(channel), ..message.clone() }
}

/// Returns the message with some bytes of its layout changed.
pub fn with_bytes<'a>(message: &Message<'a>, at: usize, bytes: &[u8]) -> Message<'a> {
    let mut data = message.data.clone().into_owned();
    data[LAYOUT + at..LAYOUT + at + bytes.len()].copy_from_slice(bytes);
    Message { data: Cow::Owned(data), ..message.clone() }
}

/// Returns true if a message is a frame.
pub fn is_frame(message: &Message<'_>) -> bool {
    message.channel.topic.ends_with("/handles")
}
