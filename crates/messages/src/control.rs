//! What can be commanded of a running show, and how a command is answered.
//!
//! Called by the show clock, which obeys, and by every door through which commands come.

/// Rates that a show can be played at, simulated seconds per second.
pub const RATES: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

/// The most periods of one step: a double counts no further in whole numbers.
const MOST_STEPS: f64 = 9_007_199_254_740_992.0;

/// A command, numbered on the wire in this order, from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Does nothing: the answer reports the state of the show.
    State,
    /// Simulated time stands still.
    Pause,
    /// It advances again.
    Resume,
    /// Simulated seconds per second from now on; kept through a pause.
    Rate(f64),
    /// To a simulated time, playing or paused as before.
    Seek(f64),
    /// So many periods at the rate in force, then paused again.
    Step(u64),
    /// To the start, playing or paused as before.
    Restart,
    /// As a pause, from any state, latched until it is released.
    Hold,
    /// From hold to paused.
    Release,
    /// On from where the show waits: a cue that pauses, or a start that waits.
    Go,
}

impl Command {
    /// Every command by name, in the order of its number.
    pub const NAMES: [&str; 10] =
        ["state", "pause", "resume", "rate", "seek", "step", "restart", "hold", "release", "go"];

    /// The command of a number, with its value where it has one.
    ///
    /// # Errors
    /// [`Code::NotUnderstood`] for another number, [`Code::OutOfRange`] for a value that no show can obey.
    pub fn of_number(number: u32, value: f64) -> Result<Self, Code> {
        let command = match number {
            0 => Self::State,
            1 => Self::Pause,
            2 => Self::Resume,
            3 => Self::Rate(value),
            4 => Self::Seek(value),
            5 if (1.0..=MOST_STEPS).contains(&value) && value.fract() == 0.0 => Self::Step(value as u64),
            5 => return Err(Code::OutOfRange),
            6 => Self::Restart,
            7 => Self::Hold,
            8 => Self::Release,
            9 => Self::Go,
            _ => return Err(Code::NotUnderstood),
        };
        Ok(command)
    }

    /// Its number on the wire, and its value, 0 where it has none.
    pub fn number_and_value(self) -> (u32, f64) {
        match self {
            Self::State => (0, 0.0),
            Self::Pause => (1, 0.0),
            Self::Resume => (2, 0.0),
            Self::Rate(rate) => (3, rate),
            Self::Seek(time) => (4, time),
            Self::Step(periods) => (5, periods as f64),
            Self::Restart => (6, 0.0),
            Self::Hold => (7, 0.0),
            Self::Release => (8, 0.0),
            Self::Go => (9, 0.0),
        }
    }
}

/// What became of a command, numbered on the wire in this order, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Code {
    /// It is done.
    Done,
    /// The show stood so already.
    Already,
    /// Not in this state.
    Refused,
    /// The value is out of range.
    OutOfRange,
    /// There is no such command.
    NotUnderstood,
    /// Too many commands are waiting.
    TooMany,
}

impl Code {
    /// Every code, in the order of its number.
    pub const ALL: [Self; 6] =
        [Self::Done, Self::Already, Self::Refused, Self::OutOfRange, Self::NotUnderstood, Self::TooMany];

    /// Its name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Already => "already",
            Self::Refused => "refused",
            Self::OutOfRange => "out_of_range",
            Self::NotUnderstood => "not_understood",
            Self::TooMany => "too_many",
        }
    }
}

/// Commands and ended steps that a frame has room for; the loop obeys one command a period, which can end a step.
pub const COMMANDS_PER_FRAME: usize = 4;

/// A command that was given to the show, or the end of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CommandRecord {
    /// A command.
    Given {
        /// The command.
        command: Command,
        /// What became of it; `None` for a step that has begun, whose end is a record of its own.
        code: Option<Code>,
    },
    /// A step was over, or was broken off.
    StepFinished {
        /// How it ended.
        code: Code,
    },
}
