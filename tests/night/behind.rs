//! The queue of a transport with a separate thread, and a fake of that transport.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::Duration;

use bench_dragon::messages::{CollisionAlert, Cue, FrameHeader, HandlePose, LoopStatus};
use bench_dragon::publisher::live::TransportCounters;
use bench_dragon::publisher::transports::background::Sink;

use crate::world::same;

/// The promises of the queue: a quarter of a second of frames, at least 4, at most 256; 256 alerts; all cues 8 times.
const MOST_ALERTS: usize = 256;
const SHOWS: usize = 8;

/// The messages that the transport must receive.
pub struct Behind {
    share: f64,
    slot: Option<u64>,
    most_frames: usize,
    most_cues: usize,
    frames: VecDeque<(FrameHeader, f64)>,
    alerts: VecDeque<(u64, u32)>,
    cues: VecDeque<(u64, u32)>,
    /// True if a frame has found the queue full since it was emptied.
    was_full: bool,
    delivered: TransportCounters,
}

impl Behind {
    pub fn new(loop_rate: f64, rate: f64, cues: usize) -> Self {
        Self {
            share: rate / loop_rate,
            slot: None,
            most_frames: ((0.25 * rate) as usize).clamp(4, 256),
            most_cues: SHOWS * cues,
            frames: VecDeque::new(),
            alerts: VecDeque::new(),
            cues: VecDeque::new(),
            was_full: false,
            delivered: TransportCounters::default(),
        }
    }

    /// Records a sent frame with its head at `x`, and its alerts and cues.
    pub fn published(&mut self, header: &FrameHeader, x: f64, alerts: &[(u64, u32)], cues: &[(u64, u32)]) {
        self.alerts.extend(alerts.iter().take(MOST_ALERTS - self.alerts.len()));
        self.cues.extend(cues.iter().take(self.most_cues - self.cues.len()));
        let slot = (header.tick as f64 * self.share) as u64;
        if self.slot.replace(slot) == Some(slot) {
            return;
        }
        if self.frames.len() < self.most_frames {
            self.frames.push_back((*header, x));
        } else {
            self.was_full = true;
            self.delivered.skipped += 1;
        }
    }

    /// Checks that the thread has emptied the queues.
    pub fn emptied(&mut self, deliveries: TransportCounters) {
        same("messages left in the queues", (self.frames.len(), self.alerts.len(), self.cues.len()), (0, 0, 0));
        self.was_full = false;
        same("the delivered messages", deliveries, self.delivered);
    }

    fn frame(&mut self, header: &FrameHeader, handles: &[HandlePose]) {
        if self.was_full {
            // The thread continues with the newest frame.
            self.delivered.skipped += self.frames.len().saturating_sub(1) as u64;
            self.frames.drain(..self.frames.len().saturating_sub(1));
        }
        let Some((expected, x)) = self.frames.pop_front() else { panic!("{header:?} was not queued") };
        // If no boards are near, the clearance is NaN, which does not equal itself.
        let without = |of: &FrameHeader| FrameHeader { sent_ns: 0, min_clearance: 0.0, ..*of };
        same("the frame that is sent", without(header), without(&expected));
        same("its clearance", header.min_clearance.to_bits(), expected.min_clearance.to_bits());
        same("its head", handles[0].x, x);
        self.delivered.frames += 1;
    }
}

/// A replacement for the network: receives all messages, and compares them.
pub struct Network(pub Rc<RefCell<Behind>>);

impl Sink for Network {
    fn frame(&mut self, header: &FrameHeader, handles: &[HandlePose]) {
        self.0.borrow_mut().frame(header, handles);
    }

    fn alert(&mut self, alert: CollisionAlert) {
        same("the alert that is sent", Some((alert.tick, alert.level)), self.0.borrow_mut().alerts.pop_front());
    }

    fn cue(&mut self, cue: Cue) {
        same("the cue that is sent", Some((cue.tick, cue.number)), self.0.borrow_mut().cues.pop_front());
    }

    fn status(&mut self, _status: &LoopStatus) {}

    fn discarded(&self) -> u64 {
        0
    }

    fn linger(&self) -> Duration {
        Duration::ZERO
    }
}
