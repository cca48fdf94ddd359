//! The remote endpoints that RustDDS has matched with the program's own: the endpoints that a message reaches.
//!
//! RustDDS reports each match once, in the events of its participant, which only this file reads. A response is lost if
//! it is written before the client's reply reader is matched.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError};

use ros2_client::Context;
use rustdds::policy::Durability;
use rustdds::{DomainParticipant, DomainParticipantStatusEvent, DomainParticipantStatusListener, GUID, StatusEvented};

use super::acknowledgements::send_to_own;
use super::gaps::{OldMessages, send_gap};
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
    /// The requests of the remote readers.
    requests: BTreeMap<GUID, Requests>,
    /// New writers whose first messages are requested.
    first_messages: Vec<FirstMessages>,
    /// New readers from which older messages are withheld.
    old_messages: Vec<OldMessages>,
}

/// The requests of a remote reader.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Requests {
    /// True if the reader requests the history.
    pub(super) transient_local: bool,
    /// True if the reader acknowledges messages.
    pub(super) reliable: bool,
}

impl Matches {
    /// Observes the matches of a context from now on.
    pub(super) fn new(context: &Context) -> Self {
        let participant = context.domain_participant();
        let events = participant.status_listener();
        let [readers, writers] = [BTreeSet::new(), BTreeSet::new()];
        let (requests, first_messages, old_messages) = (BTreeMap::new(), Vec::new(), Vec::new());
        let ends = Ends { participant, events, readers, writers, requests, first_messages, old_messages };
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

    /// Returns the subscribers of a local writer.
    pub(super) fn subscribers(&self, writer: GUID) -> BTreeMap<GUID, Requests> {
        self.with(|ends| {
            let readers = ends.readers.iter().filter(|(here, _)| *here == writer);
            readers.map(|(_, reader)| (*reader, ends.requests.get(reader).copied().unwrap_or_default())).collect()
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

    /// Notifies a remote reader that a local writer has written `written` messages until now.
    pub(super) fn announce(&self, writer: GUID, reader: GUID, written: u32) {
        self.with(|ends| send_heartbeat(&ends.participant, writer, reader, written));
    }

    /// Notifies a remote reader that the first `last` messages of a local writer are not for it.
    pub(super) fn send_gap(&self, writer: GUID, reader: GUID, last: u64) {
        self.with(|ends| send_gap(&ends.participant, writer, reader, last));
    }

    /// Sends RustDDS the datagram of an acknowledgement.
    pub(super) fn acknowledge(&self, datagram: &[u8]) {
        self.with(|ends| send_to_own(&ends.participant, datagram));
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
                    let transient_local = reader.qos.durability().is_some_and(|of| of != Durability::Volatile);
                    let reliable = reader.qos.is_reliable();
                    self.requests.insert(reader.guid, Requests { transient_local, reliable });
                }
                Event::ReaderLost { guid, .. } => {
                    self.readers.retain(|(_, reader)| *reader != guid);
                    self.requests.remove(&guid);
                    self.old_messages.retain(|of| of.reader() != guid);
                }
                Event::WriterLost { guid, .. } => {
                    self.writers.retain(|(_, writer)| *writer != guid);
                    self.first_messages.retain(|of| of.writer() != guid);
                }
                Event::ParticipantLost { id, .. } => {
                    self.readers.retain(|(_, reader)| reader.prefix != id);
                    self.requests.retain(|reader, _| reader.prefix != id);
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
