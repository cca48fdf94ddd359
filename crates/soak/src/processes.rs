//! Starts, signals and reads the processes of a soak test: a thread for each pipe turns its lines into events.

use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::Sender;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::conduct::Conducted;
use super::member::Role;
use super::observation::Observation;
use bench_dragon_publisher::live::statistics::RunSummary;

/// The processes to start.
#[derive(Debug, Clone)]
pub struct Plan {
    /// This program.
    pub program: PathBuf,
    /// Arguments of every process before its subcommand.
    pub common: Vec<OsString>,
    /// Arguments of `run`.
    pub publisher: Vec<OsString>,
    /// The subscribers.
    pub roles: Vec<Role>,
    /// True if the publisher starts a process that publishes on ROS 2.
    pub ros2: bool,
    /// The load generator and its clients, if any.
    pub conduct: Option<ConductPlan>,
}

/// The plan of a load generator and its clients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConductPlan {
    /// The seed of the commands.
    pub seed: u64,
    /// The rate, in frames per second, if not the scene's.
    pub rate: Option<f64>,
    /// Further clients of the control service, each killed during a request and started again.
    pub flaky_clients: usize,
}

/// The output of a process, or its end.
pub(super) enum ProcessEvent {
    /// A subscriber has printed its observation.
    Observed { member: usize, start: u64, observation: Box<Observation> },
    /// A subscriber has closed its standard output.
    Ended { member: usize, start: u64 },
    /// The load generator has printed its counts.
    Conducted(Box<Conducted>),
    /// The load generator has closed its standard output.
    LoadGeneratorEnded,
    /// The publisher has printed its summary.
    Summary(Box<RunSummary>),
    /// The publisher has printed a line on standard error.
    Stderr(String),
}

impl Plan {
    /// Returns a command for this program in another process group, so that Ctrl-C on the terminal reaches the soak
    /// test only.
    fn command(&self, subcommand: &str) -> Command {
        let mut command = Command::new(&self.program);
        command.args(&self.common).arg(subcommand).args(["--end-with-parent", &std::process::id().to_string()]);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).process_group(0);
        command
    }

    /// Starts the publisher.
    pub(super) fn spawn_publisher(&self, sender: &Sender<ProcessEvent>) -> std::io::Result<Child> {
        let mut command = self.command("run");
        command.args(&self.publisher).arg("--json").stderr(Stdio::piped());
        let mut child = command.spawn()?;
        // The receiver is gone if the test has ended.
        read_lines(child.stdout.take(), sender, |line, sender| {
            if let Ok(summary) = serde_json::from_str(&line) {
                let _ = sender.send(ProcessEvent::Summary(Box::new(summary)));
            }
        });
        read_lines(child.stderr.take(), sender, |line, sender| {
            let _ = sender.send(ProcessEvent::Stderr(line));
        });
        Ok(child)
    }

    /// Starts the process of a member.
    pub(super) fn spawn_subscriber(
        &self,
        member: usize,
        role: Role,
        start: u64,
        sender: &Sender<ProcessEvent>,
    ) -> std::io::Result<Child> {
        let mut command = self.command("soak-subscriber");
        if role == Role::Slow {
            command.arg("--slow");
        }
        let mut child = command.spawn()?;
        let stdout = child.stdout.take();
        let sender = sender.clone();
        std::thread::spawn(move || {
            // A killed process can leave half a line.
            let observations = lines(stdout).filter_map(|line| serde_json::from_str(&line).ok());
            for observation in observations {
                // The receiver is gone if the test has ended.
                let _ = sender.send(ProcessEvent::Observed { member, start, observation: Box::new(observation) });
            }
            let _ = sender.send(ProcessEvent::Ended { member, start });
        });
        Ok(child)
    }
}

impl Plan {
    /// Starts the process that sends commands.
    pub(super) fn spawn_load_generator(
        &self,
        conduct: &ConductPlan,
        sender: &Sender<ProcessEvent>,
    ) -> std::io::Result<Child> {
        let mut command = self.command("soak-load-generator");
        command.args(["--seed", &conduct.seed.to_string()]);
        if let Some(rate) = conduct.rate {
            command.args(["--rate", &rate.to_string()]);
        }
        let mut child = command.spawn()?;
        let stdout = child.stdout.take();
        let sender = sender.clone();
        std::thread::spawn(move || {
            // The receiver is gone if the test has ended.
            for conducted in lines(stdout).filter_map(|line| serde_json::from_str(&line).ok()) {
                let _ = sender.send(ProcessEvent::Conducted(Box::new(conducted)));
            }
            let _ = sender.send(ProcessEvent::LoadGeneratorEnded);
        });
        Ok(child)
    }

    /// Starts a client of the control service that always awaits an answer.
    pub(super) fn spawn_client(&self) -> std::io::Result<Child> {
        self.command("soak-client").stdout(Stdio::null()).spawn()
    }
}

fn lines(pipe: Option<impl Read>) -> impl Iterator<Item = String> {
    pipe.into_iter().flat_map(|pipe| BufReader::new(pipe).lines().map_while(Result::ok))
}

/// Starts a thread that passes each line of a pipe to `each`.
fn read_lines(
    pipe: Option<impl Read + Send + 'static>,
    sender: &Sender<ProcessEvent>,
    each: impl Fn(String, &Sender<ProcessEvent>) + Send + 'static,
) {
    let sender = sender.clone();
    std::thread::spawn(move || lines(pipe).for_each(|line| each(line, &sender)));
}

/// Sends a signal to a process, which may have ended already: its exit status shows that.
pub(super) fn signal(child: &Child, signal: Signal) {
    let _ = kill(Pid::from_raw(child.id() as i32), signal);
}
