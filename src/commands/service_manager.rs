//! Messages to the service manager that started this program (systemd, `Type=notify`): ready with the first frame,
//! alive while the loop turns, stopping. Without `NOTIFY_SOCKET` in the environment nothing is sent.
//!
//! They are sent on the statistics thread, which sees the loop turn, so that the loop's thread makes no system call for
//! them. The loop turns about ten times a second, also between the frames of a slow scene and while a show is paused or
//! held.

use std::time::{Duration, Instant};

use sd_notify::NotifyState;

/// A service manager, as seen by a publisher.
pub struct ServiceManager {
    /// Half the time after which the manager takes a silent program for dead, if it watches.
    interval: Option<Duration>,
    last_sign: Option<Instant>,
}

impl ServiceManager {
    /// Returns the service manager of this process; `None` if no service manager has started it.
    pub fn of_this_process() -> Option<Self> {
        std::env::var_os("NOTIFY_SOCKET")?;
        let interval = sd_notify::watchdog_enabled().map(|timeout| timeout / 2);
        Some(Self { interval, last_sign: None })
    }

    /// Reports that the loop lives, if the manager waits for a sign.
    pub fn alive(&mut self) {
        let Some(interval) = self.interval else { return };
        if self.last_sign.is_none_or(|sign| sign.elapsed() >= interval) {
            self.last_sign = Some(Instant::now());
            send(&[NotifyState::Watchdog]);
        }
    }
}

/// Reports that the first frame is published.
pub fn ready() {
    send(&[NotifyState::Ready]);
}

/// Reports that the loop has ended and the program shuts down.
pub fn stopping() {
    send(&[NotifyState::Stopping]);
}

fn send(states: &[NotifyState]) {
    if let Err(error) = sd_notify::notify(states) {
        log::warn!("the service manager (NOTIFY_SOCKET) cannot be reached: {error}");
    }
}
