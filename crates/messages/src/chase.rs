//! The sources and the states of a chase.

use crate::layouts::ChaseStatus;

/// A source of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChaseSource {
    /// ArtTimeCode over the network.
    ArtNet,
    /// MIDI timecode.
    Mtc,
    /// Linear timecode as sound.
    Ltc,
    /// A tracker of PosiStageNet.
    Psn,
}

impl ChaseSource {
    /// Every source, by its number on the wire.
    pub const ALL: [Self; 4] = [Self::ArtNet, Self::Mtc, Self::Ltc, Self::Psn];

    /// Returns the name on the command line and in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ArtNet => "artnet",
            Self::Mtc => "mtc",
            Self::Ltc => "ltc",
            Self::Psn => "psn",
        }
    }

    /// Returns the name for people.
    pub const fn title(self) -> &'static str {
        match self {
            Self::ArtNet => "ArtTimeCode",
            Self::Mtc => "MTC",
            Self::Ltc => "LTC",
            Self::Psn => "PSN",
        }
    }
}

/// The state of a chase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChaseState {
    /// Nothing has come from the source.
    Silent,
    /// Too few readings in order have come.
    Locking,
    /// The show follows.
    Locked,
    /// The source is silent; the show continues at the source's rate.
    Freewheeling,
    /// The source stands; the show is paused there.
    Standing,
    /// The source runs backward; the show is paused.
    Backward,
    /// The source is silent for longer than the freewheel time, or off the path; the show is paused.
    Lost,
    /// The show is held: the chase waits.
    Held,
    /// The show is paused, by another client or a cue, now or before the chase began: the chase waits until it plays.
    Paused,
    /// Another client has sent the show to another time: the chase waits until the show is paused and resumed.
    Sought,
    /// The chase has ended.
    Ended,
}

impl ChaseState {
    /// Every state, by its number on the wire.
    pub const ALL: [Self; 11] = [
        Self::Silent,
        Self::Locking,
        Self::Locked,
        Self::Freewheeling,
        Self::Standing,
        Self::Backward,
        Self::Lost,
        Self::Held,
        Self::Paused,
        Self::Sought,
        Self::Ended,
    ];

    /// Returns the name in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Silent => "silent",
            Self::Locking => "locking",
            Self::Locked => "locked",
            Self::Freewheeling => "freewheeling",
            Self::Standing => "standing",
            Self::Backward => "backward",
            Self::Lost => "lost",
            Self::Held => "held",
            Self::Paused => "paused",
            Self::Sought => "sought",
            Self::Ended => "ended",
        }
    }

    /// Returns the words for people.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Silent => "no signal has come",
            Self::Locking => "locking",
            Self::Locked => "locked",
            Self::Freewheeling => "freewheeling",
            Self::Standing => "stands: the show is paused there",
            Self::Backward => "runs backward: the show is paused",
            Self::Lost => "lost: the show is paused",
            Self::Held => "waits: the show is held",
            Self::Paused => "waits: the show is paused, by another client or a cue; a resume ends that",
            Self::Sought => "waits: another client has sent a seek; a pause and a resume end that",
            Self::Ended => "the chase has ended",
        }
    }
}

impl ChaseStatus {
    /// Returns the source, or `None` for a number that this layout does not know.
    pub fn chase_source(&self) -> Option<ChaseSource> {
        ChaseSource::ALL.get(self.source as usize).copied()
    }

    /// Returns the state, or `None` for a number that this layout does not know.
    pub fn chase_state(&self) -> Option<ChaseState> {
        ChaseState::ALL.get(self.state as usize).copied()
    }

    /// Returns the label of timecode; `None` without a label.
    pub fn label(&self) -> Option<String> {
        let Self { hours, minutes, seconds, frames, .. } = *self;
        (self.frame_rate != 0).then(|| format!("{hours:02}:{minutes:02}:{seconds:02}:{frames:02}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_layout() {
        let states = ChaseState::ALL.map(|state| format!("{} {}", state as u32, state.name())).join(", ");
        assert!(include_str!("layouts/chase.rs").contains(&format!("/// {states}.")), "{states}");
        let sources = ChaseSource::ALL.map(|source| source as u32);
        assert_eq!(sources, [0, 1, 2, 3]);
    }
}
