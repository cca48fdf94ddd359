//! Commands over ROS 2: the services below `/<name>`, on their own thread, as a client of the show's own service.
//!
//! The requests use ros2-client's subscriptions, so that the node shows its services; the responses use RustDDS's
//! writers. ros2-client's `Server` does not fit: it hides the bytes of a request, which determine the mapping
//! ([`mapping`]), and answers at once. A client whose reply reader is not matched yet would never get that answer, so
//! an answer waits here ([`Matches`]). A dead client, or one that floods the services, costs the loop nothing: this
//! process takes the requests, and passes a bounded number of commands to the show at once.

mod calls;
mod endpoints;
mod mapping;
mod services;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ros2_client::Context;
use rustdds::{GUID, SampleIdentity, SequenceNumber};

use super::Ros2Error;
use super::matching::Matches;
use crate::commands::{Answer, ShowCommands};
use bench_dragon_client::control::command_client::MOST_WAITING;
use bench_dragon_messages::control::{Code, Command};
use calls::{Next, ServiceAdapter, refusal, sentence};
use endpoints::{Client, Endpoints};
pub use mapping::Mapping;
use mapping::Request;
use services::{Call, Response};

/// The most calls of one process without an answer, so that a flood of one process leaves room for the others.
const MOST_CALLS: usize = 16;
/// The most calls without an answer in all; further calls wait in their readers.
const MOST_PENDING: usize = 512;
/// The longest wait of an answer for its client's reply reader. RMW implementations stop after 0.1 s; a loaded machine
/// takes longer. Other answers do not wait.
const MATCHING_PATIENCE: Duration = Duration::from_secs(2);
/// The intervals at which requests are polled, and answers while some are pending.
const POLL_INTERVAL: Duration = Duration::from_millis(2);
const ANSWER_INTERVAL: Duration = Duration::from_micros(500);
/// The time for clients to get the last answers.
const LINGER: Duration = Duration::from_millis(20);

/// The thread. Dropping this value ends the thread.
pub(super) struct ControlThread {
    stop: Arc<AtomicBool>,
    handle: Option<JoinHandle<()>>,
}

impl ControlThread {
    /// Offers the services below `/<name>` and serves them.
    ///
    /// # Errors
    /// [`Ros2Error`]
    pub(super) fn start(
        name: &str,
        context: Context,
        matches: Matches,
        mapping: Mapping,
        commands: ShowCommands,
    ) -> Result<Self, Ros2Error> {
        let stop = Arc::new(AtomicBool::new(false));
        let (opened, opening) = mpsc::channel();
        let thread = {
            let (name, stop) = (name.to_owned(), Arc::clone(&stop));
            move || match Endpoints::open(&name, &context) {
                Ok(endpoints) => {
                    let _ = opened.send(Ok(()));
                    Server::new(endpoints, matches, mapping, commands).serve(&stop);
                }
                Err(error) => drop(opened.send(Err(error))),
            }
        };
        let spawned = std::thread::Builder::new().name("ros2 control".to_owned()).spawn(thread);
        let handle = Some(spawned.map_err(|error| Ros2Error::Failed(error.to_string()))?);
        let thread = Self { stop, handle };
        opening.recv().unwrap_or_else(|_| Err(Ros2Error::Failed("the control thread ended early".to_owned())))?;
        Ok(thread)
    }
}

impl Drop for ControlThread {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(handle) = self.handle.take() {
            // The thread has printed its panic.
            let _ = handle.join();
        }
    }
}

/// A call without an answer.
struct Pending {
    /// The index of its service.
    port: usize,
    call: Call,
    client: Client,
    progress: Progress,
}

/// The progress of a call.
enum Progress {
    /// Waits for room in the loop's queue.
    Waiting(Command),
    /// Sent to the loop.
    Sent(u64, Command),
    /// Answered; waits for its client's reply reader.
    Answered(Response, Instant),
}

struct Server {
    endpoints: Endpoints,
    matches: Matches,
    mapping: Mapping,
    commands: ShowCommands,
    adapter: ServiceAdapter,
    pending: Vec<Pending>,
}

impl Server {
    fn new(endpoints: Endpoints, matches: Matches, mapping: Mapping, commands: ShowCommands) -> Self {
        Self {
            endpoints,
            matches,
            mapping,
            commands,
            adapter: ServiceAdapter::default(),
            pending: Vec::with_capacity(MOST_PENDING),
        }
    }

    fn serve(mut self, stop: &AtomicBool) {
        while !stop.load(Ordering::Acquire) {
            for port in 0..self.endpoints.ports.len() {
                self.take_requests(port);
            }
            self.pass_on();
            self.take_answers();
            self.send_answers();
            std::thread::sleep(if self.pending.is_empty() { POLL_INTERVAL } else { ANSWER_INTERVAL });
        }
        std::thread::sleep(LINGER);
    }

    fn take_requests(&mut self, port: usize) {
        // Bounded, so that a flood of requests does not delay answers.
        for _ in 0..MOST_WAITING {
            if self.pending.len() >= MOST_PENDING {
                return;
            }
            let end = &mut self.endpoints.ports[port];
            let Ok(Some((raw, info))) = end.requests.take() else { return };
            let Request { header, body } = match self.mapping.split(raw.bytes(), end.service.lengths) {
                Ok(request) => request,
                Err(misfit) => {
                    end.report_misfit(self.mapping, misfit);
                    continue;
                }
            };
            let writer = GUID::from(info.publisher_gid());
            let named = info.related_request_id().map(|id| GUID::from(id.writer_gid));
            let reader = named.filter(|guid| *guid != GUID::GUID_UNKNOWN && *guid != writer);
            let identity = SampleIdentity {
                writer_guid: reader.unwrap_or(writer),
                sequence_number: SequenceNumber::from(info.sequence_number()),
            };
            let call = (end.service.read)(body);
            let client = Client { writer, header: header.to_vec(), identity, reader };
            let of_process =
                self.pending.iter().filter(|pending| pending.client.writer.prefix == writer.prefix).count();
            let progress = if of_process < MOST_CALLS {
                match self.adapter.begin(call) {
                    Next::Execute(command) => Progress::Waiting(command),
                    Next::Answer(response) => Progress::Answered(response, Instant::now()),
                }
            } else {
                end.report_crowd(MOST_CALLS);
                let sentence = format!("refused: {MOST_CALLS} calls of this process have no answer yet");
                let Some(response) = refusal(call, &sentence) else { continue };
                Progress::Answered(response, Instant::now())
            };
            self.pending.push(Pending { port, call, client, progress });
        }
    }

    /// Passes commands to the loop, in the order of reception, as far as its queue has room.
    fn pass_on(&mut self) {
        for pending in &mut self.pending {
            if let Progress::Waiting(command) = pending.progress {
                let Ok(ticket) = self.commands.send(command) else { return };
                pending.progress = Progress::Sent(ticket, command);
            }
        }
    }

    fn take_answers(&mut self) {
        while let Some(Answer { ticket, result }) = self.commands.answer() {
            let of_ticket = |pending: &Pending| matches!(pending.progress, Progress::Sent(sent, _) if sent == ticket);
            let Some(index) = self.pending.iter().position(of_ticket) else { continue };
            let pending = &mut self.pending[index];
            let Progress::Sent(_, command) = pending.progress else { continue };
            let outcome = match result {
                Ok(outcome) => outcome,
                Err(error) => {
                    let sentence = error.to_string();
                    self.endpoints.ports[pending.port].report_refusal(&sentence);
                    match refusal(pending.call, &sentence) {
                        Some(response) => pending.progress = Progress::Answered(response, Instant::now()),
                        None => drop(self.pending.remove(index)),
                    }
                    continue;
                }
            };
            if !matches!(outcome.code, Code::Done | Code::Already) {
                self.endpoints.ports[pending.port].report_refusal(&sentence(command, &outcome));
            }
            pending.progress = match self.adapter.proceed(pending.call, command, &outcome) {
                Next::Execute(command) => Progress::Waiting(command),
                Next::Answer(response) => Progress::Answered(response, Instant::now()),
            };
        }
    }

    /// Sends the answers whose clients are matched, or after [`MATCHING_PATIENCE`].
    fn send_answers(&mut self) {
        let (ports, matches) = (&mut self.endpoints.ports, &self.matches);
        self.pending.retain(|Pending { port, client, progress, .. }| {
            let Progress::Answered(response, since) = progress else { return true };
            let endpoint = &mut ports[*port];
            let reached =
                matches.reaches(endpoint.responses_guid, endpoint.requests_guid, client.writer, client.reader);
            if !reached && since.elapsed() < MATCHING_PATIENCE {
                return true;
            }
            endpoint.answer(client, response);
            false
        });
    }
}
