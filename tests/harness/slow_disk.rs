//! A disk that is slow, for one process: preloaded into it (`LD_PRELOAD`), this library answers `fsync` in the C library's
//! place. The first file of a node and the first of a service take three seconds each, as they can where much else is
//! being written; every other file takes as long as it takes.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use nix::libc::{SYS_fsync, c_int, syscall};

const SLOW: Duration = Duration::from_secs(3);
/// How the names of slow files end, and whether there has been one.
static KINDS: [(&str, AtomicBool); 2] = [(".details", AtomicBool::new(false)), (".service", AtomicBool::new(false))];

/// The C library's `fsync`.
#[unsafe(no_mangle)]
pub extern "C" fn fsync(file: c_int) -> c_int {
    let path = std::fs::read_link(PathBuf::from(format!("/proc/self/fd/{file}"))).unwrap_or_default();
    let name = path.to_string_lossy();
    if KINDS.iter().any(|(ending, seen)| name.ends_with(ending) && !seen.swap(true, Ordering::Relaxed)) {
        std::thread::sleep(SLOW);
    }
    // SAFETY: the system call that the C library's function makes, with its argument.
    unsafe { syscall(SYS_fsync, file) as c_int }
}
