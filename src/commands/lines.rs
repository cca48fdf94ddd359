//! Lines on standard error that hold nobody up. A terminal that is stopped with Ctrl-S, or a pipe that nobody reads, takes none
//! for as long as it likes. Used by `publishing`, whose statistics have other things to do.

use std::io::{self, Write};
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::time::Duration;

/// Lines that may wait; further ones are lost.
const QUEUED: usize = 256;
/// How long those that wait are given in the end.
const PATIENCE: Duration = Duration::from_secs(1);

/// The thread that writes them.
pub struct Lines {
    sender: SyncSender<String>,
    written: Receiver<()>,
}

impl Lines {
    /// Starts the thread.
    pub fn start() -> io::Result<Self> {
        let (sender, lines) = sync_channel::<String>(QUEUED);
        let (end, written) = channel();
        let write = move || {
            // Where there is nobody to read it, nobody misses it.
            lines.into_iter().for_each(|line| drop(writeln!(io::stderr(), "{line}")));
            drop(end);
        };
        std::thread::Builder::new().name("lines".to_owned()).spawn(write)?;
        Ok(Self { sender, written })
    }

    /// Returns a function that queues a line. [`finish`](Self::finish) waits for the function's end.
    pub fn printer(&self) -> impl Fn(String) + Send + use<> {
        let sender = self.sender.clone();
        move |line| drop(sender.try_send(line))
    }

    /// Waits until all is written, or will not be.
    pub fn finish(self) {
        drop(self.sender);
        // The thread sends nothing, and ends.
        let _ = self.written.recv_timeout(PATIENCE);
    }
}
