//! A stepped wall clock for one process: preloaded into the process (`LD_PRELOAD`), this library replaces the C
//! library's `clock_gettime`. CLOCK_REALTIME is right for two seconds, an hour ahead for two seconds, an hour behind
//! for two seconds, and so on. Every other clock is the true one. The machine's own clock stays untouched.

use std::sync::OnceLock;

use nix::libc::{CLOCK_MONOTONIC, CLOCK_REALTIME, SYS_clock_gettime, c_int, clockid_t, syscall, timespec};

/// Seconds of CLOCK_MONOTONIC when the process first read the time.
static BEGAN: OnceLock<i64> = OnceLock::new();

fn true_time(clock: clockid_t, time: *mut timespec) -> c_int {
    // SAFETY: the system call that the C library's function makes, with its arguments.
    unsafe { syscall(SYS_clock_gettime, clock, time) as c_int }
}

/// The C library's `clock_gettime`, except for CLOCK_REALTIME.
///
/// # Safety
/// `time` is writable, as for the C library's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn clock_gettime(clock: clockid_t, time: *mut timespec) -> c_int {
    let result = true_time(clock, time);
    if clock == CLOCK_REALTIME && result == 0 {
        let mut now = timespec { tv_sec: 0, tv_nsec: 0 };
        true_time(CLOCK_MONOTONIC, &mut now);
        let step = match (now.tv_sec - BEGAN.get_or_init(|| now.tv_sec)) % 6 {
            0..2 => 0,
            2..4 => 3600,
            _ => -3600,
        };
        // SAFETY: writable by this function's contract.
        unsafe { (*time).tv_sec += step };
    }
    result
}
