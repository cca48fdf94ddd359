//! The state of a frame, the level of an alert and the playback state: each a type without impossible values.
//!
//! Only this file has the [`Severity`] of each, so that colours, signs and diagnostics follow from the severity, and
//! not from the list of states.
//!
//! On the wire the values of each type are numbered in their order, from 0; levels have the numbers of their states.
//! The constants in `msgs/msg` and in the Python layouts are generated from this file, doc comments included: see
//! [`layouts`](crate::layouts).

/// The kinds of events. Two events at one time are listed in this order, those that end a motion last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EventKind {
    /// Two boards that share no handle first touch.
    Contact,
    /// A link is at its dead point, square to the path at its front handle: the rest of the chain is pushed backwards.
    Stall,
    /// A link is in a singular configuration, square to the path at its rear handle, which would need unbounded speed.
    Lock,
    /// The head reaches the end of the path.
    PathEnd,
    /// A board reaches the keep-out of an obstacle, or leaves the boundary by its keep-out.
    Obstacle,
}

impl EventKind {
    /// Returns the name in JSON and on the terminal.
    pub fn name(self) -> &'static str {
        FrameState::from(self).name()
    }
}

/// The severity of a state or a level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// Nothing is wrong.
    Ok,
    /// Something is about to go wrong.
    Warning,
    /// Something has gone wrong.
    Error,
}

impl Severity {
    /// Returns the name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }
}

/// The state of the dragon: the latest event passed, until the show ends or loops, or else an approaching event.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FrameState {
    /// Nothing has happened and nothing is near.
    Moving,
    /// An event is near in time, or two boards are near each other.
    Approaching,
    /// Two boards that share no handle have touched.
    Contact,
    /// A link is at its dead point, square to the path at its front handle: the rest of the chain is pushed backwards.
    Stall,
    /// A link is in a singular configuration, square to the path at its rear handle, which would need unbounded speed.
    Lock,
    /// The head has reached the end of the path.
    PathEnd,
    /// A board has reached the keep-out of an obstacle, or has left the boundary by its keep-out.
    Obstacle,
}

impl FrameState {
    /// Every state, in the order of their numbers on the wire.
    pub const ALL: [Self; 7] =
        [Self::Moving, Self::Approaching, Self::Contact, Self::Stall, Self::Lock, Self::PathEnd, Self::Obstacle];

    /// Returns the name, the severity and the event of each state: the one table of them.
    fn facts(self) -> (&'static str, Severity, Option<EventKind>) {
        match self {
            Self::Moving => ("moving", Severity::Ok, None),
            Self::Approaching => ("approaching", Severity::Warning, None),
            Self::Contact => ("contact", Severity::Error, Some(EventKind::Contact)),
            Self::Stall => ("stall", Severity::Error, Some(EventKind::Stall)),
            Self::Lock => ("lock", Severity::Error, Some(EventKind::Lock)),
            // The intended end of a show.
            Self::PathEnd => ("path_end", Severity::Ok, Some(EventKind::PathEnd)),
            Self::Obstacle => ("obstacle", Severity::Error, Some(EventKind::Obstacle)),
        }
    }

    /// Returns the event that led to this state; `None` if no event has happened.
    pub fn event(self) -> Option<EventKind> {
        self.facts().2
    }

    /// Returns the severity.
    pub fn severity(self) -> Severity {
        self.facts().1
    }

    /// Returns the name in JSON and on the terminal.
    pub fn name(self) -> &'static str {
        self.facts().0
    }
}

impl From<EventKind> for FrameState {
    fn from(kind: EventKind) -> Self {
        match kind {
            EventKind::Contact => Self::Contact,
            EventKind::Obstacle => Self::Obstacle,
            EventKind::Stall => Self::Stall,
            EventKind::Lock => Self::Lock,
            EventKind::PathEnd => Self::PathEnd,
        }
    }
}

const _: () = {
    let mut at = 0;
    while at < FrameState::ALL.len() {
        assert!(FrameState::ALL[at] as usize == at);
        at += 1;
    }
    assert!(Level::Approaching as u32 == FrameState::Approaching as u32);
    assert!(Level::Contact as u32 == FrameState::Contact as u32);
    assert!(Level::Stall as u32 == FrameState::Stall as u32);
    assert!(Level::Lock as u32 == FrameState::Lock as u32);
    assert!(Level::Obstacle as u32 == FrameState::Obstacle as u32);
};

impl From<Level> for FrameState {
    fn from(level: Level) -> Self {
        // Levels have the numbers of their states.
        Self::ALL[level as usize]
    }
}

/// The level of an alert.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Level {
    /// Nothing has happened and nothing is near.
    Clear,
    /// An event is near in time, or two boards are near each other.
    Approaching,
    /// Two boards that share no handle have touched.
    Contact,
    /// A link is at its dead point, square to the path at its front handle: the rest of the chain is pushed backwards.
    Stall,
    /// A link is in a singular configuration, square to the path at its rear handle, which would need unbounded speed.
    Lock,
    /// A board has reached the keep-out of an obstacle, or has left the boundary by its keep-out.
    Obstacle = 6,
}

impl Level {
    /// Every level, in the order of their numbers on the wire, which are the numbers of the states: 5 is no level.
    pub const ALL: [Self; 6] = [Self::Clear, Self::Approaching, Self::Contact, Self::Stall, Self::Lock, Self::Obstacle];

    /// Returns the level that an event raises; `None` for the end of the path, which raises none.
    pub fn of(kind: EventKind) -> Option<Self> {
        Self::ALL.into_iter().find(|level| *level as u32 == FrameState::from(kind) as u32)
    }

    /// Returns true if an event has happened.
    pub fn has_happened(self) -> bool {
        FrameState::from(self).event().is_some()
    }

    /// Returns the severity of the state with the same name.
    pub fn severity(self) -> Severity {
        FrameState::from(self).severity()
    }

    /// Returns the name in JSON and on the terminal.
    pub fn name(self) -> &'static str {
        match self {
            Self::Clear => "clear",
            _ => FrameState::from(self).name(),
        }
    }
}

/// The playback state: simulated time advances or stands still.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PlaybackState {
    /// Simulated time advances.
    Playing,
    /// Simulated time stands still until it is resumed.
    Paused,
    /// Simulated time stands still until the hold is released.
    Held,
    /// The show has ended.
    Ended,
}

impl PlaybackState {
    /// Every state, in the order of their numbers on the wire.
    pub const ALL: [Self; 4] = [Self::Playing, Self::Paused, Self::Held, Self::Ended];

    /// Returns the name in JSON and on the terminal.
    pub fn name(self) -> &'static str {
        match self {
            Self::Playing => "playing",
            Self::Paused => "paused",
            Self::Held => "held",
            Self::Ended => "ended",
        }
    }
}
