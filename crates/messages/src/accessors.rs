//! From the numbers of a layout back to states, levels, codes and events. Called by every subscriber that wants more than a
//! number.

use crate::control::Code;
use crate::layouts::{CollisionAlert, ControlResponse, FrameHeader, NO_BENCH, StageEvent};
use crate::state::{EventKind, FrameState, Level, PlaybackState};

impl FrameHeader {
    /// The state, or `None` for a number that this layout does not know.
    pub fn frame_state(&self) -> Option<FrameState> {
        of_number(&FrameState::ALL, self.state)
    }

    /// Whether the show plays, or `None` for a number that this layout does not know.
    pub fn playback_state(&self) -> Option<PlaybackState> {
        of_number(&PlaybackState::ALL, self.playback)
    }
}

impl ControlResponse {
    /// What became of the command, or `None` for a number that this layout does not know.
    pub fn result(&self) -> Option<Code> {
        Code::of_number(self.code)
    }

    /// Whether the show plays, or `None` for a number that this layout does not know.
    pub fn playback_state(&self) -> Option<PlaybackState> {
        of_number(&PlaybackState::ALL, self.playback)
    }
}

impl StageEvent {
    /// What happens, or `None` for a number that this layout does not know.
    pub fn kind(&self) -> Option<EventKind> {
        of_number(&FrameState::ALL, self.state)?.event()
    }
}

impl CollisionAlert {
    /// The level, or `None` for a number that this layout does not know.
    pub fn alert_level(&self) -> Option<Level> {
        of_number(&Level::ALL, self.level)
    }

    /// What the alert is about; `None` where it is about no event.
    pub fn event_kind(&self) -> Option<EventKind> {
        of_number(&FrameState::ALL, self.event)?.event()
    }

    /// The nearest benches in this frame, from 0.
    pub fn nearest_benches(&self) -> impl Iterator<Item = u32> {
        benches(self.bench_a, self.bench_b)
    }

    /// The benches of the event, from 0.
    pub fn event_benches(&self) -> impl Iterator<Item = u32> {
        benches(self.event_bench_a, self.event_bench_b)
    }
}

/// The value with a number on the wire: values are numbered in order, from 0.
fn of_number<T: Copy>(all: &[T], number: u32) -> Option<T> {
    all.get(number as usize).copied()
}

fn benches(a: u32, b: u32) -> impl Iterator<Item = u32> {
    [a, b].into_iter().filter(|bench| *bench != NO_BENCH)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_design_and_come_back() {
        let states = FrameState::ALL.map(|state| (state as u32, state.name()));
        let expected = [(0, "moving"), (1, "approaching"), (2, "contact"), (3, "stall"), (4, "lock"), (5, "path_end")];
        assert_eq!(states, expected);
        let levels = Level::ALL.map(|level| (level as u32, level.name()));
        assert_eq!(levels, [(0, "clear"), (1, "approaching"), (2, "contact"), (3, "stall"), (4, "lock")]);
        let playback = PlaybackState::ALL.map(|playback| (playback as u32, playback.name()));
        assert_eq!(playback, [(0, "playing"), (1, "paused"), (2, "held"), (3, "ended")]);
        let header = |state, playback| FrameHeader { state, playback, ..Default::default() };
        assert_eq!(header(4, 3).frame_state(), Some(FrameState::Lock));
        assert_eq!(header(4, 3).playback_state(), Some(PlaybackState::Ended));
        assert_eq!((header(6, 4).frame_state(), header(6, 4).playback_state()), (None, None));
        let alert = |level, event| CollisionAlert { level, event, ..Default::default() };
        assert_eq!(alert(1, 2).alert_level(), Some(Level::Approaching));
        assert_eq!(alert(1, 2).event_kind(), Some(EventKind::Contact));
        assert_eq!(alert(0, 0).event_kind(), None);
        assert_eq!((alert(5, 6).alert_level(), alert(5, 6).event_kind()), (None, None));
    }
}
