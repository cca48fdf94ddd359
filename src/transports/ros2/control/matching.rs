//! Which clients RustDDS has matched: those that an answer reaches.
//!
//! A response that is written before its client's reply reader has been matched is lost: responses are volatile. RustDDS
//! reports each match once, in the events of its participant, which nobody else reads here. Called by the control thread.

use std::collections::BTreeSet;

use ros2_client::Context;
use rustdds::{DomainParticipantStatusEvent, DomainParticipantStatusListener, GUID, StatusEvented};

/// The remote ends that the services' own ends are matched with.
pub struct Matches {
    events: DomainParticipantStatusListener,
    /// A writer here and a reader there.
    readers: BTreeSet<(GUID, GUID)>,
    /// A reader here and a writer there.
    writers: BTreeSet<(GUID, GUID)>,
}

impl Matches {
    /// The matches of a context from now on.
    pub fn new(context: &Context) -> Self {
        let events = context.domain_participant().status_listener();
        Self { events, readers: BTreeSet::new(), writers: BTreeSet::new() }
    }

    /// Takes in what has happened.
    pub fn update(&mut self) {
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

    /// Whether what is written to `responses` reaches the client whose request came from `client` to `requests`.
    ///
    /// Only Fast DDS names the `reader` of the response in the request. Otherwise every client of that process has to be
    /// complete: as many of its readers matched here as writers.
    pub fn reaches(&self, responses: GUID, requests: GUID, client: GUID, reader: Option<GUID>) -> bool {
        if let Some(reader) = reader {
            return self.readers.contains(&(responses, reader));
        }
        let of_client = |ends: &BTreeSet<(GUID, GUID)>, own: GUID| {
            ends.iter().filter(|(here, there)| *here == own && there.prefix == client.prefix).count()
        };
        let writers = of_client(&self.writers, requests).max(1);
        of_client(&self.readers, responses) >= writers
    }
}
