//! The commands to a running show, and the codes of their responses: one table of each.
//!
//! The show clock executes the commands. The client, the publisher's control service, the ROS 2 services, the log and
//! the stage page take numbers and names from the tables here.

use std::mem::discriminant;

/// Rates at which a show can be played, simulated seconds per second.
pub const RATES: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

/// The most periods of a step: the greatest whole number up to which a double counts exactly.
pub const MOST_PERIODS: u64 = 1 << f64::MANTISSA_DIGITS;

/// The value of a request for the state. The response then has, as its `time_scale`, the rate at which the show plays
/// or will continue. A show that is paused or held has another rate in force, 0.
pub const PLAYING_RATE: f64 = 1.0;

/// A command. Its number on the wire is its place in [`Command::TABLE`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Changes nothing: the response reports the state of the show.
    State,
    /// Stops simulated time.
    Pause,
    /// Lets simulated time advance again.
    Resume,
    /// Sets the rate, simulated seconds per second; a pause keeps it.
    Rate(f64),
    /// Jumps to a simulated time, in seconds, playing or paused as before.
    Seek(f64),
    /// Plays this number of periods at the rate in force, then pauses again.
    Step(u64),
    /// Jumps to the start, playing or paused as before.
    Restart,
    /// Stops simulated time in any state, until [`Command::Release`].
    Hold,
    /// From hold to paused.
    Release,
    /// Continues from a cue that pauses, or from a start that waits.
    Go,
}

/// The value of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CommandValue {
    /// None; 0 on the wire.
    None,
    /// Simulated seconds per second.
    Rate,
    /// Simulated seconds since the start of the scene.
    Seconds,
    /// A whole number of periods.
    Periods,
}

/// The reason for which a show that is not held refuses a command or its value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// The command is never refused.
    Never,
    /// The value is outside [`RATES`].
    RateOutOfRange,
    /// The time is before 0 or past the end of the show.
    TimeOutOfRange,
    /// The show is not paused.
    NotPaused,
    /// The show is not held.
    NotHeld,
    /// The show does not wait at a cue or at its start.
    NotWaiting,
}

/// A row of the table of commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandEntry {
    /// The number on the wire.
    pub number: u32,
    /// The name in JSON, in the log and on the command line.
    pub name: &'static str,
    /// The command, with the value 1 if it has one.
    pub command: Command,
    /// The kind of its value.
    pub value: CommandValue,
    /// The help of the command line.
    pub help: &'static str,
    /// The reason for a refusal.
    pub refusal: Refusal,
    /// True if a show that is held executes it.
    pub allowed_while_held: bool,
}

const fn entry(
    number: u32,
    name: &'static str,
    command: Command,
    value: CommandValue,
    refusal: Refusal,
    allowed_while_held: bool,
    help: &'static str,
) -> CommandEntry {
    CommandEntry { number, name, command, value, help, refusal, allowed_while_held }
}

impl Command {
    /// Every command, in the order of its number.
    #[rustfmt::skip]
    pub const TABLE: [CommandEntry; 10] = [
        entry(0, "state", Self::State, CommandValue::None, Refusal::Never, true,
            "Print the playback state"),
        entry(1, "pause", Self::Pause, CommandValue::None, Refusal::Never, false,
            "Stop simulated time; frames are sent at full rate"),
        entry(2, "resume", Self::Resume, CommandValue::None, Refusal::Never, false,
            "Let simulated time advance again"),
        entry(3, "rate", Self::Rate(1.0), CommandValue::Rate, Refusal::RateOutOfRange, false,
            "Set the simulated seconds per second of wall time"),
        entry(4, "seek", Self::Seek(1.0), CommandValue::Seconds, Refusal::TimeOutOfRange, false,
            "Go to a simulated time"),
        entry(5, "step", Self::Step(1), CommandValue::Periods, Refusal::NotPaused, false,
            "Play PERIODS periods, then pause again"),
        entry(6, "restart", Self::Restart, CommandValue::None, Refusal::Never, false,
            "Go to the start of the show"),
        entry(7, "hold", Self::Hold, CommandValue::None, Refusal::Never, true,
            "Stop until released, whatever else is commanded"),
        entry(8, "release", Self::Release, CommandValue::None, Refusal::NotHeld, true,
            "Go from hold to paused"),
        entry(9, "go", Self::Go, CommandValue::None, Refusal::NotWaiting, false,
            "Continue from a cue that pauses, or from --paused"),
    ];

    /// Returns the row of a name; `None` for an unknown name.
    pub fn named(name: &str) -> Option<&'static CommandEntry> {
        Self::TABLE.iter().find(|entry| entry.name == name)
    }

    /// Returns the command of a number, with its value if it has one.
    ///
    /// # Errors
    /// [`Code::NotUnderstood`] for an unknown number, [`Code::OutOfRange`] for a value that no show accepts.
    pub fn of_number(number: u32, value: f64) -> Result<Self, Code> {
        let entry = Self::TABLE.get(number as usize).ok_or(Code::NotUnderstood)?;
        match entry.command {
            Self::Rate(_) => Ok(Self::Rate(value)),
            Self::Seek(_) => Ok(Self::Seek(value)),
            Self::Step(_) if (1.0..=MOST_PERIODS as f64).contains(&value) && value.fract() == 0.0 => {
                Ok(Self::Step(value as u64))
            }
            Self::Step(_) => Err(Code::OutOfRange),
            command => Ok(command),
        }
    }

    /// Returns the row of the command.
    pub fn entry(self) -> &'static CommandEntry {
        // `every_command_has_its_row` proves that there is one.
        let found = Self::TABLE.iter().find(|entry| discriminant(&entry.command) == discriminant(&self));
        found.expect("a row of every command")
    }

    /// Returns the name of the command.
    pub fn name(self) -> &'static str {
        self.entry().name
    }

    /// Returns the number on the wire, and the value, 0 if it has none.
    pub fn number_and_value(self) -> (u32, f64) {
        let value = match self {
            Self::Rate(value) | Self::Seek(value) => value,
            Self::Step(periods) => periods as f64,
            _ => 0.0,
        };
        (self.entry().number, value)
    }
}

/// The result of a command. Its number on the wire is its place in [`Code::TABLE`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Code {
    /// The command is done.
    Done,
    /// The show was in that state already.
    Already,
    /// The command is refused in this state.
    Refused,
    /// The value is out of range.
    OutOfRange,
    /// The number of the command is unknown.
    NotUnderstood,
    /// Too many commands are waiting.
    TooMany,
}

/// A row of the table of codes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CodeEntry {
    /// The code; `code as u32` is its number.
    pub code: Code,
    /// The name in JSON and in the log.
    pub name: &'static str,
    /// Its meaning, in words.
    pub words: &'static str,
}

impl Code {
    /// Every code, in the order of its number.
    pub const TABLE: [CodeEntry; 6] = [
        CodeEntry { code: Self::Done, name: "done", words: "done" },
        CodeEntry { code: Self::Already, name: "already", words: "already so" },
        CodeEntry { code: Self::Refused, name: "refused", words: "refused in this state" },
        CodeEntry { code: Self::OutOfRange, name: "out_of_range", words: "value out of range" },
        CodeEntry { code: Self::NotUnderstood, name: "not_understood", words: "not understood" },
        CodeEntry { code: Self::TooMany, name: "too_many", words: "too many waiting" },
    ];

    /// Returns the code of a number; `None` for an unknown number.
    pub fn of_number(number: u32) -> Option<Self> {
        Self::TABLE.get(number as usize).map(|entry| entry.code)
    }

    /// Returns the code of a name; `None` for an unknown name.
    pub fn named(name: &str) -> Option<Self> {
        Self::TABLE.iter().find(|entry| entry.name == name).map(|entry| entry.code)
    }

    /// Returns the name in JSON and in the log.
    pub fn name(self) -> &'static str {
        Self::TABLE[self as usize].name
    }
}

/// Commands and ended steps that a frame has room for: the loop executes one command a period, which can end a step.
pub const COMMANDS_PER_FRAME: usize = 4;

/// A command that the show was given, or the end of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CommandRecord {
    /// A command.
    Given {
        /// The command.
        command: Command,
        /// Its result; `None` for a step that has begun, whose end is a record of its own.
        code: Option<Code>,
    },
    /// A step was over, or was broken off.
    StepFinished {
        /// Its result.
        code: Code,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_has_its_row() {
        use Command::*;
        let commands = [State, Pause, Resume, Rate(3.0), Seek(3.0), Step(3), Restart, Hold, Release, Go];
        for (number, command) in commands.into_iter().enumerate() {
            // A new command does not compile here until the list above has it.
            match command {
                State | Pause | Resume | Rate(_) | Seek(_) | Step(_) | Restart | Hold | Release | Go => (),
            }
            let (wire, value) = command.number_and_value();
            assert_eq!((wire, command.entry()), (number as u32, &Command::TABLE[number]), "{command:?}");
            assert_eq!(Command::of_number(wire, value), Ok(command));
            assert_eq!(Command::named(command.name()), Some(command.entry()));
            assert_eq!(command.entry().value == CommandValue::None, value == 0.0, "{command:?}");
        }
        assert_eq!(Command::of_number(10, 0.0), Err(Code::NotUnderstood));
        for periods in [0.0, 0.5, 1.5, MOST_PERIODS as f64 * 2.0, f64::NAN] {
            assert_eq!(Command::of_number(5, periods), Err(Code::OutOfRange), "{periods}");
        }
    }

    #[test]
    fn every_code_has_its_row() {
        for (number, entry) in Code::TABLE.iter().enumerate() {
            assert_eq!((entry.code as usize, Code::of_number(number as u32)), (number, Some(entry.code)));
            assert_eq!(Code::named(entry.name), Some(entry.code));
        }
        assert_eq!((Code::of_number(6), Code::named("")), (None, None));
    }
}
