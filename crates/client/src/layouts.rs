//! Layouts of messages by their names in shared memory: those of this program, and those of a service that this program
//! cannot read.

use iceoryx2::config::Config;
use iceoryx2::prelude::*;
use iceoryx2::service::static_config::message_type_details::MessageTypeDetails;
use iceoryx2::service::static_config::messaging_pattern::MessagingPattern as Described;

use crate::shared_memory::OpenError;
use bench_dragon_messages::{
    ChaseStatus, CollisionAlert, ControlRequest, ControlResponse, Cue, FrameHeader, HandlePose, HandlePose32,
    LoopStatus, SceneHeader, Stage, StageSegment,
};

/// The name of a layout, which ends in its version: `bench_dragon/HandlePose/1`.
pub fn name<Message: ZeroCopySend>() -> &'static str {
    // SAFETY: only a name is read.
    unsafe { <Message as ZeroCopySend>::type_name() }
}

/// Returns the names of all layouts that this program sends and reads.
pub fn names() -> [&'static str; 12] {
    [
        name::<HandlePose>(),
        name::<HandlePose32>(),
        name::<FrameHeader>(),
        name::<CollisionAlert>(),
        name::<LoopStatus>(),
        name::<ChaseStatus>(),
        name::<Cue>(),
        name::<ControlRequest>(),
        name::<ControlResponse>(),
        name::<SceneHeader>(),
        name::<Stage>(),
        name::<StageSegment>(),
    ]
}

/// Returns the error of a service whose messages have another layout than `own`.
pub fn another(service: &ServiceName, pattern: MessagingPattern, own: &[&str]) -> OpenError {
    let theirs = of_service(service, pattern);
    // Another limit or attribute of the service is refused by the same error of iceoryx2.
    if theirs.is_empty() || theirs == own {
        return OpenError::Incompatible(service.to_string());
    }
    OpenError::OtherLayout { service: service.to_string(), theirs: theirs.join(" and "), own: own.join(" and ") }
}

/// Returns the names of a service's layouts, the payload before its header; none if the service has gone.
fn of_service(service: &ServiceName, pattern: MessagingPattern) -> Vec<String> {
    let details = ipc::Service::details(service, Config::global_config(), pattern).ok().flatten();
    let Some(details) = details else { return Vec::new() };
    match details.static_details.messaging_pattern() {
        Described::PublishSubscribe(of) => layouts([of.message_type_details()]),
        Described::RequestResponse(of) => {
            layouts([of.request_message_type_details(), of.response_message_type_details()])
        }
        _ => Vec::new(),
    }
}

fn layouts<const N: usize>(messages: [&MessageTypeDetails; N]) -> Vec<String> {
    let names = messages.iter().flat_map(|message| [&message.payload, &message.user_header]);
    names.map(|layout| layout.type_name().to_string()).filter(|name| name != "()").collect()
}
