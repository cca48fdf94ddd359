//! `view`: the live stage picture in a browser.

use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};

use bench_dragon::subscribers::view::{ViewError, serve};
use serde::Serialize;

use super::{CommandError, Common, Output, stop_on_signals};

/// Arguments of `view`.
#[derive(Debug, clap::Args)]
pub struct ViewArguments {
    /// The port of the page; 0 takes any free one
    #[arg(long, default_value_t = 8080)]
    port: u16,
    /// The address to listen on; any but a loopback one lets others watch
    #[arg(long, value_name = "ADDR", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    listen: IpAddr,
}

/// What `view --json` prints once browsers can connect.
#[derive(Serialize)]
struct Ready {
    r#type: &'static str,
    url: String,
}

/// Serves the picture until a signal comes.
pub fn view(common: &Common, arguments: &ViewArguments) -> Result<(), CommandError> {
    let stop = stop_on_signals()?;
    let address = SocketAddr::new(arguments.listen, arguments.port);
    serve(&common.name, address, &stop, |address| announce(common, address))
}

fn announce(common: &Common, address: SocketAddr) -> Result<(), CommandError> {
    let url = format!("http://{address}/");
    let mut output = Output::standard();
    if common.json {
        output.json(&Ready { r#type: "ready", url })?;
    } else if address.ip().is_unspecified() {
        let port = address.port();
        output.line(&format!(
            "The stage picture of \"{}\" is at port {port} of every address of this machine; here, http://localhost:{port}/. Ctrl-C ends.",
            common.name
        ))?;
    } else {
        output.line(&format!("The stage picture of \"{}\" is at {url}. Ctrl-C ends.", common.name))?;
    }
    if !address.ip().is_loopback() {
        eprintln!("WARNING: anyone who can reach {address} can watch this show; there is no password.");
    }
    output.finish()
}

impl From<ViewError> for CommandError {
    fn from(error: ViewError) -> Self {
        match error {
            ViewError::Open(error) => error.into(),
            ViewError::Listen { ref source, .. } if source.kind() == ErrorKind::AddrNotAvailable => {
                Self::BadInput(error.to_string())
            }
            ViewError::Listen { .. } => Self::Failed(error.to_string()),
        }
    }
}
