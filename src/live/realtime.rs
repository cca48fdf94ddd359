//! What the operating system can do for a punctual thread: timer slack, real-time priority, locked memory, a CPU of
//! its own. Called once, on the loop's thread, before the loop.

use nix::sys::mman::{MlockAllFlags, mlockall};
use thread_priority::unix::{
    RealtimeThreadSchedulePolicy, ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
};
use thread_priority::{ThreadPriority, ThreadPriorityValue};

/// The real-time priorities that Linux has.
pub const PRIORITIES: std::ops::RangeInclusive<u8> = 1..=99;

/// Wakes this thread as precisely as timers can: Linux otherwise lets a wake-up slip by 50 microseconds.
pub fn set_timer_slack() {
    if let Err(error) = nix::sys::prctl::set_timerslack(1) {
        log::warn!("the timer slack could not be set ({error}): wake-ups will be some 50 microseconds later");
    }
}

/// Gives this thread the real-time priority `priority` under SCHED_FIFO and locks the memory the process has so far.
///
/// Without the right to either a warning says how to get it. What is mapped later, the queues in shared memory among
/// it, is not locked here: that would fill all of it, used or not.
pub fn become_realtime(priority: u8) {
    // Every priority of PRIORITIES is a valid value.
    let value = ThreadPriorityValue::try_from(priority).unwrap_or(ThreadPriorityValue::MIN);
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let set = set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy);
    if let Err(error) = set {
        log::warn!(
            "no real-time priority ({error:?}): the loop runs as an ordinary thread. To allow it, run as root, or add \
             \"@realtime - rtprio 99\" to /etc/security/limits.conf, put the user into that group and log in again"
        );
    }
    if let Err(error) = mlockall(MlockAllFlags::MCL_CURRENT) {
        log::warn!(
            "memory could not be locked ({error}): a page fault can delay a frame. To allow it, raise the limit with \
             \"ulimit -l unlimited\", or add \"@realtime - memlock unlimited\" to /etc/security/limits.conf"
        );
    }
}

/// Keeps this thread on one CPU.
///
/// # Errors
/// One sentence where there is no such CPU, or the thread may not run on it.
pub fn pin_to_cpu(cpu: usize) -> Result<(), String> {
    let cores = core_affinity::get_core_ids().unwrap_or_default();
    let core = cores.iter().find(|core| core.id == cpu);
    match core {
        Some(core) if core_affinity::set_for_current(*core) => Ok(()),
        _ => {
            let known: Vec<_> = cores.iter().map(|core| core.id.to_string()).collect();
            Err(format!("--cpu is {cpu}, expected one of {}", known.join(", ")))
        }
    }
}
