//! From the time that a show should have to commands: rate, seek, pause, resume. Pure: frames and answers in, at most
//! one command at a time out.
//!
//! Each frame contains the simulated time of the show at a moment. A small error is corrected by the rate, a larger one
//! by a seek. During a hold, and after a pause or a seek of another client, the chase waits until the show plays again.

use bench_dragon_messages::FrameHeader;
use bench_dragon_messages::control::{Code, Command, RATES};
use bench_dragon_messages::state::PlaybackState;

use crate::filter::seconds_between;

/// The interval of changes of the rate, in nanoseconds.
const RATE_INTERVAL_NS: u64 = 100_000_000;
/// A change of the rate that is too small to be sent, as a part of the rate.
const LEAST_CHANGE: f64 = 2e-5;
/// The times in which a small error and an error above [`SMALL`] are corrected, in seconds.
const TAKE_UP: f64 = 1.0;
const TAKE_UP_FAST: f64 = 0.25;
/// Errors that follow from jitter, in seconds.
const SMALL: f64 = 0.005;
/// The distance from its place at which a paused show is moved there, in seconds.
const PLACE: f64 = 0.02;
/// The time from a command to its effect, in seconds, before the first answer.
const LATENCY: f64 = 0.012;
/// The time after which an unanswered command is given up, in nanoseconds.
const PATIENCE_NS: u64 = 2_000_000_000;

/// The time that a show should have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// Nothing is known: the show is left alone.
    None,
    /// Play, with this simulated time now.
    Follow {
        /// Simulated seconds.
        time: f64,
        /// Simulated seconds per second.
        rate: f64,
    },
    /// Stand still, at a simulated time if there is one.
    Stand(Option<f64>),
}

/// The reason why a chase waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Waiting {
    /// The show is held.
    Held,
    /// Another client, or a cue, has paused the show.
    Paused,
    /// Another client has sent the show to another time.
    Sought,
}

/// The limits of the corrections.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// The greatest correction of the rate, simulated seconds per second.
    pub take_up: f64,
    /// The error above which the show is sent to its time, in seconds.
    pub seek_above: f64,
    /// False if a playing show is never sent back.
    pub seeks_back: bool,
}

/// A command that has been sent.
#[derive(Debug, Clone, Copy)]
struct Pending {
    command: Command,
    sent_ns: u64,
}

/// The steering of one show.
#[derive(Debug, Clone)]
pub struct Steering {
    limits: Limits,
    show: Option<Show>,
    /// Simulated seconds at the end of the show.
    end: f64,
    /// The time from a command to its effect, in seconds.
    latency: f64,
    waiting: Option<Waiting>,
    rate_sent_ns: u64,
}

/// A run of a publisher.
#[derive(Debug, Clone)]
struct Show {
    frame: FrameHeader,
    /// The deadline of that frame on the clock of this process.
    frame_ns: u64,
    period: f64,
    pending: Option<Pending>,
    /// The tick from which frames show the latest command.
    settled_tick: u64,
    /// The state that the latest commands have led to.
    plays: bool,
    epoch: u32,
    /// The latest command without an answer that changes more than the rate: the show may still execute this command.
    unanswered: Option<Command>,
    /// True for a show that was paused or held when it was found, until the show plays or answers a command.
    is_new: bool,
    /// True if another client has made the show play while it should stand.
    is_released: bool,
}

impl Steering {
    /// Creates the steering of a show that has not been found.
    pub fn new(limits: Limits) -> Self {
        Self { limits, show: None, end: f64::INFINITY, latency: LATENCY, waiting: None, rate_sent_ns: 0 }
    }

    /// Sets the simulated time at which the show ends, in seconds.
    pub fn set_end(&mut self, end: f64) {
        self.end = end;
    }

    /// Returns the reason why the chase waits.
    pub fn waiting(&self) -> Option<Waiting> {
        self.waiting
    }

    /// Returns true for a show that was paused when the chase found it, until the show plays or answers a command: its
    /// distance from the source is no error of the chase.
    pub fn begins(&self) -> bool {
        self.show.as_ref().is_some_and(|show| show.is_new)
    }

    /// Returns the latest frame.
    pub fn frame(&self) -> Option<&FrameHeader> {
        self.show.as_ref().map(|show| &show.frame)
    }

    /// Handles the end of the publisher.
    pub fn gone(&mut self) {
        (self.show, self.waiting, self.end) = (None, None, f64::INFINITY);
    }

    /// Handles a frame with its deadline on the clock of this process, in nanoseconds.
    pub fn frame_came(&mut self, header: &FrameHeader, frame_ns: u64) {
        let playback = header.playback_state();
        let Some(show) = self.show.as_mut().filter(|show| show.frame.run_id == header.run_id) else {
            let plays = !matches!(playback, Some(PlaybackState::Paused | PlaybackState::Held));
            self.waiting = (playback == Some(PlaybackState::Held)).then_some(Waiting::Held);
            self.show = Some(Show {
                frame: *header,
                frame_ns,
                period: 1.0 / 60.0,
                pending: None,
                settled_tick: 0,
                plays,
                epoch: header.epoch,
                unanswered: None,
                is_new: !plays,
                is_released: false,
            });
            return;
        };
        let ticks = header.tick.saturating_sub(show.frame.tick);
        if ticks > 0 {
            show.period = seconds_between(show.frame_ns, frame_ns) / ticks as f64;
        }
        (show.frame, show.frame_ns) = (*header, frame_ns);
        if show.pending.is_some() || header.tick < show.settled_tick {
            return;
        }
        let has_jumped = header.epoch != show.epoch;
        let is_paused = playback == Some(PlaybackState::Paused);
        let is_own_seek = has_jumped && matches!(show.unanswered, Some(Command::Seek(_)));
        let is_own_pause = is_paused && show.plays && matches!(show.unanswered, Some(Command::Pause));
        let is_playing = matches!(playback, Some(PlaybackState::Playing | PlaybackState::Ended));
        let is_own_start = is_playing && !show.plays && matches!(show.unanswered, Some(Command::Resume | Command::Go));
        let is_sought = has_jumped && !is_own_seek;
        show.unanswered = show.unanswered.filter(|_| !is_own_seek && !is_own_pause && !is_own_start);
        show.epoch = header.epoch;
        match playback {
            Some(PlaybackState::Held) => self.waiting = Some(Waiting::Held),
            Some(PlaybackState::Paused) if show.is_new && self.waiting.is_none() => (),
            Some(PlaybackState::Paused) if is_own_pause => (),
            Some(PlaybackState::Paused) if show.plays || self.waiting.is_some() => self.waiting = Some(Waiting::Paused),
            Some(PlaybackState::Paused) if is_sought => self.waiting = Some(Waiting::Sought),
            Some(PlaybackState::Playing | PlaybackState::Ended) if !show.plays => {
                // Unless the chase has started the show late, another client has.
                (self.waiting, show.is_released) = (None, !is_own_start);
            }
            Some(PlaybackState::Playing | PlaybackState::Ended) => match self.waiting {
                Some(Waiting::Held | Waiting::Paused) => self.waiting = None,
                _ if is_sought => self.waiting = Some(Waiting::Sought),
                _ => (),
            },
            _ => (),
        }
        show.plays = !matches!(playback, Some(PlaybackState::Paused | PlaybackState::Held));
        show.is_new &= !show.plays;
    }

    /// Handles the answer to the command of the moment `sent_ns`: its code and the tick at which it took hold; `None`
    /// if no answer comes. Late answers, and answers of a publisher that has ended, are ignored.
    pub fn answered(&mut self, sent_ns: u64, answer: Option<(Code, u64)>) {
        let Some(show) = &mut self.show else { return };
        let pending = show.pending.take_if(|pending| pending.sent_ns == sent_ns);
        let Some(Pending { command, .. }) = pending else { return };
        let Some((code, tick)) = answer else {
            show.give_up(command);
            return;
        };
        show.settled_tick = tick;
        if matches!(code, Code::Done | Code::Already) {
            match command {
                Command::Pause => show.plays = false,
                Command::Resume | Command::Go => show.plays = true,
                Command::Seek(_) => show.epoch = show.epoch.wrapping_add(1),
                _ => (),
            }
        } else if command == Command::Go {
            // The show does not wait at its start: a client has paused it.
            self.waiting = Some(Waiting::Paused);
        }
        if command != Command::State {
            show.is_new = false;
        }
        // The moment of the tick, by the latest frame.
        let ticks = tick as f64 - show.frame.tick as f64;
        let took = seconds_between(sent_ns, show.frame_ns) + ticks * show.period;
        if (0.0..0.25).contains(&took) {
            self.latency += 0.2 * (took - self.latency);
        }
    }

    /// Returns the simulated time of the show at a moment; `None` without a show.
    pub fn show_time(&self, now_ns: u64) -> Option<f64> {
        let Show { frame, frame_ns, .. } = self.show.as_ref()?;
        let is_playing = frame.playback_state() == Some(PlaybackState::Playing);
        let elapsed = if is_playing { seconds_between(*frame_ns, now_ns) } else { 0.0 };
        Some((frame.sim_time + frame.time_scale * elapsed).min(self.end))
    }

    /// Returns the next command towards a goal, and counts it as sent at `now_ns`.
    pub fn command(&mut self, goal: Goal, now_ns: u64) -> Option<Command> {
        let time = self.show_time(now_ns)?;
        let (waiting, latency, limits, end) = (self.waiting, self.latency, self.limits, self.end);
        let may_set_rate = now_ns.saturating_sub(self.rate_sent_ns) >= RATE_INTERVAL_NS;
        let show = self.show.as_mut()?;
        if let Some(Pending { command, sent_ns }) = show.pending {
            if now_ns.saturating_sub(sent_ns) > PATIENCE_NS {
                show.pending = None;
                show.give_up(command);
            }
            return None;
        }
        if waiting.is_some() || show.frame.tick < show.settled_tick {
            return None;
        }
        let command = match goal {
            // Before its start and after its end the show stands there.
            Goal::Follow { time: to, .. } if to < 0.0 => show.stand(time, Some(0.0)),
            Goal::Follow { time: to, .. } if to >= end => show.stand(time, Some(end)),
            Goal::Follow { time: to, rate } => {
                show.is_released = false;
                show.follow(to - time, rate, to + latency * rate, limits, may_set_rate, end)
            }
            Goal::Stand(_) if show.is_released => None,
            Goal::Stand(place) => show.stand(time, place.map(|place| place.clamp(0.0, end))),
            Goal::None => None,
        }?;
        if matches!(command, Command::Rate(_)) {
            self.rate_sent_ns = now_ns;
        }
        show.pending = Some(Pending { command, sent_ns: now_ns });
        Some(command)
    }
}

impl Show {
    /// Handles a command whose answer is lost.
    fn give_up(&mut self, command: Command) {
        // A late rate is no sign of another client.
        if !matches!(command, Command::Rate(_)) {
            self.unanswered = Some(command);
        }
    }

    fn stand(&self, time: f64, place: Option<f64>) -> Option<Command> {
        if self.plays {
            return Some(Command::Pause);
        }
        place.filter(|place| (time - place).abs() > PLACE).map(Command::Seek)
    }

    /// Returns the command for a show that is behind by `error`, and should be at `next` when a command takes hold.
    fn follow(
        &self,
        error: f64,
        rate: f64,
        next: f64,
        limits: Limits,
        may_set_rate: bool,
        end: f64,
    ) -> Option<Command> {
        let place = next.clamp(0.0, end);
        if self.is_new {
            return Some(Command::Go);
        }
        if !self.plays {
            let is_there = error.abs() < limits.seek_above.min(0.1);
            return Some(if is_there { Command::Resume } else { Command::Seek(place) });
        }
        if error.abs() > limits.seek_above && (error > 0.0 || limits.seeks_back) {
            return Some(Command::Seek(place));
        }
        let within = if error.abs() > SMALL { TAKE_UP_FAST } else { TAKE_UP };
        let correction = (error / within).clamp(-limits.take_up, limits.take_up);
        let wanted = (rate + correction).clamp(*RATES.start(), *RATES.end());
        let is_other = (wanted - self.frame.time_scale).abs() > LEAST_CHANGE * wanted;
        (is_other && may_set_rate).then_some(Command::Rate(wanted))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn playing(tick: u64, epoch: u32, sim_time: f64) -> FrameHeader {
        let playback = PlaybackState::Playing as u32;
        FrameHeader { run_id: 1, tick, epoch, sim_time, playback, time_scale: 1.0, ..FrameHeader::default() }
    }

    fn steering() -> Steering {
        let mut steering = Steering::new(Limits { take_up: 0.1, seek_above: 0.5, seeks_back: true });
        (0..3).for_each(|tick| steering.frame_came(&playing(tick, 0, tick as f64 / 60.0), at(tick)));
        steering
    }

    fn at(tick: u64) -> u64 {
        1_000_000_000 + tick * 16_666_667
    }

    #[test]
    fn a_seek_whose_answer_is_lost_is_no_seek_of_another_client() {
        let mut steering = steering();
        let command = steering.command(Goal::Follow { time: 50.0, rate: 1.0 }, at(2));
        assert!(matches!(command, Some(Command::Seek(_))), "{command:?}");
        steering.answered(at(2), None);
        // Nor after a lost rate.
        let command = steering.command(Goal::Follow { time: 0.1, rate: 1.0 }, at(12));
        assert!(matches!(command, Some(Command::Rate(_))), "{command:?}");
        steering.answered(at(12), None);
        steering.frame_came(&playing(13, 1, 50.0), at(13));
        assert_eq!(steering.waiting(), None);
        steering.frame_came(&playing(14, 2, 70.0), at(14));
        assert_eq!(steering.waiting(), Some(Waiting::Sought));
    }

    #[test]
    fn an_answer_to_a_command_of_another_run_is_ignored() {
        let mut steering = steering();
        let goal = Goal::Follow { time: 50.0, rate: 1.0 };
        assert!(matches!(steering.command(goal, at(2)), Some(Command::Seek(_))));
        steering.gone();
        let of_next = |header: FrameHeader| FrameHeader { run_id: 2, ..header };
        let waits = FrameHeader { playback: PlaybackState::Paused as u32, ..of_next(playing(0, 0, 0.0)) };
        steering.frame_came(&waits, at(3));
        assert!(matches!(steering.command(goal, at(4)), Some(Command::Go)));
        steering.answered(at(2), None);
        assert_eq!(steering.command(goal, at(5)), None, "a second command before the answer to the first");
        steering.answered(at(4), Some((Code::Done, 1)));
        steering.frame_came(&of_next(playing(1, 0, 0.0)), at(6));
        assert!(matches!(steering.command(goal, at(6)), Some(Command::Seek(_))));
        assert_eq!(steering.waiting(), None);
    }

    /// A show that another client makes play is left alone while the source stands. A show that the chase has started
    /// late is paused again.
    #[test]
    fn a_start_whose_answer_is_lost_is_no_start_of_another_client() {
        for is_own in [false, true] {
            let mut steering = steering();
            assert!(matches!(steering.command(Goal::Stand(None), at(2)), Some(Command::Pause)));
            steering.answered(at(2), Some((Code::Done, 3)));
            let paused = FrameHeader { playback: PlaybackState::Paused as u32, ..playing(3, 0, 3.0) };
            steering.frame_came(&paused, at(3));
            if is_own {
                let resumed = steering.command(Goal::Follow { time: 3.0, rate: 1.0 }, at(4));
                assert!(matches!(resumed, Some(Command::Resume)));
                steering.answered(at(4), None);
            }
            steering.frame_came(&playing(5, 0, 3.0), at(5));
            let command = steering.command(Goal::Stand(None), at(6));
            assert_eq!(matches!(command, Some(Command::Pause)), is_own, "{command:?}");
        }
    }

    /// Its distance from the source is no error, and the pause no command to the chase.
    #[test]
    fn a_show_that_was_paused_before_the_chase_begins_without_an_error() {
        let mut steering = Steering::new(Limits { take_up: 0.1, seek_above: 0.5, seeks_back: true });
        let paused = FrameHeader { playback: PlaybackState::Paused as u32, ..playing(0, 0, 3.0) };
        steering.frame_came(&paused, at(0));
        assert_eq!((steering.begins(), steering.waiting()), (true, None));
        assert!(matches!(steering.command(Goal::Follow { time: 20.5, rate: 1.0 }, at(1)), Some(Command::Go)));
        steering.answered(at(1), Some((Code::Refused, 2)));
        assert_eq!((steering.begins(), steering.waiting()), (false, Some(Waiting::Paused)));
    }

    #[test]
    fn a_pause_whose_answer_is_lost_is_no_pause_of_another_client() {
        let mut steering = steering();
        assert!(matches!(steering.command(Goal::Stand(None), at(2)), Some(Command::Pause)));
        // After two seconds without an answer the command counts as unanswered.
        assert_eq!(steering.command(Goal::Stand(None), at(200)), None);
        let paused = |tick| FrameHeader { playback: PlaybackState::Paused as u32, ..playing(tick, 0, 3.0) };
        steering.frame_came(&paused(201), at(201));
        assert_eq!(steering.waiting(), None);
        assert!(matches!(steering.command(Goal::Follow { time: 3.0, rate: 1.0 }, at(202)), Some(Command::Resume)));
        steering.answered(at(202), Some((Code::Done, 203)));
        steering.frame_came(&playing(203, 0, 3.0), at(203));
        steering.frame_came(&paused(204), at(204));
        assert_eq!(steering.waiting(), Some(Waiting::Paused));
    }
}
