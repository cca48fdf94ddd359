//! `metrics`: the figures of a running publisher for Prometheus.

use std::io::ErrorKind;
use std::net::{Ipv4Addr, SocketAddr};

use bench_dragon::outputs::metrics::{MetricsError, serve};
use serde::Serialize;

use super::{CommandError, Common, Output, stop_on_signals};

/// Arguments of `metrics`.
#[derive(Debug, Clone, clap::Args)]
pub struct MetricsArguments {
    /// The address to listen on; port 0 takes any free one
    #[arg(long, value_name = "ADDR:PORT", default_value_t = SocketAddr::from((Ipv4Addr::LOCALHOST, 9464)))]
    listen: SocketAddr,
}

/// The line of `metrics --json` once requests are answered.
#[derive(Serialize)]
struct ReadyLine {
    r#type: &'static str,
    url: String,
}

/// Serves until a signal comes.
pub fn metrics(common: &Common, arguments: &MetricsArguments) -> Result<(), CommandError> {
    let stop = stop_on_signals()?;
    serve(&common.names, arguments.listen, &stop, |address| {
        let url = format!("http://{address}/metrics");
        let mut output = Output::standard();
        if common.json {
            output.json(&ReadyLine { r#type: "ready", url })?;
        } else {
            output.line(&format!("The metrics of {} are at {url}. Ctrl-C ends.", common.quoted_names()))?;
        }
        if !address.ip().is_loopback() {
            eprintln!("WARNING: anyone who can reach {address} can read these figures; there is no password.");
        }
        output.finish()
    })
}

impl From<MetricsError> for CommandError {
    fn from(error: MetricsError) -> Self {
        match error {
            MetricsError::Open(error) => error.into(),
            MetricsError::Listen { ref source, .. } if source.kind() == ErrorKind::AddrNotAvailable => {
                Self::BadInput(error.to_string())
            }
            MetricsError::Listen { .. } => Self::Failed(error.to_string()),
        }
    }
}
