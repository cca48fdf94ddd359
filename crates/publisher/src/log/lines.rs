//! The lines of a log: JSON objects, each with a check over all bytes before it.
//!
//! [`HashChain`] creates and tests the checks. A line with a wrong check is damaged or forged, and is reported by its
//! number before anything is computed from it.

use serde::{Deserialize, Serialize};

use super::arithmetic::Arithmetic;
use crate::live::End;
use bench_dragon_messages::control::{Command, CommandRecord, CommandValue};
use bench_dragon_show::Playback;
use bench_dragon_show::scene::{AtEnd, OnContact, SceneText};

/// The version of this format.
pub const FORMAT: u32 = 2;

/// The text before a line's check, and the text after it.
const CHECK: &str = ",\"check\":\"";
const CHECK_DIGITS: usize = 16;
const CHECK_END: &str = "\"}";

/// A line that is damaged or forged.
#[derive(Debug, thiserror::Error)]
pub enum LineError {
    /// The line has no check.
    #[error("it does not end in a check, expected a line of a log")]
    NoCheck,
    /// The check is wrong.
    #[error("its check is {found}, expected {expected}: it, or a line before it, is not as it was written")]
    Check {
        /// The digits of the line.
        found: String,
        /// The digits of the bytes before them.
        expected: String,
    },
    /// The text before the check is no line of a log.
    #[error("{0}, expected a line of a log")]
    Json(#[from] serde_json::Error),
}

/// A line without its check. Lines are in the order of ticks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Line {
    /// The first line. With the commands and the skipped periods, it determines the frames.
    Show(Box<ShowLine>),
    /// A command, executed or refused at the beginning of a period.
    Command {
        /// The period.
        tick: u64,
        /// Its name.
        command: String,
        /// Its value, if the value is a finite number.
        value: Option<f64>,
        /// Its result, by name; `None` for a step that has begun.
        code: Option<String>,
    },
    /// A step ended, or was broken off, in this period.
    StepFinished {
        /// The period.
        tick: u64,
        /// The result of the step, by name.
        code: String,
    },
    /// Periods without a frame: they had passed before it could be computed.
    Skipped {
        /// The first.
        from: u64,
        /// The last.
        to: u64,
    },
    /// Published frames that are in no hash because the log was behind.
    Lost {
        /// The tick of the first.
        from: u64,
        /// The tick of the last.
        to: u64,
    },
    /// A second of the loop: the ticks with one `floor(tick / rate)`.
    Second(SecondLine),
    /// The log was too far behind and ended; the show continued.
    Stopped {
        /// The first tick that is missing.
        tick: u64,
    },
    /// The last line of a complete log.
    End {
        /// Frames in the hashes.
        frames: u64,
        /// Periods skipped.
        skipped: u64,
        /// Frames in no hash.
        lost: u64,
        /// The reason for the end of the run. After an error, the frame of the last period may be published and not
        /// logged.
        reason: End,
    },
}

/// The show.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShowLine {
    /// [`FORMAT`].
    pub format: u32,
    /// The program's version.
    pub version: String,
    /// The arithmetic of the frames.
    pub arithmetic: Arithmetic,
    /// The solver and the reason for its choice, for people.
    pub solver: String,
    /// The run's number, as text.
    pub run_id: String,
    /// CLOCK_REALTIME in nanoseconds at the start of the log, as text: for people.
    pub stamp_ns: String,
    /// The rate, in frames per second.
    pub rate: f64,
    /// Simulated seconds at which the show begins.
    pub start: f64,
    /// Simulated seconds per second of wall time.
    pub time_scale: f64,
    /// `stop` or `continue`.
    pub on_contact: String,
    /// `hold` or `loop`.
    pub at_end: String,
    /// The wall time for which a looping show stands at its end, in seconds.
    pub end_hold: f64,
    /// True if the show waits at its start.
    pub paused: bool,
    /// The scene's file, as errors name it.
    pub scene_file: String,
    /// The scene's name if its text gives none.
    pub scene_stem: String,
    /// The scene's text, TOML.
    pub scene: String,
}

/// The hash of a second.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SecondLine {
    /// Its number, from 0.
    pub second: u64,
    /// The tick of the first frame in the hash.
    pub from: u64,
    /// The tick of the last.
    pub to: u64,
    /// Frames in the hash.
    pub frames: u64,
    /// BLAKE3 over the frames.
    pub hash: String,
    /// Simulated seconds of the last.
    pub sim_time: f64,
    /// Some of its handles: number, x, y.
    pub handles: Vec<(u32, f64, f64)>,
}

impl ShowLine {
    /// Creates the line of a scene's show.
    pub fn new(
        scene: &SceneText,
        playback: &Playback,
        arithmetic: Arithmetic,
        solver: &str,
        run_id: u64,
        stamp_ns: u64,
    ) -> Self {
        let Playback { start, time_scale, rate, on_contact, at_end, end_hold, paused } = *playback;
        let on_contact = if on_contact == OnContact::Stop { "stop" } else { "continue" };
        let at_end = if at_end == AtEnd::Hold { "hold" } else { "loop" };
        Self {
            format: FORMAT,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            arithmetic,
            solver: solver.to_owned(),
            run_id: run_id.to_string(),
            stamp_ns: stamp_ns.to_string(),
            rate,
            start,
            time_scale,
            on_contact: on_contact.to_owned(),
            at_end: at_end.to_owned(),
            end_hold,
            paused,
            scene_file: scene.file.clone(),
            scene_stem: scene.stem.clone(),
            scene: scene.text.clone(),
        }
    }

    /// Returns the settings of the show. Returns `None` for a word that this program does not know.
    pub fn playback(&self) -> Option<Playback> {
        let on_contact = match self.on_contact.as_str() {
            "stop" => OnContact::Stop,
            "continue" => OnContact::Continue,
            _ => return None,
        };
        let at_end = match self.at_end.as_str() {
            "hold" => AtEnd::Hold,
            "loop" => AtEnd::Loop,
            _ => return None,
        };
        let Self {
            format: _,
            version: _,
            arithmetic: _,
            solver: _,
            run_id: _,
            stamp_ns: _,
            rate,
            start,
            time_scale,
            on_contact: _,
            at_end: _,
            end_hold,
            paused,
            scene_file: _,
            scene_stem: _,
            scene: _,
        } = *self;
        Some(Playback { start, time_scale, rate, on_contact, at_end, end_hold, paused })
    }

    /// Returns the scene's text.
    pub fn scene_text(&self, file: &str) -> SceneText {
        let file = format!("{file}, line 1, the scene \"{}\"", self.scene_file);
        SceneText { text: self.scene.clone(), file, stem: self.scene_stem.clone() }
    }
}

impl Line {
    /// Creates the line of a command, or of the end of a step.
    pub fn of(tick: u64, record: CommandRecord) -> Self {
        match record {
            CommandRecord::Given { command, code } => {
                let (_, value) = command.number_and_value();
                let has_value = command.entry().value != CommandValue::None;
                let command = command.name().to_owned();
                let value = (has_value && value.is_finite()).then_some(value);
                Self::Command { tick, command, value, code: code.map(|code| code.name().to_owned()) }
            }
            CommandRecord::StepFinished { code } => Self::StepFinished { tick, code: code.name().to_owned() },
        }
    }
}

/// Returns the command of a name and a value. Returns `None` for a command that no log has.
pub(super) fn command_of(name: &str, value: Option<f64>) -> Option<Command> {
    // A value that is not a number is null in the log.
    Command::of_number(Command::named(name)?.number, value.unwrap_or(f64::NAN)).ok()
}

/// The checks of a file, line by line: each depends on all lines before it.
#[derive(Default)]
pub struct HashChain {
    hasher: blake3::Hasher,
}

impl HashChain {
    /// Returns the text of a line with its check and newline.
    pub fn line(&mut self, line: &Line) -> String {
        // serde_json serialises structs of numbers and text without error.
        let mut text = serde_json::to_string(line).unwrap_or_default();
        text.pop();
        let check = self.check(&text);
        text.push_str(&check);
        text
    }

    /// Reads a line that ends with a newline.
    ///
    /// # Errors
    /// [`LineError`]
    pub fn read(&mut self, text: &str) -> Result<Line, LineError> {
        let length = CHECK.len() + CHECK_DIGITS + CHECK_END.len() + 1;
        let body = text.len().checked_sub(length).and_then(|at| text.split_at_checked(at));
        let checked = body.filter(|(_, check)| check.starts_with(CHECK) && check.ends_with("\"}\n"));
        let Some((body, check)) = checked else {
            return Err(LineError::NoCheck);
        };
        let expected = self.check(body);
        if check != expected {
            let digits = |check: &str| check[CHECK.len()..CHECK.len() + CHECK_DIGITS].to_owned();
            return Err(LineError::Check { found: digits(check), expected: digits(&expected) });
        }
        Ok(serde_json::from_str(&format!("{body}}}"))?)
    }

    /// Returns the end of a line that begins with `body`: BLAKE3 over all bytes of the file before the check.
    fn check(&mut self, body: &str) -> String {
        self.hasher.update(body.as_bytes());
        let hash = self.hasher.finalize().to_hex();
        let end = format!("{CHECK}{}{CHECK_END}\n", &hash[..CHECK_DIGITS]);
        self.hasher.update(end.as_bytes());
        end
    }
}
