//! The queue, the thread and the rate divider, with a sink that a test can hold up.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, Sender, channel};

use proptest::prelude::*;

use super::*;
use crate::live::show_source::FrameMessages;
use bench_dragon_messages::state::Level;
use bench_dragon_show::alerts::Alert;
use bench_dragon_show::convert::Stamps;
use bench_dragon_show::{Frame, ReachedCue};

const HANDLES: usize = 3;

/// A message that a sink got.
#[derive(Debug, PartialEq)]
enum Sent {
    Frame { tick: u64, x: Vec<f64> },
    Alert { tick: u64 },
    Cue { tick: u64, number: u32 },
    Status { tick: u64 },
}

/// A sink that sends nothing while the test holds the lock.
struct Recorder {
    sent: Sender<Sent>,
    gate: Arc<Mutex<()>>,
}

impl Recorder {
    fn send(&self, sent: Sent) {
        let _open = self.gate.lock().unwrap();
        self.sent.send(sent).unwrap();
    }
}

impl Sink for Recorder {
    fn frame(&mut self, header: &FrameHeader, handles: &[HandlePose]) {
        self.send(Sent::Frame { tick: header.tick, x: handles.iter().map(|pose| pose.x).collect() });
    }

    fn alert(&mut self, alert: CollisionAlert) {
        self.send(Sent::Alert { tick: alert.tick });
    }

    fn cue(&mut self, cue: Cue) {
        self.send(Sent::Cue { tick: cue.tick, number: cue.number });
    }

    fn status(&mut self, status: &LoopStatus) {
        self.send(Sent::Status { tick: status.tick });
    }

    fn discarded(&self) -> u64 {
        7
    }

    fn linger(&self) -> Duration {
        Duration::ZERO
    }
}

type Ends = (BackgroundPublisher, BackgroundStatus, BackgroundThread);

fn recorder(loop_rate: f64, rate: f64) -> (Ends, Receiver<Sent>, Arc<Mutex<()>>) {
    let (sent, receiver) = channel();
    let gate = Arc::new(Mutex::new(()));
    let sink = Recorder { sent, gate: Arc::clone(&gate) };
    let config = BackgroundConfig { name: "test", handles: HANDLES, cues: 2, loop_rate, rate };
    (start(config, move || Ok::<_, std::io::Error>(sink)).unwrap(), receiver, gate)
}

fn frame(tick: u64, alerts: usize) -> Frame {
    let mut frame = Frame { tick, sim_time: tick as f64, ..Frame::new(HANDLES) };
    frame.chain.x.iter_mut().enumerate().for_each(|(handle, x)| *x = (10 * tick + handle as u64) as f64);
    frame.alerts = vec![Alert { level: Level::Clear, event: None, nearest: None }; alerts];
    frame
}

fn publish(publisher: &mut BackgroundPublisher, tick: u64, alerts: usize) {
    publish_frame(publisher, &frame(tick, alerts));
}

fn publish_frame(publisher: &mut BackgroundPublisher, frame: &Frame) {
    let stamps = Stamps { run_id: 0, sequence: 0, stamp_ns: 0, deadline_ns: 0 };
    publisher.publish(FrameMessages::default().of(frame, stamps)).unwrap();
}

#[test]
fn what_is_published_is_sent_in_order_and_whole() {
    let ((mut publisher, mut status, thread), sent, _) = recorder(60.0, 60.0);
    for tick in 0..4 {
        publish(&mut publisher, tick, usize::from(tick == 2));
    }
    status.publish_status(&LoopStatus { tick: 3, ..LoopStatus::default() });
    drop((publisher, status));
    assert_eq!(thread.finish(), TransportCounters { frames: 4, skipped: 0, discarded: 7 });
    let all: Vec<Sent> = sent.iter().collect();
    let ticks = |of: fn(&Sent) -> Option<u64>| all.iter().filter_map(of).collect::<Vec<_>>();
    assert_eq!(ticks(|sent| if let Sent::Frame { tick, .. } = sent { Some(*tick) } else { None }), [0, 1, 2, 3]);
    assert_eq!(ticks(|sent| if let Sent::Alert { tick } = sent { Some(*tick) } else { None }), [2]);
    assert_eq!(ticks(|sent| if let Sent::Status { tick } = sent { Some(*tick) } else { None }), [3]);
    assert!(all.contains(&Sent::Frame { tick: 3, x: vec![30.0, 31.0, 32.0] }), "{all:?}");
}

#[test]
fn a_sink_that_is_held_up_costs_frames_and_never_the_loop() {
    let ((mut publisher, _status, thread), sent, gate) = recorder(60.0, 60.0);
    let depth = queue_depth(HANDLES, 60.0) as u64;
    let held = gate.lock().unwrap();
    // This would never return if the loop's end waited for the sink.
    for tick in 0..10 * depth {
        publish(&mut publisher, tick, usize::from(tick == 9 * depth));
    }
    drop(held);
    while !matches!(sent.recv_timeout(Duration::from_secs(10)).unwrap(), Sent::Alert { .. }) {}
    // Until the queue is empty and has room.
    while sent.recv_timeout(Duration::from_millis(500)).is_ok() {}
    // Once free, the sink sends the frame left of the burst, and then this one.
    publish(&mut publisher, 10 * depth, 0);
    drop(publisher);
    let done = thread.finish();
    assert_eq!(done.frames + done.skipped, 10 * depth + 1, "{done:?}");
    assert!(done.skipped >= 8 * depth, "{done:?}");
    let last =
        sent.iter().filter_map(|sent| if let Sent::Frame { tick, .. } = sent { Some(tick) } else { None }).last();
    assert_eq!(last, Some(10 * depth));
}

/// A sink so slow that two frames, an alert with every tenth, and a status come while it sends one.
struct Overloaded {
    loop_end: BackgroundPublisher,
    statuses: BackgroundStatus,
    next: u64,
    sent: Rc<RefCell<Vec<Sent>>>,
}

impl Sink for Overloaded {
    fn frame(&mut self, header: &FrameHeader, _handles: &[HandlePose]) {
        self.sent.borrow_mut().push(Sent::Frame { tick: header.tick, x: vec![] });
        for tick in (self.next..1000).take(2) {
            publish(&mut self.loop_end, tick, usize::from(tick % 10 == 0));
            self.statuses.publish_status(&LoopStatus { tick, ..LoopStatus::default() });
            self.next += 1;
        }
    }

    fn alert(&mut self, alert: CollisionAlert) {
        self.sent.borrow_mut().push(Sent::Alert { tick: alert.tick });
    }

    fn cue(&mut self, _cue: Cue) {}

    fn status(&mut self, status: &LoopStatus) {
        self.sent.borrow_mut().push(Sent::Status { tick: status.tick });
    }

    fn discarded(&self) -> u64 {
        0
    }

    fn linger(&self) -> Duration {
        Duration::ZERO
    }
}

#[test]
fn a_sink_that_never_catches_up_keeps_nothing_but_frames_waiting() {
    let config = BackgroundConfig { name: "test", handles: HANDLES, cues: 0, loop_rate: 60.0, rate: 60.0 };
    let (mut loop_end, statuses, inbox) = queues(config);
    let sent = Rc::default();
    publish(&mut loop_end, 0, 1);
    let sink = Overloaded { loop_end, statuses, next: 1, sent: Rc::clone(&sent) };
    let mut worker = Worker::new(sink, inbox, 60.0);
    worker.send(&SystemClock);
    let sent = sent.borrow();
    let depth = queue_depth(HANDLES, 60.0) as u64;
    let (mut came, mut frames) = (1, 0);
    for (at, sent) in sent.iter().enumerate() {
        match sent {
            Sent::Frame { tick, .. } => {
                frames += 1;
                // No frame is older than the depth of the queue.
                assert!(tick + depth + 2 >= came, "frame {tick} when {came} had come");
                came = (came + 2).min(1000);
            }
            // Before the next frame, of which two come at once.
            Sent::Alert { tick } | Sent::Status { tick } => {
                assert!(tick + 2 >= came, "{sent:?} at {at}, {came} had come")
            }
            Sent::Cue { .. } => unreachable!(),
        }
    }
    let count_of = |of: fn(&Sent) -> bool| sent.iter().filter(|sent| of(sent)).count();
    assert_eq!(count_of(|sent| matches!(sent, Sent::Alert { .. })), 100);
    assert_eq!(count_of(|sent| matches!(sent, Sent::Status { .. })), 999);
    assert_eq!(worker.counters(), TransportCounters { frames, skipped: 1000 - frames, discarded: 0 });
    assert!(frames < 600, "{frames} of 1000");
}

#[test]
fn cues_of_frames_that_are_not_sent_are_sent() {
    let ((mut publisher, _status, thread), sent, _) = recorder(1000.0, 1.0);
    for tick in 0..4 {
        let cues = [2 * tick + 1, 2 * tick + 2].map(|number| ReachedCue {
            number: number as u32,
            time: 0.0,
            pauses: false,
            name: "".into(),
        });
        let frame = Frame { cues: cues.to_vec(), ..frame(tick, 0) };
        publish_frame(&mut publisher, &frame);
    }
    drop(publisher);
    assert_eq!(thread.finish().frames, 1, "the rate is a frame a second");
    let cues: Vec<_> = sent.iter().filter(|sent| matches!(sent, Sent::Cue { .. })).collect();
    let expected: Vec<_> = (0..8).map(|cue| Sent::Cue { tick: cue / 2, number: cue as u32 + 1 }).collect();
    assert_eq!(cues, expected);
}

#[test]
fn a_sink_that_cannot_be_made_is_an_error() {
    let config = BackgroundConfig { name: "test", handles: HANDLES, cues: 2, loop_rate: 60.0, rate: 60.0 };
    let refused = start(config, || Err::<Recorder, _>(std::io::Error::other("no such network")));
    assert!(matches!(refused, Err(BackgroundError::Open(error)) if error.to_string() == "no such network"));
}

proptest! {
    #[test]
    fn the_rate_is_kept_and_spread_evenly(loop_rate in 0.1f64..20_000.0, share in 0.0001f64..=1.0) {
        let rate = share * loop_rate;
        let (_, free) = RingBuffer::new(0);
        let ((filled, _), (alerts, _), (cues, _)) = (RingBuffer::new(0), RingBuffer::new(0), RingBuffer::new(0));
        let shared = Arc::default();
        let mut publisher =
            BackgroundPublisher { share: rate / loop_rate, latest_slot: None, free, filled, alerts, cues, shared };
        let due: Vec<u64> = (0..20_000).filter(|tick| publisher.due(*tick)).collect();
        let expected = 20_000.0 * share;
        prop_assert!((due.len() as f64 - expected).abs() <= 1.0, "{} of {expected}", due.len());
        let interval = 1.0 / share;
        for pair in due.windows(2) {
            prop_assert!(((pair[1] - pair[0]) as f64 - interval).abs() <= 1.0, "{pair:?}, {interval}");
        }
    }
}
