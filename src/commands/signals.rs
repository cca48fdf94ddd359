//! Signals that end a command: a flag that they set, and searches that stop when it is set.
//!
//! In: SIGINT, SIGTERM, SIGHUP. Out: [`stop_on_signals`] for commands that run until then, and
//! [`stop_searches_on_signals`] for commands that search: the first signal stops the search, and the command prints
//! what it has found; the second ends the command at once.

use std::io;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use indicatif::ProgressBar;
use nix::sys::signal::{SigSet, Signal};

use super::CommandError;

/// The flag that the first signal sets, in a command that searches.
static STOP: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Makes the first signal stop the searches of this command, and the second end it. Call it before other threads start.
pub fn stop_searches_on_signals() -> Result<(), CommandError> {
    let stop = STOP.get_or_init(Arc::default);
    for signal in signals().iter() {
        signal_hook::flag::register_conditional_default(signal as i32, Arc::clone(stop))?;
        signal_hook::flag::register(signal as i32, Arc::clone(stop))?;
    }
    Ok(())
}

/// Returns true if a signal has stopped the searches of this command.
pub fn are_searches_stopped() -> bool {
    STOP.get().is_some_and(|stop| stop.load(Ordering::Relaxed))
}

/// Shows the share of a search that is done, and stops the search after a signal.
pub fn report(bar: &ProgressBar, share: f64) -> ControlFlow<()> {
    bar.set_position((1000.0 * share) as u64);
    if are_searches_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

/// Returns the words for the end of a search that came to no end.
pub fn gave_up() -> &'static str {
    if are_searches_stopped() { "was stopped" } else { "gave up" }
}

/// Returns the error of a command whose search a signal has stopped.
///
/// # Errors
/// Failed: there was a signal.
pub fn unstopped() -> Result<(), CommandError> {
    if are_searches_stopped() { Err(stopped()) } else { Ok(()) }
}

/// Returns the same error, for a result that is missing because of the signal.
pub fn stopped() -> CommandError {
    CommandError::Failed("stopped by a signal before the end: the results are not complete".to_owned())
}

/// Returns SIGINT, SIGTERM and SIGHUP; SIGHUP unless it is ignored.
fn signals() -> SigSet {
    let hangup = if is_ignored(Signal::SIGHUP as i32) { None } else { Some(Signal::SIGHUP) };
    [Signal::SIGINT, Signal::SIGTERM].into_iter().chain(hangup).collect()
}

/// Returns a flag that SIGINT, SIGTERM and SIGHUP set; SIGHUP unless it is ignored, as by `nohup`.
///
/// Call it before other threads start: from then on one thread receives these signals. iceoryx2 treats an interrupted
/// system call as a failure.
pub fn stop_on_signals() -> Result<Arc<AtomicBool>, CommandError> {
    let stop = Arc::new(AtomicBool::new(false));
    let signals = signals();
    for signal in signals.iter() {
        signal_hook::flag::register(signal as i32, Arc::clone(&stop))?;
    }
    std::thread::Builder::new().name("signals".to_owned()).spawn(move || {
        // A parent such as `soak` may have them blocked, and a mask is inherited.
        // No panic: this fails only for an unknown way to change the mask.
        signals.thread_unblock().unwrap();
        loop {
            nix::unistd::pause();
        }
    })?;
    signals.thread_block().map_err(io::Error::from)?;
    Ok(stop)
}

/// Returns true if the parent process made this one ignore a signal, as `nohup` does.
fn is_ignored(signal: i32) -> bool {
    // proc(5): SigIgn is a mask in hexadecimal, the first signal its lowest bit.
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
