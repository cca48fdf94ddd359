//! From the numbers of a layout to states, levels, codes and events.

use crate::control::Code;
use crate::layouts::{CollisionAlert, ControlResponse, FrameHeader, NO_BENCH, Stage, StageDragon, StageEvent};
use crate::state::{EventKind, FrameState, Level, PlaybackState};

impl FrameHeader {
    /// Returns the state, or `None` for a number that this layout does not know.
    pub fn frame_state(&self) -> Option<FrameState> {
        of_number(&FrameState::ALL, self.state)
    }

    /// Returns the playback state, or `None` for a number that this layout does not know.
    pub fn playback_state(&self) -> Option<PlaybackState> {
        of_number(&PlaybackState::ALL, self.playback)
    }
}

impl ControlResponse {
    /// Returns the result of the command, or `None` for a number that this layout does not know.
    pub fn result(&self) -> Option<Code> {
        Code::of_number(self.code)
    }

    /// Returns the playback state, or `None` for a number that this layout does not know.
    pub fn playback_state(&self) -> Option<PlaybackState> {
        of_number(&PlaybackState::ALL, self.playback)
    }
}

impl Stage {
    /// Returns the dragon of a handle or a bench by its number through all handles, and the number within the dragon.
    /// Returns `None` for the number of an obstacle.
    ///
    /// # Examples
    ///
    /// ```
    /// use bench_dragon_messages::{List, SceneName, Stage, StageDragon};
    ///
    /// let gold = StageDragon { benches: 4, name: SceneName::new("gold"), ..StageDragon::default() };
    /// let jade = StageDragon { first_handle: 5, benches: 3, name: SceneName::new("jade"), ..StageDragon::default() };
    /// let stage = Stage { dragons: List::of([gold, jade]), ..Stage::default() };
    /// let owner = |number| stage.owner(number).map(|(dragon, bench)| (dragon.name.as_str(), bench));
    /// assert_eq!((owner(4), owner(5), owner(9)), (Some(("gold", 4)), Some(("jade", 0)), None));
    /// ```
    pub fn owner(&self, number: u32) -> Option<(&StageDragon, u32)> {
        let own = |dragon: &StageDragon| number.checked_sub(dragon.first_handle).filter(|own| *own <= dragon.benches);
        self.dragons.iter().find_map(|dragon| own(dragon).map(|bench| (dragon, bench)))
    }
}

impl StageDragon {
    /// Returns the length and the width of the board of a bench, counted within the dragon, in metres.
    pub fn board(&self, bench: u32) -> [f64; 2] {
        match bench {
            0 => [self.head_length, self.head_width],
            _ if bench + 1 == self.benches => [self.tail_length, self.tail_width],
            _ => [self.body_length, self.width],
        }
    }
}

impl StageEvent {
    /// Returns the kind of the event, or `None` for a number that this layout does not know.
    pub fn kind(&self) -> Option<EventKind> {
        of_number(&FrameState::ALL, self.state)?.event()
    }
}

impl CollisionAlert {
    /// Returns the level, or `None` for a number that this layout does not know.
    pub fn alert_level(&self) -> Option<Level> {
        Level::ALL.into_iter().find(|level| *level as u32 == self.level)
    }

    /// Returns the kind of the alert's event; `None` if the alert has no event.
    pub fn event_kind(&self) -> Option<EventKind> {
        of_number(&FrameState::ALL, self.event)?.event()
    }

    /// Returns the nearest benches in this frame, from 0.
    pub fn nearest_benches(&self) -> impl Iterator<Item = u32> {
        benches(self.bench_a, self.bench_b)
    }

    /// Returns the benches of the event, from 0.
    pub fn event_benches(&self) -> impl Iterator<Item = u32> {
        benches(self.event_bench_a, self.event_bench_b)
    }
}

/// Returns the value of a number on the wire: values are numbered in order, from 0.
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
        let expected = [
            (0, "moving"),
            (1, "approaching"),
            (2, "contact"),
            (3, "stall"),
            (4, "lock"),
            (5, "path_end"),
            (6, "obstacle"),
        ];
        assert_eq!(states, expected);
        let levels = Level::ALL.map(|level| (level as u32, level.name()));
        assert_eq!(
            levels,
            [(0, "clear"), (1, "approaching"), (2, "contact"), (3, "stall"), (4, "lock"), (6, "obstacle")]
        );
        let playback = PlaybackState::ALL.map(|playback| (playback as u32, playback.name()));
        assert_eq!(playback, [(0, "playing"), (1, "paused"), (2, "held"), (3, "ended")]);
        let header = |state, playback| FrameHeader { state, playback, ..Default::default() };
        assert_eq!(header(4, 3).frame_state(), Some(FrameState::Lock));
        assert_eq!(header(4, 3).playback_state(), Some(PlaybackState::Ended));
        assert_eq!((header(7, 4).frame_state(), header(7, 4).playback_state()), (None, None));
        let alert = |level, event| CollisionAlert { level, event, ..Default::default() };
        assert_eq!(alert(1, 2).alert_level(), Some(Level::Approaching));
        assert_eq!(alert(1, 2).event_kind(), Some(EventKind::Contact));
        assert_eq!(alert(0, 0).event_kind(), None);
        assert_eq!((alert(5, 7).alert_level(), alert(5, 7).event_kind()), (None, None));
    }
}
