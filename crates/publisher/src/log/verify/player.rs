//! Plays a show from the lines of its log, in the order of ticks, and compares each second.

use super::super::hash::{FrameHasher, columns, header_words};
use super::super::lines::{Line, SecondLine, ShowLine, command_of};
use super::super::writer::{sampled, second_of};
use super::problem::{FramesOfSecond, Problem};
use super::{Difference, Verdict};
use bench_dragon_messages::control::Code;
use bench_dragon_motion::event::unreported;
use bench_dragon_show::convert::{Stamps, frame_header};
use bench_dragon_show::scene::Scene;
use bench_dragon_show::second_solver::SecondSolver;
use bench_dragon_show::{Frame, Playback, Show, StartError};

/// A show that replays a log.
pub(super) struct Player {
    show: Show,
    rate: f64,
    same_arithmetic: bool,
    reference: SecondSolver,
    /// The next tick.
    tick: u64,
    sequence: u64,
    /// The log's commands before the frame of `tick`.
    announced: Vec<Line>,
    /// The line of the latest command.
    command_line: u64,
    hasher: FrameHasher,
    /// The frames since the latest hash: the first tick, and their number.
    hashed: Option<(u64, u64)>,
    latest: LatestFrame,
    difference: Option<Difference>,
    counts: VerifiedCounts,
    /// The part of the counts since the latest hash.
    uncompared: VerifiedCounts,
}

/// The latest frame, as in the line of a second.
#[derive(Default)]
struct LatestFrame {
    tick: u64,
    sim_time: f64,
    handles: Vec<(u32, f64, f64)>,
}

#[derive(Default)]
struct VerifiedCounts {
    seconds: u64,
    same_seconds: u64,
    frames: u64,
    commands: u64,
    skipped: u64,
    lost: u64,
    last_tick: Option<u64>,
}

impl Player {
    /// Creates the player of a scene.
    pub fn new(scene: &Scene, playback: Playback, same_arithmetic: bool) -> Result<Self, StartError> {
        let timeline = match scene.alerts {
            Some(_) => scene.ensemble.timeline(&mut unreported),
            None => scene.ensemble.timeline_without_contact(&mut unreported),
        };
        let show = Show::new(scene, timeline, playback)?;
        let reference = SecondSolver::of(scene);
        Ok(Self {
            show,
            rate: playback.rate,
            same_arithmetic,
            reference,
            tick: 0,
            sequence: 0,
            announced: Vec::new(),
            command_line: 0,
            hasher: FrameHasher::default(),
            hashed: None,
            latest: LatestFrame::default(),
            difference: None,
            counts: VerifiedCounts::default(),
            uncompared: VerifiedCounts::default(),
        })
    }

    /// Returns the first difference so far.
    pub fn difference(&self) -> Option<&Difference> {
        self.difference.as_ref()
    }

    /// Plays the frames of a line and compares.
    ///
    /// # Errors
    /// The problem of a line that no run can have written.
    pub fn line(&mut self, number: u64, line: &Line) -> Result<(), Problem> {
        match line {
            Line::Command { tick, command, value, code } => {
                self.play_until(number, *tick)?;
                let known = code.as_deref().is_none_or(|code| Code::named(code).is_some());
                let Some(command) = command_of(command, *value).filter(|_| known) else {
                    return Err(Problem::UnknownCommand);
                };
                self.counts.commands += 1;
                self.uncompared.commands += 1;
                self.announce(number, line);
                self.show.command(*tick, command);
                self.show.finished_step(*tick);
            }
            Line::StepFinished { tick, .. } => {
                self.play_until(number, *tick)?;
                self.announce(number, line);
            }
            Line::Skipped { from, to } => {
                self.play_until(number, *from)?;
                self.counts.skipped += self.range(*from, *to)?;
                self.skip_to(number, to + 1)?;
            }
            Line::Lost { from, to } => {
                self.play_until(number, *from)?;
                if second_of(*from, self.rate) != second_of(*to, self.rate) {
                    return Err(Problem::SeveralSeconds { from: *from, to: *to });
                }
                self.counts.lost += self.range(*from, *to)?;
                while self.tick <= *to && self.difference.is_none() {
                    self.play(number, false);
                }
            }
            Line::Second(second) => self.second(number, second)?,
            Line::End { frames, skipped, lost, .. } => {
                if !self.announced.is_empty() {
                    return Err(Problem::UnplayedCommands { tick: self.tick, line: self.command_line });
                }
                if let Some((from, _)) = self.hashed {
                    return Err(Problem::Unhashed(from));
                }
                let found = [*frames, *skipped, *lost];
                let expected = [self.counts.frames, self.counts.skipped, self.counts.lost];
                if found != expected {
                    return Err(Problem::Totals { found, expected });
                }
            }
            Line::Show(_) | Line::Stopped { .. } => {}
        }
        Ok(())
    }

    /// Returns the verdict.
    pub fn verdict(self, show: &ShowLine, complete: bool, cut: bool) -> Verdict {
        let VerifiedCounts { seconds, same_seconds, skipped, lost, last_tick, .. } = self.counts;
        let frames = self.counts.frames - self.uncompared.frames;
        let commands = self.counts.commands - self.uncompared.commands;
        let verdict = match &self.difference {
            Some(_) => "differs",
            None if seconds == 0 => "nothing",
            None if same_seconds == seconds => "same",
            None => "close",
        };
        Verdict {
            verdict,
            difference: self.difference,
            seconds,
            same_seconds,
            frames,
            commands,
            skipped,
            lost,
            last_tick,
            complete,
            cut,
            version: show.version.clone(),
            instructions: show.arithmetic.instructions.clone(),
            same_arithmetic: self.same_arithmetic,
            max_difference: self.reference.worst().map(|(metres, _)| metres),
            tolerance: self.reference.worst().map(|(_, tolerance)| tolerance),
        }
    }

    /// Returns the number of ticks in a line's range, which must begin at the next tick.
    fn range(&self, from: u64, to: u64) -> Result<u64, Problem> {
        if from != self.tick || to < from || to == u64::MAX {
            return Err(Problem::Ticks { from, to, next: self.tick });
        }
        Ok(to - from + 1)
    }

    fn announce(&mut self, number: u64, line: &Line) {
        self.announced.push(line.clone());
        self.command_line = number;
    }

    /// Plays the frames before a tick.
    fn play_until(&mut self, number: u64, tick: u64) -> Result<(), Problem> {
        if tick < self.tick {
            return Err(Problem::Tick { tick, next: self.tick });
        }
        // Two seconds have the line of the first between them. This also bounds the work after a wrong digit.
        if tick > self.tick && second_of(tick - 1, self.rate) != second_of(self.tick, self.rate) {
            let second = second_of(self.tick, self.rate);
            return Err(Problem::NoHash { from: self.tick, to: tick - 1, second });
        }
        while self.tick < tick && self.difference.is_none() {
            self.play(number, true);
        }
        Ok(())
    }

    /// Skips periods. The commands before them must have had their frame.
    fn skip_to(&mut self, number: u64, tick: u64) -> Result<(), Problem> {
        if !self.announced.is_empty() {
            return Err(Problem::SkippedCommands { tick: self.tick, line: number });
        }
        self.tick = tick;
        Ok(())
    }

    /// Plays the frame of the next tick.
    fn play(&mut self, number: u64, hashed: bool) {
        let tick = self.tick;
        let stamps = Stamps { run_id: 0, sequence: self.sequence, stamp_ns: 0, deadline_ns: 0 };
        let frame = self.show.frame(tick);
        let commands: Vec<Line> = frame.commands.iter().map(|record| Line::of(tick, *record)).collect();
        if hashed {
            self.hasher.frame(&header_words(&frame_header(frame, stamps)), columns(&frame.chain));
            self.latest.note(frame);
            self.hashed = Some(self.hashed.map_or((tick, 1), |(from, frames)| (from, frames + 1)));
            self.counts.frames += 1;
            self.uncompared.frames += 1;
        }
        self.show.finished_step(tick);
        (self.tick, self.sequence) = (tick + 1, self.sequence + 1);
        if commands != self.announced {
            let line = if self.announced.is_empty() { number } else { self.command_line };
            let what = format!("commands: the log has {}, computed {}", listed(&self.announced), listed(&commands));
            self.differ(line, (tick, tick), what);
        }
        self.announced.clear();
    }

    fn second(&mut self, number: u64, line: &SecondLine) -> Result<(), Problem> {
        let next = line.to.checked_add(1).ok_or(Problem::LastTick)?;
        // The frames lost at the end of the second have been played.
        self.play_until(number, next.max(self.tick))?;
        let Some((from, frames)) = self.hashed.take().filter(|_| self.difference.is_none()) else {
            return if self.difference.is_some() { Ok(()) } else { Err(Problem::NoFrame) };
        };
        let to = self.latest.tick;
        let found = FramesOfSecond { second: line.second, from: line.from, to: line.to, frames: line.frames };
        let expected = FramesOfSecond { second: second_of(from, self.rate), from, to, frames };
        if found != expected {
            return Err(Problem::Second { found, expected });
        }
        self.counts.seconds += 1;
        // The commands of the next tick have no frame yet.
        let commands = self.announced.iter().filter(|line| matches!(line, Line::Command { .. })).count() as u64;
        self.uncompared = VerifiedCounts { commands, ..VerifiedCounts::default() };
        let (hash, sample) = (self.hasher.take(), &self.latest);
        let (same_hash, same_sample) = (hash == line.hash, sample.is(line));
        if same_hash && same_sample {
            self.counts.same_seconds += 1;
            self.counts.last_tick = Some(to);
            return Ok(());
        }
        if !self.same_arithmetic {
            let numbers = |handles: &[(u32, f64, f64)]| handles.iter().map(|handle| handle.0).collect::<Vec<_>>();
            let compared = if numbers(&self.latest.handles) == numbers(&line.handles) {
                let compared = self.reference.compare(line.sim_time, self.latest.sim_time, &line.handles);
                compared.map_err(|error| error.to_string())
            } else {
                Err("other handles than those that are sampled".to_owned())
            };
            match compared {
                Ok(()) => self.counts.last_tick = Some(to),
                Err(what) => self.differ(number, (from, to), what),
            }
            return Ok(());
        }
        let apart = sample.distance(line).map_or(String::new(), |metres| {
            format!("; sampled handles of its last frame are up to {metres:.1e} m apart")
        });
        let what = match (same_hash, same_sample) {
            (true, _) => format!("the handles in its line, not its hash{apart}"),
            (_, true) => {
                format!("hash {}, computed {hash}; the sampled handles of its last frame are the same", line.hash)
            }
            _ => format!("hash {}, computed {hash}{apart}", line.hash),
        };
        self.differ(number, (from, to), what);
        Ok(())
    }

    fn differ(&mut self, line: u64, (from, to): (u64, u64), what: String) {
        let second = second_of(from, self.rate);
        self.difference.get_or_insert(Difference { line, second, from, to, what });
    }
}

impl LatestFrame {
    fn note(&mut self, frame: &Frame) {
        (self.tick, self.sim_time) = (frame.tick, frame.sim_time);
        self.handles.clear();
        let chain = &frame.chain;
        let handles = sampled(chain.handles());
        self.handles.extend(handles.map(|handle| (handle as u32, chain.x[handle], chain.y[handle])));
    }

    /// Returns true if a line has the same bits.
    fn is(&self, line: &SecondLine) -> bool {
        let bits = |(handle, x, y): &(u32, f64, f64)| (*handle, x.to_bits(), y.to_bits());
        self.sim_time.to_bits() == line.sim_time.to_bits()
            && self.handles.iter().map(bits).eq(line.handles.iter().map(bits))
    }

    /// Returns the greatest distance in metres from the handles of a line. Returns `None` for other handle numbers.
    fn distance(&self, line: &SecondLine) -> Option<f64> {
        let same_handles = self.handles.iter().map(|of| of.0).eq(line.handles.iter().map(|of| of.0));
        let pairs = self.handles.iter().zip(&line.handles);
        let most = pairs.map(|(a, b)| (a.1 - b.1).hypot(a.2 - b.2)).fold(0.0, f64::max);
        same_handles.then_some(most)
    }
}

/// Returns the commands in words.
fn listed(lines: &[Line]) -> String {
    let words = lines.iter().map(|line| match line {
        Line::Command { command, value, code, .. } => {
            let value = value.map_or(String::new(), |value| format!(" {value}"));
            format!("{command}{value} ({})", code.as_deref().unwrap_or("begun"))
        }
        Line::StepFinished { code, .. } => format!("the end of a step ({code})"),
        _ => String::new(),
    });
    let words: Vec<String> = words.collect();
    if words.is_empty() { "none".to_owned() } else { words.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench_dragon_motion::solve::{Chain, Velocities};
    use bench_dragon_show::solve_at_or_just_before;

    /// The handles of a head that another arithmetic has rounded. They are within the tolerance up to the lock, where
    /// rounding errors grow without bound.
    #[test]
    fn handles_of_another_rounding_are_close_up_to_the_lock() {
        let text = include_str!("../../../../../config/paper.toml").replace("accuracy = ", "# ");
        let text =
            text.replace("[motion]\n", "[motion]\nsolver = \"newton\"\n").replace("benches = 223", "benches = 40");
        let scene = Scene::parse(&text, "lock.toml", "lock").unwrap();
        let motion = scene.ensemble.only().unwrap();
        let lock = scene.ensemble.timeline_without_contact(&mut unreported).show_end(false).time;
        let mut reference = SecondSolver::of(&scene);
        let mut solver = motion.solver(Velocities::Omitted).solver;
        let mut chain = Chain::new(motion.team().handles());
        let mut furthest: f64 = 0.0;
        for before in [100.0, 1.0, 1e-3, 1e-6, 1e-9, 1e-10, 1e-11, 1e-12, 0.0] {
            let time = lock - before;
            let rounded = time - 8.0 * f64::EPSILON * time;
            solve_at_or_just_before(solver.as_mut(), rounded, &mut chain).unwrap();
            let mut compare = |moved: f64| {
                let handle = |handle: usize| (handle as u32, chain.x[handle] + moved, chain.y[handle]);
                reference.compare(time, time, &sampled(40).map(handle).collect::<Vec<_>>())
            };
            assert!(compare(1e-4).is_err(), "{before} s before the lock");
            assert_eq!(compare(0.0), Ok(()), "{before} s before the lock");
            furthest = furthest.max(reference.worst().unwrap().0);
        }
        assert!(furthest > 1e-11, "the last moments are no harder than others: {furthest:.1e} m");
    }
}
