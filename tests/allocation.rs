//! The loop allocates nothing of its own after its first frame: counted over its whole body, with the real shared
//! memory and the real ROS 2 publisher, across a contact and a loop of the show.
//!
//! iceoryx2 0.10.0 keeps the bookkeeping of each loaned sample in an `Rc`, made by `loan` and freed by `send`: one small
//! allocation for every frame and every alert, which its interface leaves no way round. The test demands exactly those.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::AtomicBool;

use bench_dragon::live::statistics::queues;
use bench_dragon::live::{Frames, LoopOptions, Publisher, run_loop};
use bench_dragon::scene::{AtEnd, Scene};
use bench_dragon::show::state::FrameState;
use bench_dragon::show::{Frame, Playback, Show};
use bench_dragon::subscribers::connection::{Subscription, Wake};
use bench_dragon::transports::iceoryx2::{PublisherConfig, SharedMemoryPublisher};
use bench_dragon::wire::convert::stage;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counting each thread's calls.
struct Counting;

// SAFETY: every call goes to the system's allocator unchanged; counting touches a thread-local number that is
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

/// A show that remembers what had been allocated when its second frame was asked for, and which states it showed.
struct Watched {
    show: Show,
    before: Option<u64>,
    /// Samples loaned from iceoryx2 since then: a frame each, and its alerts.
    loans: u64,
    states: [u64; 6],
    shows_played: u64,
}

impl Frames for Watched {
    fn frame(&mut self, tick: u64) -> &Frame {
        if tick > 0 {
            self.before = self.before.or(Some(allocations()));
        }
        let frame = self.show.frame(tick);
        if tick > 0 {
            self.loans += 1 + frame.alerts.len() as u64;
        }
        self.states[frame.state as usize] += 1;
        self.shows_played = frame.shows_played;
        frame
    }
}

#[test]
fn the_loop_allocates_nothing_of_its_own_after_its_first_frame() {
    let scene = Scene::paper();
    let playback =
        Playback { start: 400.0, rate: 500.0, time_scale: 20.0, at_end: AtEnd::Loop, ..Playback::of(&scene) };
    let timeline = scene.motion.timeline(&mut |_| ());
    let show = Show::new(&scene, timeline, playback).unwrap();
    let name = format!("test_{}_allocation", std::process::id());
    let config = PublisherConfig {
        name: name.clone(),
        handles: scene.team().handles(),
        queue: 64,
        subscribers: 8,
        alerts: true,
        stage: stage(1, 0, &scene.motion),
    };
    let mut publishers: Vec<Box<dyn Publisher>> = vec![Box::new(SharedMemoryPublisher::open(&config).unwrap())];
    #[cfg(feature = "ros2")]
    let ros2_thread = {
        use bench_dragon::scene::ros2::Ros2Settings;
        use bench_dragon::transports::ros2::environment::{Network, Range};
        let settings = Ros2Settings { rate: Some(100.0), ..Ros2Settings::default() };
        let config = bench_dragon::transports::ros2::Ros2Config {
            name: name.clone(),
            handles: scene.team().handles(),
            loop_rate: 500.0,
            settings,
            alerts: true,
            stage: config.stage,
        };
        let network = Network { domain: 93, range: Range::Localhost };
        let (publisher, _status, thread) = bench_dragon::transports::ros2::start(config, network).unwrap();
        publishers.push(Box::new(publisher));
        thread
    };
    let subscription = Subscription::new(&name, Wake::OnFrame).unwrap();
    let connection = subscription.connect().unwrap().unwrap();
    let (reports, _inbox) = queues();
    let options = LoopOptions { run_id: 1, rate: 500.0, periods: Some(1000) };
    let mut watched = Watched { show, before: None, loans: 0, states: [0; 6], shows_played: 0 };
    let counts = run_loop(&mut watched, &mut publishers, options, reports, &AtomicBool::new(false)).unwrap();
    let during = allocations() - watched.before.unwrap();
    assert_eq!(during, watched.loans, "the loop allocates more than iceoryx2's loans do, in {counts:?}");
    #[cfg(feature = "ros2")]
    assert!(ros2_thread.end().frames > 100);
    // Without these the test would prove nothing about alerts, contacts and loops.
    assert!(counts.frames > 500, "{counts:?}");
    assert!(watched.states[FrameState::Approaching as usize] > 0 && watched.states[FrameState::Contact as usize] > 0);
    assert!(watched.shows_played >= 2, "{}", watched.shows_played);
    assert!(connection.frames(|header, handles| assert_eq!(header.handles as usize, handles.len())) > 0);
}
