//! The feed that every subscriber command stands on, with real publishers that come and go between its polls.
//!
//! Every wait has a deadline, and nothing asserts a speed.

mod processes;

use std::time::{Duration, Instant};

use bench_dragon::subscribers::connection::Wake;
use bench_dragon::subscribers::feed::{Feed, FeedEvent, FeedOptions, Frames};
use nix::sys::signal::Signal::SIGKILL;
use processes::{Process, program, summary, unique, wait};

/// What a feed has handed over, in order: frames by their run and sequence, and how many were missed before each.
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
        FeedEvent::Stage(_) | FeedEvent::Alert(_) | FeedEvent::Cue(_) | FeedEvent::Status(_) => (),
    });
    polled.unwrap();
}

fn poll_until(feed: &mut Feed, seen: &mut Vec<Seen>, condition: impl Fn(&[Seen]) -> bool) {
    let deadline = Instant::now() + Duration::from_secs(20);
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

/// The first and the last sequence of a run, the frames received, and those missed.
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
    for frames in [Frames::All, Frames::Newest] {
        let name = format!("restart_{frames:?}");
        let mut feed = Feed::new(&unique(&name), FeedOptions { wake: Wake::OnFrame, frames }).unwrap();
        let mut seen = Vec::new();
        let first = publisher(&name, &["--rate", "100", "--duration", "2"]);
        poll_until(&mut feed, &mut seen, |seen| seen.len() > 10);
        let published = summary(&first.output_within(20))["frames"].as_u64().unwrap();
        let second = publisher(&name, &["--rate", "100"]);
        wait(1.5);
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

#[test]
fn the_newest_frame_is_one_a_poll_and_the_rest_is_counted() {
    let mut feed = Feed::new(&unique("newest"), FeedOptions { wake: Wake::Never, frames: Frames::Newest }).unwrap();
    let publisher = publisher("newest", &["--rate", "500"]);
    let mut seen = Vec::new();
    poll_until(&mut feed, &mut seen, |seen| !seen.is_empty());
    for _ in 0..20 {
        wait(0.03);
        let before = seen.len();
        poll(&mut feed, &mut seen);
        assert!(seen.len() <= before + 1, "{seen:?}");
    }
    let [run] = runs(&seen)[..] else { panic!("{seen:?}") };
    let (first, last, received, missed) = span(&seen, run);
    assert_eq!(received + missed, last - first + 1, "{seen:?}");
    assert!(missed > received, "{seen:?}");
    drop(publisher);
}
