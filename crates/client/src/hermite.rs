//! The handles at the moment of display: cubic Hermite interpolation between the frames of a stream.
//!
//! In: frames as they come, and a moment of CLOCK_MONOTONIC. Out: positions, headings and velocities at that moment,
//! also between frames. The display runs a period behind the stream, at any rate. The error falls with the fourth power
//! of the frames' distance h, because its bound is h^4 / 384 times the greatest fourth derivative (de Boor, A Practical
//! Guide to Splines, IV.6).

use std::collections::VecDeque;

use bench_dragon_messages::state::PlaybackState;
use bench_dragon_messages::{FrameHeader, HandlePose, Stage};

/// A frame that is kept.
#[derive(Debug, Clone, Default)]
struct Snapshot {
    header: FrameHeader,
    handles: Vec<HandlePose>,
}

impl Snapshot {
    /// Returns true if velocities are zero because the show stands still, and not because the handles rest there.
    fn stands_still(&self) -> bool {
        self.header.playback_state() != Some(PlaybackState::Playing)
    }

    /// Returns true if simulated time runs without a jump from this frame to a later one.
    fn continues_to(&self, later: &Self) -> bool {
        let (a, b) = (&self.header, &later.header);
        (a.run_id, a.epoch, self.handles.len()) == (b.run_id, b.epoch, later.handles.len()) && b.sim_time > a.sim_time
    }
}

/// The latest frames of a stream, and the poses between them.
///
/// # Examples
///
/// ```
/// use bench_dragon_client::hermite::HermiteReader;
/// use bench_dragon_messages::{FrameHeader, HandlePose};
///
/// // Two frames, a second apart, of one handle that moves along x at 2 m/s.
/// let mut reader = HermiteReader::new(4);
/// for second in 0..2 {
///     let header = FrameHeader {
///         deadline_ns: second * 1_000_000_000,
///         sim_time: second as f64,
///         time_scale: 1.0,
///         handles: 1,
///         ..FrameHeader::default()
///     };
///     reader.push(&header, &[HandlePose { x: 2.0 * second as f64, vx: 2.0, ..HandlePose::default() }]);
/// }
/// let mut handles = Vec::new();
/// assert_eq!(reader.at(250_000_000, &mut handles), Some(0.25));
/// assert!((handles[0].x - 0.5).abs() < 1e-15);
/// ```
#[derive(Debug, Clone)]
pub struct HermiteReader {
    frames: VecDeque<Snapshot>,
    keep: usize,
    /// The run of the stage, and the last handle of each of its dragons.
    stage_run: u64,
    tails: Vec<usize>,
}

impl HermiteReader {
    /// Creates a reader that keeps the latest `keep` frames, at least two. A display that runs `d` seconds behind a
    /// stream of `r` frames per second needs d r + 2.
    pub fn new(keep: usize) -> Self {
        Self { frames: VecDeque::with_capacity(keep.max(2)), keep: keep.max(2), stage_run: 0, tails: Vec::new() }
    }

    /// Sets the dragons of a run: the last handle of each has the heading of its last bench. Without the stage of its
    /// run, a frame is of one dragon.
    pub fn set_stage(&mut self, stage: &Stage) {
        self.stage_run = stage.run_id;
        self.tails.clear();
        self.tails.extend(stage.dragons.iter().map(|dragon| dragon.first_handle as usize + dragon.benches as usize));
    }

    /// Adds the next frame of a stream, and drops the frames of another run. A frame of another machine has a
    /// `deadline_ns` of that machine's clock, which cannot be compared with moments here. Replace it by the time of
    /// arrival.
    pub fn push(&mut self, header: &FrameHeader, handles: &[HandlePose]) {
        if self.frames.back().is_some_and(|last| last.header.run_id != header.run_id) {
            self.frames.clear();
        }
        // The oldest frame's memory is used again.
        let oldest = if self.frames.len() == self.keep { self.frames.pop_front() } else { None };
        let mut snapshot = oldest.unwrap_or_default();
        snapshot.header = *header;
        snapshot.handles.clear();
        snapshot.handles.extend_from_slice(handles);
        self.frames.push_back(snapshot);
    }

    /// Returns the header of the newest frame.
    pub fn newest(&self) -> Option<&FrameHeader> {
        self.frames.back().map(|frame| &frame.header)
    }

    /// Fills `handles` with the poses at a moment, CLOCK_MONOTONIC in nanoseconds, and returns its simulated time in
    /// seconds. Returns `None` if no frame has come. There is no interpolation before the oldest kept frame, after the
    /// newest, and at a jump of simulated time. There the nearest earlier frame, or the oldest, is returned.
    ///
    /// Headings follow from the positions, as in the frames. Without velocities in the stream the path between two
    /// frames is a straight line.
    pub fn at(&self, monotonic_ns: u64, handles: &mut Vec<HandlePose>) -> Option<f64> {
        let after = self.frames.partition_point(|frame| frame.header.deadline_ns <= monotonic_ns);
        let before = self.frames.get(after.saturating_sub(1))?;
        handles.clear();
        let elapsed_ns = monotonic_ns.saturating_sub(before.header.deadline_ns);
        match self.frames.get(after).filter(|next| elapsed_ns > 0 && before.continues_to(next)) {
            None => {
                handles.extend_from_slice(&before.handles);
                Some(before.header.sim_time)
            }
            Some(next) => {
                let (from, to) = (before.header.sim_time, next.header.sim_time);
                // The rate in force holds until the next frame; the end of the show may come earlier.
                let time = (from + before.header.time_scale * elapsed_ns as f64 * 1e-9).min(to);
                interpolate(before, next, to - from, (time - from) / (to - from), handles);
                let tails = if before.header.run_id == self.stage_run { self.tails.as_slice() } else { &[] };
                set_headings(handles, tails);
                Some(time)
            }
        }
    }
}

/// Appends the positions and rates of the handles at the share `u` of the way, `length` simulated seconds, from one
/// frame to the next.
fn interpolate(from: &Snapshot, to: &Snapshot, length: f64, u: f64, handles: &mut Vec<HandlePose>) {
    let ends = (!from.stands_still(), !to.stands_still());
    for (a, b) in from.handles.iter().zip(&to.handles) {
        let (x, vx) = coordinate([a.x, b.x], [a.vx, b.vx], ends, length, u);
        let (y, vy) = coordinate([a.y, b.y], [a.vy, b.vy], ends, length, u);
        handles.push(HandlePose { x, y, heading: a.heading, vx, vy });
    }
}

/// Sets every heading to the direction of the bench behind the handle. At the `tails` and at the last handle, the
/// heading is the direction of the bench before.
fn set_headings(handles: &mut [HandlePose], tails: &[usize]) {
    for bench in 1..handles.len() {
        let (front, rear) = (handles[bench - 1], handles[bench]);
        handles[bench - 1].heading = (front.y - rear.y).atan2(front.x - rear.x);
    }
    for tail in tails.iter().copied().chain([handles.len().saturating_sub(1)]) {
        // A damaged stage may name any number.
        if let Some([leader, last]) = tail.checked_sub(1).and_then(|leader| handles.get_mut(leader..=tail)) {
            last.heading = leader.heading;
        }
    }
}

/// One coordinate and its rate, of a cubic, a quadratic or a straight line. The curve is the polynomial of least degree
/// through both positions and the velocities that `ends` trusts.
fn coordinate(at: [f64; 2], rate: [f64; 2], ends: (bool, bool), length: f64, u: f64) -> (f64, f64) {
    let step = at[1] - at[0];
    let [first, last] = rate.map(|rate| rate * length);
    let (value, slope) = match ends {
        _ if first.is_nan() || last.is_nan() => (at[0] + step * u, step),
        (true, true) => {
            let (from_first, from_last) = (first - step, last - step);
            let w = 1.0 - u;
            (
                at[0] + step * u + u * w * (w * from_first - u * from_last),
                step + w * (w - 2.0 * u) * from_first + u * (u - 2.0 * w) * from_last,
            )
        }
        (true, false) => (at[0] + u * (first + u * (step - first)), first + 2.0 * u * (step - first)),
        (false, true) => {
            let w = 1.0 - u;
            (at[1] - w * (last + w * (step - last)), last + 2.0 * w * (step - last))
        }
        (false, false) => (at[0] + step * u, step),
    };
    (value, slope / length)
}

#[cfg(test)]
mod tests {
    use bench_dragon_motion::event::unreported;
    use proptest::prelude::*;

    use super::*;
    use bench_dragon_motion::Method;
    use bench_dragon_motion::solve::{Chain, Velocities};
    use bench_dragon_show::convert::{Stamps, frame_header, handle_pose, stage};
    use bench_dragon_show::scene::{AtEnd, Scene};
    use bench_dragon_show::{Playback, Show};

    const START_NS: u64 = 7_000_000_000;

    fn deadline_ns(tick: u64, rate: f64) -> u64 {
        START_NS + (tick as f64 * 1e9 / rate) as u64
    }

    /// The paper's scene by the safe solver, which needs no table.
    fn scene() -> Scene {
        let scene = Scene::paper();
        let ensemble = scene.ensemble.try_map(|motion| motion.with_method(Method::Newton)).unwrap();
        Scene { ensemble, ..scene }
    }

    /// A reader that has taken the first frames of a show, which ends at the contact.
    fn reader(playback: Playback, frames: u64) -> HermiteReader {
        let scene = scene();
        reader_of(&mut Show::new(&scene, scene.ensemble.timeline(&mut unreported), playback).unwrap(), playback, frames)
    }

    fn reader_of(show: &mut Show, playback: Playback, frames: u64) -> HermiteReader {
        let mut reader = HermiteReader::new(frames as usize);
        for tick in 0..frames {
            let frame = show.frame(tick);
            let deadline_ns = deadline_ns(tick, playback.rate);
            let header = frame_header(frame, Stamps { run_id: 1, sequence: tick, stamp_ns: 0, deadline_ns });
            let handles: Vec<_> = (0..frame.chain.handles()).map(|handle| handle_pose(&frame.chain, handle)).collect();
            reader.push(&header, &handles);
        }
        reader
    }

    /// The greatest distance of a handle from its place by the safe solver, and the greatest difference of a heading.
    /// The moments are spread over `seconds`, and only the first is the moment of a frame.
    fn worst(start: f64, rate: f64, seconds: f64) -> (f64, f64) {
        let scene = scene();
        let reader = reader(Playback { start, rate, ..Playback::of(&scene) }, (seconds * rate) as u64 + 2);
        let mut newton = scene.ensemble.solver(Velocities::Computed);
        let (mut chain, mut handles) = (Chain::new(224), Vec::new());
        let (mut position, mut heading) = (0.0f64, 0.0f64);
        for k in 0..331 {
            let monotonic_ns = START_NS + (k as f64 * seconds / 331.0 * 1e9) as u64;
            let time = reader.at(monotonic_ns, &mut handles).unwrap();
            let shown = start + (monotonic_ns - START_NS) as f64 * 1e-9;
            assert!((time - shown.min(412.473837682115)).abs() < 1e-8, "{time} for {shown}");
            newton.solve(time, &mut chain).unwrap();
            for (handle, pose) in handles.iter().enumerate() {
                position = position.max((pose.x - chain.x[handle]).hypot(pose.y - chain.y[handle]));
                let turned = (pose.heading - chain.heading[handle]).rem_euclid(std::f64::consts::TAU);
                heading = heading.max(turned.min(std::f64::consts::TAU - turned));
            }
        }
        (position, heading)
    }

    #[test]
    fn the_error_is_what_an_independent_program_measured() {
        // numpy, every handle around 411 s: 60 Hz 1.6e-11 m, 10 Hz 2e-8, 2 Hz 1.3e-5, 1 Hz 2.1e-4.
        for (rate, measured) in [(60.0, 1.6e-11), (10.0, 2e-8), (2.0, 1.3e-5), (1.0, 2.1e-4)] {
            let (position, heading) = worst(410.0, rate, 2.0);
            println!("{rate} Hz: {position:.1e} m, {heading:.1e} rad");
            assert!(position < 2.0 * measured && position > 0.2 * measured, "{rate} Hz: {position:e} m");
            assert!(heading < 2.0 * position / 1.65 + 1e-15, "{rate} Hz: {heading:e} rad");
        }
    }

    #[test]
    fn the_last_interval_before_the_end_trusts_no_velocity_that_standing_still_made_zero() {
        // The show ends at the contact, between two frames; the velocities of the later frame are zero.
        let (position, _) = worst(412.0, 10.0, 0.6);
        println!("{position:.1e} m");
        assert!(position < 1e-4, "{position:e} m");
    }

    #[test]
    fn nothing_lies_between_the_end_of_a_loop_and_its_beginning() {
        let playback =
            Playback { start: 412.0, rate: 10.0, at_end: AtEnd::Loop, end_hold: 0.0, ..Playback::of(&scene()) };
        let reader = reader(playback, 20);
        let mut handles = Vec::new();
        let jump = (1..20).find(|k| reader.frames[*k].header.epoch == 1).unwrap();
        let (before, after) = (deadline_ns(jump as u64 - 1, 10.0), deadline_ns(jump as u64, 10.0));
        for moment in (before..after).step_by(1_000_000) {
            let time = reader.at(moment, &mut handles).unwrap();
            assert_eq!(time, reader.frames[jump - 1].header.sim_time);
            assert!(handles == reader.frames[jump - 1].handles);
        }
    }

    proptest! {
        #[test]
        fn a_cubic_is_reproduced(a in -3.0f64..3.0, b in -3.0f64..3.0, c in -3.0f64..3.0, d in -3.0f64..3.0, h in 0.01f64..2.0, u in 0.0f64..1.0) {
            let value = |t: f64| a + t * (b + t * (c + t * d));
            let rate = |t: f64| b + t * (2.0 * c + t * 3.0 * d);
            let (x, v) = coordinate([value(0.0), value(h)], [rate(0.0), rate(h)], (true, true), h, u);
            prop_assert!((x - value(u * h)).abs() < 1e-13 * 100.0 && (v - rate(u * h)).abs() < 1e-11);
            // A parabola, with either end's velocity.
            let value = |t: f64| a + t * (b + t * c);
            let rate = |t: f64| b + 2.0 * c * t;
            for ends in [(true, false), (false, true)] {
                let rates = [if ends.0 { rate(0.0) } else { 0.0 }, if ends.1 { rate(h) } else { 0.0 }];
                let (x, v) = coordinate([value(0.0), value(h)], rates, ends, h, u);
                prop_assert!((x - value(u * h)).abs() < 1e-11 && (v - rate(u * h)).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn the_last_handle_of_each_of_two_dragons_has_the_heading_that_the_solver_gives() {
        let scene = Scene::parse(include_str!("../../../config/coil.toml"), "coil.toml", "coil").unwrap();
        let playback = Playback { start: 100.0, rate: 10.0, ..Playback::of(&scene) };
        let mut show = Show::new(&scene, scene.ensemble.timeline_without_contact(&mut unreported), playback).unwrap();
        let mut reader = reader_of(&mut show, playback, 2);
        let (mut chain, mut handles) = (Chain::new(122), Vec::new());
        scene.ensemble.solver(scene.velocities).solve(100.05, &mut chain).unwrap();
        let mut worst = |reader: &HermiteReader| {
            reader.at(START_NS + 50_000_000, &mut handles).unwrap();
            let error = |(pose, truth): (&HandlePose, &f64)| (pose.heading - truth).sin().abs();
            handles.iter().zip(&chain.heading).map(error).fold(0.0, f64::max)
        };
        // Without the stage, and with the stage of another run, the last handle of gold is turned toward the head of
        // jade.
        assert!(worst(&reader) > 0.1);
        reader.set_stage(&stage(2, 0, [0; 32], &scene.ensemble, &show).stage);
        assert!(worst(&reader) > 0.1);
        reader.set_stage(&stage(1, 0, [0; 32], &scene.ensemble, &show).stage);
        assert!(worst(&reader) < 1e-7, "{}", worst(&reader));
    }

    #[test]
    fn what_is_outside_the_frames_is_the_nearest_frame() {
        let mut handles = Vec::new();
        assert_eq!(HermiteReader::new(8).at(START_NS, &mut handles), None);
        let reader = reader(Playback { start: 10.0, rate: 10.0, ..Playback::of(&Scene::paper()) }, 5);
        assert_eq!(reader.at(0, &mut handles), Some(10.0));
        assert_eq!(reader.at(deadline_ns(2, 10.0), &mut handles), Some(10.2));
        assert!(handles == reader.frames[2].handles);
        assert_eq!(reader.at(u64::MAX, &mut handles), Some(10.4));
        assert!(handles == reader.frames[4].handles);
    }
}
