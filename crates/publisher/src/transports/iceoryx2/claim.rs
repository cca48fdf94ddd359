//! The claim of a show on its name, which lasts even where another program removes the show's files. In: a name. Out:
//! a value that holds the name as long as it lives.
//!
//! iceoryx2 admits one server of commands by a file. Once a program that cleans up has removed the file, a second show
//! would get the name, and its subscribers would be others than those of the first. A socket in Linux's abstract
//! namespace has no file and ends with its process. Its address has the identity of the shared memory, so that shows
//! of separate memories, as in containers, do not meet.

use std::io::ErrorKind;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::fs::MetadataExt;
use std::os::unix::net::{SocketAddr, UnixListener};
use std::time::{Duration, Instant};

use ::iceoryx2::config::Config;

use bench_dragon_client::shared_memory::{OpenError, SHARED_MEMORY, failed};

/// The time in which a process that has been killed gives its name up.
const PATIENCE: Duration = Duration::from_secs(1);
const RETRY_INTERVAL: Duration = Duration::from_millis(20);

/// A show's claim.
pub(super) struct NameClaim(#[expect(dead_code, reason = "the open socket is the claim")] UnixListener);

impl NameClaim {
    /// Claims a name.
    ///
    /// # Errors
    /// [`OpenError::AlreadyPublished`] if another process holds the name.
    pub(super) fn new(name: &str) -> Result<Self, OpenError> {
        let address = address(name).map_err(|error| failed(name, "control", error))?;
        let began = Instant::now();
        loop {
            match UnixListener::bind_addr(&address) {
                Ok(socket) => return Ok(Self(socket)),
                Err(error) if error.kind() != ErrorKind::AddrInUse => return Err(failed(name, "control", error)),
                Err(_) if began.elapsed() >= PATIENCE => return Err(OpenError::AlreadyPublished(name.to_owned())),
                Err(_) => std::thread::sleep(RETRY_INTERVAL),
            }
        }
    }
}

/// Returns the address of a name in this shared memory.
fn address(name: &str) -> std::io::Result<SocketAddr> {
    // Without the folder iceoryx2 will report the error.
    let memory = std::fs::metadata(SHARED_MEMORY).map_or((0, 0), |of| (of.dev(), of.ino()));
    let config = &Config::global_config().global;
    let identity = format!("{memory:?} {} {} {name}", config.root_path(), config.prefix);
    SocketAddr::from_abstract_name(format!("bench-dragon {}", blake3::hash(identity.as_bytes()).to_hex()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_held_until_the_claim_is_dropped() {
        let name = format!("claimed_{}", std::process::id());
        let first = NameClaim::new(&name).unwrap();
        assert!(matches!(NameClaim::new(&name), Err(OpenError::AlreadyPublished(held)) if held == name));
        assert!(NameClaim::new(&format!("{name}_too")).is_ok());
        drop(first);
        assert!(NameClaim::new(&name).is_ok());
    }
}
