//! The shows that run in this shared memory, whatever their names. In: iceoryx2's list of services. Out: names, numbers
//! of subscribers, and the sentence for a command that finds no publisher of its name.
//!
//! Only a show serves commands, so that a show is a name whose service of commands has a server. The end of a tunnel to
//! another machine is no show.

use iceoryx2::config::Config;
use iceoryx2::identifiers::UniqueNodeId;
use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use crate::shared_memory::{node, service_name};
use bench_dragon_messages::{ControlRequest, ControlResponse, FrameHeader, HandlePose, HandlePose32};

/// The end of the name of each show's service of commands.
const CONTROL: &str = "/control";

/// Returns the names of the shows that run in this shared memory, in alphabetical order; none if the shared memory
/// cannot be used.
///
/// # Examples
///
/// ```
/// assert!(!bench_dragon_client::shows::running().contains(&"a show that was never started".to_owned()));
/// ```
pub fn running() -> Vec<String> {
    // Its creation also removes what killed processes have left.
    let Ok(node) = node() else { return Vec::new() };
    let mut names = Vec::new();
    let listed = ipc::Service::list(Config::global_config(), |service| {
        if let Some(name) = service.static_details.name().as_str().strip_suffix(CONTROL)
            && !servers(&node, name).is_empty()
        {
            names.push(name.to_owned());
        }
        CallbackProgression::Continue
    });
    if let Err(error) = listed {
        log::debug!("the services of iceoryx2 cannot be listed: {error:?}");
    }
    names.sort();
    names
}

/// Returns what runs instead of a publisher of `name`, or how to start one.
///
/// # Examples
///
/// ```
/// use bench_dragon_client::shows::instead;
///
/// assert_eq!(instead("jade", &["gold".to_owned(), "paper".to_owned()]), "running here: gold, paper");
/// assert_eq!(instead("jade", &[]), "no show runs here: \"bench-dragon run --name jade\" starts one");
/// ```
pub fn instead(name: &str, running: &[String]) -> String {
    match running {
        [] => format!("no show runs here: \"bench-dragon run --name {name}\" starts one"),
        names => format!("running here: {}", names.join(", ")),
    }
}

/// Returns the number of processes and tunnels that subscribe to the frames of a show.
///
/// # Errors
/// [`OpenError`](crate::shared_memory::OpenError) if the shared memory cannot be used.
pub fn subscribers(name: &str) -> Result<usize, crate::shared_memory::OpenError> {
    let node = node()?;
    let single = service_name(name, "poses32")?;
    let single =
        node.service_builder(&single).publish_subscribe::<[HandlePose32]>().user_header::<FrameHeader>().open();
    let double = frames(&node, name).map_or(0, |service| service.dynamic_config().number_of_subscribers());
    Ok(double + single.map_or(0, |service| service.dynamic_config().number_of_subscribers()))
}

/// Returns the service of a name's frames, if it exists.
pub(crate) fn frames(
    node: &Node<ipc::Service>,
    name: &str,
) -> Option<PortFactory<ipc::Service, [HandlePose], FrameHeader>> {
    let name = service_name(name, "poses").ok()?;
    node.service_builder(&name).publish_subscribe::<[HandlePose]>().user_header::<FrameHeader>().open().ok()
}

/// Returns the nodes with which shows of this name serve commands.
pub(crate) fn servers(node: &Node<ipc::Service>, name: &str) -> Vec<UniqueNodeId> {
    let mut nodes = Vec::new();
    let Ok(name) = service_name(name, "control") else { return nodes };
    let opened = node.service_builder(&name).request_response::<ControlRequest, ControlResponse>().open();
    if let Ok(service) = opened {
        service.dynamic_config().list_servers(|server| {
            nodes.push(server.node_id);
            CallbackProgression::Continue
        });
    }
    nodes
}
