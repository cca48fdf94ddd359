//! The option of a process that exits when its parent process exits.

use nix::sys::signal::{SigSet, Signal};

use super::CommandError;

/// Option of a process that exits when its parent process exits.
#[derive(Debug, Clone, clap::Args)]
pub struct Parent {
    /// End when the process that started this one ends, which has this number
    #[arg(long, value_name = "PID", hide = true)]
    end_with_parent: Option<i32>,
}

impl Parent {
    /// Kills this process when its parent ends, so that no process remains. Closes the parent's files, which iceoryx2
    /// lets children inherit and which would stay open as long as this process. Call this before a file is opened.
    pub fn watch(&self) -> Result<(), CommandError> {
        let Some(parent) = self.end_with_parent else { return Ok(()) };
        close_inherited_files();
        // The soak test blocks these signals, and a mask is inherited: until `stop_on_signals` they end this process
        // at once.
        let signals = SigSet::from_iter([Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP]);
        signals.thread_unblock().map_err(std::io::Error::from)?;
        let set = nix::sys::prctl::set_pdeathsig(Signal::SIGTERM);
        set.map_err(|error| CommandError::Failed(format!("the end of the parent cannot be watched: {error}")))?;
        // A parent that ended earlier sends no signal.
        if nix::unistd::getppid().as_raw() != parent {
            return Err(CommandError::Failed("the program that started this one has ended".to_owned()));
        }
        Ok(())
    }
}

/// Closes all files but standard input, output and error.
fn close_inherited_files() {
    let files = std::fs::read_dir("/proc/self/fd").into_iter().flatten().flatten();
    let numbers: Vec<i32> = files.filter_map(|file| file.file_name().to_str()?.parse().ok()).collect();
    for number in numbers.into_iter().filter(|number| *number > 2) {
        // One of them was the directory itself, which is closed already.
        let _ = nix::unistd::close(number);
    }
}
