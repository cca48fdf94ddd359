//! Commands over shared memory: the request-response service `<name>/control`, on its own thread.
//!
//! A client that is dead, or that floods the service, does not delay the loop: this thread reads the requests, and the
//! loop executes one command in each period from a queue of bounded length.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::Duration;

use ::iceoryx2::active_request::ActiveRequest;
use ::iceoryx2::port::server::Server;
use ::iceoryx2::prelude::*;
use ::iceoryx2::service::builder::request_response::{
    RequestResponseCreateError as Create, RequestResponseOpenError as Open,
    RequestResponseOpenOrCreateError as OpenOrCreate,
};
use ::iceoryx2::service::port_factory::server::ServerCreateError;

use super::claim::NameClaim;
use super::{SPARE_NODES, node, retry_while_incomplete, service_name};
use crate::live::control::{Answer, CommandSender, MOST_WAITING};
use bench_dragon_client::shared_memory::{OpenError, failed, incomplete};
use bench_dragon_messages::control::{Code, Command, PLAYING_RATE};
use bench_dragon_messages::state::PlaybackState;
use bench_dragon_messages::{ControlRequest, ControlResponse};
use bench_dragon_show::convert::control_response;

/// Clients that the service admits at once.
const MOST_CLIENTS: usize = 16;
/// The most requests of one client without an answer, so that a flood of one client leaves room for the others.
const MOST_REQUESTS: usize = 8;
/// The intervals at which requests are polled, and answers while some are pending. iceoryx2 has no wake-up for either.
const POLL_INTERVAL: Duration = Duration::from_millis(2);
const ANSWER_INTERVAL: Duration = Duration::from_micros(500);

type Request = ActiveRequest<ipc::Service, ControlRequest, (), ControlResponse, ()>;

/// A request that waits for the loop.
struct Pending {
    ticket: u64,
    request: Request,
    /// The code of the response in place of the loop's, for a request that is no command.
    instead: Option<Code>,
    /// True if the response has the rate of the show when it plays.
    playing_rate: bool,
}

/// The thread. Dropping this value ends the thread.
pub(super) struct ControlThread {
    stop: Arc<AtomicBool>,
    handle: Option<JoinHandle<()>>,
}

impl ControlThread {
    /// Opens `<name>/control` and serves it.
    ///
    /// # Errors
    /// [`OpenError`]
    pub(super) fn start(name: &str, commands: CommandSender) -> Result<Self, OpenError> {
        let stop = Arc::new(AtomicBool::new(false));
        let (opened, opening) = mpsc::channel();
        let thread = {
            let (name, stop) = (name.to_owned(), Arc::clone(&stop));
            let claim_and_open = |name: &str| {
                // Before any file is made: the files of the show that holds the name may be gone.
                let claim = NameClaim::new(name)?;
                Ok((claim, retry_while_incomplete(|| open(name))?))
            };
            move || match claim_and_open(&name) {
                // The node is dropped after the server, which belongs to it, and the claim last.
                Ok((_claim, (_node, server))) => {
                    let _ = opened.send(Ok(()));
                    serve(&server, commands, &stop);
                }
                Err(error) => drop(opened.send(Err(error))),
            }
        };
        let refused = |reason: String| OpenError::Failed { service: format!("{name}/control"), reason };
        let spawned = std::thread::Builder::new().name("control".to_owned()).spawn(thread);
        let handle = Some(spawned.map_err(|error| refused(error.to_string()))?);
        let thread = Self { stop, handle };
        opening.recv().unwrap_or_else(|_| Err(refused("its thread ended early".to_owned())))?;
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

type Opened = (Node<ipc::Service>, Server<ipc::Service, ControlRequest, (), ControlResponse, ()>);

fn open(name: &str) -> Result<Opened, OpenError> {
    let node = node()?;
    let service = node
        .service_builder(&service_name(name, "control")?)
        .request_response::<ControlRequest, ControlResponse>()
        // This limit refuses the name to a second show.
        .max_servers(1)
        .max_clients(MOST_CLIENTS)
        .max_nodes(MOST_CLIENTS + SPARE_NODES)
        .max_active_requests_per_client(MOST_REQUESTS)
        .open_or_create()
        .map_err(|error| match error {
            // A show was killed while it created the service.
            OpenOrCreate::RequestResponseOpenError(Open::HangsInCreation)
            | OpenOrCreate::RequestResponseCreateError(Create::HangsInCreation) => incomplete(name, "control"),
            other => failed(name, "control", other),
        })?;
    let server = service
        .server_builder()
        // A dead client must not stop the others.
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .create()
        .map_err(|error| match error {
            ServerCreateError::ExceedsMaxSupportedServers => OpenError::AlreadyPublished(name.to_owned()),
            other => failed(name, "control", other),
        })?;
    Ok((node, server))
}

fn serve(
    server: &Server<ipc::Service, ControlRequest, (), ControlResponse, ()>,
    mut commands: CommandSender,
    stop: &AtomicBool,
) {
    let mut pending: Vec<Pending> = Vec::with_capacity(MOST_WAITING);
    while !stop.load(Ordering::Acquire) {
        // Bounded, so that a flood of requests does not delay answers.
        for _ in 0..MOST_WAITING {
            let Ok(Some(request)) = server.receive() else { break };
            let of_client = pending.iter().filter(|waiting| waiting.request.origin() == request.origin()).count();
            if of_client < MOST_REQUESTS {
                pending.extend(pass_on(&mut commands, request));
            } else {
                refuse(&request, Code::TooMany);
            }
        }
        while let Some(Answer { ticket, outcome }) = commands.answer() {
            let Some(index) = pending.iter().position(|waiting| waiting.ticket == ticket) else { continue };
            let Pending { request, instead, playing_rate, .. } = pending.swap_remove(index);
            let code = match instead {
                // A held show refuses every command but three, whatever its value.
                Some(Code::OutOfRange) if outcome.playback == PlaybackState::Held => Code::Refused,
                instead => instead.unwrap_or(outcome.code),
            };
            let time_scale = if playing_rate { outcome.playing_rate } else { outcome.time_scale };
            let outcome = bench_dragon_show::Outcome { code, time_scale, ..outcome };
            // The client may have ended.
            let _ = request.send_copy(control_response(request.payload().id, &outcome));
        }
        std::thread::sleep(if commands.waiting() == 0 { POLL_INTERVAL } else { ANSWER_INTERVAL });
    }
}

/// Passes a request to the loop. For a request that is no command, the loop returns the state of the show.
fn pass_on(commands: &mut CommandSender, request: Request) -> Option<Pending> {
    let ControlRequest { id: _, value, command, reserved: _ } = *request.payload();
    let (command, instead) = match Command::of_number(command, value) {
        Ok(command) => (command, None),
        Err(code) => (Command::State, Some(code)),
    };
    let playing_rate = command == Command::State && value == PLAYING_RATE && instead.is_none();
    match commands.send(command) {
        Ok(ticket) => Some(Pending { ticket, request, instead, playing_rate }),
        Err(code) => {
            refuse(&request, code);
            None
        }
    }
}

/// Answers a request that is not passed to the loop.
fn refuse(request: &Request, code: Code) {
    let id = request.payload().id;
    let _ = request.send_copy(ControlResponse { id, code: code as u32, ..Default::default() });
}
