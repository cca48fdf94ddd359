//! The terminal while keys are read: each key at once and without an echo, and as it was before on every way out.
//!
//! Signals of the terminal (Ctrl-C) and the end of lines stay as they are. Called by `watch`, and by the handler that
//! ends the program where shared memory is full.

use std::io::{IsTerminal, stdin};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use nix::libc;
use nix::sys::termios::{LocalFlags, SetArg, SpecialCharacterIndices, Termios, tcgetattr, tcsetattr};
use nix::unistd::{getpgrp, tcgetpgrp};

/// The terminal's settings as they were at the start.
static BEFORE: OnceLock<libc::termios> = OnceLock::new();
/// Whether they have been changed.
static CHANGED: AtomicBool = AtomicBool::new(false);

/// A terminal that hands over each key at once, until this is dropped.
pub struct KeyMode(());

impl KeyMode {
    /// Changes the settings of standard input; `None` where that is no terminal, or where this program is in the
    /// terminal's background, whose settings are another's then.
    pub fn enter() -> Option<Self> {
        // A terminal that is not this program's own has no foreground that could be another's.
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
        Some(Self(()))
    }
}

impl Drop for KeyMode {
    fn drop(&mut self) {
        restore();
    }
}

/// Gives the terminal its settings back. Calls nothing that a signal handler may not.
pub fn restore() {
    if CHANGED.swap(false, Ordering::AcqRel)
        && let Some(before) = BEFORE.get()
    {
        let _ = tcsetattr(stdin(), SetArg::TCSANOW, &Termios::from(*before));
    }
}
