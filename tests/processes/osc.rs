//! OSC with a user's own addresses, and OSC that conducts a show: judged by python-osc, and by npm's node-osc in the
//! long run.

use std::net::UdpSocket;
use std::process::Command;

use serde_json::{Value, json};

use crate::control::done;
use crate::harness::{
    self, Lines, Process, answering, can_run, json_lines, long, not_run, npm, program, python, python_modules, text,
};
use crate::send::free_port;
use nix::sys::signal::Signal;

/// A publisher of the paper's scene shortly before its contact, with a cue.
fn publisher(name: &str, arguments: &[&str]) -> Process {
    let cue = "\n[[cues]]\nname = \"lights\"\nat = 411.5\nthen = \"mark\"\n";
    let scene = harness::scene_file(name, &[crate::send::NEWTON]);
    std::fs::write(&scene, std::fs::read_to_string(&scene).unwrap() + cue).unwrap();
    let mut run = program(name);
    Process::start(run.arg("--scene").arg(scene).args(["run", "--duration", "600"]).args(arguments))
}

/// Messages that are sent, and heard.
struct Peer<'a> {
    /// The folder of node-osc; without it python-osc is the peer.
    npm: Option<&'a str>,
}

impl Peer<'_> {
    fn command(&self, port: &str) -> Command {
        let Some(folder) = self.npm else {
            let mut command = python();
            command.args(["tests/python/osc_peer.py", "--port", port]);
            return command;
        };
        let mut command = Command::new("node");
        command.args(["tests/python/osc_npm.mjs", folder, port]);
        command
    }

    fn send(&self, port: &str, messages: &[&str]) {
        let mut command = self.command(port);
        let output = command.args(self.npm.is_none().then_some("--send")).args(messages).output().unwrap();
        assert!(output.status.success(), "{}", text(&output.stderr));
    }

    /// Asserts that it hears the messages of a map, each once.
    fn hears_a_map(&self, name: &str) {
        let folder = tempfile::tempdir().unwrap();
        let map = folder.path().join("map.toml");
        let messages = "[[messages]]\ncue = \"lights\"\naddress = \"/cue/12/start\"\n\
                        [[messages]]\nlevel = \"contact\"\naddress = \"/cue/13/start\"\narguments = [1, 0.5, \"go\"]\n\
                        [[messages]]\nevent = \"contact\"\naddress = \"/fog\"\narguments = [0]\n";
        std::fs::write(&map, messages).unwrap();
        let port = free_port().to_string();
        let mut peer = Process::start(&mut self.command(&port));
        let lines = peer.lines();
        lines.until("listening");
        let mut send = program(name);
        send.args(["--json", "send", "osc", "--messages", "--to", &format!("127.0.0.1:{port}"), "--map"]).arg(&map);
        let mut sender = Process::start(&mut send);
        let publisher = answering(publisher(name, &["--start", "411", "--paused"]), || program(name));
        // The sender has joined before the show plays.
        harness::wait_until("the sender subscribes", || {
            let shows = json_lines(&Process::start(program(name).args(["--json", "list"])).output());
            shows.iter().any(|show| show["name"] == harness::unique(name) && show["subscribers"] == 1)
        });
        done(name, &["resume"]);
        let heard = Vec::from_iter((0..3).map(|_| lines.until("address")));
        let heard = Vec::from_iter(heard.iter().map(|line| serde_json::from_str::<Value>(line).unwrap()));
        let message = |address: &str, arguments: Value| json!({"address": address, "arguments": arguments});
        assert_eq!(heard[0], message("/cue/12/start", json!([])), "411.5 s is before the contact");
        let contact = [message("/cue/13/start", json!([1, 0.5, "go"])), message("/fog", json!([0]))];
        assert!(contact.iter().all(|expected| heard[1..].contains(expected)), "{heard:?}");
        sender.signal(Signal::SIGTERM);
        let printed = sender.lines().rest();
        assert!(printed.last().unwrap().contains("\"cues\":1"), "{printed:?}");
        peer.signal(Signal::SIGTERM);
        assert_eq!(lines.rest(), [""; 0], "nothing else was sent");
        drop(publisher);
    }

    /// Asserts that its messages conduct a show.
    fn conducts(&self, name: &str) {
        let _publisher = answering(publisher(name, &["--start", "100", "--paused"]), || program(name));
        let (_control, lines, port) = conducted(name, &[]);
        let sent = |message: &str| {
            self.send(&port, &[message]);
            line(&lines)
        };
        for (message, playback) in [
            ("/go", "playing"),
            ("/pause", "paused"),
            ("/resume,1", "playing"),
            ("/hold", "held"),
            ("/release", "paused"),
            ("/rate,0.5", "paused"),
        ] {
            let answer = sent(message);
            assert_eq!(
                (&answer["code"], &answer["playback"]),
                (&json!("done"), &json!(playback)),
                "{message}: {answer}"
            );
            assert!(answer["refusal"].is_null() && message.starts_with(answer["address"].as_str().unwrap()));
        }
        assert_eq!(sent("/seek,200.5")["sim_time"], 200.5);
        assert_eq!(done(name, &["state"])["sim_time"], 200.5);
        // A released button does nothing, so the next line is that of the next message.
        self.send(&port, &["/resume,0", "/resume"]);
        assert_eq!(line(&lines)["time_scale"], 0.5);
        assert_eq!(done(name, &["state"])["playback"], "playing");
        let beyond = sent("/seek,9999");
        assert!(beyond["refusal"].as_str().unwrap().contains("out of range"), "{beyond}");
        let unknown = sent("/start");
        assert!(unknown["refusal"].as_str().unwrap().contains("/go, /hold"), "{unknown}");
        assert!(sent("/rate")["refusal"].as_str().unwrap().contains("one number"));
    }
}

fn line(lines: &Lines) -> Value {
    serde_json::from_str(&lines.until("\"address\"")).unwrap()
}

/// Starts `control osc` at a free port.
fn conducted(name: &str, arguments: &[&str]) -> (Process, Lines, String) {
    let mut command = program(name);
    command.args(["--json", "control", "osc"]).args(arguments);
    if !arguments.contains(&"--listen") {
        command.args(["--listen", "127.0.0.1:0"]);
    }
    let mut control = Process::start(&mut command);
    let lines = control.lines();
    let ready: Value = serde_json::from_str(&lines.until("\"ready\"")).unwrap();
    let (_, port) = ready["listen"].as_str().unwrap().rsplit_once(':').unwrap();
    let port = port.to_owned();
    (control, lines, port)
}

#[test]
fn python_osc_hears_a_users_own_messages() {
    if can_run(python_modules(&["pythonosc"])) {
        Peer { npm: None }.hears_a_map("osc_map");
    }
}

#[test]
fn python_osc_conducts_a_show() {
    if can_run(python_modules(&["pythonosc"])) {
        Peer { npm: None }.conducts("osc_control");
    }
}

/// Needs node and npm, which fetches the peer.
#[test]
fn node_osc_hears_and_conducts() {
    if !long() {
        return;
    }
    match npm("node-osc@11.7.1") {
        Ok((_folder, package)) => {
            let peer = Peer { npm: package.to_str() };
            peer.hears_a_map("osc_npm_map");
            peer.conducts("osc_npm_control");
        }
        Err(why) => not_run(&why),
    }
}

#[test]
fn plain_messages_are_single_datagrams_with_the_addresses_of_bundles() {
    let name = "osc_plain";
    let _publisher = publisher(name, &["--start", "100"]);
    let heard = |options: &[&str]| {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.set_read_timeout(Some(harness::patience())).unwrap();
        let to = socket.local_addr().unwrap().to_string();
        let _sender = Process::start(program(name).args(["send", "osc", "--to", &to]).args(options));
        let mut datagram = [0; 1500];
        let mut next = || {
            let length = socket.recv(&mut datagram).unwrap();
            datagram[..length].to_vec()
        };
        Vec::from_iter((0..100).map(|_| next()))
    };
    assert!(heard(&[]).iter().all(|datagram| datagram.starts_with(b"#bundle\0")));
    let plain = heard(&["--messages"]);
    let prefix = format!("/{}/", harness::unique(name));
    for address in ["head\0", "sim_time\0", "state\0", "alert\0"] {
        let whole = format!("{prefix}{address}");
        assert!(plain.iter().any(|datagram| datagram.starts_with(whole.as_bytes())), "no {address}");
    }
    assert!(plain.iter().all(|datagram| datagram.starts_with(prefix.as_bytes())));
}

#[test]
fn others_than_the_named_hosts_conduct_nothing_and_an_open_address_is_warned_of() {
    let name = "osc_strangers";
    let _publisher = answering(publisher(name, &["--start", "100"]), || program(name));
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let hold = b"/hold\0\0\0,\0\0\0";
    let (mut closed, lines, port) = conducted(name, &["--from", "127.0.0.9"]);
    let said = closed.error_lines();
    socket.send_to(hold, format!("127.0.0.1:{port}")).unwrap();
    assert!(said.until("--from").contains("may not send"));
    assert_eq!(done(name, &["state"])["playback"], "playing");
    // The host that may send is heard, on the same port.
    UdpSocket::bind("127.0.0.9:0").unwrap().send_to(hold, format!("127.0.0.1:{port}")).unwrap();
    assert_eq!(line(&lines)["playback"], "held");
    let (mut open, _, _) = conducted(name, &["--listen", "0.0.0.0:0"]);
    assert!(open.error_lines().until("WARNING").contains("every host"));
    let mut local = Process::start(program(name).args(["control", "osc", "--listen", "127.0.0.1:0"]));
    assert!(local.first_line().contains("of this machine may send, and no other machine"));
}

#[test]
fn a_wrong_map_is_refused_with_file_and_line() {
    let folder = tempfile::tempdir().unwrap();
    let map = folder.path().join("map.toml");
    std::fs::write(&map, "[[messages]]\nlevel = \"near\"\naddress = \"/a\"\n").unwrap();
    for (file, expected) in [(map.to_str().unwrap(), "map.toml, line 2: level: expected"), ("/nowhere", "/nowhere: ")] {
        let mut send = program("osc_wrong");
        let output = send.args(["send", "osc", "--to", "127.0.0.1:9", "--map", file]).output().unwrap();
        let sentence = text(&output.stderr);
        assert!(output.status.code() == Some(2) && sentence.contains(expected), "{sentence}");
    }
}
