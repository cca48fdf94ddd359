//! A [`Show`] as the loop's frame source.
//!
//! The header, the alerts and the cues of a frame are converted here, once, into memory that is reserved beforehand.

use bench_dragon_messages::control::Command;
use bench_dragon_messages::{CollisionAlert, Cue, FrameHeader};
use bench_dragon_show::alerts::MOST_PER_FRAME;
use bench_dragon_show::convert::{Stamps, collision_alert, cue, frame_header};
use bench_dragon_show::{Frame, Outcome, Show};

use super::{FrameSource, Outgoing, Period};

/// The messages of one frame.
#[derive(Debug, Default)]
pub struct FrameMessages {
    header: FrameHeader,
    alerts: Vec<CollisionAlert>,
    cues: Vec<Cue>,
}

impl FrameMessages {
    /// Reserves memory for the alerts and the cues of a frame of a scene with `events` events and `cues` cues.
    pub fn new(events: usize, cues: usize) -> Self {
        // With several dragons one frame can announce all events, and a contact that no search had found.
        let alerts = Vec::with_capacity(MOST_PER_FRAME.max(events + 1));
        // One frame can reach each cue twice.
        Self { header: FrameHeader::default(), alerts, cues: Vec::with_capacity(2 * cues) }
    }

    /// Converts a frame. Allocates nothing for a frame of the scene that this memory was reserved for.
    pub fn of<'a>(&'a mut self, frame: &'a Frame, stamps: Stamps) -> Outgoing<'a> {
        let Self { header, alerts, cues } = self;
        *header = frame_header(frame, stamps);
        alerts.clear();
        alerts.extend(frame.alerts.iter().map(|alert| collision_alert(header, alert)));
        cues.clear();
        cues.extend(frame.cues.iter().map(|reached| cue(header, reached)));
        Outgoing { alerts, cues, ..Outgoing::new(header, frame) }
    }
}

/// A show and the messages of its latest frame.
pub struct ShowSource {
    /// The show.
    pub show: Show,
    messages: FrameMessages,
}

impl ShowSource {
    /// Reserves the memory for a show's messages.
    pub fn new(show: Show) -> Self {
        let messages = FrameMessages::new(show.timeline().events().len(), show.cues().len());
        Self { show, messages }
    }

    /// Returns the frame of the period `tick`.
    pub fn outgoing(&mut self, tick: u64, stamps: Stamps) -> Outgoing<'_> {
        self.messages.of(self.show.frame(tick), stamps)
    }
}

impl FrameSource for ShowSource {
    fn frame(&mut self, tick: u64, stamps: Stamps) -> Period<'_> {
        Period::Frame(self.outgoing(tick, stamps))
    }

    fn command(&mut self, tick: u64, command: Command) -> Option<Outcome> {
        self.show.command(tick, command)
    }

    fn finished_step(&mut self, tick: u64) -> Option<Outcome> {
        self.show.finished_step(tick)
    }
}
