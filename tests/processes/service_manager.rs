//! A publisher under a service manager: the messages of systemd's `Type=notify`, received on a real socket.

use crate::harness;

use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::time::Duration;

use harness::{Process, program, summary, text};
use nix::sys::signal::Signal::{SIGCONT, SIGINT, SIGSTOP};

/// Receives one message. Panics after two minutes without one.
fn message(manager: &UnixDatagram) -> String {
    let mut bytes = [0; 256];
    let length = manager.recv(&mut bytes).expect("a message within two minutes");
    text(&bytes[..length])
}

/// Returns the socket of a service manager in `folder`.
fn manager(folder: &tempfile::TempDir) -> (UnixDatagram, PathBuf) {
    let socket = folder.path().join("notify");
    let manager = UnixDatagram::bind(&socket).unwrap();
    manager.set_read_timeout(Some(harness::patience())).unwrap();
    (manager, socket)
}

/// Starts `run` under the manager, which takes a program that is silent for 0.4 s for dead.
fn managed(name: &str, socket: &Path, options: &[&str]) -> Process {
    let mut run = program(name);
    let run = run.env("NOTIFY_SOCKET", socket).env("WATCHDOG_USEC", "400000");
    Process::start(run.args(["run", "--json"]).args(options))
}

/// Receives until the program has ended, and returns the messages but for signs of life.
fn last_messages(manager: &UnixDatagram) -> Vec<String> {
    let mut messages = Vec::new();
    while messages.last().is_none_or(|last| last != "STOPPING=1\n") {
        messages.push(message(manager));
    }
    messages.retain(|message| message != "WATCHDOG=1\n");
    messages
}

#[test]
fn a_publisher_is_ready_alive_and_stopping() {
    let folder = tempfile::tempdir().unwrap();
    let (manager, socket) = manager(&folder);
    let publisher = managed("managed", &socket, &["--duration", "600"]);

    // The loop may live before the first frame is published.
    let first = std::iter::repeat_with(|| message(&manager)).find(|message| message != "WATCHDOG=1\n");
    assert_eq!(first.as_deref(), Some("READY=1\n"));
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
    manager.set_read_timeout(Some(harness::patience())).unwrap();
    assert_eq!(message(&manager), "WATCHDOG=1\n");

    publisher.signal(SIGINT);
    assert_eq!(last_messages(&manager), ["STOPPING=1\n"]);
    summary(&publisher.output());
}

/// One frame in ten seconds, and a pause: the loop lives by its own clock.
#[test]
fn a_publisher_that_waits_for_its_next_frame_is_alive() {
    for (name, options) in
        [("managed_slow", &["--rate", "0.1"][..]), ("managed_paused", &["--rate", "0.1", "--paused"])]
    {
        let folder = tempfile::tempdir().unwrap();
        let (manager, socket) = manager(&folder);
        let publisher = managed(name, &socket, options);
        let mut messages: Vec<_> = (0..10).map(|_| message(&manager)).collect();
        messages.retain(|message| message != "WATCHDOG=1\n");
        assert_eq!(messages, ["READY=1\n"], "{name}");
        publisher.signal(SIGINT);
        assert_eq!(last_messages(&manager), ["STOPPING=1\n"], "{name}");
        let frames = summary(&publisher.output())["frames"].as_u64().unwrap();
        assert!(frames < 5, "{name}: {frames} frames, which would be signs of life themselves");
    }
}
