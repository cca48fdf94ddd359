//! A slow disk for one process. Preloaded into the process (`LD_PRELOAD`), this library replaces the C library's
//! `fsync`. The first file of a node and the first file of a service take three seconds each, as on a disk under load.
//! Every other file takes its usual time.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use nix::libc::{SYS_fsync, c_int, syscall};

const SLOW: Duration = Duration::from_secs(3);
/// The endings of the names of slow files, and true once there has been one.
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
