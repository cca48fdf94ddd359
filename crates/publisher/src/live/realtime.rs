//! Settings of the operating system for a thread with deadlines: timer slack, real-time priority, locked memory, a
//! fixed CPU, CPUs that stay awake. They are made once on the loop's thread, before the loop.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::os::unix::fs::MetadataExt;

use nix::sched::{CpuSet, sched_getaffinity, sched_setaffinity};
use nix::sys::mman::{MlockAllFlags, mlockall};
use nix::sys::resource::{Resource, getrlimit};
use nix::unistd::Pid;
use thread_priority::unix::{
    RealtimeThreadSchedulePolicy, ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
};
use thread_priority::{ThreadPriority, ThreadPriorityValue};

/// The scheduling that is requested for the loop's thread.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Scheduling {
    /// The priority under SCHED_FIFO, 1 to 99.
    pub realtime: Option<u8>,
    /// The CPU to stay on.
    pub cpu: Option<usize>,
    /// The longest wake-up latency of all CPUs, in microseconds.
    pub cpu_latency: Option<u32>,
}

impl Scheduling {
    /// Requests the scheduling for the calling thread. The limit of the latency lasts until the returned file is
    /// closed.
    ///
    /// # Errors
    /// [`CpuError`]. A right that the user does not have is a warning.
    pub fn prepare_thread(self) -> Result<Option<File>, CpuError> {
        let Self { realtime, cpu, cpu_latency } = self;
        cpu.map(pin_to_cpu).transpose()?;
        set_timer_slack();
        realtime.into_iter().for_each(become_realtime);
        Ok(cpu_latency.and_then(limit_cpu_latency))
    }
}

/// Sets the least timer slack. Linux may otherwise delay a wake-up by 50 microseconds.
fn set_timer_slack() {
    if let Err(error) = nix::sys::prctl::set_timerslack(1) {
        log::warn!("the timer slack could not be set ({error}): wake-ups will be some 50 microseconds later");
    }
}

/// Gives this thread the real-time priority `priority` under SCHED_FIFO and locks the memory the process has so far.
///
/// Without the right to either, a warning states how to get it. Memory that is mapped later, such as the queues in
/// shared memory, is not locked: locking would allocate all of it, used or not.
fn become_realtime(priority: u8) {
    // Every priority that Linux has is a valid value.
    let value = ThreadPriorityValue::try_from(priority).unwrap_or(ThreadPriorityValue::MIN);
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let set = set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy);
    if let Err(error) = set {
        log::warn!(
            "no real-time priority ({error:?}): the loop runs as an ordinary thread. To allow it, {}",
            remedy(is_root(), greatest_priority(), priority)
        );
    }
    if let Err(error) = mlockall(MlockAllFlags::MCL_CURRENT) {
        log::warn!(
            "memory could not be locked ({error}): a page fault can delay a frame. To allow it, raise the limit with \
             \"ulimit -l unlimited\", or add \"@realtime - memlock unlimited\" to /etc/security/limits.conf"
        );
    }
}

/// Returns the greatest real-time priority that the limits of this process admit.
fn greatest_priority() -> u64 {
    getrlimit(Resource::RLIMIT_RTPRIO).map_or(0, |(limit, _)| limit)
}

/// Returns true for a process of root; Linux has its folder with its owner.
fn is_root() -> bool {
    std::fs::metadata("/proc/self").is_ok_and(|process| process.uid() == 0)
}

/// Returns the way to a refused `priority`. Who is root, or within the limit, has been refused by a container or by a
/// control group whose real-time budget is 0 (Linux, Documentation/scheduler/sched-rt-group.rst).
fn remedy(is_root: bool, limit: u64, priority: u8) -> &'static str {
    if is_root || limit >= u64::from(priority) {
        "give the container the right (docker run --cap-add SYS_NICE --ulimit rtprio=99) and, where the kernel has \
         real-time budgets for control groups, a budget (cpu.rt_runtime_us; docker run --cpu-rt-runtime=950000)"
    } else {
        "run as root, or add \"@realtime - rtprio 99\" to /etc/security/limits.conf, put the user into that group and \
         log in again"
    }
}

/// The device for limits of the CPUs' wake-up latency (Linux, Documentation/power/pm_qos_interface.rst).
const CPU_LATENCY_DEVICE: &str = "/dev/cpu_dma_latency";

/// Limits the wake-up latency of all CPUs to `microseconds` while the returned file is open. With 0, idle CPUs do not
/// sleep. cyclictest does the same by default.
///
/// Without the right to it, a warning states how to get it.
fn limit_cpu_latency(microseconds: u32) -> Option<File> {
    // The device reads a signed 32-bit number.
    let limit = i32::try_from(microseconds).unwrap_or(i32::MAX);
    let opened = OpenOptions::new().write(true).open(CPU_LATENCY_DEVICE);
    opened
        .and_then(|mut device| device.write_all(&limit.to_ne_bytes()).map(|()| device))
        .inspect_err(|error| {
            log::warn!(
                "the CPUs' wake-up latency could not be limited ({CPU_LATENCY_DEVICE}: {error}): idle CPUs still \
                 sleep. To allow it, run as root or grant write access to that file"
            );
        })
        .ok()
}

/// A CPU that does not exist, or on which this thread may not run.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("no CPU {cpu} for this thread, expected one of {available:?}")]
pub struct CpuError {
    /// The CPU.
    pub cpu: usize,
    /// The CPUs on which the thread may run.
    pub available: Vec<usize>,
}

/// Keeps this thread on one CPU.
///
/// # Errors
/// [`CpuError`] if there is no such CPU, or the thread may not run on it.
fn pin_to_cpu(cpu: usize) -> Result<(), CpuError> {
    // The calling thread.
    let this = Pid::from_raw(0);
    let set = sched_getaffinity(this).unwrap_or_default();
    let available: Vec<usize> = (0..CpuSet::count()).filter(|cpu| set.is_set(*cpu).unwrap_or(false)).collect();
    let mut one = CpuSet::new();
    let pinned = available.contains(&cpu) && one.set(cpu).and_then(|()| sched_setaffinity(this, &one)).is_ok();
    if pinned { Ok(()) } else { Err(CpuError { cpu, available }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_has_the_right_already_is_told_of_the_control_group() {
        for (is_root, limit, is_of_the_group) in
            [(true, 0, true), (false, 80, true), (false, 79, false), (false, 0, false)]
        {
            let sentence = remedy(is_root, limit, 80);
            assert_eq!(sentence.contains("cpu.rt_runtime_us"), is_of_the_group, "{sentence}");
            assert_eq!(sentence.contains("limits.conf"), !is_of_the_group, "{sentence}");
        }
    }
}
