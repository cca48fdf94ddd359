//! Real-time scheduling of the loop: the options that `run` takes and `soak` passes to the `run` it starts.

use std::ffi::OsString;

use bench_dragon::publisher::live::realtime::Scheduling;

/// The scheduling that is requested from the operating system.
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
    /// Returns the options as the library takes them.
    pub fn scheduling(&self) -> Scheduling {
        let Self { realtime, cpu, cpu_latency } = *self;
        Scheduling { realtime, cpu, cpu_latency }
    }

    /// Returns the same options for another process.
    pub fn arguments(&self) -> impl Iterator<Item = OsString> {
        let given = [
            ("--realtime", self.realtime.map(|priority| priority.to_string())),
            ("--cpu", self.cpu.map(|cpu| cpu.to_string())),
            ("--cpu-latency", self.cpu_latency.map(|microseconds| microseconds.to_string())),
        ];
        given.into_iter().flat_map(|(option, value)| value.into_iter().flat_map(|value| [option.into(), value.into()]))
    }
}
