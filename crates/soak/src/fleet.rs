//! The processes of a soak test: one publisher, and subscribers that keep up, are slow, or die and return.
//!
//! In: a [`Plan`], and the output of the processes. Out: the observations of the subscribers, the counts of the
//! publisher.

use std::process::{Child, ExitStatus};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use nix::sys::signal::Signal;

use super::conducting::Conducting;
use super::member::{Member, ProcessState, Role};
use super::observation::Status;
use super::processes::{Plan, ProcessEvent, signal};
use super::resources::{Resources, child_of};
use bench_dragon_publisher::live::statistics::RunSummary;

/// The time after which a flaky subscriber is killed.
const FLAKY_LIFETIME: Duration = Duration::from_secs(5);
/// The time limit of a subscriber's first frame.
const START_TIMEOUT: Duration = Duration::from_secs(60);
/// The time limit of the publisher's end after a signal, and then of the subscribers'.
const END_TIMEOUT: Duration = Duration::from_secs(30);
/// The exit code of a program for an invalid request.
const REFUSED: i32 = 2;
/// The time after the start from which the publisher's memory should no longer grow.
pub const SETTLING: Duration = Duration::from_secs(60);

/// The reason why the soak test cannot continue.
#[derive(Debug, thiserror::Error)]
pub enum FleetError {
    /// A process could not be started or signalled.
    #[error("a process of the soak test could not be started: {0}")]
    Start(#[from] std::io::Error),
    /// The publisher refuses its options or its scene: its own sentence.
    #[error("{0}")]
    Refused(String),
    /// The publisher ended before all steady subscribers had received a frame.
    #[error("the publisher ended at once ({0}){1}")]
    PublisherEnded(ExitStatus, String),
    /// A subscriber ended by itself before all steady subscribers had received a frame.
    #[error("the subscriber {0} ended at once: its error stands above")]
    SubscriberEnded(String),
    /// The load generator did not begin.
    #[error("the load generator did not begin within {} s", START_TIMEOUT.as_secs())]
    NoLoadGenerator,
    /// Frames did not come.
    #[error("not every subscriber received a frame within {} s", START_TIMEOUT.as_secs())]
    NoFrames,
}

/// All processes of a soak test. Dropping the fleet kills the processes that still run.
pub struct Fleet {
    plan: Plan,
    publisher: Child,
    /// The exit status of the publisher, if it has ended.
    publisher_ended: Option<ExitStatus>,
    /// The time after which the publisher ended without a signal from the soak test.
    publisher_ended_early: Option<Duration>,
    summary: Option<RunSummary>,
    members: Vec<Member>,
    conducting: Option<Conducting>,
    events: Receiver<ProcessEvent>,
    sender: Sender<ProcessEvent>,
    /// Lines of the publisher's standard error since [`Fleet::take_stderr`].
    stderr: Vec<String>,
    publisher_growth: Growth,
    ros2_growth: Growth,
    began: Instant,
}

/// The growth of a process's memory after [`SETTLING`].
#[derive(Debug, Default)]
struct Growth {
    settled_bytes: Option<u64>,
    most_bytes_after: u64,
}

impl Growth {
    fn record(&mut self, resident_bytes: u64, since_start: Duration) {
        if since_start >= SETTLING {
            self.settled_bytes.get_or_insert(resident_bytes);
            self.most_bytes_after = self.most_bytes_after.max(resident_bytes);
        }
    }

    fn bytes(&self) -> Option<u64> {
        self.settled_bytes.map(|settled| self.most_bytes_after - settled)
    }
}

impl Fleet {
    /// Starts the publisher and the subscribers, and waits until every steady subscriber has received a frame, or until
    /// `proceed` returns false.
    ///
    /// # Errors
    /// [`FleetError`] if a process fails or no frame comes.
    pub fn start(plan: Plan, proceed: &dyn Fn() -> bool) -> Result<Self, FleetError> {
        let (sender, events) = channel();
        let mut fleet = Self {
            publisher: plan.spawn_publisher(&sender)?,
            publisher_ended: None,
            publisher_ended_early: None,
            summary: None,
            members: Vec::new(),
            conducting: None,
            events,
            sender,
            stderr: Vec::new(),
            publisher_growth: Growth::default(),
            ros2_growth: Growth::default(),
            began: Instant::now(),
            plan,
        };
        for (index, role) in fleet.plan.roles.clone().into_iter().enumerate() {
            let member = fleet.spawn(index, role)?;
            fleet.members.push(member);
        }
        fleet.wait_for_frames(proceed)?;
        if let Some(conduct) = &fleet.plan.conduct {
            fleet.conducting = Some(Conducting::start(&fleet.plan, conduct, &fleet.sender)?);
            fleet.wait_for_load_generator(proceed)?;
        }
        fleet.began = Instant::now();
        Ok(fleet)
    }

    fn wait_for_frames(&mut self, proceed: &dyn Fn() -> bool) -> Result<(), FleetError> {
        let deadline = Instant::now() + START_TIMEOUT;
        let receives = |member: &Member| member.role != Role::Steady || member.present().received > 0;
        while proceed() && !self.members.iter().all(receives) {
            self.poll(Duration::from_millis(50))?;
            if let Some(status) = self.publisher_ended {
                self.receive(Duration::from_millis(200));
                if let (Some(REFUSED), Some(line)) = (status.code(), self.stderr.last()) {
                    return Err(FleetError::Refused(line.trim_start_matches("error: ").to_owned()));
                }
                let stderr = self.stderr.iter().map(|line| format!(": {line}")).collect();
                return Err(FleetError::PublisherEnded(status, stderr));
            }
            if let Some(member) = self.members.iter().find(|member| member.state == ProcessState::EndedByItself) {
                return Err(FleetError::SubscriberEnded(member.label.clone()));
            }
            if Instant::now() > deadline {
                return Err(FleetError::NoFrames);
            }
        }
        Ok(())
    }

    /// Waits for the first report of the load generator.
    fn wait_for_load_generator(&mut self, proceed: &dyn Fn() -> bool) -> Result<(), FleetError> {
        let deadline = Instant::now() + START_TIMEOUT;
        while proceed() && self.conducting.as_ref().is_some_and(|conducting| conducting.conducted().is_none()) {
            self.poll(Duration::from_millis(50))?;
            if self.publisher_ended.is_some() || Instant::now() > deadline {
                return Err(FleetError::NoLoadGenerator);
            }
        }
        Ok(())
    }

    fn spawn(&self, index: usize, role: Role) -> Result<Member, FleetError> {
        let number = self.plan.roles[..=index].iter().filter(|other| **other == role).count();
        let child = self.plan.spawn_subscriber(index, role, 1, &self.sender)?;
        Ok(Member::new(format!("{} {number}", role.name()), role, child))
    }

    /// Handles the output of the processes for `time`, detects deaths, and kills and replaces flaky subscribers.
    ///
    /// # Errors
    /// [`FleetError::Start`] if a subscriber cannot be started again.
    pub fn poll(&mut self, time: Duration) -> Result<(), FleetError> {
        self.receive(time);
        if self.publisher_ended.is_none() {
            self.publisher_ended = self.publisher.try_wait()?;
            self.publisher_ended_early = self.publisher_ended.map(|_| self.began.elapsed());
        }
        for (index, member) in self.members.iter_mut().enumerate() {
            if member.role == Role::Flaky && member.spawned.elapsed() >= FLAKY_LIFETIME {
                let had_ended = member.child.try_wait()?.is_some();
                member.child.kill()?;
                member.child.wait()?;
                let next = member.starts + 1;
                member.replace(self.plan.spawn_subscriber(index, member.role, next, &self.sender)?, had_ended);
            }
        }
        if let Some(conducting) = &mut self.conducting {
            conducting.poll(&self.plan)?;
        }
        Ok(())
    }

    fn receive(&mut self, time: Duration) {
        let deadline = Instant::now() + time;
        loop {
            match self.events.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
                Ok(event) => self.handle(event),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    fn handle(&mut self, event: ProcessEvent) {
        match event {
            ProcessEvent::Observed { member, start, observation } => {
                self.members[member].observed(start, *observation);
            }
            ProcessEvent::Ended { member, start } => self.members[member].ended(start),
            ProcessEvent::Conducted(conducted) => {
                self.conducting.iter_mut().for_each(|conducting| conducting.counted((*conducted).clone()));
            }
            ProcessEvent::LoadGeneratorEnded => self.conducting.iter_mut().for_each(Conducting::ended),
            ProcessEvent::Summary(summary) => self.summary = Some(*summary),
            ProcessEvent::Stderr(line) => self.stderr.push(line),
        }
    }

    /// Returns true if the publisher has ended.
    pub fn publisher_has_ended(&self) -> bool {
        self.publisher_ended.is_some()
    }

    /// Returns the processes that send commands, if any.
    pub fn conducting(&self) -> Option<&Conducting> {
        self.conducting.as_ref()
    }

    /// Returns the subscribers.
    pub fn members(&self) -> &[Member] {
        &self.members
    }

    pub(super) fn members_mut(&mut self) -> &mut [Member] {
        &mut self.members
    }

    fn steady(&self) -> impl Iterator<Item = &Member> {
        self.members.iter().filter(|member| member.role == Role::Steady)
    }

    /// Returns the latest status that a steady subscriber has received.
    pub fn status(&self) -> Option<Status> {
        self.steady().find_map(|member| member.present().status)
    }

    /// Returns the number of frames that steady subscribers have missed so far.
    pub fn missed(&self) -> u64 {
        self.steady().map(|member| member.present().missed).sum()
    }

    /// Returns the lines that the publisher has printed on standard error since the last call.
    pub fn take_stderr(&mut self) -> Vec<String> {
        std::mem::take(&mut self.stderr)
    }

    /// Returns the present resources of the publisher's process, from which the growth of its memory follows.
    pub(super) fn measure_publisher(&mut self) -> Option<Resources> {
        let held = Resources::of(self.publisher.id())?;
        self.publisher_growth.record(held.resident_bytes, self.began.elapsed());
        Some(held)
    }

    /// Returns the present resources of the publisher's child process, which publishes on ROS 2, from which the growth
    /// of its memory follows. Returns `None` without ROS 2, and while the process is restarted.
    pub(super) fn measure_ros2(&mut self) -> Option<Resources> {
        let child = self.plan.ros2.then(|| child_of(self.publisher.id())).flatten()?;
        let held = Resources::of(child)?;
        self.ros2_growth.record(held.resident_bytes, self.began.elapsed());
        Some(held)
    }

    /// Returns true if the publisher has a process that publishes on ROS 2.
    pub fn has_ros2(&self) -> bool {
        self.plan.ros2
    }

    /// Returns the growth of the publisher's resident memory after [`SETTLING`], in bytes; `None` if the test was
    /// shorter.
    pub fn resident_growth(&self) -> Option<u64> {
        self.publisher_growth.bytes()
    }

    /// Returns the same growth for the process of ROS 2; `None` also without this process.
    pub fn ros2_growth(&self) -> Option<u64> {
        self.ros2_growth.bytes()
    }

    /// Returns true if the publisher ended without a signal, with an error, or not at all. Call it after the fleet has
    /// finished.
    pub fn publisher_failed(&self) -> bool {
        self.publisher_ended_early.is_some()
            || self.summary.is_none()
            || self.publisher_ended.is_none_or(|status| !status.success())
    }

    /// Returns the exit status of the publisher, if it has ended, and the time after which it ended without a signal
    /// from the soak test.
    pub(super) fn publisher_end(&self) -> (Option<ExitStatus>, Option<Duration>) {
        (self.publisher_ended, self.publisher_ended_early)
    }

    /// Returns the moment at which all steady subscribers had received a frame.
    pub(super) fn began(&self) -> Instant {
        self.began
    }

    /// Returns the summary of the publisher, after it has ended without an error.
    pub fn summary(&self) -> Option<&RunSummary> {
        self.summary.as_ref()
    }

    /// Ends the load generator, then the publisher, lets subscribers receive the remaining frames, and ends them.
    ///
    /// # Errors
    /// [`FleetError::Start`] if the state of a process is not known.
    pub fn finish(&mut self) -> Result<(), FleetError> {
        self.conducting.iter_mut().for_each(Conducting::end);
        let deadline = Instant::now() + END_TIMEOUT;
        while self.conducting.as_mut().is_some_and(Conducting::is_ending) && Instant::now() < deadline {
            self.receive(Duration::from_millis(20));
        }
        self.publisher_ended = self.publisher.try_wait()?;
        let early = self.publisher_ended.map(|_| self.began.elapsed());
        self.publisher_ended_early = self.publisher_ended_early.or(early);
        signal(&self.publisher, Signal::SIGINT);
        let deadline = Instant::now() + END_TIMEOUT;
        while self.publisher_ended.is_none() && Instant::now() < deadline {
            self.receive(Duration::from_millis(20));
            self.publisher_ended = self.publisher.try_wait()?;
        }
        self.receive(Duration::from_millis(200));
        for member in self.members.iter_mut().filter(|member| member.state == ProcessState::Running) {
            member.state = ProcessState::Ending;
            signal(&member.child, Signal::SIGTERM);
        }
        let deadline = Instant::now() + END_TIMEOUT;
        let ending = |members: &[Member]| members.iter().any(|member| member.state == ProcessState::Ending);
        while ending(&self.members) && Instant::now() < deadline {
            self.receive(Duration::from_millis(20));
        }
        for member in self.members.iter_mut().filter(|member| member.state == ProcessState::EndedByItself) {
            member.exit = member.child.try_wait()?;
        }
        Ok(())
    }
}

impl Drop for Fleet {
    fn drop(&mut self) {
        let conducting = self.conducting.iter_mut().flat_map(Conducting::children);
        let members = self.members.iter_mut().map(|member| &mut member.child);
        for child in members.chain(conducting).chain([&mut self.publisher]) {
            // The process may have ended already.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
