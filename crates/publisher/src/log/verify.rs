//! `verify`: replays the show of a log, tick by tick, and compares.
//!
//! In: the lines of a log. Out: a [`Verdict`], or a [`VerifyError`] that names the line. The code of `run` computes the
//! show, with the instructions that the log names. If this machine lacks these instructions, or has another
//! architecture or other elementary functions, different bits prove nothing. Then the handles in the line of each
//! second with other bits are compared with those of a [second solver](bench_dragon_show::second_solver).

mod player;
mod problem;

use std::io::{BufRead, Read};

use serde::Serialize;

use super::lines::{FORMAT, HashChain, Line, ShowLine};
use bench_dragon_motion::solve::table::Instructions;
use bench_dragon_show::scene::{Accepted, Scene, SceneError, printable};
use player::Player;
pub use problem::Problem;

/// The reason why there is no verdict.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// The file is no log, or is damaged.
    #[error("line {line}: {}", printable(&.problem.to_string()))]
    Line {
        /// The line, from 1.
        line: u64,
        /// The problem.
        problem: Problem,
    },
    /// The scene in its first line cannot be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] std::io::Error),
}

/// The result of `verify`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// `same`: every bit is the same. `close`: the machine has another arithmetic, and every position is within the
    /// tolerance. `differs`: neither. `nothing`: the log has no second to compare.
    pub verdict: &'static str,
    /// The first difference.
    pub difference: Option<Difference>,
    /// The number of seconds compared.
    pub seconds: u64,
    /// The number of these with the same hash.
    pub same_seconds: u64,
    /// The frames in the compared seconds.
    pub frames: u64,
    /// The commands in the compared seconds, executed or refused.
    pub commands: u64,
    /// Periods skipped.
    pub skipped: u64,
    /// Frames lost by the log.
    pub lost: u64,
    /// The last verified tick; `None` if there is none.
    pub last_tick: Option<u64>,
    /// True if the log has its last line.
    pub complete: bool,
    /// True if the last line is cut.
    pub cut: bool,
    /// The version of the program that wrote the log.
    pub version: String,
    /// The instructions that computed the frames.
    pub instructions: String,
    /// True if this machine computes the same bits.
    pub same_arithmetic: bool,
    /// The greatest distance of a sampled handle from the second solver's, in metres; `None` if bits were compared.
    pub max_difference: Option<f64>,
    /// The tolerance of that distance, in metres.
    pub tolerance: Option<f64>,
}

/// The first difference between a log and its show.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// The line, from 1.
    pub line: u64,
    /// The second, from 0.
    pub second: u64,
    /// The first tick concerned.
    pub from: u64,
    /// The last tick concerned.
    pub to: u64,
    /// The difference, in words.
    pub what: String,
}

/// The most bytes of a line. The first line holds the text of the scene.
const LONGEST_LINE: u64 = 1 << 26;

/// Verifies a log.
///
/// `file` is its name in errors. `progress` is called with the bytes read so far.
///
/// # Errors
/// [`VerifyError`]
pub fn verify(log: impl BufRead, file: &str, progress: &mut dyn FnMut(u64)) -> Result<Verdict, VerifyError> {
    let mut lines = Lines { log, chain: HashChain::default(), number: 0, bytes: 0, cut: false };
    let show = match lines.next()? {
        Some(Line::Show(show)) => *show,
        Some(_) => return Err(lines.error(Problem::NoShow)),
        None if lines.cut => return Err(lines.error(Problem::CutShow)),
        None => return Err(VerifyError::Line { line: 1, problem: Problem::Empty }),
    };
    let mut player = player(&show, file, &lines)?;
    let (mut complete, mut ended) = (false, false);
    while player.difference().is_none() {
        let Some(line) = lines.next()? else {
            if ended && lines.cut {
                return Err(lines.error(Problem::AfterEnd));
            }
            break;
        };
        if ended {
            return Err(lines.error(Problem::AfterEnd));
        }
        match line {
            Line::Show(_) => return Err(lines.error(Problem::SecondShow)),
            Line::End { .. } | Line::Stopped { .. } => (complete, ended) = (matches!(line, Line::End { .. }), true),
            _ => {}
        }
        player.line(lines.number, &line).map_err(|problem| lines.error(problem))?;
        progress(lines.bytes);
    }
    Ok(player.verdict(&show, complete, lines.cut))
}

/// Creates the player of a show.
fn player<R>(show: &ShowLine, file: &str, lines: &Lines<R>) -> Result<Player, VerifyError> {
    if show.format != FORMAT {
        return Err(lines.error(Problem::Format(show.format)));
    }
    let scene = show.scene_text(file).parse()?;
    let playback = show.playback().ok_or_else(|| lines.error(Problem::Playback))?;
    let numbers = [
        (Accepted::RATE, "rate", playback.rate),
        (Accepted::TIME_SCALE, "time_scale", playback.time_scale),
        (Accepted::END_HOLD, "end_hold", playback.end_hold),
    ];
    for (accepted, name, value) in numbers {
        accepted.check(name, value).map_err(|error| lines.error(error))?;
    }
    let scene = match show.arithmetic.sets() {
        Some(sets) => with_instructions(scene, &sets),
        None => scene,
    };
    let player = Player::new(&scene, playback, show.arithmetic.is_available());
    player.map_err(|error| lines.error(error))
}

/// Returns the scene computed with these instructions, one set for each dragon.
fn with_instructions(scene: Scene, sets: &[Instructions]) -> Scene {
    Scene { ensemble: scene.ensemble.with_instructions(sets).unwrap_or(scene.ensemble), ..scene }
}

/// The lines of a file.
struct Lines<R> {
    log: R,
    chain: HashChain,
    /// The latest line, from 1.
    number: u64,
    bytes: u64,
    cut: bool,
}

impl<R> Lines<R> {
    fn error(&self, problem: impl Into<Problem>) -> VerifyError {
        VerifyError::Line { line: self.number, problem: problem.into() }
    }
}

impl<R: BufRead> Lines<R> {
    /// Returns the next line, or `None` at the end and at a cut line.
    fn next(&mut self) -> Result<Option<Line>, VerifyError> {
        let mut bytes = Vec::new();
        let read = (&mut self.log).take(LONGEST_LINE).read_until(b'\n', &mut bytes)?;
        if read == 0 {
            return Ok(None);
        }
        self.number += 1;
        self.bytes += read as u64;
        if bytes.last() != Some(&b'\n') && read as u64 == LONGEST_LINE {
            return Err(self.error(Problem::TooLong(LONGEST_LINE)));
        }
        if bytes.last() != Some(&b'\n') {
            self.cut = true;
            return Ok(None);
        }
        let text = std::str::from_utf8(&bytes).map_err(|_| self.error(Problem::NotText))?;
        let line = self.chain.read(text).map_err(|error| self.error(error))?;
        Ok(Some(line))
    }
}
