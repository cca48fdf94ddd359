//! The remote endpoints that RustDDS has matched with the program's own: those that a message reaches.
//!
//! RustDDS reports each match once, in the events of its participant, which only this file reads. Called by the topics,
//! which hold a message until there is a subscriber, and by the services: a response is lost if it is written before
//! the client's reply reader is matched.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};

use ros2_client::Context;
use rustdds::policy::Durability;
use rustdds::{DomainParticipant, DomainParticipantStatusEvent, DomainParticipantStatusListener, GUID, StatusEvented};

use super::gaps::OldMessages;
use super::heartbeats::send_heartbeat;
use super::retransmission::FirstMessages;

/// The matches of one participant, shared by its threads.
#[derive(Clone)]
pub(super) struct Matches {
    ends: Arc<Mutex<Ends>>,
}

struct Ends {
    participant: DomainParticipant,
    events: DomainParticipantStatusListener,
    /// Pairs of a local writer and a remote reader.
    readers: BTreeSet<(GUID, GUID)>,
    /// Pairs of a local reader and a remote writer.
    writers: BTreeSet<(GUID, GUID)>,
    /// Remote readers that request the history.
    transient_local: BTreeSet<GUID>,
    /// New writers whose first messages are requested.
    first_messages: Vec<FirstMessages>,
    /// New readers from which older messages are withheld.
    old_messages: Vec<OldMessages>,
}

impl Matches {
    /// Observes the matches of a context from now on.
    pub(super) fn new(context: &Context) -> Self {
        let participant = context.domain_participant();
        let events = participant.status_listener();
        let [readers, writers] = [BTreeSet::new(), BTreeSet::new()];
        let (transient_local, first_messages) = (BTreeSet::new(), Vec::new());
        let old_messages = Vec::new();
        let ends = Ends { participant, events, readers, writers, transient_local, first_messages, old_messages };
        Self { ends: Arc::new(Mutex::new(ends)) }
    }

    /// Reads the current state.
    fn with<T>(&self, read: impl FnOnce(&Ends) -> T) -> T {
        let mut ends = self.ends.lock().unwrap_or_else(PoisonError::into_inner);
        ends.update();
        read(&ends)
    }

    /// Processes pending discovery events. RustDDS buffers 2,048 and drops the rest, so call it often.
    pub(super) fn update(&self) {
        self.with(|_| ());
    }

    /// Returns the subscribers of a local writer, and for each whether it requests the history.
    pub(super) fn subscribers(&self, writer: GUID) -> BTreeMap<GUID, bool> {
        self.with(|ends| {
            let readers = ends.readers.iter().filter(|(here, _)| *here == writer);
            readers.map(|(_, reader)| (*reader, ends.transient_local.contains(reader))).collect()
        })
    }

    /// Forgets a local writer that is gone: RustDDS reports no end of its matches.
    pub(super) fn forget(&self, writer: GUID) {
        let mut ends = self.ends.lock().unwrap_or_else(PoisonError::into_inner);
        ends.update();
        ends.readers.retain(|(here, _)| *here != writer);
    }

    /// Withholds the first `last` messages of a local writer from a new subscriber.
    pub(super) fn withhold(&self, writer: GUID, reader: GUID, last: u32) {
        let mut ends = self.ends.lock().unwrap_or_else(PoisonError::into_inner);
        let old = OldMessages::of(&ends.participant, writer, reader, last);
        ends.old_messages.extend(old);
    }

    /// Tells a remote reader that a local writer has written `written` messages until now.
    pub(super) fn announce(&self, writer: GUID, reader: GUID, written: u32) {
        self.with(|ends| send_heartbeat(&ends.participant, writer, reader, written));
    }

    /// Returns true if a response written to `responses` reaches the client that sent a request from `client` to
    /// `requests`.
    ///
    /// Only Fast DDS names the `reader` of the response in the request. Otherwise every client of that process must be
    /// complete: as many of its readers as of its writers are matched here.
    pub(super) fn reaches(&self, responses: GUID, requests: GUID, client: GUID, reader: Option<GUID>) -> bool {
        self.with(|ends| {
            if let Some(reader) = reader {
                return ends.readers.contains(&(responses, reader));
            }
            let of_client = |ends: &BTreeSet<(GUID, GUID)>, own: GUID| {
                ends.iter().filter(|(here, there)| *here == own && there.prefix == client.prefix).count()
            };
            let writers = of_client(&ends.writers, requests).max(1);
            of_client(&ends.readers, responses) >= writers
        })
    }
}

impl Matches {
    /// Returns true if `client`, the writer of requests to the local reader `requests`, is still there.
    pub(super) fn is_present(&self, requests: GUID, client: GUID) -> bool {
        self.with(|ends| ends.writers.contains(&(requests, client)))
    }

    /// Returns the readers of a local writer in the process of `client`.
    pub(super) fn readers_in_process(&self, writer: GUID, client: GUID) -> Vec<GUID> {
        self.with(|ends| {
            let readers = ends.readers.iter().filter(|(here, there)| *here == writer && there.prefix == client.prefix);
            readers.map(|(_, reader)| *reader).collect()
        })
    }
}

impl Ends {
    fn update(&mut self) {
        use DomainParticipantStatusEvent as Event;
        while let Some(event) = self.events.try_recv_status() {
            match event {
                Event::RemoteReaderMatched { local_writer, remote_reader } => {
                    self.readers.insert((local_writer, remote_reader));
                }
                Event::RemoteWriterMatched { local_reader, remote_writer } => {
                    self.writers.insert((local_reader, remote_writer));
                    self.first_messages.extend(FirstMessages::of(local_reader, remote_writer));
                }
                // RustDDS sends this before the matches of that reader.
                Event::ReaderDetected { reader } => {
                    if matches!(reader.qos.durability(), Some(durability) if durability != Durability::Volatile) {
                        self.transient_local.insert(reader.guid);
                    }
                }
                Event::ReaderLost { guid, .. } => {
                    self.readers.retain(|(_, reader)| *reader != guid);
                    self.transient_local.remove(&guid);
                    self.old_messages.retain(|of| of.reader() != guid);
                }
                Event::WriterLost { guid, .. } => {
                    self.writers.retain(|(_, writer)| *writer != guid);
                    self.first_messages.retain(|of| of.writer() != guid);
                }
                Event::ParticipantLost { id, .. } => {
                    self.readers.retain(|(_, reader)| reader.prefix != id);
                    self.transient_local.retain(|reader| reader.prefix != id);
                    self.old_messages.retain(|of| of.reader().prefix != id);
                    self.writers.retain(|(_, writer)| writer.prefix != id);
                    self.first_messages.retain(|of| of.writer().prefix != id);
                }
                _ => {}
            }
        }
        let participant = &self.participant;
        self.first_messages.retain_mut(|of| of.serve(participant));
        self.old_messages.retain_mut(OldMessages::serve);
    }
}
