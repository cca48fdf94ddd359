//! The picture of a scene at a time: its stage and its frame.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use bench_dragon_messages::state::EventKind;
use bench_dragon_messages::{FrameHeader, HandlePose, Stage, StageMessage};
use bench_dragon_motion::Method;
use bench_dragon_motion::event::Event;
use bench_dragon_motion::timeline::{TimedEvent, Timeline};
use bench_dragon_show::convert::{Stamps, frame_header, handle_poses, stage_without_show};
use bench_dragon_show::moments::Moments;
use bench_dragon_show::scene::Scene;

/// The time after which the searches for the branches of the followers and for the end of the motion give up, while a
/// page waits for its picture.
const PATIENCE: Duration = Duration::from_millis(100);

/// Returns the stage of a scene whose events are not known yet.
pub fn stage(scene: &Scene, run: u64, end: f64) -> StageMessage {
    let message = stage_without_show(&scene.ensemble, end, &[], &[]);
    StageMessage { stage: Stage { run_id: run, ..message.stage }, ..message }
}

/// The frames of a scene.
pub struct Frames {
    /// The scene in exact motion.
    exact: Scene,
    timeline: Timeline,
    /// Its solvers are made for the first frame.
    moments: Option<Moments>,
    /// True if the first frame waits for the branches that a search beside it finds.
    waits: bool,
    run: u64,
    /// The events that the frames know.
    knowledge: Knowledge,
}

/// The events that the frames of a scene know.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Knowledge {
    /// The end of the path.
    PathEnd,
    /// Stalls, locks and the end of the path.
    Singularities,
    All,
}

impl Frames {
    /// Creates the frames of a scene of a number. They are of exact motion, each follower bracketed, because a table
    /// would take longer than the first frame. Without `timeline` they know no events.
    pub fn new(scene: &Scene, run: u64, timeline: Option<Timeline>) -> Self {
        // A clearance in each frame would cost more than the frame.
        let exact = Scene { alerts: None, ..without_tables(scene) };
        let knowledge = if timeline.is_some() { Knowledge::All } else { Knowledge::PathEnd };
        let timeline = timeline.unwrap_or_else(|| path_end(&exact));
        Self { exact, timeline, moments: None, waits: false, run, knowledge }
    }

    /// Returns true if the states of the frames know all events.
    pub fn know_all_events(&self) -> bool {
        self.knowledge == Knowledge::All
    }

    /// Returns true if the first frame waits for the branches of the followers, whose search has taken too long for it.
    pub fn waits(&self) -> bool {
        self.waits
    }

    /// Returns the frame at a time, or at the end of the motion before that, for the request of a number; `None`
    /// without a solution, and if it [`waits`](Self::waits). `is_searched` is true if another thread searches the scene,
    /// and finds the branches of the followers, too.
    pub fn at(&mut self, time: f64, id: u64, is_searched: bool) -> Option<(FrameHeader, Vec<HandlePose>)> {
        let until = Instant::now() + PATIENCE;
        let mut progress = |_| if Instant::now() < until { ControlFlow::Continue(()) } else { ControlFlow::Break(()) };
        let moments = match &mut self.moments {
            Some(moments) => moments,
            None => {
                let (waits, is_searched) = (self.waits, is_searched && self.knowledge != Knowledge::All);
                let mut beside = |share| match (is_searched, waits) {
                    (false, _) => ControlFlow::Continue(()),
                    (true, true) => ControlFlow::Break(()),
                    (true, false) => progress(share),
                };
                let mut dragons = self.exact.ensemble.dragons().iter();
                self.waits = !dragons.all(|dragon| dragon.motion.search_branches(&mut beside));
                if self.waits {
                    return None;
                }
                self.moments.insert(Moments::new(&self.exact, self.timeline.clone()))
            }
        };
        if moments.frame(time).is_none() && self.knowledge == Knowledge::PathEnd {
            // The motion ends earlier, with a lock.
            self.knowledge = Knowledge::Singularities;
            let timeline = self.exact.ensemble.timeline_without_contact(&mut progress);
            *moments = Moments::new(&self.exact, timeline);
        }
        let frame = moments.frame(time)?;
        let stamps = Stamps { run_id: self.run, sequence: id, stamp_ns: 0, deadline_ns: 0 };
        Some((frame_header(frame, stamps), handle_poses(&frame.chain).collect()))
    }
}

/// Returns a scene in exact motion, whose solvers make no tables: to make one takes as long as hundreds of frames.
pub fn without_tables(scene: &Scene) -> Scene {
    // The paper's rules stay: only a change to them can fail.
    let exact = scene.ensemble.try_map(|motion| match motion.method() {
        Method::Paper(_) => Ok(motion.clone()),
        _ => motion.with_method(Method::Newton),
    });
    Scene { ensemble: exact.unwrap_or_else(|_| scene.ensemble.clone()), ..scene.clone() }
}

/// Returns the timeline of a motion of which nothing but the length of the path is known.
fn path_end(scene: &Scene) -> Timeline {
    let ends = scene.ensemble.dragons().iter().map(|dragon| {
        let travelled = dragon.motion.bare_path().length();
        (dragon.delay + dragon.motion.time_at(travelled), travelled)
    });
    let (time, travelled) = ends.max_by(|one, other| one.0.total_cmp(&other.0)).unwrap_or_default();
    let event = Event { kind: EventKind::PathEnd, travelled, bench_a: None, bench_b: None, place: None };
    Timeline::new(vec![TimedEvent { event, time }], None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench_dragon_motion::event::unreported;

    #[test]
    fn a_frame_that_waits_is_there_once_another_search_has_found_the_branches() {
        let scene = Scene::parse(include_str!("../../../config/turnaround.toml"), "test", "test").unwrap();
        let mut frames = Frames { waits: true, ..Frames::new(&scene, 1, None) };
        assert!(frames.at(0.0, 1, true).is_none() && frames.waits());
        scene.ensemble.timeline_without_contact(&mut unreported);
        assert!(frames.at(0.0, 2, true).is_some() && !frames.waits());
    }

    #[test]
    fn a_frame_that_waits_searches_where_no_search_is_beside() {
        // Each has motions of its own, whose branches are not known.
        let scene = || Scene::parse(include_str!("../../../config/turnaround.toml"), "test", "test").unwrap();
        let mut of_refused = Frames { waits: true, ..Frames::new(&scene(), 1, None) };
        assert!(of_refused.at(0.0, 1, false).is_some() && !of_refused.waits());
        let timeline = scene().ensemble.timeline_without_contact(&mut unreported);
        let mut of_ended = Frames { waits: true, ..Frames::new(&scene(), 1, Some(timeline)) };
        assert!(of_ended.at(0.0, 1, true).is_some() && !of_ended.waits());
    }
}
