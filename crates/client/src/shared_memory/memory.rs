//! The shared memory itself: its free bytes, and pages reserved before they are written.

use std::collections::BTreeSet;
use std::fs::OpenOptions;

use super::SHARED_MEMORY;
use super::error::OpenError;

/// The number of bytes that a subscriber needs for its bookkeeping, with a margin.
const SUBSCRIBER_BYTES: u64 = 500_000;

/// Refuses to subscribe if the shared memory is almost full.
///
/// # Errors
/// [`OpenError::Full`].
pub fn check_room_to_subscribe() -> Result<(), OpenError> {
    match free_bytes() {
        Some(free) if free < SUBSCRIBER_BYTES => Err(OpenError::Full { free }),
        _ => Ok(()),
    }
}

/// Returns the free bytes of the shared memory; `None` if the folder does not exist: iceoryx2 will report this error.
pub fn free_bytes() -> Option<u64> {
    let space = nix::sys::statvfs::statvfs(SHARED_MEMORY).ok()?;
    Some(space.blocks_available() * space.fragment_size())
}

/// Reserves every page of the shared memory that this process has mapped. Otherwise the system allocates a page at its
/// first write, and kills the process with SIGBUS if the memory is full by then.
///
/// # Errors
/// [`OpenError::Full`] if there are not enough pages.
pub fn reserve_pages() -> Result<(), OpenError> {
    let full = || OpenError::Full { free: free_bytes().unwrap_or(0) };
    // Linux has this file for every process.
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap_or_default();
    let mapped: BTreeSet<_> = maps.lines().filter_map(|line| Some(&line[line.find(SHARED_MEMORY)?..])).collect();
    // A file that is removed meanwhile needs no pages.
    for file in mapped.into_iter().filter_map(|file| OpenOptions::new().read(true).write(true).open(file).ok()) {
        let length = file.metadata().map_or(0, |of| of.len());
        if length > 0 {
            nix::fcntl::posix_fallocate(&file, 0, length as i64).map_err(|_| full())?;
        }
    }
    Ok(())
}
