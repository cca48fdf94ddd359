//! `view`: the live stage picture in a browser.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};

use bench_dragon::subscribers::view::{ViewError, serve};

use super::{CommandError, Common, stop_on_signals};

/// Arguments of `view`.
#[derive(Debug, clap::Args)]
pub struct ViewArguments {
    /// The port of the page
    #[arg(long, default_value_t = 8080)]
    port: u16,
    /// The address to listen on; any but a loopback one lets others watch
    #[arg(long, value_name = "ADDR", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    listen: IpAddr,
}

/// Serves the picture until a signal comes.
pub fn view(common: &Common, arguments: &ViewArguments) -> Result<(), CommandError> {
    let stop = stop_on_signals()?;
    let address = SocketAddr::new(arguments.listen, arguments.port);
    let ready = |address: SocketAddr| {
        eprintln!("The stage picture of \"{}\" is at http://{address}/; Ctrl-C ends.", common.name);
        if !address.ip().is_loopback() {
            eprintln!("Anyone who can reach {address} can watch it.");
        }
    };
    serve(&common.name, address, &stop, ready).map_err(|error| match error {
        ViewError::Open(error) => error.into(),
        listen @ ViewError::Listen { .. } => CommandError::Failed(listen.to_string()),
    })
}
