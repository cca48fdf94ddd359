//! The remote endpoints that RustDDS has matched with the program's own: the endpoints that a message reaches.
//!
//! In: the events of the participant, in which RustDDS reports each match once, and which only this file reads. Out:
//! the readers of each writer; for the services, whether a response has a receiver, since a response is lost if it is
//! written before the client's reply reader is matched.

use std::collections::{BTreeMap, BTreeSet};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use ros2_client::Context;
use rustdds::policy::Durability;
use rustdds::{
    DomainParticipant, DomainParticipantStatusEvent, DomainParticipantStatusListener, GUID, LostReason, RTPSEntity,
    StatusEvented,
};

use super::departures::Departures;
use super::readers::{Owed, Requests};
use super::repeated::Repeated;
use super::wire::{self, Prefix, prefix};

/// The prefix of the topics of requests.
const REQUEST_PREFIX: &str = "rq/";

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
    /// The remote writers of requests.
    clients: BTreeSet<GUID>,
    /// The addresses of remote endpoints, of writers only those of requests.
    addresses: BTreeMap<GUID, Vec<SocketAddr>>,
    /// The addresses of readers of Fast DDS on this machine.
    neighbours: BTreeMap<GUID, SocketAddr>,
    /// Datagrams for new endpoints.
    repeated: Vec<Repeated>,
    departures: Departures,
    /// Farewells that have been said.
    farewells: u16,
    /// Acknowledgements that have been sent.
    acknowledged: u32,
}

impl Matches {
    /// Observes the matches of a context from now on.
    pub(super) fn new(context: &Context) -> Self {
        let participant = context.domain_participant();
        let ends = Ends {
            events: participant.status_listener(),
            participant,
            readers: BTreeSet::new(),
            writers: BTreeSet::new(),
            requests: BTreeMap::new(),
            clients: BTreeSet::new(),
            addresses: BTreeMap::new(),
            neighbours: BTreeMap::new(),
            repeated: Vec::new(),
            departures: Departures::default(),
            farewells: 0,
            acknowledged: 0,
        };
        Self { ends: Arc::new(Mutex::new(ends)) }
    }

    /// Reads or changes the current state.
    fn with<T>(&self, act: impl FnOnce(&mut Ends) -> T) -> T {
        let mut ends = self.ends.lock().unwrap_or_else(PoisonError::into_inner);
        ends.update();
        act(&mut ends)
    }

    /// Processes pending discovery events. RustDDS buffers 2,048 (`dds/participant.rs:324`) and drops the rest, so call
    /// it often.
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

    /// Returns the subscribers of Fast DDS of a local writer on this machine, with their addresses.
    pub(super) fn neighbours(&self, writer: GUID) -> Vec<(GUID, SocketAddr)> {
        self.with(|ends| {
            let readers = ends.readers.iter().filter(|(here, _)| *here == writer);
            readers.filter_map(|(_, reader)| Some((*reader, *ends.neighbours.get(reader)?))).collect()
        })
    }

    /// Forgets a local writer that is gone: RustDDS reports no end of its matches.
    pub(super) fn forget(&self, writer: GUID) {
        self.with(|ends| ends.readers.retain(|(here, _)| *here != writer));
    }

    /// Sends what a local writer owes its readers.
    pub(super) fn settle(&self, writer: GUID, owed: Owed) {
        let Owed { acknowledgements, withheld } = owed;
        if acknowledgements.is_empty() && withheld.is_empty() {
            return;
        }
        self.with(|ends| {
            for (reader, last) in acknowledgements {
                ends.acknowledged = ends.acknowledged.wrapping_add(1);
                let datagram = wire::acknowledgement(reader, writer, last, ends.acknowledged);
                wire::send_to_own(&ends.participant, &datagram);
            }
            ends.repeated.extend(withheld.into_iter().map(|(reader, last)| Repeated::withheld(writer, reader, last)));
            ends.serve_repeated();
        });
    }

    /// Notifies a remote reader that a local writer has written `written` messages until now.
    ///
    /// Cyclone DDS takes the messages that the first heartbeat of a writer names for old ones, and acknowledges them
    /// without delivery to a volatile reader. RustDDS sends a heartbeat when it matches a reader
    /// (`Writer::update_reader_proxy`, `rtps/writer.rs:1971`), but the reader may not know the writer yet. The next
    /// heartbeat follows an answer, and also names the answers that are written and not sent
    /// (`FragmentationIter::next`, `rtps/writer.rs:2392`). The client would wait for these without end. So this
    /// heartbeat, just before an answer is written, names the earlier answers. Held by
    /// `all_first_calls_of_a_new_client_are_answered`.
    pub(super) fn announce(&self, writer: GUID, reader: GUID, written: u32) {
        self.with(|ends| {
            let addresses = ends.addresses.get(&reader).into_iter().flatten().copied();
            wire::send(&wire::heartbeat(writer, reader, written), addresses);
        });
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
        let (mut has_come, mut detected) = (false, BTreeSet::new());
        while let Some(event) = self.events.try_recv_status() {
            match event {
                Event::ParticipantDiscovered { dpd } => {
                    has_come = true;
                    self.departures.discovered(prefix(dpd.guid));
                }
                Event::RemoteReaderMatched { local_writer, remote_reader } => {
                    self.readers.insert((local_writer, remote_reader));
                }
                Event::RemoteWriterMatched { local_reader, remote_writer } => {
                    self.writers.insert((local_reader, remote_writer));
                    if self.clients.contains(&remote_writer) {
                        self.repeated.extend(Repeated::first_requests(local_reader, remote_writer));
                    }
                }
                // RustDDS sends this before the matches of that reader.
                Event::ReaderDetected { reader } => {
                    let transient_local = reader.qos.durability().is_some_and(|of| of != Durability::Volatile);
                    let reliable = reader.qos.is_reliable();
                    self.requests.insert(reader.guid, Requests { transient_local, reliable });
                    detected.insert(reader.guid);
                }
                Event::WriterDetected { writer } if writer.topic_name.starts_with(REQUEST_PREFIX) => {
                    self.clients.insert(writer.guid);
                    detected.insert(writer.guid);
                }
                Event::ReaderLost { guid, .. } | Event::WriterLost { guid, .. } => self.retain(|of| of != guid),
                Event::ParticipantLost { id, reason } => {
                    if let Ok(lost) = Prefix::try_from(id.as_ref()) {
                        match reason {
                            LostReason::Disposed => self.departures.left(lost),
                            LostReason::Timeout { .. } => self.departures.forget(lost),
                        }
                    }
                    self.retain(|of| of.prefix != id);
                }
                _ => {}
            }
        }
        let mut dead = self.departures.gone(has_come, Instant::now());
        if !detected.is_empty() {
            dead.extend(self.note_addresses(&detected));
        }
        for participant in dead {
            log::debug!("ROS 2: participant {participant:02x?} has died: it leaves the network");
            // Its loss is then an event of RustDDS.
            self.farewells = self.farewells.wrapping_add(1);
            wire::send_to_own(&self.participant, &wire::farewell(participant, self.farewells));
        }
        self.give_life_signs();
        self.serve_repeated();
    }

    /// Gives RustDDS a life sign of each participant that is not known to have left, so that no lease ends.
    ///
    /// RustDDS never serves a participant again whose lease has ended: it drops its announcements, which have the number
    /// of the first one (`TopicCache::add_change`, `structure/dds_cache.rs:303`). So a cable that was out for longer than
    /// the lease, or a process that stood still, would end all topics there. Held by the tests
    /// `a_subscriber_that_was_silent`, `a_subscriber_behind_a_cable` and `a_client_that_was_silent`.
    fn give_life_signs(&mut self) {
        for participant in self.departures.due(Instant::now()) {
            wire::send_to_own(&self.participant, &wire::life_sign(participant));
        }
    }

    /// Keeps the remote endpoints that `stays` admits.
    fn retain(&mut self, stays: impl Fn(GUID) -> bool) {
        self.readers.retain(|(_, reader)| stays(*reader));
        self.writers.retain(|(_, writer)| stays(*writer));
        self.requests.retain(|reader, _| stays(*reader));
        self.clients.retain(|writer| stays(*writer));
        self.addresses.retain(|end, _| stays(*end));
        self.neighbours.retain(|reader, _| stays(*reader));
        self.repeated.retain(|of| stays(of.remote()));
    }

    /// Reads the addresses of endpoints that have been detected. Returns the participants that had them before.
    fn note_addresses(&mut self, detected: &BTreeSet<GUID>) -> Vec<Prefix> {
        let readers = self.participant.discovered_readers().into_iter();
        let readers =
            readers.map(|data| (data.reader_proxy.remote_reader_guid, data.reader_proxy.unicast_locator_list));
        let writers = self.participant.discovered_writers().into_iter();
        let writers =
            writers.map(|data| (data.writer_proxy.remote_writer_guid, data.writer_proxy.unicast_locator_list));
        let own = self.participant.guid().prefix;
        let remote = readers.chain(writers).filter(|(guid, _)| detected.contains(guid) && guid.prefix != own);
        let found: Vec<(GUID, Vec<SocketAddr>)> = remote
            .map(|(guid, locators)| {
                let locators = locators.into_iter().filter(|locator| locator.is_udp());
                (guid, locators.map(SocketAddr::from).collect())
            })
            .collect();
        let dead = self.departures.note(found.iter().map(|(guid, addresses)| (prefix(*guid), addresses.clone())));
        let of_fast_dds = found.iter().filter(|(guid, _)| wire::is_fast_dds(*guid));
        let here = of_fast_dds.filter(|(guid, _)| self.departures.is_here(prefix(*guid)));
        self.neighbours.extend(here.filter_map(|(guid, addresses)| Some((*guid, *addresses.first()?))));
        self.addresses.extend(found);
        dead
    }

    fn serve_repeated(&mut self) {
        let (addresses, now) = (&self.addresses, Instant::now());
        self.repeated.retain_mut(|of| of.serve(addresses.get(&of.remote()).map_or(&[][..], Vec::as_slice), now));
    }
}
