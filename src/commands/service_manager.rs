//! Messages to the service manager that started this program (systemd, `Type=notify`): ready with the first frame, alive
//! while the loop publishes, stopping. Without `NOTIFY_SOCKET` in the environment nothing is sent.
//!
//! Called on the statistics thread, which gets a sample of every frame: the loop's thread does no system call for it, and a
//! loop that hangs sends no sample.

use std::time::{Duration, Instant};

use sd_notify::NotifyState;

/// A service manager, as seen by a publisher.
pub struct ServiceManager {
    /// Half the time after which the manager takes a silent program for dead, if it watches.
    interval: Option<Duration>,
    is_ready: bool,
    last_sign: Instant,
}

impl ServiceManager {
    /// Returns the service manager of this process; `None` if no service manager has started it.
    pub fn of_this_process() -> Option<Self> {
        std::env::var_os("NOTIFY_SOCKET")?;
        let interval = sd_notify::watchdog_enabled().map(|timeout| timeout / 2);
        Some(Self { interval, is_ready: false, last_sign: Instant::now() })
    }

    /// Reports that the loop has published a frame.
    pub fn frame(&mut self) {
        if !self.is_ready {
            self.is_ready = true;
            self.last_sign = Instant::now();
            send(&[NotifyState::Ready, NotifyState::Watchdog]);
        } else if self.interval.is_some_and(|interval| self.last_sign.elapsed() >= interval) {
            self.last_sign = Instant::now();
            send(&[NotifyState::Watchdog]);
        }
    }
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
