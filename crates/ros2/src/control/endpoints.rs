//! The DDS endpoints of the services: subscriptions that return requests as bytes, writers that send responses as
//! bytes.
//!
//! Created with the node, before the control thread that uses them.

use std::convert::Infallible;
use std::fmt;

use ros2_client::{Context, Node, Subscription};
use rustdds::bytes::Bytes;
use rustdds::no_key::{DataWriter, SerializerAdapter};
use rustdds::policy::{self, ResourceLimits};
use rustdds::{
    CDRSerializerAdapter, GUID, QosPolicies, QosPolicyBuilder, RTPSEntity, RepresentationIdentifier, SampleIdentity,
    TopicKind, WriteOptionsBuilder,
};
use serde::de::{Deserialize, Deserializer, SeqAccess, Visitor};

use super::services::{PARAMETER_SERVICES, Response, SERVICES, Service};
use crate::Ros2Error;

/// Requests of one service that its reader keeps between two polls.
const REQUEST_DEPTH: i32 = 256;
/// Answers of one service kept for clients that are slow or dead.
const MOST_ANSWERS: i32 = 4096;
/// The answers that clients may request again while RustDDS refuses one. Earlier ones are acknowledged in their names: a
/// client that is slow or dead holds up no other.
pub(super) const KEPT_ANSWERS: u64 = MOST_ANSWERS as u64 / 2;
/// The most bytes of a request that are read. Only requests for parameters have no fixed length.
const MOST_REQUEST_BYTES: usize = 4096;

/// The bytes of a request.
pub(super) struct Raw(pub(super) Vec<u8>);

impl<'de> Deserialize<'de> for Raw {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct AllBytes;
        impl<'de> Visitor<'de> for AllBytes {
            type Value = Raw;

            fn expecting(&self, text: &mut fmt::Formatter) -> fmt::Result {
                text.write_str("a request")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut bytes: A) -> Result<Raw, A::Error> {
                let mut raw = Vec::new();
                // CDR contains no length: the error at the end of the message determines it.
                while let Ok(Some(byte)) = bytes.next_element() {
                    raw.push(byte);
                }
                Ok(Raw(raw))
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
pub(super) struct ServiceEndpoint {
    pub(super) service: &'static Service,
    pub(super) requests: Subscription<Raw>,
    pub(super) requests_guid: GUID,
    pub(super) responses_guid: GUID,
    responses: DataWriter<Vec<u8>, AsTheyAre>,
    /// Answers that RustDDS has taken.
    pub(super) answers: u32,
    /// The warnings already reported.
    reported: Reported,
}

#[derive(Default)]
struct Reported {
    misfit: bool,
    crowd: bool,
    refusal: bool,
    discarded: bool,
}

/// All services of the node.
pub(crate) struct Endpoints {
    pub(super) ports: Vec<ServiceEndpoint>,
}

impl Endpoints {
    /// Opens the parameter services of the node `/<name>`, and if `conducting` those that conduct the show.
    ///
    /// # Errors
    /// [`Ros2Error`]
    pub(crate) fn open(name: &str, context: &Context, node: &mut Node, conducting: bool) -> Result<Self, Ros2Error> {
        let failed = |error: &dyn fmt::Display| Ros2Error::Failed(error.to_string());
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
            let responses: DataWriter<_, _> =
                publisher.create_datawriter_no_key(&responses, None).map_err(|error| failed(&error))?;
            let (requests_guid, responses_guid) = (requests.guid(), responses.guid());
            Ok(ServiceEndpoint {
                service,
                requests,
                requests_guid,
                responses_guid,
                responses,
                answers: 0,
                reported: Reported::default(),
            })
        };
        let services = PARAMETER_SERVICES.iter().chain(if conducting { &SERVICES[..] } else { &[] });
        let ports = services.map(&mut open).collect::<Result<_, Ros2Error>>()?;
        Ok(Self { ports })
    }
}

/// Returns the quality of service of ROS 2 services: reliable, volatile. A full queue refuses at once instead of
/// blocking.
fn policies(depth: i32) -> QosPolicies {
    QosPolicyBuilder::new()
        .reliability(policy::Reliability::Reliable { max_blocking_time: rustdds::Duration::ZERO })
        .durability(policy::Durability::Volatile)
        .history(policy::History::KeepLast { depth })
        .resource_limits(ResourceLimits { max_samples: depth, max_instances: 1, max_samples_per_instance: depth })
        .build()
}

/// The receiver of an answer.
pub(super) struct Client {
    /// The writer of the request.
    pub(super) writer: GUID,
    /// The header of Cyclone before the response.
    pub(super) header: Vec<u8>,
    /// The identity of the request.
    pub(super) identity: SampleIdentity,
    /// The reader of the response, if the request names it, as with Fast DDS.
    pub(super) reader: Option<GUID>,
}

impl ServiceEndpoint {
    /// Sends a response to these readers, or to all readers if the list is empty. Returns false if RustDDS refuses the
    /// response: then call this function again. After many answers RustDDS refuses until each new client has
    /// acknowledged one answer.
    pub(super) fn answer(&mut self, client: &Client, readers: &[GUID], response: &Response) -> bool {
        let mut bytes = client.header.clone();
        // The header's 16 bytes do not change the alignment.
        let Ok(body) = CDRSerializerAdapter::<Response>::to_bytes(response) else { return true };
        bytes.extend_from_slice(&body);
        let options = || WriteOptionsBuilder::new().related_sample_identity(client.identity);
        let mut write = |options| {
            let is_taken = self.responses.write_with_options(bytes.clone(), options).is_ok();
            self.answers += u32::from(is_taken);
            is_taken
        };
        match readers {
            [] => write(options().build()),
            _ => readers.iter().all(|reader| write(options().to_single_reader(*reader).build())),
        }
    }

    pub(super) fn report_discarded(&mut self) {
        if !std::mem::replace(&mut self.reported.discarded, true) {
            log::warn!(
                "ROS 2 service {}: a client is so slow, or dead, that answers are discarded (reported once)",
                self.service.name
            );
        }
    }

    pub(super) fn report_misfit(&mut self, bytes: usize) {
        if !std::mem::replace(&mut self.reported.misfit, true) {
            log::warn!(
                "ROS 2 service {}: a request of {bytes} bytes is none of {}/{}: refused (reported once)",
                self.service.name,
                self.service.package,
                self.service.kind
            );
        }
    }

    pub(super) fn report_crowd(&mut self, most: usize) {
        if !std::mem::replace(&mut self.reported.crowd, true) {
            let name = self.service.name;
            log::warn!(
                "ROS 2 service {name}: a process has {most} calls without an answer: further ones are refused \
                 (reported once)"
            );
        }
    }

    pub(super) fn report_refusal(&mut self, sentence: &str) {
        if !std::mem::replace(&mut self.reported.refusal, true) {
            log::warn!("ROS 2 service {}: {sentence} (reported once)", self.service.name);
        }
    }
}
