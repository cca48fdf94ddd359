//! Services over ROS 2, on their own thread: the node's parameter services and, on request, those below `/<name>`. The
//! latter conduct the show, as a client of the show's own service.
//!
//! Clients of both RMW implementations are answered, each in its own mapping ([`mapping`]). The requests use
//! ros2-client's subscriptions, so that the node shows its services. The responses use RustDDS's writers. The `Server`
//! of ros2-client does not fit: it speaks one mapping, hides the bytes of a request, and answers at once. A client
//! whose reply reader is not matched yet would never get that answer, so an answer waits here ([`Matches`]). A dead
//! client, or one that floods the services, costs the loop nothing. This process takes the requests, and passes a
//! bounded number of commands to the show at once.

mod calls;
mod endpoints;
mod mapping;
mod parameters;
mod services;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rustdds::{GUID, SampleIdentity, SequenceNumber};

use super::Ros2Error;
use super::matching::Matches;
use super::readers::Owed;
use crate::commands::{Answer, ShowCommands};
use bench_dragon_client::control::command_client::MOST_WAITING;
use bench_dragon_messages::control::{Code, Command};
use calls::{Next, ServiceAdapter, refusal, sentence};
pub(super) use endpoints::Endpoints;
use endpoints::{Client, KEPT_ANSWERS};
use mapping::split;
use services::{Call, Response};

/// The most calls of one process without an answer, so that a flood of one process leaves room for the others.
const MOST_CALLS: usize = 16;
/// The most calls without an answer in all; further calls wait in their readers.
const MOST_PENDING: usize = 512;
/// The longest wait of an answer for its client's reply reader: while the client is there, and otherwise. RMW
/// implementations stop after 0.1 s. On a loaded machine discovery takes longer, and a lost datagram of discovery is
/// repeated after seconds. An answer that is sent before is lost. Other answers do not wait. The same limits hold for
/// an answer that RustDDS refuses.
const MATCHING_PATIENCE: Duration = Duration::from_secs(30);
const PATIENCE_AFTER_LEAVING: Duration = Duration::from_secs(2);
/// The intervals at which requests are polled, and answers while some are pending.
const POLL_INTERVAL: Duration = Duration::from_millis(2);
const ANSWER_INTERVAL: Duration = Duration::from_micros(500);
/// The longest interval at which an answer that RustDDS refuses is tried again: the interval doubles.
const RETRY_INTERVAL: Duration = Duration::from_millis(32);
/// The interval without services that conduct the show.
const PARAMETERS_INTERVAL: Duration = Duration::from_millis(50);
/// The time for clients to get the last answers.
const LINGER: Duration = Duration::from_millis(20);

/// Returns for each service its name, and whether the bytes are a request of `rmw_fastrtps_cpp` and of
/// `rmw_cyclonedds_cpp`. The bytes are never a request of both for a service that conducts the show. For tests.
pub fn mappings_of(bytes: &[u8]) -> impl Iterator<Item = (&'static str, [bool; 2])> {
    services::SERVICES.iter().chain(&services::PARAMETER_SERVICES).map(|service| {
        let headed = bytes.split_at_checked(mapping::CYCLONE_HEADER).and_then(|(_, body)| (service.read)(body));
        (service.name, [(service.read)(bytes).is_some(), headed.is_some()])
    })
}

/// The thread. Dropping this value ends the thread.
pub(super) struct ControlThread {
    stop: Arc<AtomicBool>,
    handle: Option<JoinHandle<()>>,
}

impl ControlThread {
    /// Serves the services. Without `commands`, none of them may conduct the show.
    ///
    /// # Errors
    /// [`Ros2Error`]
    pub(super) fn start(
        endpoints: Endpoints,
        matches: Matches,
        commands: Option<ShowCommands>,
    ) -> Result<Self, Ros2Error> {
        let stop = Arc::new(AtomicBool::new(false));
        let thread = {
            let stop = Arc::clone(&stop);
            move || Server::new(endpoints, matches, commands).serve(&stop)
        };
        let spawned = std::thread::Builder::new().name("ros2 control".to_owned()).spawn(thread);
        let handle = Some(spawned.map_err(|error| Ros2Error::Failed(error.to_string()))?);
        Ok(Self { stop, handle })
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
    /// The time of the next attempt with a refused answer, and the interval before that attempt.
    retry: Option<(Instant, Duration)>,
}

/// The progress of a call.
enum Progress {
    /// Waits for room in the queue of the command client.
    Waiting(Command),
    /// Sent to the show.
    Sent(u64, Command),
    /// Answered; waits for its client's reply reader.
    Answered(Response, Instant),
}

struct Server {
    endpoints: Endpoints,
    matches: Matches,
    commands: Option<ShowCommands>,
    adapter: ServiceAdapter,
    pending: Vec<Pending>,
}

impl Server {
    fn new(endpoints: Endpoints, matches: Matches, commands: Option<ShowCommands>) -> Self {
        Self {
            endpoints,
            matches,
            commands,
            adapter: ServiceAdapter::default(),
            pending: Vec::with_capacity(MOST_PENDING),
        }
    }

    fn serve(mut self, stop: &AtomicBool) {
        let idle = if self.commands.is_some() { POLL_INTERVAL } else { PARAMETERS_INTERVAL };
        while !stop.load(Ordering::Acquire) {
            for port in 0..self.endpoints.ports.len() {
                self.take_requests(port);
            }
            self.pass_on();
            self.take_answers();
            self.send_answers();
            std::thread::sleep(if self.pending.is_empty() { idle } else { ANSWER_INTERVAL });
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
            let Some((header, call)) = split(&raw.0, end.service.read) else {
                end.report_misfit(raw.0.len());
                continue;
            };
            let writer = GUID::from(info.publisher_gid());
            let named = info.related_request_id().map(|id| GUID::from(id.writer_gid));
            let reader = named.filter(|guid| *guid != GUID::GUID_UNKNOWN && *guid != writer);
            let identity = SampleIdentity {
                writer_guid: reader.unwrap_or(writer),
                sequence_number: SequenceNumber::from(info.sequence_number()),
            };
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
            self.pending.push(Pending { port, call, client, progress, retry: None });
        }
    }

    /// Passes commands to the show, in the order of reception, until too many commands have no answer.
    fn pass_on(&mut self) {
        let Some(commands) = &mut self.commands else { return };
        for pending in &mut self.pending {
            if let Progress::Waiting(command) = pending.progress {
                let Ok(ticket) = commands.send(command) else { return };
                pending.progress = Progress::Sent(ticket, command);
            }
        }
    }

    fn take_answers(&mut self) {
        while let Some(Answer { ticket, result }) = self.commands.as_mut().and_then(ShowCommands::answer) {
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

    /// Sends the answers whose clients are matched, or whose patience is over.
    fn send_answers(&mut self) {
        let (ports, matches) = (&mut self.endpoints.ports, &self.matches);
        self.pending.retain_mut(|Pending { port, client, progress, retry, .. }| {
            let Progress::Answered(response, since) = progress else { return true };
            if retry.is_some_and(|(at, _)| Instant::now() < at) {
                return true;
            }
            let endpoint = &mut ports[*port];
            let reached =
                matches.reaches(endpoint.responses_guid, endpoint.requests_guid, client.writer, client.reader);
            let patience = match matches.is_present(endpoint.requests_guid, client.writer) {
                true => MATCHING_PATIENCE,
                false => PATIENCE_AFTER_LEAVING,
            };
            if !reached && since.elapsed() < patience {
                return true;
            }
            // A client of the other mapping would read this answer as random numbers. Without a match, all get the
            // answer.
            let readers = match client.reader.filter(|_| reached) {
                Some(reader) => vec![reader],
                None => matches.readers_in_process(endpoint.responses_guid, client.writer),
            };
            // Cyclone drops an answer that is named in the first heartbeat.
            if !client.header.is_empty() {
                readers.iter().for_each(|reader| matches.announce(endpoint.responses_guid, *reader, endpoint.answers));
            }
            let is_sent = endpoint.answer(client, &readers, response);
            if !is_sent {
                let readers = matches.subscribers(endpoint.responses_guid).into_keys();
                matches.settle(endpoint.responses_guid, Owed::all_but(KEPT_ANSWERS, endpoint.answers.into(), readers));
            }
            let is_late = since.elapsed() >= patience;
            if !is_sent && is_late {
                endpoint.report_discarded();
            }
            let delay = retry.map_or(ANSWER_INTERVAL, |(_, delay)| RETRY_INTERVAL.min(2 * delay));
            *retry = Some((Instant::now() + delay, delay));
            !is_sent && !is_late
        });
    }
}
