//! The frames of a scene at any time, for the page of `view`. In: the text of a scene. Out: frames for `outputs`, those
//! of `solve --at`.

use bench_dragon::messages::{FrameHeader, HandlePose};
use bench_dragon::motion::event::unreported;
use bench_dragon::outputs::view::SceneFrames;
use bench_dragon::show::convert::{Stamps, frame_header, handle_poses};
use bench_dragon::show::moments::Moments;
use bench_dragon::show::scene::Scene;

/// The nice value of the thread that computes: a publisher on this machine comes first.
const NICE: i32 = 10;

/// Opens the scene with this text, and lowers the priority of the calling thread; `None` for a text that is no scene.
pub fn scene_frames(text: &str) -> Option<Box<dyn SceneFrames>> {
    // Of this thread alone: setpriority(2), "C library/kernel differences". Where it fails, the priority stays.
    let _ = rustix::process::setpriority_process(None, NICE);
    let scene = Scene::parse(text, "the scene of the show", "show").ok()?;
    let timeline = scene.ensemble.timeline_without_contact(&mut unreported);
    Some(Box::new(Frames(Moments::new(&scene, timeline))))
}

struct Frames(Moments);

impl SceneFrames for Frames {
    fn frame(&mut self, time: f64) -> Option<(FrameHeader, Vec<HandlePose>)> {
        let frame = self.0.frame(time)?;
        let header = frame_header(frame, Stamps { run_id: 0, sequence: 0, stamp_ns: 0, deadline_ns: 0 });
        Some((header, handle_poses(&frame.chain).collect()))
    }
}
