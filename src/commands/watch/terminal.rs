//! The terminal while keys are read: each key at once and without an echo. Every exit restores the settings.
//!
//! Reading never waits for the rest of an incomplete sequence, because the display must continue.
//!
//! Signals of the terminal (Ctrl-C) and ends of lines are unchanged.

use std::io::{IsTerminal, stdin};
use std::os::fd::AsFd;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::key_bytes::{Key, keys_of};
use nix::libc;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::termios::{LocalFlags, SetArg, SpecialCharacterIndices, Termios, tcgetattr, tcsetattr};
use nix::unistd::{getpgrp, read, tcgetpgrp};

/// Longest wait for the rest of a sequence: a terminal sends it in one piece, a network in a few.
const SEQUENCE_TIMEOUT: Duration = Duration::from_millis(100);

/// The terminal's settings at the start.
static BEFORE: OnceLock<libc::termios> = OnceLock::new();
/// True if they have been changed.
static CHANGED: AtomicBool = AtomicBool::new(false);

/// A terminal that delivers each key at once, until this value is dropped.
pub struct KeyMode {
    /// The bytes of an incomplete key, and the time of the latest.
    bytes: Vec<u8>,
    came: Instant,
}

impl KeyMode {
    /// Changes the settings of standard input. Returns `None` if that is no terminal, or if this program is in its
    /// background, where the settings belong to another program.
    pub fn enter() -> Option<Self> {
        // Only the controlling terminal has a foreground group.
        let is_foreground = tcgetpgrp(stdin()).map_or(true, |group| group == getpgrp());
        if !stdin().is_terminal() || !is_foreground {
            return None;
        }
        let mut settings = tcgetattr(stdin()).ok()?;
        BEFORE.get_or_init(|| settings.clone().into());
        settings.local_flags.remove(LocalFlags::ICANON | LocalFlags::ECHO);
        settings.control_chars[SpecialCharacterIndices::VMIN as usize] = 1;
        settings.control_chars[SpecialCharacterIndices::VTIME as usize] = 0;
        CHANGED.store(true, Ordering::Release);
        tcsetattr(stdin(), SetArg::TCSANOW, &settings).ok()?;
        Some(Self { bytes: Vec::new(), came: Instant::now() })
    }

    /// Returns the keys pressed since the last call, without waiting.
    ///
    /// # Errors
    /// The terminal has gone.
    pub fn keys(&mut self) -> nix::Result<Vec<Key>> {
        let input = stdin();
        let mut ready = [PollFd::new(input.as_fd(), PollFlags::POLLIN)];
        let mut keys = Vec::new();
        let now = Instant::now();
        // Before reading: new bytes belong to no sequence that has timed out.
        if now.duration_since(self.came) >= SEQUENCE_TIMEOUT {
            keys = self.take_keys(true);
        }
        if poll(&mut ready, PollTimeout::ZERO)? > 0 {
            let mut bytes = [0; 256];
            match read(&input, &mut bytes)? {
                0 => return Err(nix::Error::EIO),
                count => self.bytes.extend_from_slice(&bytes[..count]),
            }
            self.came = now;
        }
        keys.extend(self.take_keys(false));
        Ok(keys)
    }

    fn take_keys(&mut self, is_over: bool) -> Vec<Key> {
        let (keys, used) = keys_of(&self.bytes, is_over);
        self.bytes.drain(..used);
        keys
    }
}

impl Drop for KeyMode {
    fn drop(&mut self) {
        restore();
    }
}

/// Restores the terminal's settings. Async-signal-safe.
pub fn restore() {
    if CHANGED.swap(false, Ordering::AcqRel)
        && let Some(before) = BEFORE.get()
    {
        let _ = tcsetattr(stdin(), SetArg::TCSANOW, &Termios::from(*before));
    }
}
