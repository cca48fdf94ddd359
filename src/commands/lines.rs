//! A non-blocking writer for standard error, because a terminal stopped with Ctrl-S, or an unread pipe, can block
//! without limit.

use std::io;
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::time::Duration;

/// The greatest number of waiting lines; further ones are dropped.
const QUEUED: usize = 256;
/// Longest wait for the waiting lines at the end.
const PATIENCE: Duration = Duration::from_secs(1);

/// The thread that writes the lines.
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
            // A closed standard error loses the line.
            lines.into_iter().for_each(|line| eprintln!("{line}"));
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

    /// Waits until all lines are written, or the limit passes.
    pub fn finish(self) {
        drop(self.sender);
        // The thread sends nothing, and ends.
        let _ = self.written.recv_timeout(PATIENCE);
    }
}
