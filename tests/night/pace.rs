//! Each period is a frame or skipped; deadlines never shift.

use bench_dragon::messages::FrameHeader;
use bench_dragon::publisher::live::{End, LoopCounts};

use crate::world::{SECOND_NS, World, same};

/// Rounding of a deadline to a nanosecond, on both sides.
const ROUNDING_NS: f64 = 2.0;
/// The loop checks its stop flag ten times a second.
const HEEDED_NS: u64 = SECOND_NS / 10;

/// The count of periods so far.
pub struct Pace {
    rate: f64,
    /// The start of the first period.
    begin_ns: u64,
    /// The next period, if nothing is late.
    next_tick: u64,
    pub frames: u64,
    pub skipped: u64,
    pub overruns: u64,
    /// The least and the greatest possible lateness of the present frame.
    pub lateness_ns: (u64, u64),
    frames_at_stop: Option<u64>,
}

impl Pace {
    pub fn new(rate: f64) -> Self {
        Self {
            rate,
            begin_ns: 0,
            next_tick: 0,
            frames: 0,
            skipped: 0,
            overruns: 0,
            lateness_ns: (0, 0),
            frames_at_stop: None,
        }
    }

    /// Sets the beginning of the periods: the loop's first read of its clock.
    fn begin(&mut self, world: &World) {
        self.begin_ns = world.first_read_ns.get().expect("the loop has read its clock");
    }

    /// Returns start + tick / rate.
    fn deadline(&self, tick: u64) -> f64 {
        self.begin_ns as f64 + tick as f64 / self.rate * 1e9
    }

    /// Returns the distance of some doubles of that size, with the rounding to a nanosecond.
    fn tolerance(&self, tick: u64) -> f64 {
        ROUNDING_NS + 4.0 * f64::EPSILON * self.deadline(tick)
    }

    fn skip_to(&mut self, tick: u64) {
        self.overruns += u64::from(tick > self.next_tick);
        self.skipped += tick - self.next_tick;
        self.next_tick = tick;
    }

    /// Checks the time of a frame of the period `tick` before its computation.
    pub fn frame_begins(&mut self, world: &World, tick: u64) {
        self.begin(world);
        assert!(tick >= self.next_tick, "period {tick}, where {} or a later one is due", self.next_tick);
        let (now, awake) = (world.now_ns() as f64, world.awake_ns.get() as f64);
        let (begins, ends) = (self.deadline(tick), self.deadline(tick + 1));
        assert!(now + self.tolerance(tick) >= begins, "period {tick} is {} ns early", begins - now);
        assert!(awake < ends + self.tolerance(tick), "period {tick} was over {} ns ago", awake - ends);
        let intended = self.deadline(self.next_tick) - self.tolerance(tick);
        let late = |at: f64, rounding: f64| (at - intended + rounding).max(0.0) as u64;
        self.lateness_ns = (late(awake, -2.0 * self.tolerance(tick)), late(now, self.tolerance(tick)));
        self.skip_to(tick);
        let stopped = world.stopped.get().map(|_| self.frames);
        self.frames_at_stop = self.frames_at_stop.or(stopped);
    }

    /// Checks the header of a frame that is sent.
    pub fn frame_goes_out(&mut self, world: &World, header: &FrameHeader, run_id: u64) {
        same("the run and the sequence", (header.run_id, header.sequence), (run_id, self.frames));
        same("the period", header.tick, self.next_tick);
        let error = (header.deadline_ns as f64 - self.deadline(header.tick)).abs();
        assert!(error <= self.tolerance(header.tick), "the deadline is {error} ns off");
        same("the stamp", header.stamp_ns, world.stamp_ns.get());
    }

    pub fn frame_is_out(&mut self) {
        self.frames += 1;
        self.next_tick += 1;
    }

    /// Checks the counts after the end of the loop.
    pub fn ended(&mut self, world: &World, counts: &LoopCounts, periods: Option<u64>) {
        // A loop that is stopped at once has sent no frame.
        self.begin(world);
        let elapsed = counts.frames + counts.skipped;
        same("the frames", counts.frames, self.frames);
        let now = world.now_ns() as f64;
        match counts.end {
            End::Error => same("the periods until the failure", elapsed, self.next_tick),
            End::Duration => {
                same("the periods", Some(elapsed), periods);
                assert!(now + self.tolerance(elapsed) >= self.deadline(elapsed), "the last period is not over");
                self.skip_to(elapsed);
            }
            End::Signal => {
                let (at_ns, delayed_ns) = world.stopped.get().expect("a stop");
                let held_up_ns = world.delayed_ns.get() - delayed_ns;
                assert!(world.now_ns() <= at_ns + HEEDED_NS + held_up_ns, "the stop came at {at_ns} ns");
                if elapsed > 0 {
                    assert!(now + self.tolerance(elapsed) >= self.deadline(elapsed - 1), "periods that did not elapse");
                }
                let next = self.deadline(elapsed + 1) + self.tolerance(elapsed);
                assert!((world.awake_ns.get() as f64) < next, "periods elapsed that are not counted");
                assert!(elapsed >= self.next_tick);
                self.skip_to(elapsed);
                let after = self.frames - self.frames_at_stop.unwrap_or(self.frames);
                assert!(after <= 1, "{after} frames after the stop");
            }
            End::Recording => panic!("nothing was played from a recording"),
        }
        same("periods skipped, and incidents", (counts.skipped, counts.overruns), (self.skipped, self.overruns));
    }
}
