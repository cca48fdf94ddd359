//! The check that each frame follows from the frame before: time stands still while paused or held, and advances at the
//! rate in force while playing; the epoch changes exactly at jumps of simulated time.
//!
//! In: the frames of a publisher that loops without a hold at its end, as the soak test starts it. A frame is checked
//! against earlier frames, never against the commands.

use bench_dragon_messages::state::PlaybackState;
use bench_dragon_messages::{FrameHeader, HandlePose};

/// The tolerance of a whole number of periods.
const PERIODS_TOLERANCE: f64 = 0.01;

/// A frame that does not follow from the frame before.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("{fault}: {frame:?} after {previous:?}")]
pub(super) struct FrameFault {
    fault: &'static str,
    frame: FrameHeader,
    previous: Option<FrameHeader>,
}

/// The facts from the frames so far.
#[derive(Debug, Default)]
pub(super) struct ConformanceCheck {
    /// The first frame of the present stretch, which has one epoch, playback state and time scale.
    anchor: FrameHeader,
    previous: Option<FrameHeader>,
    /// The handles of the previous frame, if the show stood still.
    still: Vec<HandlePose>,
    /// Simulated seconds at the end of the show, after the first end.
    end: Option<f64>,
}

impl ConformanceCheck {
    /// Checks a frame of a publisher of `rate` frames per second.
    ///
    /// # Errors
    /// The fault of the frame.
    pub fn check(&mut self, header: &FrameHeader, handles: &[HandlePose], rate: f64) -> Result<(), Box<FrameFault>> {
        let previous = self.previous.replace(*header);
        let result = self.stands_as_it_says(header, handles).and_then(|()| match &previous {
            Some(before) if before.run_id == header.run_id && before.sequence + 1 == header.sequence => {
                self.follows(before, header, handles, rate)
            }
            // The frames between were not received.
            _ => {
                self.anchor = *header;
                Ok(())
            }
        });
        if result.is_err() {
            self.anchor = *header;
        }
        self.still.clear();
        if header.playback_state() != Some(PlaybackState::Playing) {
            self.still.extend_from_slice(handles);
        }
        result.map_err(|fault| Box::new(FrameFault { fault, frame: *header, previous }))
    }

    /// Checks that playback state, time scale and velocities are consistent.
    fn stands_as_it_says(&mut self, header: &FrameHeader, handles: &[HandlePose]) -> Result<(), &'static str> {
        let Some(playback) = header.playback_state() else { return Err("no such playback") };
        let stands = matches!(playback, PlaybackState::Paused | PlaybackState::Held);
        if stands != (header.time_scale == 0.0) || header.time_scale < 0.0 || !header.time_scale.is_finite() {
            return Err("the time scale is not that of its playback");
        }
        // Velocities that are not requested are NaN.
        let moves = |handle: &HandlePose| handle.vx.abs() > 0.0 || handle.vy.abs() > 0.0;
        if playback != PlaybackState::Playing && handles.iter().any(moves) {
            return Err("a frame that stands still has velocities");
        }
        if playback == PlaybackState::Ended && *self.end.get_or_insert(header.sim_time) != header.sim_time {
            return Err("the show has ended at another time than before");
        }
        let end = self.end.unwrap_or(f64::INFINITY);
        if header.sim_time >= 0.0 && header.sim_time <= end { Ok(()) } else { Err("the time is outside the show") }
    }

    fn follows(
        &mut self,
        before: &FrameHeader,
        header: &FrameHeader,
        handles: &[HandlePose],
        rate: f64,
    ) -> Result<(), &'static str> {
        let Some(jumps) = header.epoch.checked_sub(before.epoch) else { return Err("the epoch has fallen") };
        let periods = header.tick.saturating_sub(before.tick);
        let begins_again = before.playback_state() == Some(PlaybackState::Ended);
        if jumps == 0 {
            if begins_again {
                return Err("the show has ended and does not begin again");
            }
            let same_pose = |(a, b): (&HandlePose, &HandlePose)| (a.x, a.y, a.heading) == (b.x, b.y, b.heading);
            let still = self.still.len() == handles.len() && header.sim_time == before.sim_time;
            if still && !self.still.iter().zip(handles).all(same_pose) {
                return Err("the same moment is shown in another pose");
            }
            return self.goes_on(before, header, rate, periods);
        }
        self.anchor = *header;
        // A period executes one command, so it has at most one jump, and one more if the show begins again.
        if periods == 1 && jumps > 1 + u32::from(begins_again) {
            return Err("more jumps than a period can have");
        }
        Ok(())
    }

    /// Checks the time against the present stretch. Begins another stretch at a change.
    fn goes_on(
        &mut self,
        before: &FrameHeader,
        header: &FrameHeader,
        rate: f64,
        periods: u64,
    ) -> Result<(), &'static str> {
        let ticks = header.tick - self.anchor.tick;
        let expected = self.anchor.sim_time + self.anchor.time_scale * ticks as f64 / rate;
        let tolerance = 8.0 * f64::EPSILON * expected;
        let on_time = (header.sim_time - expected).abs() <= tolerance;
        let same = (header.playback, header.time_scale) == (self.anchor.playback, self.anchor.time_scale);
        if on_time && same {
            return Ok(());
        }
        self.anchor = *header;
        if on_time || self.stops_early(before, header, expected + tolerance, rate, periods) {
            Ok(())
        } else {
            Err("the time is not that of the rate in force")
        }
    }

    /// Returns true if a time before the expected time has a reason. Reasons are the end, a cue that pauses, and a step
    /// that ended within skipped periods.
    fn stops_early(
        &mut self,
        before: &FrameHeader,
        header: &FrameHeader,
        latest: f64,
        rate: f64,
        periods: u64,
    ) -> bool {
        if !(header.sim_time >= before.sim_time && header.sim_time <= latest) {
            return false;
        }
        let stands = header.time_scale == 0.0;
        if stands && header.cue > before.cue {
            return true;
        }
        let played = (header.sim_time - before.sim_time) * rate / before.time_scale;
        if periods > 1 && played < periods as f64 && (played - played.round()).abs() <= PERIODS_TOLERANCE {
            return true;
        }
        // A show that is paused in the period of its end has no frame with the state `ended`.
        let ends = stands || header.playback_state() == Some(PlaybackState::Ended);
        ends && *self.end.get_or_insert(header.sim_time) == header.sim_time
    }
}

#[cfg(test)]
mod tests;
