//! The picture of a scene at a time: its stage and its frame.

use bench_dragon_messages::state::{FrameState, PlaybackState};
use bench_dragon_messages::{FrameHeader, HandlePose, Stage, StageMessage};
use bench_dragon_motion::Method;
use bench_dragon_motion::event::unreported;
use bench_dragon_motion::solve::{Chain, Velocities};
use bench_dragon_motion::timeline::Timeline;
use bench_dragon_show::convert::{handle_poses, stage_without_show};
use bench_dragon_show::scene::Scene;
use bench_dragon_show::solve_at_or_just_before;

/// Returns the stage of a scene whose events are not known yet.
pub fn stage(scene: &Scene, run: u64, end: f64) -> StageMessage {
    let message = stage_without_show(&scene.ensemble, end, &[], &[]);
    StageMessage { stage: Stage { run_id: run, ..message.stage }, ..message }
}

/// Returns the frame of a scene at a time, or at the end of the motion before that; `None` without a solution. The
/// events, where they are known, give it its state.
pub fn frame(
    scene: &Scene,
    time: f64,
    (run, id): (u64, u64),
    timeline: Option<&Timeline>,
) -> Option<(FrameHeader, Vec<HandlePose>)> {
    let exact = scene.ensemble.try_map(|motion| motion.with_method(Method::Newton)).ok()?;
    let mut solver = exact.solver(Velocities::Computed);
    let mut chain = Chain::new(exact.handles());
    let time = timeline.map_or(time, |timeline| time.min(timeline.end().time));
    let at = solve_at_or_just_before(&mut *solver, time, &mut chain).or_else(|_| {
        let end = exact.timeline_without_contact(&mut unreported).end().time;
        solve_at_or_just_before(&mut *solver, end.min(time), &mut chain)
    });
    let at = at.ok()?;
    let passed = timeline.and_then(|timeline| timeline.latest_passed(at));
    let header = FrameHeader {
        run_id: run,
        sequence: id,
        sim_time: at,
        time_scale: 0.0,
        state: passed.map_or(FrameState::Moving, |passed| passed.event.kind.into()) as u32,
        playback: PlaybackState::Paused as u32,
        handles: chain.handles() as u32,
        min_clearance: f64::NAN,
        ..FrameHeader::default()
    };
    Some((header, handle_poses(&chain).collect()))
}
