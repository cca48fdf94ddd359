//! [`Moments`]: frames of a scene at any time of its motion, in any order, as `solve --at` computes them. The pages of
//! `view` and `design` show them.
//!
//! In: a scene, its events as far as they are known, and times. Out: frames. There is no clock, no cue and no alert.

use bench_dragon_messages::state::{FrameState, PlaybackState};
use bench_dragon_motion::timeline::Timeline;

use crate::Frame;
use crate::dancers::Dancers;
use crate::scene::Scene;

/// The frames of a scene at any times.
pub struct Moments {
    dancers: Dancers,
    timeline: Timeline,
    frame: Frame,
}

impl Moments {
    /// Creates the frames of a scene. Its solvers make their tables here; a scene with
    /// [`Method::Newton`](bench_dragon_motion::Method) has none. `timeline` gives each frame its state.
    pub fn new(scene: &Scene, timeline: Timeline) -> Self {
        let standing =
            Frame { time_scale: 0.0, playback: PlaybackState::Paused, ..Frame::new(scene.ensemble.handles()) };
        Self { dancers: Dancers::new(scene), timeline, frame: standing }
    }

    /// Returns the time at which the motion ends, in seconds.
    pub fn end(&self) -> f64 {
        self.timeline.end().time
    }

    /// Returns the frame at a time of the show, at most the end of the motion. Its velocities are those of the motion.
    /// Returns `None` without a solution.
    pub fn frame(&mut self, time: f64) -> Option<&Frame> {
        let frame = &mut self.frame;
        frame.sim_time = time.clamp(0.0, self.timeline.end().time);
        let closest = self.dancers.solve(frame.sim_time, true, &mut frame.chain).ok()?;
        frame.min_clearance = closest.any.map_or(f64::NAN, |least| least.value);
        let passed = self.timeline.latest_passed(frame.sim_time);
        frame.state = passed.map_or(FrameState::Moving, |passed| passed.event.kind.into());
        Some(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve_at_or_just_before;
    use bench_dragon_messages::state::EventKind;
    use bench_dragon_motion::event::unreported;
    use bench_dragon_motion::solve::Chain;

    #[test]
    fn frames_in_any_order_are_those_of_the_solver() {
        for text in [include_str!("../../../config/paper.toml"), include_str!("../../../config/crossing.toml")] {
            let scene = Scene::parse(text, "test", "test").unwrap();
            let timeline = scene.ensemble.timeline(&mut unreported);
            let (end, contact) = (timeline.end().time, timeline.find(EventKind::Contact).copied());
            let mut moments = Moments::new(&scene, timeline);
            let mut solver = scene.ensemble.solver(scene.velocities);
            let mut chain = Chain::new(scene.ensemble.handles());
            let of_contact = contact.map_or(0.0, |contact| contact.time);
            for time in [300.0, 0.0, end, of_contact, 12.25, 12.25, of_contact.next_down().max(0.0), 0.5 * end] {
                let time = time.min(end);
                solve_at_or_just_before(solver.as_mut(), time, &mut chain).unwrap();
                let frame = moments.frame(time).unwrap();
                assert_eq!((frame.sim_time, &frame.chain), (time, &chain));
                let has_passed = contact.is_some_and(|contact| contact.time <= time);
                assert_eq!(frame.state.event().is_some(), has_passed || time == end, "at {time}");
            }
            assert_eq!(moments.frame(2.0 * end).unwrap().sim_time, end);
        }
    }
}
