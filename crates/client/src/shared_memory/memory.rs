//! The shared memory itself: what is left of it, and pages reserved before they are written.

use std::collections::BTreeSet;
use std::fs::OpenOptions;

use super::error::OpenError;

/// Where Linux keeps shared memory.
pub const SHARED_MEMORY: &str = "/dev/shm";
/// What a subscriber needs of it for its own bookkeeping, and more.
const SUBSCRIBER_BYTES: u64 = 500_000;

/// Refuses to subscribe where the shared memory is as good as full.
///
/// # Errors
/// [`OpenError::Full`].
pub fn check_room_to_subscribe() -> Result<(), OpenError> {
    match free_bytes() {
        Some(free) if free < SUBSCRIBER_BYTES => Err(OpenError::Full { free }),
        _ => Ok(()),
    }
}

/// What is left of the shared memory; `None` where there is no such folder: iceoryx2 itself will report what is wrong.
pub fn free_bytes() -> Option<u64> {
    let space = nix::sys::statvfs::statvfs(SHARED_MEMORY).ok()?;
    Some(space.blocks_available() * space.fragment_size())
}

/// Has the system set aside every page of the shared memory that this process has mapped. Without this a page is looked
/// for when it is first written, and should others have filled the memory by then, the process is killed with SIGBUS.
///
/// # Errors
/// [`OpenError::Full`] where the pages are not there.
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
