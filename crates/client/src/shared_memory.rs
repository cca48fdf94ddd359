//! The shared memory of iceoryx2, for publishers and subscribers: names, nodes, errors, stale files.

mod error;
mod memory;
mod own_files;
pub mod sender;
pub mod stale_files;

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use ::iceoryx2::config::Config;
use ::iceoryx2::prelude::*;

pub use error::{OpenError, failed, incomplete, port_error, service_error};
pub use memory::{check_room_to_subscribe, free_bytes, reserve_pages};

/// The folder of Linux for shared memory.
pub const SHARED_MEMORY: &str = "/dev/shm";
/// Publishers that a service admits: the show's, and the end of a tunnel to other machines. The end of a tunnel opens a
/// publisher and a subscriber of every service.
pub const MOST_PUBLISHERS: usize = 2;
/// The attribute of a service of frames with the name of its publisher's clock
/// ([`monotonic_clock_name`](crate::clock::monotonic_clock_name)). Tunnels between machines create services without it.
pub const CLOCK: &str = "clock";

/// Returns the name of one of a publisher's services.
///
/// # Errors
/// [`OpenError::Name`] if iceoryx2 refuses the name.
pub fn service_name(name: &str, service: &str) -> Result<ServiceName, OpenError> {
    let refused = || OpenError::Name { name: name.to_owned(), most: ServiceName::max_len() - "/poses32".len() };
    if name.is_empty() {
        return Err(refused());
    }
    ServiceName::new(&format!("{name}/{service}")).map_err(|_| refused())
}

/// Returns the entries of a folder; none of one that cannot be read.
fn entries(folder: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(folder)
        .map_or_else(|_| Vec::new(), |entries| entries.flatten().map(|entry| entry.path()).collect())
}

/// Creates a node that leaves signals to this program.
///
/// # Errors
/// [`OpenError::AnotherUsers`] if the folder belongs to another user, [`OpenError::Failed`] if iceoryx2 fails for
/// another reason.
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

/// Returns what a test holds while it looks at the open files of this process: they are those of all its tests.
#[cfg(test)]
fn only_test_with_open_files() -> std::sync::MutexGuard<'static, ()> {
    static OPEN_FILES: std::sync::Mutex<()> = std::sync::Mutex::new(());
    OPEN_FILES.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}
