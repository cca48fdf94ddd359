//! The processes of a soak test: one publisher, and subscribers that keep up, are slow, or die and return.
//!
//! Used by the command `soak`, which calls [`Fleet::attend`] often and [`Fleet::figures`] once a second.

use std::ffi::OsString;
use std::io::{BufRead, BufReader};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde::{Deserialize, Serialize};

use super::observer::{Latencies, Observation, Status};
use super::resources::Resources;
use crate::live::statistics::Percentiles;

/// How long a flaky subscriber lives before it is killed.
const FLAKY_LIFE: Duration = Duration::from_secs(5);
/// How long subscribers may take to receive their first frame.
const PATIENCE_AT_START: Duration = Duration::from_secs(60);
/// How long the publisher, and then the subscribers, may take to end when asked to.
const PATIENCE_AT_END: Duration = Duration::from_secs(15);
/// From this long after the start the publisher's memory should no longer grow.
pub const SETTLING: Duration = Duration::from_secs(60);

/// What to start.
#[derive(Debug, Clone)]
pub struct Plan {
    /// This program.
    pub program: PathBuf,
    /// What publisher and subscribers are told before their subcommand.
    pub common: Vec<OsString>,
    /// What follows `run`.
    pub publisher: Vec<OsString>,
    /// The subscribers.
    pub roles: Vec<Role>,
}

/// What a subscriber is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Reads whenever a frame comes, and must miss none.
    Steady,
    /// Sleeps longer than its queue lasts.
    Slow,
    /// Is killed with SIGKILL every few seconds and started again.
    Flaky,
}

impl Role {
    fn name(self) -> &'static str {
        match self {
            Self::Steady => "steady",
            Self::Slow => "slow",
            Self::Flaky => "flaky",
        }
    }
}

/// Why the soak test could not go on.
#[derive(Debug, thiserror::Error)]
pub enum FleetError {
    /// A process could not be started or signalled.
    #[error("a process of the soak test could not be started: {0}")]
    Start(#[from] std::io::Error),
    /// The publisher ended before all subscribers had received a frame.
    #[error("the publisher ended at once ({0}){1}")]
    PublisherRefused(ExitStatus, String),
    /// A subscriber ended before it received a frame.
    #[error("the subscriber {0} ended at once: see what it said above")]
    SubscriberRefused(String),
    /// Frames did not come.
    #[error("not every subscriber received a frame within {} s", PATIENCE_AT_START.as_secs())]
    NoFrames,
}

/// The summary that `run --json` prints at its end.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunSummary {
    /// Frames published.
    pub frames: u64,
    /// Incidents in which at least one period was skipped.
    pub overruns: u64,
    /// Periods skipped.
    pub skipped: u64,
    /// Wake-up lateness against the intended deadlines.
    pub wakeup_ns: Percentiles,
    /// Cost of a step.
    pub step_ns: Percentiles,
    /// Why it ended.
    pub end: String,
    /// What the ROS 2 side did, where it was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ros2: Option<Ros2Counts>,
}

/// What the ROS 2 side of a publisher did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ros2Counts {
    /// Frames published.
    pub frames: u64,
    /// Frames left out because the ROS 2 thread was behind.
    pub skipped: u64,
    /// Messages that a full queue did not take.
    pub discarded: u64,
}

/// A subscriber and all its lives.
#[derive(Debug)]
pub struct Member {
    /// Its name in the report.
    pub label: String,
    /// What it is for.
    pub role: Role,
    /// Processes it has been so far.
    pub lives: u64,
    /// Whether it ended when it should not have.
    pub ended_by_itself: bool,
    child: Child,
    born: Instant,
    /// What its former lives saw.
    past: Observation,
    present: Observation,
    /// The latencies that came since the last row of figures.
    fresh: Option<Latencies>,
}

impl Member {
    /// What all its lives have seen. Latencies are those of the life in which they were worst.
    pub fn seen(&self) -> Observation {
        joined(&self.past, &self.present)
    }
}

enum Event {
    Observed { member: usize, life: u64, observation: Box<Observation> },
    Ended { member: usize, life: u64 },
    Summary(Box<RunSummary>),
    Said(String),
}

/// All processes of a soak test. Dropping it kills those that still run.
pub struct Fleet {
    plan: Plan,
    publisher: Child,
    /// How the publisher ended, if it has.
    publisher_ended: Option<ExitStatus>,
    summary: Option<RunSummary>,
    members: Vec<Member>,
    events: Receiver<Event>,
    sender: Sender<Event>,
    /// What the publisher said on standard error and nobody has printed yet.
    said: Vec<String>,
    settled_bytes: Option<u64>,
    most_bytes_after: u64,
    began: Instant,
}

impl Fleet {
    /// Starts the publisher and the subscribers, and waits until every steady one has received a frame. `go_on` is
    /// asked meanwhile.
    ///
    /// # Errors
    /// [`FleetError`] where that does not come about.
    pub fn start(plan: Plan, go_on: &dyn Fn() -> bool) -> Result<Self, FleetError> {
        let (sender, events) = channel();
        let mut publisher = command(&plan);
        publisher.arg("run").args(&plan.publisher).arg("--json").stderr(Stdio::piped());
        let mut publisher = publisher.spawn()?;
        listen_to_publisher(&mut publisher, &sender);
        let mut fleet = Self {
            publisher,
            publisher_ended: None,
            summary: None,
            members: Vec::new(),
            events,
            sender,
            said: Vec::new(),
            settled_bytes: None,
            most_bytes_after: 0,
            began: Instant::now(),
            plan,
        };
        for (index, role) in fleet.plan.roles.clone().into_iter().enumerate() {
            let member = fleet.born(index, role)?;
            fleet.members.push(member);
        }
        fleet.wait_for_frames(go_on)?;
        fleet.began = Instant::now();
        Ok(fleet)
    }

    fn wait_for_frames(&mut self, go_on: &dyn Fn() -> bool) -> Result<(), FleetError> {
        let deadline = Instant::now() + PATIENCE_AT_START;
        let receives = |member: &Member| member.role != Role::Steady || member.present.received > 0;
        while go_on() && !self.members.iter().all(receives) {
            self.attend(Duration::from_millis(50))?;
            if let Some(status) = self.publisher_ended {
                self.take_events(Duration::from_millis(200));
                let said = self.said.iter().map(|line| format!(": {line}")).collect();
                return Err(FleetError::PublisherRefused(status, said));
            }
            if let Some(member) = self.members.iter().find(|member| member.ended_by_itself) {
                return Err(FleetError::SubscriberRefused(member.label.clone()));
            }
            if Instant::now() > deadline {
                return Err(FleetError::NoFrames);
            }
        }
        Ok(())
    }

    fn born(&self, index: usize, role: Role) -> Result<Member, FleetError> {
        let child = self.start_subscriber(index, role, 1)?;
        Ok(Member {
            label: format!(
                "{} {}",
                role.name(),
                self.plan.roles[..=index].iter().filter(|other| **other == role).count()
            ),
            role,
            lives: 1,
            ended_by_itself: false,
            child,
            born: Instant::now(),
            past: Observation::default(),
            present: Observation::default(),
            fresh: None,
        })
    }

    fn start_subscriber(&self, member: usize, role: Role, life: u64) -> Result<Child, FleetError> {
        let mut command = command(&self.plan);
        command.arg("soak-subscriber");
        if role == Role::Slow {
            command.arg("--slow");
        }
        let mut child = command.spawn()?;
        if let Some(stdout) = child.stdout.take() {
            let sender = self.sender.clone();
            std::thread::spawn(move || listen_to_subscriber(stdout, member, life, &sender));
        }
        Ok(child)
    }

    /// Takes in what comes within `time`, notices deaths, and kills and revives flaky subscribers.
    ///
    /// # Errors
    /// [`FleetError::Start`] where a subscriber cannot be started again.
    pub fn attend(&mut self, time: Duration) -> Result<(), FleetError> {
        self.take_events(time);
        if self.publisher_ended.is_none() {
            self.publisher_ended = self.publisher.try_wait()?;
        }
        for index in 0..self.members.len() {
            let member = &mut self.members[index];
            if member.role == Role::Flaky && member.born.elapsed() >= FLAKY_LIFE {
                member.child.kill()?;
                member.child.wait()?;
                member.past = member.seen();
                member.present = Observation::default();
                member.lives += 1;
                member.born = Instant::now();
                let (role, life) = (member.role, member.lives);
                self.members[index].child = self.start_subscriber(index, role, life)?;
            }
        }
        Ok(())
    }

    fn take_events(&mut self, time: Duration) {
        let deadline = Instant::now() + time;
        loop {
            match self.events.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
                Ok(event) => self.take(event),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    fn take(&mut self, event: Event) {
        match event {
            Event::Observed { member, life, observation } => {
                let member = &mut self.members[member];
                if life == member.lives {
                    member.fresh = worst(member.fresh, observation.second);
                    member.present = *observation;
                }
            }
            Event::Ended { member, life } => {
                let member = &mut self.members[member];
                member.ended_by_itself |= life == member.lives;
            }
            Event::Summary(summary) => self.summary = Some(*summary),
            Event::Said(line) => self.said.push(line),
        }
    }

    /// The process id of the publisher.
    pub fn publisher_id(&self) -> u32 {
        self.publisher.id()
    }

    /// Whether the publisher has ended.
    pub fn publisher_has_ended(&self) -> bool {
        self.publisher_ended.is_some()
    }

    /// The subscribers.
    pub fn members(&self) -> &[Member] {
        &self.members
    }

    /// The latest status that a steady subscriber has received.
    pub fn status(&self) -> Option<Status> {
        self.members.iter().filter(|member| member.role == Role::Steady).find_map(|member| member.present.status)
    }

    /// Frames that steady subscribers have missed so far.
    pub fn missed(&self) -> u64 {
        self.members.iter().filter(|member| member.role == Role::Steady).map(|member| member.present.missed).sum()
    }

    /// What the publisher has said on standard error since the last call.
    pub fn said(&mut self) -> Vec<String> {
        std::mem::take(&mut self.said)
    }

    /// The names of what [`Fleet::figures`] returns.
    pub fn columns(&self) -> Vec<String> {
        let publisher = PUBLISHER_COLUMNS.iter().map(|name| (*name).to_owned());
        let subscribers = self.members.iter().flat_map(|member| {
            SUBSCRIBER_COLUMNS.iter().map(|name| column_of(&member.label, name)).collect::<Vec<_>>()
        });
        publisher.chain(subscribers).collect()
    }

    /// The figures since the last call, in the order of [`Fleet::columns`]; NaN where nothing is known.
    pub fn figures(&mut self) -> Vec<f64> {
        let status = self.status();
        let held = Resources::of(self.publisher.id());
        self.watch_memory(held);
        let of_status = |value: fn(&Status) -> u64| status.as_ref().map_or(f64::NAN, |status| value(status) as f64);
        let of_process = |value: fn(&Resources) -> u64| held.as_ref().map_or(f64::NAN, |held| value(held) as f64);
        let mut figures = vec![
            of_status(|status| status.lateness_second[0]),
            of_status(|status| status.lateness_second[1]),
            of_status(|status| status.lateness_second[2]),
            of_status(|status| status.step_second[0]),
            of_status(|status| status.step_second[1]),
            of_status(|status| status.step_second[2]),
            of_status(|status| status.overruns),
            of_status(|status| status.skipped),
            of_status(|status| status.shows_played),
            of_process(|held| held.resident_bytes),
            of_process(|held| held.file_descriptors),
            of_process(|held| held.shared_memory_bytes),
        ];
        for member in &mut self.members {
            let fresh = member.fresh.take();
            let of = |value: fn(&Latencies) -> u64| fresh.as_ref().map_or(f64::NAN, |fresh| value(fresh) as f64);
            figures.extend([
                of(|fresh| fresh.since_sent.p50),
                of(|fresh| fresh.since_sent.p99),
                of(|fresh| fresh.since_sent.max),
                of(|fresh| fresh.since_deadline.p99),
                member.seen().missed as f64,
            ]);
        }
        figures
    }

    fn watch_memory(&mut self, held: Option<Resources>) {
        let Some(held) = held.filter(|_| self.began.elapsed() >= SETTLING) else { return };
        self.settled_bytes.get_or_insert(held.resident_bytes);
        self.most_bytes_after = self.most_bytes_after.max(held.resident_bytes);
    }

    /// By how many bytes the publisher's resident memory grew after [`SETTLING`]; `None` if the test was shorter.
    pub fn resident_growth(&self) -> Option<u64> {
        self.settled_bytes.map(|settled| self.most_bytes_after - settled)
    }

    /// The summary of the publisher, once it has ended in good order.
    pub fn summary(&self) -> Option<&RunSummary> {
        self.summary.as_ref()
    }

    /// Ends the publisher, lets subscribers take what is left, and ends them.
    ///
    /// # Errors
    /// [`FleetError::Start`] where a process cannot be asked how it is.
    pub fn finish(&mut self) -> Result<(), FleetError> {
        signal(&self.publisher, Signal::SIGINT);
        let deadline = Instant::now() + PATIENCE_AT_END;
        while self.publisher_ended.is_none() && Instant::now() < deadline {
            self.take_events(Duration::from_millis(20));
            self.publisher_ended = self.publisher.try_wait()?;
        }
        self.take_events(Duration::from_millis(200));
        let alive: Vec<_> = (0..self.members.len()).filter(|index| !self.members[*index].ended_by_itself).collect();
        self.members.iter().for_each(|member| signal(&member.child, Signal::SIGTERM));
        let deadline = Instant::now() + PATIENCE_AT_END;
        while alive.iter().any(|index| !self.members[*index].ended_by_itself) && Instant::now() < deadline {
            self.take_events(Duration::from_millis(20));
        }
        // These ended because they were told to; one that did not is at fault.
        for index in alive {
            self.members[index].ended_by_itself = !self.members[index].ended_by_itself;
        }
        Ok(())
    }
}

impl Drop for Fleet {
    fn drop(&mut self) {
        for child in self.members.iter_mut().map(|member| &mut member.child).chain([&mut self.publisher]) {
            // It may have ended already, which is what is wanted.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// The figures of the publisher in a row of the history.
const PUBLISHER_COLUMNS: [&str; 12] = [
    "lateness_p50_ns",
    "lateness_p99_ns",
    "lateness_max_ns",
    "step_p50_ns",
    "step_p99_ns",
    "step_max_ns",
    "overruns",
    "skipped",
    "shows_played",
    "resident_bytes",
    "file_descriptors",
    "shared_memory_bytes",
];
/// The figures of each subscriber in a row of the history.
const SUBSCRIBER_COLUMNS: [&str; 5] =
    ["latency_p50_ns", "latency_p99_ns", "latency_max_ns", "latency_since_deadline_p99_ns", "missed"];

/// The name of a subscriber's column.
pub fn column_of(label: &str, name: &str) -> String {
    format!("{label}: {name}")
}

/// This program in a process group of its own, so that Ctrl-C on the terminal reaches the soak test alone.
fn command(plan: &Plan) -> Command {
    let mut command = Command::new(&plan.program);
    command.args(&plan.common).stdin(Stdio::null()).stdout(Stdio::piped()).process_group(0);
    command
}

fn listen_to_publisher(publisher: &mut Child, sender: &Sender<Event>) {
    if let Some(stdout) = publisher.stdout.take() {
        let sender = sender.clone();
        std::thread::spawn(move || {
            let lines = BufReader::new(stdout).lines().map_while(Result::ok);
            for summary in lines.filter_map(|line| serde_json::from_str(&line).ok()) {
                let _ = sender.send(Event::Summary(Box::new(summary)));
            }
        });
    }
    if let Some(stderr) = publisher.stderr.take() {
        let sender = sender.clone();
        std::thread::spawn(move || {
            for line in BufReader::new(stderr).lines().map_while(Result::ok) {
                let _ = sender.send(Event::Said(line));
            }
        });
    }
}

fn listen_to_subscriber(stdout: ChildStdout, member: usize, life: u64, sender: &Sender<Event>) {
    // A process that is killed can leave half a line.
    let lines = BufReader::new(stdout).lines().map_while(Result::ok);
    for observation in lines.filter_map(|line| serde_json::from_str(&line).ok()) {
        // Whoever does not listen any more has ended the test.
        let _ = sender.send(Event::Observed { member, life, observation: Box::new(observation) });
    }
    let _ = sender.send(Event::Ended { member, life });
}

fn signal(child: &Child, signal: Signal) {
    // It may have ended already, which its exit status tells.
    let _ = kill(Pid::from_raw(child.id() as i32), signal);
}

/// What two lives of a subscriber saw together.
fn joined(past: &Observation, present: &Observation) -> Observation {
    Observation {
        received: past.received + present.received,
        missed: past.missed + present.missed,
        skipped: past.skipped + present.skipped,
        disordered: past.disordered + present.disordered,
        links_checked: past.links_checked + present.links_checked,
        wrong_links: past.wrong_links + present.wrong_links,
        worst_link_error: past.worst_link_error.max(present.worst_link_error),
        phase_error_ns: past.phase_error_ns.max(present.phase_error_ns),
        runs: past.runs.max(present.runs),
        alerts: past.alerts + present.alerts,
        last_sequence: past.last_sequence.max(present.last_sequence),
        last_tick: past.last_tick.max(present.last_tick),
        second: present.second,
        total: worst(past.total, present.total),
        status: present.status.or(past.status),
    }
}

fn worst(a: Option<Latencies>, b: Option<Latencies>) -> Option<Latencies> {
    let (Some(a), Some(b)) = (a, b) else { return a.or(b) };
    let worse = |a: Percentiles, b: Percentiles| Percentiles {
        p50: a.p50.max(b.p50),
        p99: a.p99.max(b.p99),
        p999: a.p999.max(b.p999),
        max: a.max.max(b.max),
    };
    Some(Latencies {
        since_sent: worse(a.since_sent, b.since_sent),
        since_deadline: worse(a.since_deadline, b.since_deadline),
    })
}
