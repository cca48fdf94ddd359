//! A client of the control services that calls as `rmw_fastrtps_cpp` does: ros2-client's own.

use std::time::{Duration, Instant};

use ros2_client::{
    Client, Context, ContextOptions, DEFAULT_PUBLISHER_QOS, Message, Name, NodeName, NodeOptions, ServiceMapping,
    ServiceTypeName,
};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::harness::unique;
use crate::ros2_control::domain;

/// An empty request or response: one byte.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Empty(pub u8);

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Time {
    pub sec: i32,
    pub nanosec: u32,
}

/// simulation_interfaces/Result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    pub result: u8,
    pub error_message: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct State {
    pub state: u8,
    pub result: Outcome,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Features {
    pub features: Vec<u16>,
    pub spawn_formats: Vec<String>,
    pub custom_info: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trigger {
    pub success: bool,
    pub message: String,
}

/// The content of a request or a response.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Fields<T>(T);
impl<T: Serialize + DeserializeOwned> Message for Fields<T> {}

/// Calls a service as a new client with its own participant. Returns `None` if no answer comes within `seconds`.
///
/// A participant of ros2-client may wait without end for a service on a busy machine: then another one is tried.
pub fn first_call<Request, Response>(
    name: &str,
    service: &str,
    kind: (&str, &str),
    request: Request,
    seconds: u64,
) -> Option<Response>
where
    Request: Serialize + DeserializeOwned + Clone + 'static,
    Response: Serialize + DeserializeOwned + 'static,
{
    let deadline = Instant::now() + crate::harness::patience();
    loop {
        if let Some(answer) = discovered_call(name, service, kind, request.clone(), seconds) {
            return answer;
        }
        assert!(Instant::now() < deadline, "{service} was not discovered");
    }
}

/// Calls a service as [`first_call`] does. Returns `None` if the service is not discovered within 10 s: ros2-client
/// holds eight events of discovery, and loses further ones.
fn discovered_call<Request, Response>(
    name: &str,
    service: &str,
    kind: (&str, &str),
    request: Request,
    seconds: u64,
) -> Option<Option<Response>>
where
    Request: Serialize + DeserializeOwned + Clone + 'static,
    Response: Serialize + DeserializeOwned + 'static,
{
    let context = Context::with_options(ContextOptions::new().domain_id(domain())).unwrap();
    let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
    let mut node = context.new_node(NodeName::new("/", "caller").unwrap(), options).unwrap();
    let qos = DEFAULT_PUBLISHER_QOS;
    let service_name = Name::new(&format!("/{}", unique(name)), service).unwrap();
    let client: Client<Fields<Request>, Fields<Response>> = node
        .create_client(ServiceMapping::Enhanced, &service_name, &ServiceTypeName::new(kind.0, kind.1), qos.clone(), qos)
        .unwrap();
    let spinner = node.spinner().unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let answer = runtime.block_on(async {
        let call = async {
            tokio::time::timeout(Duration::from_secs(10), client.wait_for_service(&node)).await.ok()?;
            Some(tokio::time::timeout(Duration::from_secs(seconds), client.async_call_service(Fields(request))).await)
        };
        tokio::select! {
            ended = spinner.spin() => panic!("the spinner ended: {ended:?}"),
            answer = call => answer.map(|answer| answer.ok().map(|answer| answer.unwrap().0)),
        }
    });
    node.stop_spinner();
    answer
}

/// Calls as [`first_call`] does, in the mapping of `rmw_fastrtps_cpp`; an answer must come.
pub fn enhanced<Request, Response>(name: &str, service: &str, kind: (&str, &str), request: Request) -> Response
where
    Request: Serialize + DeserializeOwned + Clone + 'static,
    Response: Serialize + DeserializeOwned + 'static,
{
    first_call(name, service, kind, request, 300).unwrap_or_else(|| panic!("{service}: no answer"))
}
