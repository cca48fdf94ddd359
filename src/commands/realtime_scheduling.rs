//! Real-time scheduling of the loop: the options that `run` takes and `soak` passes to the `run` it starts.

use std::ffi::OsString;
use std::fs::File;

use bench_dragon::publisher::live::realtime;

use super::CommandError;

/// What is requested from the operating system.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Real-time scheduling")]
pub struct RealtimeScheduling {
    /// Run the loop with this real-time priority, 1 to 99 (SCHED_FIFO), and lock its memory
    #[arg(long, value_name = "PRIORITY", value_parser = clap::value_parser!(u8).range(1..=99))]
    realtime: Option<u8>,
    /// Keep the loop on this CPU
    #[arg(long, value_name = "N")]
    cpu: Option<usize>,
    /// Let no CPU sleep so deeply that waking it takes longer than this many microseconds; with 0 none sleeps
    /// (/dev/cpu_dma_latency, as cyclictest does)
    #[arg(long, value_name = "MICROSECONDS")]
    cpu_latency: Option<u32>,
}

impl RealtimeScheduling {
    /// Requests it, on the loop's thread. The CPUs stay awake for as long as what is returned is kept.
    ///
    /// # Errors
    /// Bad input: there is no such CPU. What the user has no right to is a warning.
    pub fn prepare_thread(&self) -> Result<Option<File>, CommandError> {
        if let Some(cpu) = self.cpu {
            realtime::pin_to_cpu(cpu).map_err(|error| CommandError::BadInput(format!("--cpu: {error}")))?;
        }
        realtime::set_timer_slack();
        if let Some(priority) = self.realtime {
            realtime::become_realtime(priority);
        }
        Ok(self.cpu_latency.and_then(realtime::limit_cpu_latency))
    }

    /// The same options for another process.
    pub fn arguments(&self) -> impl Iterator<Item = OsString> {
        let given = [
            ("--realtime", self.realtime.map(|priority| priority.to_string())),
            ("--cpu", self.cpu.map(|cpu| cpu.to_string())),
            ("--cpu-latency", self.cpu_latency.map(|microseconds| microseconds.to_string())),
        ];
        given.into_iter().flat_map(|(option, value)| value.into_iter().flat_map(|value| [option.into(), value.into()]))
    }
}
