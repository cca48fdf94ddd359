//! The loop itself allocates nothing after its first frame. Allocations are counted over the whole loop, across a
//! contact and a loop of the show. The shared memory and the log are real.
//!
//! iceoryx2 0.10.0 keeps the state of each loaned sample in an `Rc`, made by `loan` and freed by `send`. This is one
//! small allocation for every frame and every alert, which its interface does not avoid. The test demands exactly
//! these.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, Ordering};

use bench_dragon::client::clock::SystemClock;
use bench_dragon::client::connection::{Subscription, Wake};
use bench_dragon::messages::control::Command;
use bench_dragon::messages::state::FrameState;
use bench_dragon::motion::event::unreported;
use bench_dragon::publisher::live::show_source::ShowSource;
use bench_dragon::publisher::live::statistics::queues;
use bench_dragon::publisher::live::{FrameSource, LoopOptions, Period, run_loop};
use bench_dragon::publisher::log;
use bench_dragon::publisher::log::arithmetic::Arithmetic;
use bench_dragon::publisher::log::lines::ShowLine;
use bench_dragon::publisher::run::open_transports;
use bench_dragon::publisher::transports::TransportConfig;
use bench_dragon::show::convert::{Stamps, stage};
use bench_dragon::show::scene::{AtEnd, Scene, SceneText, SinglePrecision};
use bench_dragon::show::{Outcome, Playback, Show};

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, with a count of each thread's calls.
struct Counting;

// SAFETY: every call goes to the system's allocator unchanged. Counting touches a thread-local number that is
// initialised at compile time and has no destructor, so that it never allocates itself.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations() -> u64 {
    ALLOCATIONS.with(Cell::get)
}

/// Frames after which the run ends, however long the machine takes for them: more than three rounds of the show.
const FRAMES: u64 = 1000;

/// A show that records the number of allocations at its second frame, and the states that it showed. It sets the stop
/// flag with its last frame.
struct Watched<'a> {
    show: ShowSource,
    stop: &'a AtomicBool,
    frames: u64,
    before: Option<u64>,
    /// Samples loaned from iceoryx2 since then: a frame each in double and in single precision, and its alerts.
    loans: u64,
    states: [u64; 6],
    shows_played: u64,
}

impl FrameSource for Watched<'_> {
    fn frame(&mut self, tick: u64, stamps: Stamps) -> Period<'_> {
        self.frames += 1;
        self.stop.store(self.frames == FRAMES, Ordering::Relaxed);
        if self.frames > 1 {
            self.before = self.before.or(Some(allocations()));
        }
        let outgoing = self.show.outgoing(tick, stamps);
        if self.frames > 1 {
            self.loans += 2 + outgoing.alerts.len() as u64;
        }
        self.states[outgoing.header.state as usize] += 1;
        self.shows_played = outgoing.counts.shows_played;
        Period::Frame(outgoing)
    }

    fn command(&mut self, tick: u64, command: Command) -> Option<Outcome> {
        self.show.command(tick, command)
    }

    fn finished_step(&mut self, tick: u64) -> Option<Outcome> {
        self.show.finished_step(tick)
    }
}

#[test]
fn the_loop_allocates_nothing_of_its_own_after_its_first_frame() {
    let scene = Scene { single_precision: Some(SinglePrecision { every: 7 }), ..Scene::paper() };
    let playback = Playback {
        start: 400.0,
        rate: 500.0,
        time_scale: 20.0,
        at_end: AtEnd::Loop,
        end_hold: 0.0,
        ..Playback::of(&scene)
    };
    let timeline = scene.ensemble.timeline(&mut unreported);
    let show = Show::new(&scene, timeline, playback).unwrap();
    let name = format!("test_{}_allocation", std::process::id());
    let stage = stage(1, 0, [0; 32], &scene.ensemble, &show);
    let config = TransportConfig::of(&name, &scene, &stage);
    let (mut transports, mut commands) = open_transports(&config).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let line = ShowLine::new(&SceneText::paper(), &playback, Arithmetic::of(&scene), "", 1, 2);
    transports.push(log::open(&folder.path().join("log"), line, scene.ensemble.handles()).unwrap().0);
    let mut publishers: Vec<_> = transports.iter_mut().map(|transport| transport.publisher().unwrap()).collect();
    let subscription = Subscription::new(&name, Wake::OnFrame).unwrap();
    let mut connection = subscription.connect().unwrap().unwrap();
    let (reports, _inbox) = queues();
    let options = LoopOptions { run_id: 1, rate: 500.0, periods: None };
    let stop = AtomicBool::new(false);
    let show = ShowSource::new(show);
    let mut watched = Watched { show, stop: &stop, frames: 0, before: None, loans: 0, states: [0; 6], shows_played: 0 };
    let counts = run_loop(&SystemClock, &mut watched, &mut commands, &mut publishers, options, reports, &stop).unwrap();
    let during = allocations() - watched.before.unwrap();
    assert_eq!(during, watched.loans, "the loop allocates more than iceoryx2's loans do, in {counts:?}");
    drop(publishers);
    for (name, counters) in transports.into_iter().filter_map(|transport| transport.finish()) {
        assert!(counters.frames > 0, "{name}: {counters:?}");
    }
    // Without these the test would not cover alerts, contacts and loops.
    assert_eq!(counts.frames, FRAMES);
    assert!(watched.states[FrameState::Approaching as usize] > 0 && watched.states[FrameState::Contact as usize] > 0);
    assert!(watched.shows_played >= 2, "{}", watched.shows_played);
    assert!(connection.frames(|header, handles| assert_eq!(header.handles as usize, handles.len())) > 0);
}
