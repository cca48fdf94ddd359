//! `control osc`: OSC messages conduct a running show, through any number of publishers of its name.

use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use bench_dragon::client::control::command_client::{Action, ActionResult, CommandClient};
use bench_dragon::client::control::{refusal, standing};
use bench_dragon::outputs::osc_control::{ADDRESSES, MOST_BYTES, received};
use serde::Serialize;

use super::super::{CommandError, Common, Output, stop_on_signals};
use super::ResponseLine;

/// The longest wait for a datagram: the delay of an end.
const SOCKET_TIMEOUT: Duration = Duration::from_millis(100);

/// Arguments of `control osc`.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct OscArguments {
    /// The address to listen at: programs of this machine alone, unless it is another
    #[arg(long, value_name = "ADDR:PORT", default_value_t = SocketAddr::from((Ipv4Addr::LOCALHOST, 9000)))]
    listen: SocketAddr,
    /// The hosts that may send; without it, all that reach the address
    #[arg(long, value_name = "IP", num_args = 1..)]
    from: Vec<IpAddr>,
}

/// The line of a message with `--json`.
#[derive(Serialize)]
struct MessageLine {
    from: SocketAddr,
    address: String,
    #[serde(flatten)]
    response: Option<ResponseLine>,
    /// The reason why nothing was done.
    refusal: Option<String>,
}

/// The line of `control osc --json` once it listens.
#[derive(Serialize)]
struct ReadyLine {
    r#type: &'static str,
    listen: SocketAddr,
}

/// A message with its sender.
struct Message {
    from: SocketAddr,
    address: String,
}

/// Prints a line for each message, until the reader of the output is gone.
#[derive(Clone)]
struct Printer {
    json: bool,
    quiet: bool,
    stop: Arc<AtomicBool>,
}

impl Printer {
    fn print(&self, line: Result<&MessageLine, &str>) {
        let printed = || {
            let mut output = Output::standard();
            match line {
                Ok(line) if self.json => output.json(line)?,
                Err(text) if !self.json && !self.quiet => output.line(text)?,
                _ => (),
            }
            output.finish()
        };
        self.stop.fetch_or(printed().is_err(), Ordering::Relaxed);
    }

    fn refused(&self, Message { from, address }: Message, why: String) {
        self.print(Err(&format!("{address} from {from}: {why}")));
        self.print(Ok(&MessageLine { from, address, response: None, refusal: Some(why) }));
    }

    fn answered(&self, message: Message, result: ActionResult) {
        let (command, response) = match result {
            Ok(done) => done,
            Err(error) => return self.refused(message, error.to_string()),
        };
        let Message { from, address } = message;
        let refusal = refusal(&response, command);
        let text = refusal.clone().unwrap_or_else(|| standing(&response));
        self.print(Err(&format!("{address} from {from}: {text}")));
        self.print(Ok(&MessageLine { from, address, response: Some((&response).into()), refusal }));
    }
}

/// Conducts until a signal comes.
pub(super) fn osc(common: &Common, arguments: &OscArguments) -> Result<(), CommandError> {
    let stop = stop_on_signals()?;
    let OscArguments { listen, from: allowed } = arguments;
    let failed = |error: std::io::Error| {
        let sentence = format!("cannot listen at {listen}: {error}");
        match error.kind() {
            ErrorKind::AddrNotAvailable => CommandError::BadInput(sentence),
            _ => CommandError::Failed(sentence),
        }
    };
    let socket = UdpSocket::bind(listen).map_err(failed)?;
    socket.set_read_timeout(Some(SOCKET_TIMEOUT)).map_err(failed)?;
    let address = socket.local_addr().map_err(failed)?;
    let printer = Printer { json: common.json, quiet: common.quiet, stop: Arc::clone(&stop) };
    let answers = printer.clone();
    let client = CommandClient::start(common.name(), move |message, result| answers.answered(message, result))?;
    announce(common, address, allowed)?;
    let mut bytes = [0; MOST_BYTES + 1];
    let (mut strangers, mut malformed) = (0u64, 0u64);
    while !stop.load(Ordering::Relaxed) {
        // A timeout, or an error that the sender's machine has caused.
        let Ok((length, from)) = socket.recv_from(&mut bytes) else { continue };
        if !allowed.is_empty() && !allowed.contains(&from.ip()) {
            warn_once(&mut strangers, &format!("{from} may not send (--from): its messages are ignored"));
            continue;
        }
        let messages = bytes.get(..length.min(MOST_BYTES)).map(received);
        let Some(Ok(messages)) = messages.filter(|_| length <= MOST_BYTES) else {
            warn_once(&mut malformed, &format!("a datagram of {from} is no OSC, or longer than {MOST_BYTES} bytes"));
            continue;
        };
        for received in messages {
            let message = || Message { from, address: received.address.clone() };
            match received.command {
                Ok(None) => (),
                Ok(Some(command)) => {
                    if let Err(too_many) = client.request(message(), Action::Send(command)) {
                        printer.refused(message(), too_many.to_string());
                    }
                }
                Err(why) => printer.refused(message(), why.to_string()),
            }
        }
    }
    drop(client);
    if strangers + malformed > 0 {
        log::warn!("ignored datagrams: {strangers} of other hosts, {malformed} that are no OSC");
    }
    Ok(())
}

/// Says where messages are awaited, and who may send them.
fn announce(common: &Common, address: SocketAddr, allowed: &[IpAddr]) -> Result<(), CommandError> {
    let is_open = allowed.is_empty() && !address.ip().is_loopback();
    let mut output = Output::standard();
    if common.json {
        output.json(&ReadyLine { r#type: "ready", listen: address })?;
    } else {
        let hosts = || allowed.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        let who = match (allowed.is_empty(), is_open) {
            (false, _) => format!("{} may send", hosts()),
            (true, false) => "every user and program of this machine may send, and no other machine".to_owned(),
            (true, true) => format!("every host that reaches {address} may send"),
        };
        output.line(&format!("OSC at {address} conducts \"{}\": {ADDRESSES}; {who}. Ctrl-C ends.", common.name()))?;
    }
    if is_open {
        eprintln!("WARNING: every host that reaches {address} can conduct the show: OSC has no password (see --from).");
    }
    output.finish()
}

/// Counts, and warns of the first.
fn warn_once(count: &mut u64, sentence: &str) {
    *count += 1;
    if *count == 1 {
        log::warn!("{sentence}");
    }
}
