//! The lines of this program's log on their way to `/rosout`: JSON lines on the standard input of the process of ROS 2.
//!
//! In the parent: a [`LogSender`], called by the thread that watches the process. In the process: [`receive`], called
//! by `send ros2`.

use std::io::{self, ErrorKind, Write};
use std::process::ChildStdin;

use nix::fcntl::{FcntlArg, OFlag, fcntl};

/// The parent's end.
pub struct LogSender {
    input: ChildStdin,
    /// The bytes of lines that the pipe has not taken yet.
    unsent: Vec<u8>,
}

impl LogSender {
    /// Creates the end of a pipe, which never blocks from now on.
    ///
    /// # Errors
    /// The system refuses.
    pub fn new(input: ChildStdin) -> io::Result<Self> {
        fcntl(&input, FcntlArg::F_SETFL(OFlag::O_NONBLOCK))?;
        Ok(Self { input, unsent: Vec::new() })
    }

    /// Sends the lines logged since the last call, as far as the pipe has room. Must be called often.
    pub fn send(&mut self) {
        if self.unsent.is_empty() {
            self.unsent = queued_lines();
        }
        while !self.unsent.is_empty() {
            match self.input.write(&self.unsent) {
                Ok(written) => drop(self.unsent.drain(..written)),
                Err(error) if error.kind() == ErrorKind::Interrupted => (),
                // Full, or without a reader: the process has ended, and its end is logged for the next one.
                Err(_) => return,
            }
        }
    }
}

/// Returns the queued lines as JSON lines.
#[cfg(feature = "ros2")]
fn queued_lines() -> Vec<u8> {
    let lines = bench_dragon::ros2::rosout::take_queued();
    // A line is numbers and texts, which JSON can always have.
    let encoded = lines.iter().filter_map(|line| serde_json::to_string(line).ok());
    encoded.flat_map(|line| (line + "\n").into_bytes()).collect()
}

#[cfg(not(feature = "ros2"))]
fn queued_lines() -> Vec<u8> {
    Vec::new()
}

/// Queues the lines of standard input for `/rosout`, on a thread, until the parent closes it.
#[cfg(feature = "ros2")]
pub fn receive() {
    std::thread::spawn(|| {
        for line in io::stdin().lines().map_while(Result::ok) {
            // Half a line is left by a parent that was killed.
            if let Ok(line) = serde_json::from_str(&line) {
                bench_dragon::ros2::rosout::enqueue_line(line);
            }
        }
    });
}
