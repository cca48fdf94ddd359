//! Network output, as independent receivers decode it: PosiStageNet by pypsn (and npm's decoder in the long run), OSC
//! by python-osc. No receiver, killed or stopped, costs the publisher or another subscriber a frame.

use crate::control::done;
use crate::harness;

use std::net::UdpSocket;
use std::time::Instant;

use bench_dragon::motion::Method;
use bench_dragon::motion::solve::{Chain, Velocities};
use bench_dragon::show::scene::Scene;
use harness::{
    Lines, Process, can_run, long, not_run, npm, program, python, python_modules, scene_file, stopped, summary, text,
    unique, wait, wait_until,
};
use nix::sys::signal::Signal;
use serde_json::{Value, json};

/// A solver with which the publisher starts at once, even if the program is not optimised.
pub const NEWTON: (&str, &str) = ("accuracy = 1e-9", "solver = \"newton\"");
/// Frames by which a subscriber may fall behind: ten seconds.
const QUEUE: u64 = 600;

fn publisher(name: &str, arguments: &[&str]) -> Process {
    let scene = scene_file(name, &[NEWTON, ("[publish]", &format!("[publish]\nqueue = {QUEUE}"))]);
    Process::start(program(name).arg("--scene").arg(scene).args(["run", "--json"]).args(arguments))
}

pub fn free_port() -> u16 {
    UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

fn listener() -> (UdpSocket, String) {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_read_timeout(Some(harness::patience())).unwrap();
    let address = socket.local_addr().unwrap().to_string();
    (socket, address)
}

fn end(process: Process) -> Value {
    // On a busy machine a program starts late: before it catches the signal, the signal would kill it.
    wait_until("the program catches SIGTERM", || {
        let status = std::fs::read_to_string(format!("/proc/{}/status", process.id())).unwrap_or_default();
        let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
        let caught = caught.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
        caught.is_none_or(|mask| mask & (1 << (Signal::SIGTERM as u64 - 1)) != 0)
    });
    process.signal(Signal::SIGTERM);
    summary(&process.output())
}

/// A sender's output, and the frames until it ends.
struct Sending<'a> {
    name: &'a str,
    frames: u64,
    group: Option<&'a str>,
    axes: &'a str,
    first_id: u64,
    /// The folder of npm's decoder, which must then decode the same.
    npm: Option<&'a str>,
}

impl Default for Sending<'_> {
    fn default() -> Self {
        Self { name: "psn", frames: 120, group: None, axes: "x,up,y", first_id: 1, npm: None }
    }
}

impl Sending<'_> {
    /// Asserts that pypsn decodes the paper's team: every tracker of every frame equals the shared memory.
    fn of_the_paper(&self) {
        let publish = || publisher(self.name, &["--start", "250", "--time-scale", "2", "--duration", "600"]);
        self.is_heard(publish, 224);
    }

    /// Asserts that pypsn decodes a publisher of `handles` handles.
    fn is_heard(&self, publish: impl FnOnce() -> Process, handles: u64) {
        if !can_run(python_modules(&["iceoryx2", "numpy", "pypsn"])) {
            return;
        }
        let Sending { name, frames, group, axes, first_id, npm } = *self;
        let _publisher = publish();
        let (port, first) = (free_port().to_string(), first_id.to_string());
        let mut peer = python();
        peer.args(["tests/python/psn_peer.py", "--name", &unique(name), "--port", &port, &format!("--axes={axes}")]);
        peer.args(["--progress", "--first-id", &first])
            .args(group.map(|group| ["--group", group]).into_iter().flatten());
        let mut peer = Process::start(peer.args(npm.map(|folder| ["--npm", folder]).into_iter().flatten()));
        let lines = peer.lines();
        lines.until("listening");
        let to = format!("{}:{port}", group.unwrap_or("127.0.0.1"));
        let mut send = program(name);
        send.args(["send", "psn", "--json", "--to", &to, "--interface", "127.0.0.1"]);
        send.args([&format!("--axes={axes}"), "--first-id", &first, "--system-name", "The dragon"]);
        let sender = Process::start(&mut send);
        until_equal(&lines, frames);
        let sent = end(sender);
        end_desk(&to);
        let last = lines.rest().pop();
        let output = peer.output();
        assert!(output.status.success(), "{}", text(&output.stderr));
        let heard: Value = serde_json::from_str(&last.unwrap()).unwrap();
        let number = |of: &Value, field: &str| of[field].as_u64().unwrap_or_else(|| panic!("no {field} in {of}"));
        println!("sent {sent}, heard {}, {} equal", heard["frames"], heard["equal"]);
        assert!(number(&heard, "equal") >= frames, "{}", heard["publishers"]);
        assert!(number(&heard, "unknown") <= number(&heard, "memory_missed"), "{}", heard["publishers"]);
        assert_eq!(number(&heard, "equal") + number(&heard, "unknown"), number(&sent, "frames"));
        assert_eq!((number(&heard, "stopped"), number(&sent, "stopped_frames")), (1, 1), "the sender reports its end");
        assert_eq!((number(&heard, "packets"), number(&sent, "unsent_packets")), (number(&sent, "packets"), 0));
        assert_eq!(number(&heard, "trackers"), handles);
        assert!(number(&heard, "largest") <= 1472, "{} bytes", heard["largest"]);
        let names = &heard["names"];
        assert_eq!(names.as_object().unwrap().len() as u64, handles);
        let named = |handle: u64| names[(first_id + handle).to_string()].as_str().unwrap();
        assert_eq!((named(0), named(11), named(handles - 1)), ("head", "handle 12", "tail"));
        assert_eq!(heard["systems"], json!(["The dragon"]));
    }
}

/// Waits until `psn_peer.py --progress` has found a number of frames of its first publisher equal.
pub fn until_equal(lines: &Lines, frames: u64) {
    let is_enough = |line: &str| {
        let line: Value = serde_json::from_str(line).unwrap();
        line["equal"][0].as_u64() >= Some(frames)
    };
    lines.all_until_one(is_enough, "equal frames");
}

/// Ends `psn_peer.py` after all that was sent to its address: an empty packet.
pub fn end_desk(to: &str) {
    UdpSocket::bind("127.0.0.1:0").unwrap().send_to(&[], to).unwrap();
}

#[test]
fn pypsn_hears_every_tracker_of_every_frame_by_multicast() {
    let frames = if long() { 3600 } else { 180 };
    Sending { name: "psn_multicast", frames, group: Some("236.10.10.10"), ..Sending::default() }.of_the_paper();
}

#[test]
fn one_desk_hears_them_in_axes_and_numbers_of_its_own() {
    Sending { name: "psn_axes", axes: "-y,up,x", first_id: 301, ..Sending::default() }.of_the_paper();
}

#[test]
fn pypsn_hears_every_one_of_five_thousand() {
    let name = "psn_5001";
    let frames = if long() { 300 } else { 10 };
    let publish = || {
        let mut run = program(name);
        run.args(["--scene", "config/long.toml", "run", "--json", "--rate", "5", "--duration", "600"]);
        Process::start(&mut run)
    };
    Sending { name, frames, ..Sending::default() }.is_heard(publish, 5001);
}

/// Needs node and npm, which fetches the decoder.
#[test]
fn a_second_decoder_sees_the_same() {
    if !long() {
        return;
    }
    match npm("@jwetzell/posistagenet@2.1.1") {
        Ok((_folder, package)) => {
            Sending { name: "psn_npm", frames: 600, npm: package.to_str(), ..Sending::default() }.of_the_paper();
        }
        Err(why) => not_run(&why),
    }
}

/// Receives a frame of one tracker and returns its status, position and speed, from their places in the packet.
fn only_tracker(socket: &UdpSocket) -> (f32, [f32; 3], [f32; 3]) {
    let mut packet = [0; 1500];
    loop {
        let length = socket.recv(&mut packet).unwrap();
        if packet[..2] == [0x55, 0x67] {
            assert_eq!(length, 96);
            let float = |at: usize| f32::from_le_bytes(packet[at..at + 4].try_into().unwrap());
            return (float(80), [float(32), float(36), float(40)], [float(48), float(52), float(56)]);
        }
    }
}

fn until_status(socket: &UdpSocket, status: f32) -> ([f32; 3], [f32; 3]) {
    let deadline = Instant::now() + harness::patience();
    while Instant::now() < deadline {
        let (seen, position, speed) = only_tracker(socket);
        if seen == status {
            return (position, speed);
        }
        assert_eq!(seen, 1.0 - status);
    }
    panic!("no status {status}");
}

#[test]
fn a_desk_is_told_when_the_publisher_dies_and_when_it_is_back() {
    let name = "psn_status";
    let (socket, address) = listener();
    let sender = Process::start(program(name).args(["send", "psn", "--json", "--trackers", "head", "--to", &address]));
    let killed = publisher(name, &["--start", "300", "--duration", "600"]);
    let (_, speed) = until_status(&socket, 1.0);
    assert!((speed[0].hypot(speed[2]) - 1.0).abs() < 1e-6, "the head moves at 1 m/s: {speed:?}");
    killed.signal(Signal::SIGKILL);
    let (position, speed) = until_status(&socket, 0.0);
    assert_eq!(speed, [0.0; 3]);
    assert_eq!(only_tracker(&socket), (0.0, position, speed), "it stays where it was");
    let stopped = publisher(name, &["--start", "100", "--duration", "600"]);
    until_status(&socket, 1.0);
    stopped.stop();
    until_status(&socket, 0.0);
    stopped.signal(Signal::SIGCONT);
    until_status(&socket, 1.0);
    let sent = end(sender);
    assert!(sent["stopped_frames"].as_u64().unwrap() > 2, "{sent}");
}

/// Returns the messages with an address among the output of a peer.
pub fn heard<'a>(messages: &'a [Value], address: &'a str) -> impl Iterator<Item = &'a Value> {
    messages.iter().filter(move |message| message["address"] == address).map(|message| &message["arguments"])
}

fn is_near(value: &Value, expected: &Value) -> bool {
    let (value, expected) = (value.as_f64().unwrap(), expected.as_f64().unwrap());
    (value - expected).abs() <= 1e-6 * expected.abs()
}

#[test]
fn python_osc_hears_every_alert_and_cue_once_and_in_order() {
    if !can_run(python_modules(&["pythonosc"])) {
        return;
    }
    let name = "osc";
    let cues = "\n[[cues]]\nname = \"the coil closes\"\nat = 409.0\nthen = \"mark\"\n\n\
                [[cues]]\nname = \"lights\"\nbefore = \"contact\"\nseconds = 1.0\nthen = \"mark\"\n";
    let scene = scene_file(name, &[NEWTON]);
    std::fs::write(&scene, std::fs::read_to_string(&scene).unwrap() + cues).unwrap();
    let port = free_port().to_string();
    let mut peer = Process::start(python().args(["tests/python/osc_peer.py", "--port", &port]));
    let lines = peer.lines();
    lines.until("listening");
    // One of the receivers is gone, which must not affect the other.
    let to = [format!("127.0.0.1:{}", free_port()), format!("127.0.0.1:{port}")];
    let sender = Process::start(program(name).args(["send", "osc", "--json", "--to", &to[0], &to[1]]));
    let mut watch = Process::start(program(name).args(["watch", "--json"]));
    let watched = watch.lines();
    let mut run = program(name);
    run.arg("--scene").arg(scene).args(["run", "--json", "--start", "407", "--paused"]);
    let publisher = Process::start(&mut run);
    // The show moves when both have frames, and ends half a second or more after the contact.
    let mut seen = watched.all_until("\"state\":\"approaching\"");
    let mut printed = lines.all_until("\"paused\"");
    done(name, &["resume"]);
    printed.extend(lines.all_until("\"playing\""));
    let began = printed.len() - 1;
    printed.extend(lines.all_until("\"ended\""));
    printed.extend((0..30).flat_map(|_| lines.all_until("/sim_time\"")));
    stopped(publisher);
    printed.extend(lines.all_until("\"stopped\""));
    let parsed =
        |lines: Vec<String>| Vec::from_iter(lines.iter().map(|line| serde_json::from_str::<Value>(line).unwrap()));
    let mut messages = parsed(printed);
    for message in &mut messages {
        let address = message["address"].as_str().unwrap().strip_prefix(&format!("/{}/", unique(name)));
        message["address"] = json!(address.unwrap());
    }
    watch.signal(Signal::SIGTERM);
    seen.extend(watched.rest());
    let watched = parsed(seen);
    let sent = end(sender);

    let of_type = |name: &str| Vec::from_iter(watched.iter().filter(|line| line["type"] == name));
    let (alerts, expected) = (Vec::from_iter(heard(&messages, "alert")), of_type("alert"));
    assert_eq!((alerts.len(), &sent["alerts"]), (expected.len(), &json!(expected.len())), "{alerts:#?} {expected:#?}");
    assert!(alerts.len() > 5);
    let person = |bench: &Value| bench.as_u64().map_or(json!(-1), |bench| json!(bench + 1));
    for (alert, expected) in alerts.iter().zip(expected) {
        assert_eq!((&alert[0], &alert[2]), (&expected["level"], &expected["event"]));
        for (argument, field) in [(3, "time_to_event"), (4, "clearance"), (5, "event_x"), (6, "event_y")] {
            assert!(is_near(&alert[argument], &expected[field]), "{field}: {alert} for {expected}");
        }
        assert_eq!([&alert[7], &alert[8]], [&person(&expected["event_bench_a"]), &person(&expected["event_bench_b"])]);
    }
    assert_eq!(alerts[0].as_array().unwrap()[7..9], [1, 9], "the paper's scene: benches 0 and 8, counted from 1");
    assert_eq!((&alerts.last().unwrap()[0], &alerts.last().unwrap()[1]), (&json!("contact"), &json!(2)));

    let (cues, expected) = (Vec::from_iter(heard(&messages, "cue")), of_type("cue"));
    assert_eq!((cues.len(), expected.len(), &sent["cues"]), (2, 2, &json!(2)));
    for (cue, expected) in cues.iter().zip(expected) {
        assert_eq!((&cue[0], &cue[1]), (&expected["number"], &expected["name"]));
        assert!(is_near(&cue[2], &expected["sim_time"]));
    }
    let messages = &messages[began..];
    countdown_and_head_are_true(messages);
    let states = Vec::from_iter(heard(messages, "state").cloned());
    assert_eq!(states[0], json!(["approaching", 1, "playing", 0]));
    assert_eq!(states.last(), Some(&json!(["stopped", -1, "stopped", -1])));
    assert!(states.contains(&json!(["contact", 2, "ended", 3])), "{states:?}");
}

/// Asserts that each countdown ends at the contact, and that the head is at the safe solver's place at the time beside
/// it.
fn countdown_and_head_are_true(messages: &[Value]) {
    let motion = Scene::paper().ensemble.only().unwrap().with_method(Method::Newton).unwrap();
    let (mut newton, mut chain) = (motion.solver(Velocities::Computed).solver, Chain::new(224));
    let contact = 412.473837682115;
    let [times, heads] = ["sim_time", "head"].map(|address| Vec::from_iter(heard(messages, address)));
    assert!(times.len() == heads.len() && times.len() > 200, "{} frames", times.len());
    for (time, head) in times.iter().zip(heads).step_by(20) {
        let time = time[0].as_f64().unwrap();
        newton.solve(time.min(contact), &mut chain).unwrap();
        // A float of 400 s has an error of a hundred-thousandth of a second, and so does the head, in metres.
        let place = (head[0].as_f64().unwrap() - chain.x[0]).hypot(head[1].as_f64().unwrap() - chain.y[0]);
        assert!(place < 1e-4, "{place} m at {time}");
        let speed = head[3].as_f64().unwrap().hypot(head[4].as_f64().unwrap());
        let expected = if time < contact - 1e-3 { 1.0 } else { 0.0 };
        assert!((speed - expected).abs() < 1e-5, "{speed} m/s at {time}");
    }
    let mut left: Option<f64> = None;
    let (mut countdowns, mut over) = (0, 0);
    for message in messages {
        match message["address"].as_str().unwrap() {
            "sim_time" => {
                let time = message["arguments"][0].as_f64().unwrap();
                // The countdown comes before the time of the same frame.
                if let Some(left) = left.take() {
                    assert!((contact - left - time).abs() < 1e-3, "{left} s left at {time}");
                }
            }
            "countdown" if message["arguments"][1] == "none" => over += 1,
            "countdown" => {
                left = message["arguments"][0].as_f64();
                assert_eq!(message["arguments"][1], "contact");
                countdowns += 1;
            }
            _ => (),
        }
    }
    // A sender also ends its countdown where the machine does not run the publisher for seconds.
    assert!(countdowns > 10 && over > 0, "{countdowns} countdowns, {over} ends");
}

/// Waits until a separate subscriber has received `frames` more frames, and returns the number that it has missed.
fn further_frames(watched: &Lines, frames: u64) -> u64 {
    let deadline = Instant::now() + harness::patience();
    let mut first = None;
    while Instant::now() < deadline {
        let line: Value = serde_json::from_str(&watched.until("\"received\"")).unwrap();
        let received = line["received"].as_u64().unwrap();
        if received >= *first.get_or_insert(received) + frames {
            return line["missed"].as_u64().unwrap();
        }
    }
    panic!("no {frames} frames")
}

/// Starts a sender of each kind, and waits until each is connected.
fn senders(name: &str) -> [Process; 3] {
    let ((psn, to_psn), (osc, to_osc)) = (listener(), listener());
    let psn_sender = Process::start(program(name).args(["send", "psn", "--to", &to_psn]));
    let osc_sender = Process::start(program(name).args(["send", "osc", "--to", &to_osc]));
    let mut metrics = Process::start(program(name).args(["metrics", "--json", "--listen", "127.0.0.1:0"]));
    let ready: Value = serde_json::from_str(&metrics.first_line()).unwrap();
    psn.recv(&mut [0; 1500]).unwrap();
    osc.recv(&mut [0; 1500]).unwrap();
    let mut tries =
        (0..harness::patience().as_secs() * 10).map(|_| harness::http_get(ready["url"].as_str().unwrap(), "*/*"));
    let is_connected = |answer: String| {
        // A figure that exists only after a frame.
        let connected = answer.contains("bench_dragon_simulated_time_seconds{");
        if !connected {
            wait(0.1);
        }
        connected
    };
    assert!(tries.any(is_connected), "no metrics");
    [psn_sender, osc_sender, metrics]
}

#[test]
fn a_sender_that_is_killed_or_stopped_costs_nobody_a_frame() {
    let name = "kills";
    let publisher = publisher(name, &["--start", "100", "--loop", "--duration", "3600"]);
    let mut watch = Process::start(program(name).args(["watch", "--json"]));
    let watched = watch.lines();
    further_frames(&watched, 1);
    for round in 0..if long() { 100 } else { 2 } {
        let senders = senders(name);
        for sender in &senders {
            sender.stop();
        }
        // The loop waits for none of them: more frames than their queues hold.
        assert_eq!(further_frames(&watched, QUEUE + 64), 0, "round {round}");
        // Some are killed while they are stopped, some after they have continued.
        if round % 2 == 0 {
            senders.iter().for_each(|sender| sender.signal(Signal::SIGCONT));
        }
        senders.iter().for_each(|sender| sender.signal(Signal::SIGKILL));
        drop(senders);
        assert_eq!(further_frames(&watched, 1), 0, "round {round}");
    }
    let run = end(publisher);
    println!("{run}");
    watch.signal(Signal::SIGTERM);
    let last = watched.rest().pop();
    assert!(last.is_none_or(|last| last.contains("\"missed\":0")), "the other subscriber missed frames");
}
