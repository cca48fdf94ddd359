//! The shared memory of iceoryx2 as publishers and subscribers both open it: names, nodes, errors, stale files.

mod error;
mod memory;
pub mod stale_files;

use std::io::ErrorKind;

use ::iceoryx2::config::Config;
use ::iceoryx2::prelude::*;

pub use error::{OpenError, failed, incomplete, port_error, service_error};
pub use memory::{SHARED_MEMORY, check_room_to_subscribe, free_bytes, reserve_pages};

/// Publishers that a service admits: the show's, and one that is the end of a tunnel to other machines, which opens a
/// publisher and a subscriber of everything.
pub const MOST_PUBLISHERS: usize = 2;
/// The attribute of a service of frames that states which clock its publisher reads
/// ([`monotonic_clock_name`](crate::clock::monotonic_clock_name)). What joins machines makes services without it.
pub const CLOCK: &str = "clock";

/// The name of one of a publisher's services.
///
/// # Errors
/// [`OpenError::Name`] where iceoryx2 takes no such name.
pub fn service_name(name: &str, service: &str) -> Result<ServiceName, OpenError> {
    let refused = || OpenError::Name { name: name.to_owned(), most: ServiceName::max_len() - "/poses32".len() };
    if name.is_empty() {
        return Err(refused());
    }
    ServiceName::new(&format!("{name}/{service}")).map_err(|_| refused())
}

/// A node that leaves signals to this program.
///
/// # Errors
/// [`OpenError::AnotherUsers`] where another user's processes keep this one out, [`OpenError::Failed`] where iceoryx2
/// cannot make one for another reason.
pub fn node() -> Result<Node<ipc::Service>, OpenError> {
    stale_files::remove_unfinished_files();
    let made = NodeBuilder::new().signal_handling_mode(SignalHandlingMode::Disabled).create::<ipc::Service>();
    made.map_err(|error| {
        let folder = Config::global_config().global.root_path().to_string();
        match std::fs::read_dir(&folder) {
            Err(refused) if refused.kind() == ErrorKind::PermissionDenied => OpenError::AnotherUsers { folder },
            _ => OpenError::Failed { service: "a node".to_owned(), reason: format!("{error:?}") },
        }
    })
}
