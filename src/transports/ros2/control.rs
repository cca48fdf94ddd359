//! The door for commands over ROS 2: the services below `/<name>`, on a thread of their own.
//!
//! Made of ros2-client's subscriptions (for the requests, so that the node shows its services) and RustDDS's writers (for
//! the responses), not of ros2-client's `Server`: that one hides the bytes of a request, which tell the mapping
//! ([`mapping`]), and answers at once. A client whose reply reader RustDDS has not matched yet would never get that
//! answer, so an answer waits here until it is ([`matching`]). A client that is dead or floods the door costs the loop
//! nothing: the thread takes requests, the loop takes one command a period from a queue of bounded length.

mod calls;
mod mapping;
mod matching;
mod services;

use std::convert::Infallible;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ros2_client::{Context, Node, NodeName, NodeOptions, Subscription};
use rustdds::bytes::Bytes;
use rustdds::no_key::{DataWriter, SerializerAdapter};
use rustdds::policy::{self, ResourceLimits};
use rustdds::{
    CDRSerializerAdapter, GUID, QosPolicies, QosPolicyBuilder, RTPSEntity, RepresentationIdentifier, SampleIdentity,
    SequenceNumber, TopicKind, WriteOptionsBuilder,
};
use serde::de::{Deserialize, Deserializer, SeqAccess, Visitor};

use super::Ros2Error;
use crate::live::control::{Answer, Door, MOST_WAITING};
use crate::show::control::{Code, Command};
use calls::{Conductor, Next, refusal, sentence};
pub use mapping::Mapping;
use mapping::{Misfit, Request};
use matching::Matches;
use services::{Call, Response, SERVICES, Service};

/// Calls of one process that may have no answer yet, so that one which floods the door leaves room for the others.
const MOST_CALLS: usize = 16;
/// Calls that may have no answer yet in all; further ones wait in their readers.
const MOST_PENDING: usize = 512;
/// How long an answer waits for its client's reply reader. RMW implementations give up after 0.1 s; a loaded machine
/// takes longer, and nobody else waits.
const MATCHING_PATIENCE: Duration = Duration::from_secs(2);
/// How often requests are looked for, and answers while some are awaited.
const POLL_INTERVAL: Duration = Duration::from_millis(2);
const ANSWER_INTERVAL: Duration = Duration::from_micros(500);
/// How long clients are given for the last answers.
const LINGER: Duration = Duration::from_millis(20);
/// Requests of one service that its reader keeps between two polls.
const REQUEST_DEPTH: i32 = 256;
/// Answers of one service kept for clients that are slow or dead.
const MOST_ANSWERS: i32 = 4096;
/// More bytes than any request here has.
const MOST_REQUEST_BYTES: usize = 64;

/// The thread. Dropping it ends it.
pub(super) struct ControlThread {
    stop: Arc<AtomicBool>,
    handle: Option<JoinHandle<()>>,
}

impl ControlThread {
    /// Offers the services below `/<name>` and serves them.
    ///
    /// # Errors
    /// [`Ros2Error`]
    pub(super) fn start(name: &str, context: Context, mapping: Mapping, door: Door) -> Result<Self, Ros2Error> {
        let stop = Arc::new(AtomicBool::new(false));
        let (opened, opening) = mpsc::channel();
        let thread = {
            let (name, stop) = (name.to_owned(), Arc::clone(&stop));
            move || match Endpoints::open(&name, &context) {
                Ok(endpoints) => {
                    let _ = opened.send(Ok(()));
                    Server::new(endpoints, Matches::new(&context), mapping, door).serve(&stop);
                }
                Err(error) => drop(opened.send(Err(error))),
            }
        };
        let spawned = std::thread::Builder::new().name("ros2 control".to_owned()).spawn(thread);
        let handle = Some(spawned.map_err(|error| Ros2Error::Failed(error.to_string()))?);
        let thread = Self { stop, handle };
        opening.recv().unwrap_or_else(|_| Err(Ros2Error::Failed("the control thread ended early".to_owned())))?;
        Ok(thread)
    }
}

impl Drop for ControlThread {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(handle) = self.handle.take() {
            // A panic has been printed by then.
            let _ = handle.join();
        }
    }
}

/// The bytes of a request as they came.
struct Raw {
    bytes: [u8; MOST_REQUEST_BYTES],
    length: usize,
}

impl<'de> Deserialize<'de> for Raw {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct AllBytes;
        impl<'de> Visitor<'de> for AllBytes {
            type Value = Raw;

            fn expecting(&self, text: &mut fmt::Formatter) -> fmt::Result {
                text.write_str("a request")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut bytes: A) -> Result<Raw, A::Error> {
                let mut raw = Raw { bytes: [0; MOST_REQUEST_BYTES], length: 0 };
                // CDR tells no length of its own: the end of the message is an error here, and the length.
                while let Ok(Some(byte)) = bytes.next_element() {
                    raw.bytes[raw.length] = byte;
                    raw.length += 1;
                }
                Ok(raw)
            }
        }
        deserializer.deserialize_tuple(MOST_REQUEST_BYTES, AllBytes)
    }
}

/// Sends bytes as they are.
struct AsTheyAre;

impl SerializerAdapter<Vec<u8>> for AsTheyAre {
    type Error = Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(value: &Vec<u8>) -> Result<Bytes, Infallible> {
        Ok(Bytes::copy_from_slice(value))
    }
}

/// The ends of one service.
struct Port {
    service: &'static Service,
    requests: Subscription<Raw>,
    requests_guid: GUID,
    responses: DataWriter<Vec<u8>, AsTheyAre>,
    /// What has been reported once.
    reported: Reported,
}

#[derive(Default)]
struct Reported {
    misfit: bool,
    crowd: bool,
    refusal: bool,
    discarded: bool,
}

/// All services, and the node that they belong to.
struct Endpoints {
    ports: Vec<Port>,
    // Dropped after the ports: they belong to it.
    _node: Node,
}

impl Endpoints {
    fn open(name: &str, context: &Context) -> Result<Self, Ros2Error> {
        let failed = |error: &dyn fmt::Display| Ros2Error::Failed(error.to_string());
        let node_name = NodeName::new(&format!("/{name}"), "control").map_err(|error| failed(&error))?;
        let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        let mut node = context.new_node(node_name, options).map_err(|error| failed(&error))?;
        let participant = context.domain_participant();
        let publisher = participant.create_publisher(&policies(MOST_ANSWERS)).map_err(|error| failed(&error))?;
        let mut open = |service: &'static Service| {
            let topic = |prefix: &str, suffix: &str, direction: &str, depth: i32| {
                let topic = format!("{prefix}/{name}/{}{suffix}", service.name);
                let kind = format!("{}::srv::dds_::{}_{direction}_", service.package, service.kind);
                participant.create_topic(topic, kind, &policies(depth), TopicKind::NoKey)
            };
            let requests = topic("rq", "Request", "Request", REQUEST_DEPTH).map_err(|error| failed(&error))?;
            let responses = topic("rr", "Reply", "Response", MOST_ANSWERS).map_err(|error| failed(&error))?;
            let requests = node.create_subscription(&requests, None).map_err(|error| failed(&error))?;
            let responses = publisher.create_datawriter_no_key(&responses, None).map_err(|error| failed(&error))?;
            let (requests_guid, reported) = (requests.guid(), Reported::default());
            Ok(Port { service, requests, requests_guid, responses, reported })
        };
        let ports = SERVICES.iter().map(&mut open).collect::<Result<_, Ros2Error>>()?;
        Ok(Self { ports, _node: node })
    }
}

/// As ROS 2 has it for services: reliable, volatile. A full queue refuses at once instead of blocking.
fn policies(depth: i32) -> QosPolicies {
    QosPolicyBuilder::new()
        .reliability(policy::Reliability::Reliable { max_blocking_time: rustdds::Duration::ZERO })
        .durability(policy::Durability::Volatile)
        .history(policy::History::KeepLast { depth })
        .resource_limits(ResourceLimits { max_samples: depth, max_instances: 1, max_samples_per_instance: depth })
        .build()
}

/// A call that has no answer yet.
struct Pending {
    /// The index of its service.
    port: usize,
    call: Call,
    client: Client,
    progress: Progress,
}

/// How far a call is.
enum Progress {
    /// To be passed to the loop as soon as its queue has room.
    Waiting(Command),
    /// With the loop.
    Sent(u64, Command),
    /// Answered, but for its client's reply reader.
    Answered(Response, Instant),
}

/// Whom an answer goes to.
struct Client {
    /// What sent the request.
    writer: GUID,
    /// What Cyclone wants before the response.
    header: Vec<u8>,
    /// What the response refers to.
    identity: SampleIdentity,
    /// What will read the response, where the request names it, as those of Fast DDS do.
    reader: Option<GUID>,
}

struct Server {
    endpoints: Endpoints,
    matches: Matches,
    mapping: Mapping,
    door: Door,
    conductor: Conductor,
    pending: Vec<Pending>,
}

impl Server {
    fn new(endpoints: Endpoints, matches: Matches, mapping: Mapping, door: Door) -> Self {
        Self {
            endpoints,
            matches,
            mapping,
            door,
            conductor: Conductor::default(),
            pending: Vec::with_capacity(MOST_PENDING),
        }
    }

    fn serve(mut self, stop: &AtomicBool) {
        while !stop.load(Ordering::Acquire) {
            self.matches.update();
            for port in 0..self.endpoints.ports.len() {
                self.take_requests(port);
            }
            self.pass_on();
            self.take_answers();
            self.send_answers();
            std::thread::sleep(if self.pending.is_empty() { POLL_INTERVAL } else { ANSWER_INTERVAL });
        }
        std::thread::sleep(LINGER);
    }

    fn take_requests(&mut self, port: usize) {
        // Bounded, so that a client which floods the door does not keep answers back.
        for _ in 0..MOST_WAITING {
            if self.pending.len() >= MOST_PENDING {
                return;
            }
            let end = &mut self.endpoints.ports[port];
            let Ok(Some((raw, info))) = end.requests.take() else { return };
            let Request { header, body } = match self.mapping.split(&raw.bytes[..raw.length], end.service.lengths) {
                Ok(request) => request,
                Err(misfit) => {
                    end.report_misfit(self.mapping, misfit);
                    continue;
                }
            };
            let writer = GUID::from(info.publisher_gid());
            let named = info.related_request_id().map(|id| GUID::from(id.writer_gid));
            let reader = named.filter(|guid| *guid != GUID::GUID_UNKNOWN && *guid != writer);
            let identity = SampleIdentity {
                writer_guid: reader.unwrap_or(writer),
                sequence_number: SequenceNumber::from(info.sequence_number()),
            };
            let call = (end.service.read)(body);
            let client = Client { writer, header: header.to_vec(), identity, reader };
            let of_process =
                self.pending.iter().filter(|pending| pending.client.writer.prefix == writer.prefix).count();
            let progress = if of_process < MOST_CALLS {
                match self.conductor.begin(call) {
                    Next::Obey(command) => Progress::Waiting(command),
                    Next::Answer(response) => Progress::Answered(response, Instant::now()),
                }
            } else {
                end.report_crowd();
                let sentence = format!("refused: {MOST_CALLS} calls of this process have no answer yet");
                let Some(response) = refusal(call, &sentence) else { continue };
                Progress::Answered(response, Instant::now())
            };
            self.pending.push(Pending { port, call, client, progress });
        }
    }

    /// Passes commands to the loop, in the order in which they came, as far as its queue has room.
    fn pass_on(&mut self) {
        for pending in &mut self.pending {
            if let Progress::Waiting(command) = pending.progress {
                let Ok(ticket) = self.door.send(command) else { return };
                pending.progress = Progress::Sent(ticket, command);
            }
        }
    }

    fn take_answers(&mut self) {
        while let Some(Answer { ticket, outcome }) = self.door.answer() {
            let of_ticket =
                |pending: &&mut Pending| matches!(pending.progress, Progress::Sent(sent, _) if sent == ticket);
            let Some(pending) = self.pending.iter_mut().find(of_ticket) else { continue };
            let Progress::Sent(_, command) = pending.progress else { continue };
            if !matches!(outcome.code, Code::Done | Code::Already) {
                self.endpoints.ports[pending.port].report_refusal(&sentence(command, &outcome));
            }
            pending.progress = match self.conductor.proceed(pending.call, command, &outcome) {
                Next::Obey(command) => Progress::Waiting(command),
                Next::Answer(response) => Progress::Answered(response, Instant::now()),
            };
        }
    }

    /// Sends the answers whose clients can be reached.
    fn send_answers(&mut self) {
        let (ports, matches) = (&mut self.endpoints.ports, &self.matches);
        self.pending.retain(|Pending { port, client, progress, .. }| {
            let Progress::Answered(response, since) = progress else { return true };
            let port = &mut ports[*port];
            let reached = matches.reaches(port.responses.guid(), port.requests_guid, client.writer, client.reader);
            if !reached && since.elapsed() < MATCHING_PATIENCE {
                return true;
            }
            port.answer(client, response);
            false
        });
    }
}

impl Port {
    fn answer(&mut self, client: &Client, response: &Response) {
        let mut bytes = client.header.clone();
        // The header's 16 bytes leave the alignment of what follows as it is.
        let Ok(body) = CDRSerializerAdapter::<Response>::to_bytes(response) else { return };
        bytes.extend_from_slice(&body);
        let options = WriteOptionsBuilder::new().related_sample_identity(client.identity).build();
        if self.responses.write_with_options(bytes, options).is_err()
            && !std::mem::replace(&mut self.reported.discarded, true)
        {
            log::warn!(
                "ROS 2 service {}: a client is so slow, or dead, that answers are discarded until it is back or its lease \
                 ends (reported once)",
                self.service.name
            );
        }
    }

    fn report_misfit(&mut self, mapping: Mapping, misfit: Misfit) {
        if std::mem::replace(&mut self.reported.misfit, true) {
            return;
        }
        let name = self.service.name;
        match misfit {
            Misfit::OtherMapping(other) => log::warn!(
                "ROS 2 service {name}: a client calls as {} does, and this publisher answers those of {}: refused \
                 (reported once). Set RMW_IMPLEMENTATION alike on both sides",
                other.rmw(),
                mapping.rmw()
            ),
            Misfit::Length(bytes) => log::warn!(
                "ROS 2 service {name}: a request of {bytes} bytes is none of {}/{}: refused (reported once)",
                self.service.package,
                self.service.kind
            ),
        }
    }

    fn report_crowd(&mut self) {
        if !std::mem::replace(&mut self.reported.crowd, true) {
            let name = self.service.name;
            log::warn!(
                "ROS 2 service {name}: a process has {MOST_CALLS} calls without an answer: further ones are refused \
                 (reported once)"
            );
        }
    }

    fn report_refusal(&mut self, sentence: &str) {
        if !std::mem::replace(&mut self.reported.refusal, true) {
            log::warn!("ROS 2 service {}: {sentence} (reported once)", self.service.name);
        }
    }
}
