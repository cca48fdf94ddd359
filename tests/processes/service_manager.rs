//! A publisher under a service manager: the messages of systemd's `Type=notify`, received on a real socket.

use crate::harness;

use std::os::unix::net::UnixDatagram;
use std::time::Duration;

use harness::{Process, program, summary, text};
use nix::sys::signal::Signal::{SIGCONT, SIGINT, SIGSTOP};

/// Receives one message. Panics after two minutes without one.
fn message(manager: &UnixDatagram) -> String {
    let mut bytes = [0; 256];
    let length = manager.recv(&mut bytes).expect("a message within two minutes");
    text(&bytes[..length])
}

#[test]
fn a_publisher_is_ready_alive_and_stopping() {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("notify");
    let manager = UnixDatagram::bind(&socket).unwrap();
    manager.set_read_timeout(Some(Duration::from_secs(120))).unwrap();
    let mut run = program("managed");
    let run = run.env("NOTIFY_SOCKET", &socket).env("WATCHDOG_USEC", "400000");
    let publisher = Process::start(run.args(["run", "--json", "--duration", "600"]));

    assert_eq!(message(&manager), "READY=1\nWATCHDOG=1\n");
    for _ in 0..5 {
        assert_eq!(message(&manager), "WATCHDOG=1\n");
    }
    // A publisher that hangs is not alive.
    publisher.signal(SIGSTOP);
    manager.set_read_timeout(Some(Duration::from_secs(2))).unwrap();
    let mut bytes = [0; 256];
    // Messages that were sent before the stop.
    while manager.recv(&mut bytes).is_ok() {}
    publisher.signal(SIGCONT);
    manager.set_read_timeout(Some(Duration::from_secs(120))).unwrap();
    assert_eq!(message(&manager), "WATCHDOG=1\n");

    publisher.signal(SIGINT);
    let last = std::iter::repeat_with(|| message(&manager)).find(|message| message != "WATCHDOG=1\n");
    assert_eq!(last.as_deref(), Some("STOPPING=1\n"));
    summary(&publisher.output_within(120));
}
