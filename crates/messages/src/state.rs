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
        match self {
            Self::Contact => "contact",
            Self::Obstacle => "obstacle",
            Self::Stall => "stall",
            Self::Lock => "lock",
            Self::PathEnd => "path_end",
        }
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

    /// Returns the event that led to this state; `None` if no event has happened.
    pub fn event(self) -> Option<EventKind> {
        match self {
            Self::Moving | Self::Approaching => None,
            Self::Contact => Some(EventKind::Contact),
            Self::Stall => Some(EventKind::Stall),
            Self::Lock => Some(EventKind::Lock),
            Self::PathEnd => Some(EventKind::PathEnd),
            Self::Obstacle => Some(EventKind::Obstacle),
        }
    }

    /// Returns the severity. The end of the path is the intended end of a show.
    pub fn severity(self) -> Severity {
        match self {
            Self::Moving | Self::PathEnd => Severity::Ok,
            Self::Approaching => Severity::Warning,
            Self::Contact | Self::Stall | Self::Lock | Self::Obstacle => Severity::Error,
        }
    }

    /// Returns the name in JSON and on the terminal.
    pub fn name(self) -> &'static str {
        match self {
            Self::Moving => "moving",
            Self::Approaching => "approaching",
            Self::Contact => EventKind::Contact.name(),
            Self::Stall => EventKind::Stall.name(),
            Self::Lock => EventKind::Lock.name(),
            Self::PathEnd => EventKind::PathEnd.name(),
            Self::Obstacle => EventKind::Obstacle.name(),
        }
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

impl From<Level> for FrameState {
    fn from(level: Level) -> Self {
        match level {
            Level::Clear => Self::Moving,
            Level::Approaching => Self::Approaching,
            Level::Contact => Self::Contact,
            Level::Stall => Self::Stall,
            Level::Lock => Self::Lock,
            Level::Obstacle => Self::Obstacle,
        }
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
        match kind {
            EventKind::Contact => Some(Self::Contact),
            EventKind::Obstacle => Some(Self::Obstacle),
            EventKind::Stall => Some(Self::Stall),
            EventKind::Lock => Some(Self::Lock),
            EventKind::PathEnd => None,
        }
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
