//! The process that publishes a show on ROS 2 for `run` and `replay`: `send ros2`, started, restarted and ended here.
//!
//! The loop's process loads no DDS. A thread starts the process, restarts a process that ended, sends it the lines of
//! this program's log, and ends it with the show.

use std::ffi::OsString;
use std::io::{self, BufRead, BufReader};
use std::os::unix::process::CommandExt;
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use bench_dragon::publisher::live::TransportCounters;
use bench_dragon::ros2_messages::settings::{Ros2Settings, StampClock};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde::{Deserialize, Serialize};

use super::log_lines::LogSender;
use super::{CommandError, Common};

/// The interval at which the supervisor tests whether the process still runs.
const TEST_INTERVAL: Duration = Duration::from_millis(20);
/// The time in which the process must end after a signal; a longer-lived one is killed.
const LONGEST_END: Duration = Duration::from_secs(30);
/// The lifetime after which a process is restarted at once.
const LIFETIME: Duration = Duration::from_secs(5);
/// The first and the longest time before the restart of a process with a shorter lifetime. The time doubles with each
/// restart.
const DELAYS: (Duration, Duration) = (Duration::from_millis(250), Duration::from_secs(60));

/// A line of `send ros2 --json` on standard output.
#[derive(Debug, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Ros2Line {
    /// The process receives the frames of this publisher.
    Connected {
        /// The name.
        name: String,
    },
    /// The topics of a show are open.
    Opened {
        /// The name.
        name: String,
        /// The topics.
        topics: Vec<String>,
    },
    /// A show has ended.
    Gone {
        /// The name.
        name: String,
    },
    /// The counters so far, once a second: a process that is killed prints no summary.
    Counters(TransportCounters),
    /// The counters, at the end.
    Summary(TransportCounters),
}

/// A process of ROS 2 that can be started: name and environment have been tested.
pub struct Ros2Request {
    /// The topics and services in words.
    pub description: String,
    arguments: Vec<OsString>,
}

impl Ros2Request {
    /// Tests name and environment. `override_settings` passes the scene of the command line in place of the show's.
    ///
    /// # Errors
    /// Bad input: one sentence for a name or an environment that ROS 2 cannot take.
    pub fn of(
        common: &Common,
        settings: &Ros2Settings,
        show: Ros2Show,
        override_settings: bool,
    ) -> Result<Self, CommandError> {
        let description = describe(common.name(), settings, show)?;
        let mut arguments: Vec<OsString> = vec![format!("--name={}", common.name()).into(), "--json".into()];
        if let Some(scene) = common.scene.as_ref().filter(|_| override_settings) {
            arguments.extend(["--scene".into(), scene.into()]);
        }
        arguments.extend((0..common.verbose).map(|_| "--verbose".into()));
        arguments.extend(common.quiet.then(|| "--quiet".into()));
        arguments.extend(["send".into(), "ros2".into()]);
        arguments.extend(settings.control.then(|| "--control".into()));
        arguments.push(format!("--use-sim-time={}", settings.stamps == StampClock::Sim).into());
        arguments.extend(["--end-with-parent".into(), std::process::id().to_string().into()]);
        arguments.push("--log-on-stdin".into());
        Ok(Self { description, arguments })
    }
}

/// The facts of a show that ROS 2 needs.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(not(feature = "ros2"), expect(dead_code, reason = "a program without ROS 2 refuses before it reads them"))]
pub struct Ros2Show {
    /// The rate of the loop, in frames per second.
    pub loop_rate: f64,
    /// True if there are alerts.
    pub alerts: bool,
    /// The cues of the show.
    pub cues: usize,
}

#[cfg(feature = "ros2")]
fn describe(name: &str, settings: &Ros2Settings, show: Ros2Show) -> Result<String, CommandError> {
    let Ros2Show { loop_rate, alerts, cues } = show;
    Ok(bench_dragon::ros2::describe(name, settings, bench_dragon::ros2::ShowFacts { loop_rate, alerts, cues })?)
}

#[cfg(not(feature = "ros2"))]
fn describe(_: &str, _: &Ros2Settings, _: Ros2Show) -> Result<String, CommandError> {
    Err(not_built())
}

/// Returns the error of a program without ROS 2.
#[cfg(not(feature = "ros2"))]
pub fn not_built() -> CommandError {
    CommandError::BadInput(
        "ROS 2 is requested and this program was built without it: build it with the feature \"jazzy\" or \"humble\""
            .to_owned(),
    )
}

/// The running process, through any number of restarts. Dropping this value ends the process.
pub struct Ros2Process {
    stop: Arc<AtomicBool>,
    connected: Arc<AtomicBool>,
    thread: Option<JoinHandle<Option<TransportCounters>>>,
}

impl Ros2Process {
    /// Starts the process. Call it after [`stop_on_signals`](super::stop_on_signals).
    ///
    /// # Errors
    /// The system refuses a thread.
    pub fn start(request: &Ros2Request) -> io::Result<Self> {
        let (stop, connected) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
        let supervisor = Supervisor {
            arguments: request.arguments.clone(),
            stop: Arc::clone(&stop),
            connected: Arc::clone(&connected),
        };
        // The system ends the process with the thread that started it, so that thread lives as long as the show.
        let thread = std::thread::Builder::new().name("ros2".to_owned()).spawn(move || supervisor.serve())?;
        Ok(Self { stop, connected, thread: Some(thread) })
    }

    /// Returns a flag that is set when the process first receives the show's frames.
    pub fn connected(&self) -> &AtomicBool {
        &self.connected
    }

    /// Ends the process after it has sent the remaining frames. Returns the counters of all processes; of a process that
    /// was killed, without its last second.
    pub fn finish(mut self) -> Option<TransportCounters> {
        self.end()
    }

    fn end(&mut self) -> Option<TransportCounters> {
        self.stop.store(true, Ordering::Release);
        // A panic of the thread has been printed.
        self.thread.take()?.join().ok().flatten()
    }
}

impl Drop for Ros2Process {
    fn drop(&mut self) {
        self.end();
    }
}

/// The thread.
struct Supervisor {
    arguments: Vec<OsString>,
    stop: Arc<AtomicBool>,
    connected: Arc<AtomicBool>,
}

impl Supervisor {
    /// Keeps the process running until the show ends. Returns the counters of all processes.
    fn serve(&self) -> Option<TransportCounters> {
        let (shortest, longest) = DELAYS;
        let (mut delay, mut sum) = (Duration::ZERO, None);
        loop {
            let began = Instant::now();
            let ended = self.run_once();
            if let Ok((_, Some(TransportCounters { frames, skipped, discarded }))) = ended {
                let of: &mut TransportCounters = sum.get_or_insert_default();
                (of.frames, of.skipped) = (of.frames + frames, of.skipped + skipped);
                of.discarded += discarded;
            }
            if self.must_stop() {
                return sum;
            }
            delay = if began.elapsed() >= LIFETIME { Duration::ZERO } else { (2 * delay).clamp(shortest, longest) };
            let reason = ended.map_or_else(|error| error.to_string(), |(status, _)| status.to_string());
            log::warn!(
                "the process of ROS 2 ended ({reason}): restarted in {} s; the show itself continues",
                delay.as_secs_f64()
            );
            let restart = Instant::now() + delay;
            while Instant::now() < restart && !self.must_stop() {
                std::thread::sleep(TEST_INTERVAL);
            }
        }
    }

    fn must_stop(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }

    /// Starts the process and waits for its end.
    fn run_once(&self) -> io::Result<(ExitStatus, Option<TransportCounters>)> {
        let mut command = Command::new(std::env::current_exe()?);
        // In a process group of its own: Ctrl-C on the terminal ends the show, which then ends this process.
        command.args(&self.arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).process_group(0);
        // With an arena for each thread, the allocator of glibc keeps the memory of subscribers that have left.
        command.env("MALLOC_ARENA_MAX", "1");
        // Unless it is set, glibc raises this limit, and the receive buffers of RustDDS, 256 kB each
        // (`network/udp_listener.rs:43`), leave gaps in the pages of small objects that stay.
        command.env("MALLOC_MMAP_THRESHOLD_", "131072");
        let mut child = command.spawn()?;
        let (output, connected) = (child.stdout.take(), Arc::clone(&self.connected));
        let reader = std::thread::spawn(move || read_lines(output, &connected));
        let log = child.stdin.take().map(LogSender::new).transpose()?;
        let status = self.wait(&mut child, log)?;
        Ok((status, reader.join().ok().flatten()))
    }

    /// Waits until the process ends, by itself or after the end of the show.
    fn wait(&self, child: &mut Child, mut log: Option<LogSender>) -> io::Result<ExitStatus> {
        let mut killed_at = None;
        loop {
            log.iter_mut().for_each(LogSender::send);
            if let Some(status) = child.try_wait()? {
                return Ok(status);
            }
            if self.must_stop() {
                let deadline = *killed_at.get_or_insert_with(|| {
                    // The process has not been waited for: its number is still its own.
                    let _ = kill(Pid::from_raw(child.id() as i32), Signal::SIGTERM);
                    Instant::now() + LONGEST_END
                });
                if Instant::now() >= deadline {
                    child.kill()?;
                }
            }
            std::thread::sleep(TEST_INTERVAL);
        }
    }
}

/// Reads the lines of the process until it ends. Returns the latest counters that it has printed.
fn read_lines(output: Option<ChildStdout>, connected: &AtomicBool) -> Option<TransportCounters> {
    let lines = output.into_iter().flat_map(|output| BufReader::new(output).lines().map_while(Result::ok));
    let mut counters = None;
    for line in lines {
        match serde_json::from_str(&line) {
            Ok(Ros2Line::Connected { .. }) => connected.store(true, Ordering::Release),
            Ok(Ros2Line::Counters(of) | Ros2Line::Summary(of)) => counters = Some(of),
            // A killed process can leave half a line.
            _ => (),
        }
    }
    counters
}
