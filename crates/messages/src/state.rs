//! The state of a frame, the level of an alert, and whether the show plays: each a type without impossible values.
//!
//! How serious each is stands here alone, as its [`Severity`]: colours, signs and diagnostics follow from that, so that
//! nothing that shows a state need know which states there are.
//!
//! Called by the show; the wire numbers the values of each type in their order, from 0. The constants in `msgs/msg`
//! and in the Python layouts are generated from here, doc comments included: see `wire::layouts`.

/// The kinds of events. Their order is that in which two events at one time are listed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EventKind {
    /// Two boards that share no handle first touch.
    Contact,
    /// A link is at its dead point, square to the path at its front handle: what follows is pushed backwards.
    Stall,
    /// A link is in a singular configuration: its rear handle would have to jump, and the motion cannot continue.
    Lock,
    /// The head reaches the end of the path.
    PathEnd,
}

impl EventKind {
    /// The name in JSON and on the terminal.
    pub fn name(self) -> &'static str {
        match self {
            Self::Contact => "contact",
            Self::Stall => "stall",
            Self::Lock => "lock",
            Self::PathEnd => "path_end",
        }
    }
}

/// How serious a state or a level is, for whatever shows it.
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
    /// The name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }
}

/// What the dragon is doing: the latest event passed, which stays until the show ends or loops, or what is near.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FrameState {
    /// Nothing has happened and nothing is near.
    Moving,
    /// An event is near in time, or two boards are near each other.
    Approaching,
    /// Two boards that share no handle have touched.
    Contact,
    /// A link is at its dead point, square to the path at its front handle: what follows is pushed backwards.
    Stall,
    /// A link is in a singular configuration: the motion cannot continue.
    Lock,
    /// The head has reached the end of the path.
    PathEnd,
}

impl FrameState {
    /// Every state, in the order of their numbers on the wire.
    pub const ALL: [Self; 6] = [Self::Moving, Self::Approaching, Self::Contact, Self::Stall, Self::Lock, Self::PathEnd];

    /// The event that led to this state; `None` where none has happened.
    pub fn event(self) -> Option<EventKind> {
        match self {
            Self::Moving | Self::Approaching => None,
            Self::Contact => Some(EventKind::Contact),
            Self::Stall => Some(EventKind::Stall),
            Self::Lock => Some(EventKind::Lock),
            Self::PathEnd => Some(EventKind::PathEnd),
        }
    }

    /// How serious it is. The end of the path is where a show is meant to end.
    pub fn severity(self) -> Severity {
        match self {
            Self::Moving | Self::PathEnd => Severity::Ok,
            Self::Approaching => Severity::Warning,
            Self::Contact | Self::Stall | Self::Lock => Severity::Error,
        }
    }

    /// The name in JSON and on the terminal.
    pub fn name(self) -> &'static str {
        match self {
            Self::Moving => "moving",
            Self::Approaching => "approaching",
            Self::Contact => EventKind::Contact.name(),
            Self::Stall => EventKind::Stall.name(),
            Self::Lock => EventKind::Lock.name(),
            Self::PathEnd => EventKind::PathEnd.name(),
        }
    }
}

impl From<EventKind> for FrameState {
    fn from(kind: EventKind) -> Self {
        match kind {
            EventKind::Contact => Self::Contact,
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
        }
    }
}

/// How serious an alert is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Level {
    /// Nothing has happened and nothing is near.
    Clear,
    /// An event is near in time, or two boards are near each other.
    Approaching,
    /// Two boards that share no handle have touched.
    Contact,
    /// A link is at its dead point, square to the path at its front handle: what follows is pushed backwards.
    Stall,
    /// A link is in a singular configuration: the motion cannot continue.
    Lock,
}

impl Level {
    /// Every level, in the order of their numbers on the wire.
    pub const ALL: [Self; 5] = [Self::Clear, Self::Approaching, Self::Contact, Self::Stall, Self::Lock];

    /// The level that an event raises; `None` for the end of the path, which raises none.
    pub fn of(kind: EventKind) -> Option<Self> {
        match kind {
            EventKind::Contact => Some(Self::Contact),
            EventKind::Stall => Some(Self::Stall),
            EventKind::Lock => Some(Self::Lock),
            EventKind::PathEnd => None,
        }
    }

    /// Whether an event has happened, rather than none or one that is coming.
    pub fn has_happened(self) -> bool {
        FrameState::from(self).event().is_some()
    }

    /// How serious it is: as the state.
    pub fn severity(self) -> Severity {
        FrameState::from(self).severity()
    }

    /// The name in JSON and on the terminal.
    pub fn name(self) -> &'static str {
        match self {
            Self::Clear => "clear",
            _ => FrameState::from(self).name(),
        }
    }
}

/// Whether simulated time advances.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PlaybackState {
    /// Simulated time advances.
    Playing,
    /// Simulated time stands still until it is resumed.
    Paused,
    /// Simulated time stands still until the hold is released.
    Held,
    /// The show has frozen at its end.
    Ended,
}

impl PlaybackState {
    /// Every state, in the order of their numbers on the wire.
    pub const ALL: [Self; 4] = [Self::Playing, Self::Paused, Self::Held, Self::Ended];

    /// The name in JSON and on the terminal.
    pub fn name(self) -> &'static str {
        match self {
            Self::Playing => "playing",
            Self::Paused => "paused",
            Self::Held => "held",
            Self::Ended => "ended",
        }
    }
}
