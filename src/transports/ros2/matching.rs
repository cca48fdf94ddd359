//! Which remote ends RustDDS has matched with the program's own: those that a message reaches.
//!
//! RustDDS reports each match once, in the events of its participant, which nobody else may read. Called by the topics, which
//! keep a message back until somebody is there, and by the services: a response that is written before its client's reply
//! reader has been matched is lost.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use ros2_client::Context;
use rustdds::{DomainParticipantStatusEvent, DomainParticipantStatusListener, GUID, StatusEvented};

/// The matches of one participant, shared by its threads.
#[derive(Clone)]
pub(super) struct Matches {
    ends: Arc<Mutex<Ends>>,
}

struct Ends {
    events: DomainParticipantStatusListener,
    /// A writer here and a reader there.
    readers: BTreeSet<(GUID, GUID)>,
    /// A reader here and a writer there.
    writers: BTreeSet<(GUID, GUID)>,
}

impl Matches {
    /// The matches of a context from now on.
    pub(super) fn new(context: &Context) -> Self {
        let events = context.domain_participant().status_listener();
        Self { ends: Arc::new(Mutex::new(Ends { events, readers: BTreeSet::new(), writers: BTreeSet::new() })) }
    }

    /// The state as of now.
    fn with<T>(&self, read: impl FnOnce(&Ends) -> T) -> T {
        let mut ends = self.ends.lock().unwrap_or_else(PoisonError::into_inner);
        ends.update();
        read(&ends)
    }

    /// Whether anybody subscribes to what this writer sends.
    pub(super) fn has_reader(&self, writer: GUID) -> bool {
        self.with(|ends| ends.readers.iter().any(|(here, _)| *here == writer))
    }

    /// Whether what is written to `responses` reaches the client whose request came from `client` to `requests`.
    ///
    /// Only Fast DDS names the `reader` of the response in the request. Otherwise every client of that process has to be
    /// complete: as many of its readers matched here as writers.
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
                }
                Event::ReaderLost { guid, .. } => self.readers.retain(|(_, reader)| *reader != guid),
                Event::WriterLost { guid, .. } => self.writers.retain(|(_, writer)| *writer != guid),
                Event::ParticipantLost { id, .. } => {
                    self.readers.retain(|(_, reader)| reader.prefix != id);
                    self.writers.retain(|(_, writer)| writer.prefix != id);
                }
                _ => {}
            }
        }
    }
}
