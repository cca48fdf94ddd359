//! `/rosout`: the lines of the program's log, the alerts and the cues, as rcl_interfaces/Log.
//!
//! In: records of the program's logger ([`enqueue`]), and those of a parent process, which has no node
//! ([`take_queued`], [`enqueue_line`]). A queue keeps records from the start of the process, so that warnings before
//! the node exists are sent too. Out: messages. Stamps are wall time, as in every node of ROS 2.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use ros2_client::builtin_interfaces::Time;
use ros2_client::builtin_topics::rosout::{TOPIC_NAME, TYPE_NAME};
use ros2_client::{Context, Log, Node, Publisher};
use rustdds::{QosPolicyBuilder, TopicKind, policy};
use serde::{Deserialize, Serialize};

use super::Ros2Error;
use super::matching::Matches;
use super::readers::{Kind, Owed, Readers};
use super::topic_writer::policies;
use bench_dragon_messages::state::Severity;
use bench_dragon_ros2_messages::settings::{Durability, Qos, Reliability};

/// The most lines in the queue; then the oldest is dropped.
const QUEUED_LINES: usize = 256;
/// The most lines kept for late subscribers, and the longest time, as every node of ROS 2 does (rcl's
/// `rcl_qos_profile_rosout_default`). RustDDS sends lines of any age (no lifespan in `rtps/writer.rs`), and Fast DDS
/// takes them.
const DEPTH: u32 = 100;
const LIFESPAN: Duration = Duration::from_secs(10);
/// A usual length of a message in bytes, for the bound of the memory.
const LINE_BYTES: usize = 400;

/// The lines that wait for the node. The logger is one for the process, and older than the node.
static LINES: Mutex<VecDeque<LogLine>> = Mutex::new(VecDeque::new());

/// A line of a program's log.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct LogLine {
    stamp: Time,
    level: u8,
    text: String,
    file: String,
    line: u32,
}

/// Queues a record of the program's logger. Never blocks on the network.
pub fn enqueue(record: &log::Record<'_>) {
    // Sending makes these log in turn.
    if ["rustdds", "ros2_client"].iter().any(|name| record.target().starts_with(name)) {
        return;
    }
    let level = match record.level() {
        log::Level::Error => Log::ERROR,
        log::Level::Warn => Log::WARN,
        log::Level::Info => Log::INFO,
        log::Level::Debug | log::Level::Trace => Log::DEBUG,
    };
    enqueue_line(LogLine {
        stamp: Time::now(),
        level,
        text: record.args().to_string(),
        file: record.file().unwrap_or_default().to_owned(),
        line: record.line().unwrap_or_default(),
    });
}

/// Queues a line of another process.
pub fn enqueue_line(line: LogLine) {
    let mut lines = LINES.lock().unwrap_or_else(PoisonError::into_inner);
    if lines.len() == QUEUED_LINES {
        lines.pop_front();
    }
    lines.push_back(line);
}

/// Returns the queued lines, and empties the queue.
pub fn take_queued() -> VecDeque<LogLine> {
    std::mem::take(&mut *LINES.lock().unwrap_or_else(PoisonError::into_inner))
}

/// The writer of the topic.
pub(super) struct Rosout {
    publisher: Publisher<Log>,
    readers: Readers,
    /// True if RustDDS has refused a line.
    refused: bool,
    /// The logger's name, as rcl derives it from the node's.
    name: String,
}

impl Rosout {
    /// Opens the topic for the node `/<name>`.
    ///
    /// # Errors
    /// [`Ros2Error`]
    pub(super) fn open(context: &Context, node: &mut Node, name: &str) -> Result<Self, Ros2Error> {
        let failed = |error: &dyn std::fmt::Display| Ros2Error::Failed(format!("/rosout: {error}"));
        // ros2-client's own writer keeps one line.
        let qos = Qos { reliability: Reliability::Reliable, durability: Durability::TransientLocal, depth: DEPTH };
        let lifespan = policy::Lifespan { duration: rustdds::Duration::from_std(LIFESPAN) };
        let policies = QosPolicyBuilder::new().lifespan(lifespan).build().modify_by(&policies(qos, LINE_BYTES));
        let dds = context
            .domain_participant()
            .create_topic(TOPIC_NAME.to_owned(), TYPE_NAME.to_owned(), &policies, TopicKind::NoKey)
            .map_err(|error| failed(&error))?;
        let publisher = node.create_publisher(&dds, None).map_err(|error| failed(&error))?;
        Ok(Self {
            publisher,
            readers: Readers::new(Kind::Lifespan(LIFESPAN)),
            refused: false,
            name: name.replace('/', "."),
        })
    }

    /// Sends the lines of the log, and withholds old ones from new subscribers. Must be called often.
    pub(super) fn service(&mut self, matches: &Matches) {
        let writer = self.publisher.guid();
        let subscribers = matches.subscribers(writer);
        matches.settle(writer, self.readers.update(&subscribers, Instant::now()));
        if std::mem::take(&mut self.refused) {
            // One of them acknowledges nothing.
            let kept = DEPTH.into();
            matches.settle(writer, Owed::all_but(kept, self.readers.written(), subscribers.into_keys()));
        }
        take_queued().into_iter().for_each(|line| self.send(line));
    }

    /// Sends a sentence about the show.
    pub(super) fn tell(&mut self, severity: Severity, text: String) {
        let level = match severity {
            Severity::Ok => Log::INFO,
            Severity::Warning => Log::WARN,
            Severity::Error => Log::ERROR,
        };
        self.send(LogLine { stamp: Time::now(), level, text, file: String::new(), line: 0 });
    }

    fn send(&mut self, LogLine { stamp, level, text, file, line }: LogLine) {
        let message = Log { stamp, level, name: self.name.clone(), msg: text, file, function: String::new(), line };
        // A full queue cannot be reported here: the report would be one more line.
        match self.publisher.publish(message) {
            Ok(()) => self.readers.count(Instant::now()),
            Err(_) => self.refused = true,
        }
    }
}
