//! `watch`: the terminal monitor.

use super::{CommandError, Common};

/// Arguments of `watch`.
#[derive(Debug, clap::Args)]
pub struct WatchArguments {}

/// Runs the monitor.
pub fn watch(_common: &Common, _arguments: &WatchArguments) -> Result<(), CommandError> {
    Ok(())
}
