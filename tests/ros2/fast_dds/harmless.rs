//! Needs of a Fast DDS subscriber without which it hangs or is lost: whole messages, and silence towards dead processes.

use std::collections::BTreeSet;
use std::net::{Ipv4Addr, UdpSocket};
use std::time::{Duration, Instant};

use super::*;

/// Returns the UDP ports of a process that are bound to all addresses, from the kernel's table.
fn ports(process: u32) -> BTreeSet<u16> {
    let folder = format!("/proc/{process}/fd");
    let links = fs::read_dir(folder).unwrap().flatten().filter_map(|entry| fs::read_link(entry.path()).ok());
    let inodes: BTreeSet<String> =
        links.filter_map(|link| Some(link.to_str()?.strip_prefix("socket:[")?.strip_suffix(']')?.to_owned())).collect();
    let table = fs::read_to_string("/proc/net/udp").unwrap();
    let port = |line: &str| {
        let columns: Vec<&str> = line.split_whitespace().collect();
        let port = u16::from_str_radix(columns.get(1)?.strip_prefix("00000000:")?, 16).ok()?;
        inodes.contains(*columns.get(9)?).then_some(port)
    };
    table.lines().filter_map(port).collect()
}

/// The next process takes the ports of a dead one, and Fast DDS hangs on messages that are not meant for it. The lease
/// here is a day.
#[test]
fn the_ports_of_a_killed_subscriber_are_silent_within_seconds() {
    if !can_run(peer_program().map(drop)) {
        return;
    }
    let name = "silent_ports";
    let publisher = publisher(name, &["run", "--json", "--ros2", "--start", "50", "--duration", "6000"]);
    let mut other = Process::start(&mut subscriber(name, "poses", &["--seconds", "3000", "--lease", "86400"]));
    let others = other.lines();
    others.until(SAMPLE);
    let mut killed = Process::start(&mut subscriber(name, "poses", &["--seconds", "3000", "--lease", "86400"]));
    let received = killed.lines();
    received.until(SAMPLE);
    let ports = ports(killed.id());
    assert!(ports.len() >= 2, "{ports:?}");
    drop(killed);
    // User traffic has odd numbers, discovery even ones (RTPS 2.5, section 9.6.2.3). RustDDS calls the ports of discovery
    // of a hundred possible participants.
    let sockets: Vec<UdpSocket> = ports
        .iter()
        .filter(|port| *port % 2 == 1)
        .filter_map(|port| UdpSocket::bind((Ipv4Addr::UNSPECIFIED, *port)).ok())
        .collect();
    assert!(!sockets.is_empty(), "{ports:?}");
    sockets.iter().for_each(|socket| socket.set_nonblocking(true).unwrap());
    let mut silent_since = Instant::now();
    let limit = Instant::now() + Duration::from_secs(60);
    // At 60 messages a second, half a second without any is the end of them.
    while silent_since.elapsed() < Duration::from_millis(500) {
        assert!(Instant::now() < limit, "still messages after a minute");
        let heard = sockets.iter().filter(|socket| socket.recv(&mut [0; 65_536]).is_ok()).count();
        if heard > 0 {
            silent_since = Instant::now();
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    // The show continues for the other one.
    others.until(SAMPLE);
    stopped(publisher);
}

/// RustDDS takes a number whose port for discovery is free, also where the second port of that number is taken. Its readers
/// would send their acknowledgements to the taken port.
#[test]
fn a_publisher_is_heard_where_its_usual_port_is_taken() {
    if !can_run(peer_program().map(drop)) {
        return;
    }
    let name = "taken_port";
    // A domain of its own, with the ports that RTPS 2.5 gives it (section 9.6.2.3).
    let domain = 10 + (std::process::id() % 10) as u16;
    let _taken = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 7411 + 250 * domain)).unwrap();
    let domain = domain.to_string();
    let mut run = program(name);
    run.env("ROS_DOMAIN_ID", &domain).args(["run", "--json", "--ros2", "--start", "50", "--duration", "6000"]);
    let publisher = answering(Process::start(&mut run), || program(name));
    // The second one requests a message of before.
    let _subscribers = [(); 2].map(|()| {
        let mut late = subscriber(name, "stage", &["--transient-local", "--seconds", "3000"]);
        let mut process = Process::start(late.args(["--domain", &domain]));
        process.lines().until(SAMPLE);
        process
    });
    stopped(publisher);
}

/// A message of 223 benches, 9 or 12 kB, comes as DATA and never as DATA_FRAG: Fast DDS 2.14 hangs when a GAP names a
/// message of which it has a part.
#[test]
fn a_message_for_a_reader_on_this_machine_is_not_divided() {
    if !can_run(peer_program().map(drop).and_then(|()| harness::root("to see packets"))) {
        return;
    }
    let name = "undivided";
    let publisher = publisher(name, &["run", "--json", "--ros2", "--start", "50", "--duration", "6000"]);
    for topic in ["poses", "handles"] {
        let mut subscriber = Process::start(&mut subscriber(name, topic, &["--seconds", "3000"]));
        let received = subscriber.lines();
        received.until(SAMPLE);
        let ports: Vec<String> = ports(subscriber.id()).iter().map(u16::to_string).collect();
        let mut wire = harness::python();
        let wire = wire.args(["tests/python/ros2_wire.py", "--messages", "30", "--ports", &ports.join(",")]);
        let printed = Process::start(wire).lines().rest();
        assert_eq!(printed.last().unwrap(), r#"{"data": 30, "data_frag": 0}"#, "{topic}: {printed:?}");
        drop(received);
    }
    stopped(publisher);
}

/// 5,000 benches: 200 kB a message. What a burst of datagrams loses comes again in time. Without that a reliable reader
/// gets a fifth.
#[test]
fn a_reliable_subscriber_gets_the_messages_of_a_large_team() {
    // The share depends on the processor time that the subscriber gets.
    if !long() || !can_run(peer_program().map(drop)) {
        return;
    }
    let name = "large_team";
    let scene = scene_file(name, &[("benches = 223", "benches = 5000"), ("start_turn = 16", "start_turn = 60")]);
    let show = ["--scene", scene.to_str().unwrap(), "run", "--json", "--ros2", "--duration", "6000"];
    let publisher = publisher(name, &show);
    for topic in ["handles", "poses"] {
        let limits = ["--samples", "500", "--linger", "0", "--seconds", "120", "--depth", "10"];
        let printed = Process::start(&mut subscriber(name, topic, &limits)).lines().rest();
        let numbers: Vec<u64> = json_numbers(&printed);
        let sent = numbers.last().unwrap() - numbers.first().unwrap() + 1;
        println!("{topic}: {} of {sent} messages", numbers.len());
        assert!(numbers.len() as u64 * 20 >= sent * 19, "{topic}: {} of {sent}", numbers.len());
    }
    stopped(publisher);
}

/// Returns the writer's numbers of the samples that a subscriber has printed.
fn json_numbers(printed: &[String]) -> Vec<u64> {
    let samples = printed.iter().map(|line| serde_json::from_str::<Value>(line).unwrap());
    samples.filter(|line| line["type"] == "sample").map(|line| line["sequence"].as_u64().unwrap()).collect()
}

/// A volatile subscription gets no message of before it, also where another one of its process requests the history.
#[test]
fn a_late_volatile_subscriber_gets_nothing_old_beside_a_transient_local_one() {
    if !can_run(peer_program().map(drop)) {
        return;
    }
    let name = "beside";
    let publisher = publisher(name, &["run", "--json", "--ros2", "--start", "50", "--duration", "6000"]);
    for topic in ["path", "stage"] {
        let both = ["--transient-local", "--beside", "--samples", "1", "--linger", "2", "--seconds", "60"];
        let end = end(&Process::start(&mut subscriber(name, topic, &both)).lines().rest());
        assert_eq!((&end["samples"], &end["beside"]), (&Value::from(1), &Value::from(0)), "{topic}: {end}");
    }
    stopped(publisher);
}

/// rcl keeps a line for ten seconds, as the writer's lifespan.
#[test]
fn a_late_subscriber_of_rosout_gets_the_lines_of_ten_seconds() {
    if !can_run(peer_program().map(drop)) {
        return;
    }
    let name = "rosout_age";
    // A level that changes each second or so: a loop of two seconds before the contact.
    let publisher = publisher(name, &["run", "--json", "--ros2", "--start", "410", "--loop", "--duration", "6000"]);
    let log = |arguments: &[&str]| {
        Process::start(&mut peer(&[&["subscribe", "rosout", "rcl_interfaces::msg::dds_::Log_"], arguments].concat()))
    };
    let mut first = log(&["--transient-local", "--seconds", "3000"]);
    let lines = first.lines();
    let source = |line: &str| serde_json::from_str::<Value>(line).unwrap()["source_ns"].as_u64().unwrap();
    // The topic has the lines of all publishers of the domain.
    let node = hex(unique(name).as_bytes());
    let is_own = |line: &str| line.contains(SAMPLE) && line.contains(&node);
    let next = || source(lines.all_until_one(is_own, "a line of this show").last().unwrap());
    let begin = next();
    while next() < begin + 15_000_000_000 {}
    let mut late = log(&["--transient-local", "--depth", "100", "--seconds", "3"]);
    let printed = late.lines().rest();
    let made = serde_json::from_str::<Value>(&printed[0]).unwrap()["made_ns"].as_u64().unwrap();
    let samples: Vec<u64> = printed.iter().filter(|line| is_own(line)).map(|line| source(line)).collect();
    assert!(!samples.is_empty(), "{printed:?}");
    // A busy machine takes some time from the reader's creation to its discovery.
    assert!(samples.iter().all(|source| source + 10_500_000_000 > made), "{made} {samples:?}");
    assert!(samples.iter().any(|source| *source < made), "no line is kept: {made} {samples:?}");
    stopped(publisher);
}
