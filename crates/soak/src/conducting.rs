//! The processes that send commands in a soak test: the load generator, and clients that are killed.

use std::process::Child;
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

use nix::sys::signal::Signal;

use super::conduct::Conducted;
use super::member::ProcessState;
use super::processes::{ConductPlan, Plan, ProcessEvent, signal};

/// The time after which a client is killed.
const CLIENT_LIFETIME: Duration = Duration::from_secs(5);

/// The load generator and the clients, with their counts.
pub struct Conducting {
    load_generator: Child,
    state: ProcessState,
    conducted: Option<Conducted>,
    clients: Vec<(Child, Instant)>,
    clients_killed: u64,
    clients_lost: u64,
}

impl Conducting {
    /// Starts the load generator and the clients.
    pub(super) fn start(plan: &Plan, conduct: &ConductPlan, sender: &Sender<ProcessEvent>) -> std::io::Result<Self> {
        let mut conducting = Self {
            load_generator: plan.spawn_load_generator(conduct, sender)?,
            state: ProcessState::Running,
            conducted: None,
            clients: Vec::new(),
            clients_killed: 0,
            clients_lost: 0,
        };
        for _ in 0..conduct.flaky_clients {
            conducting.clients.push((plan.spawn_client()?, Instant::now()));
        }
        Ok(conducting)
    }

    /// Kills and replaces the clients whose time is over.
    pub(super) fn poll(&mut self, plan: &Plan) -> std::io::Result<()> {
        for (client, spawned) in &mut self.clients {
            if spawned.elapsed() < CLIENT_LIFETIME {
                continue;
            }
            let had_ended = client.try_wait()?.is_some();
            client.kill()?;
            client.wait()?;
            self.clients_lost += u64::from(had_ended);
            self.clients_killed += u64::from(!had_ended);
            (*client, *spawned) = (plan.spawn_client()?, Instant::now());
        }
        Ok(())
    }

    /// Stores the counts of the load generator.
    pub(super) fn counted(&mut self, conducted: Conducted) {
        self.conducted = Some(conducted);
    }

    /// Records the end of the load generator.
    pub(super) fn ended(&mut self) {
        self.state = match self.state {
            ProcessState::Ending => ProcessState::Ended,
            _ => ProcessState::EndedByItself,
        };
    }

    /// Sends SIGTERM to all of them.
    pub(super) fn end(&mut self) {
        if self.state == ProcessState::Running {
            self.state = ProcessState::Ending;
            signal(&self.load_generator, Signal::SIGTERM);
        }
        for (client, _) in &mut self.clients {
            self.clients_lost += u64::from(matches!(client.try_wait(), Ok(Some(_))));
            signal(client, Signal::SIGTERM);
        }
    }

    /// Returns true if any of them has not ended after SIGTERM.
    pub(super) fn is_ending(&mut self) -> bool {
        self.clients.retain_mut(|(client, _)| matches!(client.try_wait(), Ok(None)));
        self.state == ProcessState::Ending || !self.clients.is_empty()
    }

    /// Returns all processes that may still run.
    pub(super) fn children(&mut self) -> impl Iterator<Item = &mut Child> {
        self.clients.iter_mut().map(|(client, _)| client).chain([&mut self.load_generator])
    }

    /// Returns the counts of the load generator; `None` if it never reported.
    pub fn conducted(&self) -> Option<&Conducted> {
        self.conducted.as_ref()
    }

    /// Returns the number of clients that were killed during a request.
    pub fn clients_killed(&self) -> u64 {
        self.clients_killed
    }

    /// Returns the number of processes that ended by themselves, or did not end. Call it after the fleet has finished.
    pub fn failed(&self) -> u64 {
        self.clients_lost + self.clients.len() as u64 + u64::from(self.state != ProcessState::Ended)
    }
}
