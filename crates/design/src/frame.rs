//! The picture of a scene at a time: its stage and its frame.

use bench_dragon_messages::{FrameHeader, HandlePose, Stage, StageMessage};
use bench_dragon_motion::Method;
use bench_dragon_motion::event::unreported;
use bench_dragon_motion::timeline::Timeline;
use bench_dragon_show::convert::{Stamps, frame_header, handle_poses, stage_without_show};
use bench_dragon_show::moments::Moments;
use bench_dragon_show::scene::Scene;

/// Returns the stage of a scene whose events are not known yet.
pub fn stage(scene: &Scene, run: u64, end: f64) -> StageMessage {
    let message = stage_without_show(&scene.ensemble, end, &[], &[]);
    StageMessage { stage: Stage { run_id: run, ..message.stage }, ..message }
}

/// The frames of a scene.
pub struct Frames {
    moments: Moments,
    run: u64,
    /// True if the states of the frames know all events.
    pub knows_events: bool,
}

impl Frames {
    /// Creates the frames of a scene of a number. They are of exact motion, each follower bracketed, since a table would
    /// take longer than the first frame. Without `timeline` their states know stalls, locks and path ends alone.
    pub fn new(scene: &Scene, run: u64, timeline: Option<Timeline>) -> Self {
        // The paper's rules stay: only a change to them can fail.
        let exact = scene.ensemble.try_map(|motion| match motion.method() {
            Method::Paper(_) => Ok(motion.clone()),
            _ => motion.with_method(Method::Newton),
        });
        let exact = Scene {
            ensemble: exact.unwrap_or_else(|_| scene.ensemble.clone()),
            // A clearance in each frame would cost more than the frame.
            alerts: None,
            ..scene.clone()
        };
        let knows_events = timeline.is_some();
        let timeline = timeline.unwrap_or_else(|| exact.ensemble.timeline_without_contact(&mut unreported));
        Self { moments: Moments::new(&exact, timeline), run, knows_events }
    }

    /// Returns the frame at a time, or at the end of the motion before that, for the request of a number; `None` without
    /// a solution.
    pub fn at(&mut self, time: f64, id: u64) -> Option<(FrameHeader, Vec<HandlePose>)> {
        let frame = self.moments.frame(time)?;
        let stamps = Stamps { run_id: self.run, sequence: id, stamp_ns: 0, deadline_ns: 0 };
        Some((frame_header(frame, stamps), handle_poses(&frame.chain).collect()))
    }
}
