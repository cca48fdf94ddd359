//! The terminal while keys are read: each key at once and without an echo, and as it was before on every way out.
//!
//! Keys are read here and not by crossterm, whose reader waits for the rest of a sequence of which a part has come, and
//! for ever at the end of input: the display must go on. A sequence whose rest does not come is no sequence: somebody has
//! pressed Escape.
//!
//! Signals of the terminal (Ctrl-C) and the end of lines stay as they are. Called by `watch`, and by the handler that
//! ends the program where shared memory is full.

use std::io::{IsTerminal, stdin};
use std::os::fd::AsFd;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use nix::libc;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::termios::{LocalFlags, SetArg, SpecialCharacterIndices, Termios, tcgetattr, tcsetattr};
use nix::unistd::{getpgrp, read, tcgetpgrp};

/// How long the rest of a sequence may take: a terminal sends it in one piece, a network in a few.
const SEQUENCE_TIMEOUT: Duration = Duration::from_millis(100);

/// The terminal's settings as they were at the start.
static BEFORE: OnceLock<libc::termios> = OnceLock::new();
/// Whether they have been changed.
static CHANGED: AtomicBool = AtomicBool::new(false);

/// A key of those that `watch` knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Key {
    /// One that has a letter or a sign.
    Char(char),
    /// The arrow to the left.
    Left,
    /// The arrow to the right.
    Right,
}

/// A terminal that hands over each key at once, until this is dropped.
pub struct KeyMode {
    /// What has come and is no whole key yet, and when the latest of it came.
    bytes: Vec<u8>,
    came: Instant,
}

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
        Some(Self { bytes: Vec::new(), came: Instant::now() })
    }

    /// The keys that have been pressed since the last call. Waits for none.
    ///
    /// # Errors
    /// The terminal has gone.
    pub fn keys(&mut self) -> nix::Result<Vec<Key>> {
        let input = stdin();
        let mut ready = [PollFd::new(input.as_fd(), PollFlags::POLLIN)];
        let mut keys = Vec::new();
        let now = Instant::now();
        // Before more is read: what comes now belongs to no sequence that is over.
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

/// The keys that a terminal has sent these bytes for, and how many bytes they are; the rest is the beginning of another.
/// Where nothing more belongs to them, no beginning is: then an Escape without a whole sequence behind it was a key.
fn keys_of(bytes: &[u8], is_over: bool) -> (Vec<Key>, usize) {
    const ESCAPE: u8 = 0x1b;
    let (mut keys, mut at) = (Vec::new(), 0);
    while at < bytes.len() {
        let sequence = match bytes[at..] {
            [ESCAPE] => None,
            // Escape, [ or O, parameters, and a letter that tells which key it is.
            [ESCAPE, b'[' | b'O', ref rest @ ..] => rest.iter().position(|byte| (0x40..=0x7e).contains(byte)),
            [byte, ..] => {
                keys.extend((b' '..=b'~').contains(&byte).then_some(Key::Char(byte.into())));
                at += 1;
                continue;
            }
            [] => break,
        };
        match sequence {
            Some(end) => {
                match (end, bytes[at + 2 + end]) {
                    (0, b'C') => keys.push(Key::Right),
                    (0, b'D') => keys.push(Key::Left),
                    _ => (),
                }
                at += 3 + end;
            }
            None if is_over => at += 1,
            None => break,
        }
    }
    (keys, at)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_whole_whatever_comes_in_one_piece() {
        let (keys, used) = keys_of(b" \x1b[C\x1bOD]\x1b[1;5C\xc3\xa9h", false);
        assert_eq!(keys, [Key::Char(' '), Key::Right, Key::Left, Key::Char(']'), Key::Char('h')]);
        assert_eq!(used, 17);
        for (beginning, complete) in [(&b"."[..], 1), (b".\x1b", 1), (b".\x1b[", 1), (b".\x1b[1;", 1)] {
            assert_eq!(keys_of(beginning, false), (vec![Key::Char('.')], complete));
        }
    }

    #[test]
    fn a_sequence_whose_rest_does_not_come_is_keys() {
        let char = |letters: &str| letters.chars().map(Key::Char).collect::<Vec<_>>();
        for (bytes, letters) in [(&b"\x1b"[..], ""), (b".\x1b[", ".["), (b"\x1b\x1b[1;", "[1;")] {
            assert_eq!(keys_of(bytes, true), (char(letters), bytes.len()));
        }
        assert_eq!(keys_of(b"\x1b[D\x1b", true), (vec![Key::Left], 4));
    }
}
