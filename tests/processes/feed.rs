//! The feed of every subscriber command, with real publishers that come and go between its polls.
//!
//! Every wait has a deadline, and no test asserts a speed.

use crate::harness;

use std::time::{Duration, Instant};

use bench_dragon::client::connection::Wake;
use bench_dragon::client::feed::{Delivery, Feed, FeedEvent, FeedOptions};
use bench_dragon::client::shared_memory::{node, service_name};
use bench_dragon::messages::{CollisionAlert, FrameHeader, HandlePose, SceneHeader, Stage, StageMessage, StageSegment};
use bench_dragon::motion::event::unreported;
use bench_dragon::publisher::live::{Outgoing, Publisher};
use bench_dragon::publisher::transports::iceoryx2::{PublisherConfig, SharedMemoryPublisher};
use bench_dragon::show::convert::stage;
use bench_dragon::show::scene::Scene;
use bench_dragon::show::{Playback, Show};
use harness::{Process, program, summary, unique, wait};
use nix::sys::signal::Signal::{SIGINT, SIGKILL};

/// Events handed over by a feed, in order: frames by their run and sequence, and the number missed before each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Seen {
    Started(u64),
    Frame { run_id: u64, sequence: u64, missed: u64 },
    Silent,
    Gone,
}

fn poll(feed: &mut Feed, seen: &mut Vec<Seen>) {
    let polled = feed.poll(Duration::from_millis(20), &mut |event| match event {
        FeedEvent::Started { run_id } => seen.push(Seen::Started(run_id)),
        FeedEvent::Frame { header, handles, missed } => {
            assert_eq!(header.handles as usize, handles.len());
            seen.push(Seen::Frame { run_id: header.run_id, sequence: header.sequence, missed });
        }
        FeedEvent::Silent => seen.push(Seen::Silent),
        FeedEvent::Gone => seen.push(Seen::Gone),
        FeedEvent::Stage { .. } | FeedEvent::Scene { .. } => {}
        FeedEvent::Alert(_) | FeedEvent::Cue(_) | FeedEvent::Status(_) | FeedEvent::Chase(_) => {}
    });
    polled.unwrap();
}

fn poll_until(feed: &mut Feed, seen: &mut Vec<Seen>, condition: impl Fn(&[Seen]) -> bool) {
    let deadline = Instant::now() + harness::patience();
    while !condition(seen) {
        assert!(Instant::now() < deadline, "{seen:?}");
        poll(feed, seen);
    }
}

fn publisher(name: &str, arguments: &[&str]) -> Process {
    let mut command = program(name);
    Process::start(command.args(["run", "--json", "--scene", "tests/scenes/noalerts.toml"]).args(arguments))
}

fn runs(seen: &[Seen]) -> Vec<u64> {
    let run = |one: &Seen| if let Seen::Started(run_id) = one { Some(*run_id) } else { None };
    seen.iter().filter_map(run).collect()
}

/// Returns the first and the last sequence of a run, the number of frames received, and the number missed.
fn span(seen: &[Seen], of: u64) -> (u64, u64, u64, u64) {
    let frames: Vec<_> = seen
        .iter()
        .filter_map(|one| match one {
            Seen::Frame { run_id, sequence, missed } if *run_id == of => Some((*sequence, *missed)),
            _ => None,
        })
        .collect();
    let missed = frames.iter().map(|(_, missed)| missed).sum();
    (frames.first().unwrap().0, frames.last().unwrap().0, frames.len() as u64, missed)
}

#[test]
fn a_publisher_restarted_between_two_polls_is_a_new_run() {
    for frames in [Delivery::All, Delivery::Newest] {
        let name = format!("restart_{frames:?}");
        let mut feed = Feed::new(&unique(&name), FeedOptions { wake: Wake::OnFrame, frames }).unwrap();
        let mut seen = Vec::new();
        let first = publisher(&name, &["--rate", "100", "--duration", "2"]);
        poll_until(&mut feed, &mut seen, |seen| seen.len() > 10);
        let published = summary(&first.output())["frames"].as_u64().unwrap();
        let second = publisher(&name, &["--rate", "100"]);
        // The feed is not polled until the second publisher publishes, which another process reports.
        let mut monitor = Process::start(program(&name).args(["watch", "--json"]));
        monitor.lines().until("\"state\":\"moving\"");
        drop(monitor);
        poll_until(&mut feed, &mut seen, |seen| runs(seen).len() > 1 && seen.len() > 20);
        second.signal(SIGKILL);
        poll_until(&mut feed, &mut seen, |seen| seen.contains(&Seen::Gone));
        let [one, other] = runs(&seen)[..] else { panic!("{seen:?}") };
        assert_ne!(one, other);
        for run in [one, other] {
            let (first, last, received, missed) = span(&seen, run);
            assert_eq!(received + missed, last - first + 1, "{seen:?}");
            assert!(run == other || last < published, "{seen:?}");
        }
        assert_eq!(seen.iter().filter(|one| **one == Seen::Gone).count(), 1, "{seen:?}");
        assert_eq!(seen.last(), Some(&Seen::Gone), "{seen:?}");
    }
}

/// A publisher starts when the feed is about to find that the one before has gone, 200 ms after its last frame. The
/// feed selects the new publisher from its first frames on.
#[test]
fn a_publisher_that_is_started_again_at_any_moment_is_followed_at_once() {
    const RATE: u64 = 100;
    let mut feed = Feed::new(&unique("again"), FeedOptions { wake: Wake::OnFrame, frames: Delivery::All }).unwrap();
    let mut seen = Vec::new();
    // The queue holds 30 s of frames, however late this machine runs the test.
    let scene = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    let text = include_str!("../scenes/noalerts.toml").to_owned() + "[publish]\nqueue = 3000\n";
    std::fs::write(scene.path(), text).unwrap();
    let delays = [0, 40, 80, 120, 160, 200, 250, 400].map(Duration::from_millis);
    for (number, delay) in delays.into_iter().enumerate() {
        let mut run = program("again");
        run.args(["run", "--json", "--rate", &RATE.to_string(), "--scene"]).arg(scene.path());
        let publisher = Process::start(&mut run);
        let mut polls = Vec::new();
        while runs(&seen).len() == number {
            polls.push(Instant::now());
            poll(&mut feed, &mut seen);
        }
        let (first, ..) = span(&seen, runs(&seen)[number]);
        // An earlier version ignored frames for seconds. Here the machine may not run the feed for seconds: then it is
        // not polled.
        let beside = polls.iter().filter(|at| at.elapsed() < Duration::from_millis(first * 1000 / RATE)).count();
        assert!(first < RATE || beside < 40, "{first} frames before the feed had one, in {beside} polls");
        let of_run = seen.len();
        poll_until(&mut feed, &mut seen, |seen| seen.len() >= of_run + 100);
        publisher.signal(SIGINT);
        let ending = std::thread::spawn(move || publisher.output());
        while !ending.is_finished() {
            poll(&mut feed, &mut seen);
        }
        assert!(ending.join().unwrap().status.success());
        let ended = Instant::now();
        while ended.elapsed() < delay {
            poll(&mut feed, &mut seen);
        }
    }
    poll_until(&mut feed, &mut seen, |seen| seen.last() == Some(&Seen::Gone));
    assert_eq!(runs(&seen).len(), delays.len(), "{seen:?}");
    for run in runs(&seen) {
        let (first, last, received, missed) = span(&seen, run);
        assert_eq!((received, missed), (last - first + 1, 0), "{seen:?}");
    }
    let of_frame = |one: &Seen| if let Seen::Frame { run_id, .. } = one { Some(*run_id) } else { None };
    for (at, _) in seen.iter().enumerate().filter(|(_, one)| **one == Seen::Gone) {
        let before = seen[..at].iter().rev().find_map(of_frame);
        assert!(seen[at..].iter().find_map(of_frame).is_none_or(|after| Some(after) != before), "{seen:?}");
    }
}

/// A publisher gives the subscribers that wait for it 100 ms to connect, at whichever moment they try. A busy machine
/// can delay the opening of a service for longer, so that two shows may lack their first frame. A show in which the
/// machine did not run this test for some time is not counted.
#[test]
fn a_feed_that_waits_for_a_show_gets_the_first_frame() {
    let mut feed = Feed::new(&unique("first"), FeedOptions { wake: Wake::Never, frames: Delivery::All }).unwrap();
    let mut seen = Vec::new();
    let deadline = Instant::now() + harness::patience();
    let (mut complete, mut incomplete) = (0, 0);
    while complete < 8 {
        assert!(
            Instant::now() < deadline,
            "{complete} shows were received from the first frame on; the last: {seen:?}"
        );
        seen.clear();
        let publisher = publisher("first", &["--rate", "50", "--duration", "0.3"]);
        let ending = std::thread::spawn(move || publisher.output());
        let (mut polled, mut longest) = (Instant::now(), Duration::ZERO);
        while !ending.is_finished() {
            poll(&mut feed, &mut seen);
            longest = longest.max(polled.elapsed());
            polled = Instant::now();
        }
        let published = summary(&ending.join().unwrap())["frames"].as_u64().unwrap();
        let ended = Instant::now();
        while seen.last() != Some(&Seen::Gone) && ended.elapsed() < Duration::from_secs(5) {
            poll(&mut feed, &mut seen);
        }
        let is_complete = runs(&seen).first().is_some_and(|run| {
            let (first, last, received, missed) = span(&seen, *run);
            runs(&seen).len() == 1 && (first, last + 1, received + missed) == (0, published, published)
        });
        complete += u32::from(is_complete);
        incomplete += u32::from(!is_complete && longest < Duration::from_millis(80));
        assert!(incomplete <= 2, "{incomplete} shows were not received from the first frame on; the last: {seen:?}");
    }
}

/// A publisher opens its services one after another, the poses first.
#[test]
fn a_feed_is_ready_when_the_stage_and_the_scene_can_be_received() {
    let (name, node) = (unique("ready"), node().unwrap());
    let mut feed = Feed::new(&name, FeedOptions { wake: Wake::Never, frames: Delivery::All }).unwrap();
    let mut poll = || {
        feed.poll(Duration::from_millis(20), &mut |event| panic!("{event:?}")).unwrap();
        (feed.shares_clock().is_some(), feed.is_ready())
    };
    let deadline = Instant::now() + harness::patience();
    let service = |suffix: &str| node.service_builder(&service_name(&name, suffix).unwrap());
    let poses = service("poses").publish_subscribe::<[HandlePose]>().user_header::<FrameHeader>().create().unwrap();
    let _port = poses.publisher_builder().create().unwrap();
    while poll() != (true, false) {
        assert!(Instant::now() < deadline, "no connection");
    }
    let _stage = service("stage").publish_subscribe::<[StageSegment]>().user_header::<Stage>().create().unwrap();
    // Several times the interval at which the feed looks for services.
    assert!((0..10).all(|_| !poll().1), "ready without the scene");
    let _scene = service("scene").publish_subscribe::<[u8]>().user_header::<SceneHeader>().create().unwrap();
    while poll() != (true, true) {
        assert!(Instant::now() < deadline, "never ready");
    }
}

#[test]
fn the_newest_frame_is_one_a_poll_and_the_rest_is_counted() {
    let mut feed = Feed::new(&unique("newest"), FeedOptions { wake: Wake::Never, frames: Delivery::Newest }).unwrap();
    let publisher = publisher("newest", &["--rate", "500"]);
    let mut seen = Vec::new();
    poll_until(&mut feed, &mut seen, |seen| !seen.is_empty());
    for _ in 0..20 {
        wait(0.03);
        let before = seen.len();
        poll(&mut feed, &mut seen);
        // Beside the frame there may be the news that a busy machine holds the publisher up.
        let frames = seen[before..].iter().filter(|one| matches!(one, Seen::Frame { .. })).count();
        assert!(frames <= 1, "{seen:?}");
    }
    let [run] = runs(&seen)[..] else { panic!("{seen:?}") };
    let (first, last, received, missed) = span(&seen, run);
    assert_eq!(received + missed, last - first + 1, "{seen:?}");
    assert!(missed > received, "{seen:?}");
    drop(publisher);
}

fn opened(name: &str, scene: &Scene, cues: usize, stage: StageMessage) -> SharedMemoryPublisher {
    let config = PublisherConfig {
        name: name.to_owned(),
        handles: scene.ensemble.handles(),
        single_precision: None,
        queue: 64,
        subscribers: 2,
        alerts: true,
        cues,
        scene: String::new(),
        stage,
    };
    SharedMemoryPublisher::open(&config).unwrap()
}

/// A process that keeps the services of a scene with few cues open does not block a scene with more.
#[test]
fn a_scene_with_more_cues_finds_its_services_open() {
    let scene = Scene::paper();
    let show = Show::new(&scene, scene.ensemble.timeline(&mut unreported), Playback::of(&scene)).unwrap();
    let name = unique("more_cues");
    let open = |cues| opened(&name, &scene, cues, stage(cues as u64, 0, [0; 32], &scene.ensemble, &show));
    let _few = open(3);
    let _more = open(40);
}

/// The first of two publishers sends no frames, and has a stage. Nothing is taken for the show's data before a frame
/// has come, and the show's stage comes before that frame.
#[test]
fn what_is_handed_over_belongs_to_the_frames_from_the_beginning() {
    let scene = Scene::paper();
    let mut show = Show::new(&scene, scene.ensemble.timeline(&mut unreported), Playback::of(&scene)).unwrap();
    let name = unique("beside");
    let stages = [7, 8].map(|run_id| stage(run_id, 0, [0; 32], &scene.ensemble, &show));
    let [mut bystander, mut sender] = stages.map(|stage| opened(&name, &scene, 0, stage));
    let mut feed = Feed::new(&name, FeedOptions { wake: Wake::Never, frames: Delivery::All }).unwrap();
    let mut runs = Vec::new();
    let mut poll = |runs: &mut Vec<(&'static str, u64)>| {
        let polled = feed.poll(Duration::from_millis(20), &mut |event| match event {
            FeedEvent::Stage { stage, .. } => runs.push(("stage", stage.run_id)),
            FeedEvent::Scene { header, .. } => runs.push(("scene", header.run_id)),
            FeedEvent::Started { run_id } => runs.push(("started", run_id)),
            FeedEvent::Frame { header, .. } => runs.push(("frame", header.run_id)),
            other => panic!("{other:?}"),
        });
        polled.unwrap();
    };
    for _ in 0..20 {
        bystander.maintain();
        sender.maintain();
        poll(&mut runs);
    }
    assert_eq!(runs, []);
    let deadline = Instant::now() + harness::patience();
    let mut sequence = 0;
    while runs.len() < 10 {
        assert!(Instant::now() < deadline, "{runs:?}");
        let header = FrameHeader { run_id: 8, sequence, handles: 224, ..FrameHeader::default() };
        sender.publish(Outgoing::new(&header, show.frame(sequence))).unwrap();
        bystander.maintain();
        sender.maintain();
        poll(&mut runs);
        sequence += 1;
    }
    assert_eq!(runs[..4], [("stage", 8), ("scene", 8), ("started", 8), ("frame", 8)]);
    assert!(runs[4..].iter().all(|one| *one == ("frame", 8)), "{runs:?}");
}

/// A publisher delivers the stage to a late subscriber with its next maintenance, a frame and its alert at once. The
/// alert waits for the stage, which names the alert's benches.
#[test]
fn an_alert_follows_the_stage_of_its_run() {
    let scene = Scene::paper();
    let mut show = Show::new(&scene, scene.ensemble.timeline(&mut unreported), Playback::of(&scene)).unwrap();
    let name = unique("alert_order");
    let mut sender = opened(&name, &scene, 0, stage(8, 0, [0; 32], &scene.ensemble, &show));
    let mut feed = Feed::new(&name, FeedOptions { wake: Wake::Never, frames: Delivery::All }).unwrap();
    let mut seen = Vec::new();
    let mut poll = |seen: &mut Vec<&'static str>| {
        let polled = feed.poll(Duration::from_millis(20), &mut |event| match event {
            FeedEvent::Stage { .. } => seen.push("stage"),
            FeedEvent::Frame { .. } => seen.push("frame"),
            FeedEvent::Alert(alert) => seen.push(if alert.run_id == 8 { "alert" } else { "foreign alert" }),
            _ => (),
        });
        polled.unwrap();
    };
    let deadline = Instant::now() + harness::patience();
    let mut sequence = 0;
    // An alert with each frame, as many as it takes until the feed has connected.
    while !seen.contains(&"frame") {
        assert!(Instant::now() < deadline, "{seen:?}");
        let header = FrameHeader { run_id: 8, sequence, handles: 224, ..FrameHeader::default() };
        let alert = CollisionAlert { run_id: 8, tick: sequence, ..CollisionAlert::default() };
        sender.publish(Outgoing { alerts: &[alert], ..Outgoing::new(&header, show.frame(sequence)) }).unwrap();
        poll(&mut seen);
        sequence += 1;
    }
    assert!(seen.iter().all(|one| *one == "frame"), "{seen:?}");
    sender.maintain();
    while !seen.contains(&"alert") {
        assert!(Instant::now() < deadline, "{seen:?}");
        poll(&mut seen);
    }
    let first = |kind| seen.iter().position(|one| *one == kind);
    assert!(first("stage").unwrap() < first("alert").unwrap(), "{seen:?}");
    // An alert is handed over without a stage that never comes.
    let name = unique("alert_alone");
    let mut sender = opened(&name, &scene, 0, stage(9, 0, [0; 32], &scene.ensemble, &show));
    let mut feed = Feed::new(&name, FeedOptions { wake: Wake::Never, frames: Delivery::All }).unwrap();
    let mut alerts = 0;
    for sequence in 0.. {
        assert!(Instant::now() < deadline, "no alert");
        let header = FrameHeader { run_id: 8, sequence, handles: 224, ..FrameHeader::default() };
        let alert = CollisionAlert { run_id: 8, tick: sequence, ..CollisionAlert::default() };
        sender.publish(Outgoing { alerts: &[alert], ..Outgoing::new(&header, show.frame(sequence)) }).unwrap();
        feed.poll(Duration::from_millis(20), &mut |event| alerts += u32::from(matches!(event, FeedEvent::Alert(_))))
            .unwrap();
        if alerts > 0 {
            break;
        }
    }
}
