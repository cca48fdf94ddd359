//! The picture of a scene at a time: its stage and its frame.

use bench_dragon_messages::{FrameHeader, HandlePose, StageMessage};
use bench_dragon_motion::Method;
use bench_dragon_motion::solve::{Chain, Velocities};
use bench_dragon_show::convert::{handle_poses, stage_without_show};
use bench_dragon_show::scene::Scene;
use bench_dragon_show::solve_at_or_just_before;

/// Returns the stage of a scene whose events are not known yet.
pub fn stage(scene: &Scene, end: f64) -> StageMessage {
    stage_without_show(&scene.ensemble, end, &[], &[])
}

/// Returns the frame of a scene at a time, or at the end of the motion before that; `None` without a solution.
pub fn frame(scene: &Scene, time: f64, sequence: u64) -> Option<(FrameHeader, Vec<HandlePose>)> {
    let exact = scene.ensemble.try_map(|motion| motion.with_method(Method::Newton)).ok()?;
    let mut solver = exact.solver(Velocities::Computed);
    let mut chain = Chain::new(exact.handles());
    let at = solve_at_or_just_before(&mut *solver, time, &mut chain).or_else(|_| {
        let end = exact.timeline_without_contact().end().time;
        solve_at_or_just_before(&mut *solver, end.min(time), &mut chain)
    });
    let header = FrameHeader {
        sequence,
        sim_time: at.ok()?,
        handles: chain.handles() as u32,
        min_clearance: f64::NAN,
        ..FrameHeader::default()
    };
    Some((header, handle_poses(&chain).collect()))
}
