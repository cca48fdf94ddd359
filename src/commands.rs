//! The subcommands, one file each: arguments to calls of the library.

/// Replaces the standard library's, which panics if standard error is closed. Long lines are folded.
macro_rules! eprintln {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let text = $crate::commands::folded::folded(&format!($($text)*), $crate::commands::folded::COLUMNS);
        let _ = writeln!(std::io::stderr(), "{text}");
    }};
}

pub mod argument_errors;
mod certificate_file;
pub mod chase;
pub mod check;
pub mod control;
pub mod design;
pub mod draw;
mod duration;
pub mod events;
pub mod folded;
mod lines;
pub mod list;
mod log_lines;
pub mod metrics;
mod new_file;
mod parent;
pub mod plan;
mod publishing;
mod qr_code;
mod realtime_scheduling;
pub mod record;
pub mod replay;
mod ros2_process;
pub mod ros_args;
pub mod run;
pub mod scene_argument;
mod scene_facts;
mod scene_frames;
pub mod send;
mod service_manager;
pub mod sheets;
mod signals;
pub mod soak;
pub mod soak_load_generator;
pub mod solve;
pub mod swept;
pub mod trade;
pub mod verify;
pub mod view;
pub mod watch;
pub mod write_manual;

use duration::{seconds, wall_seconds};
use new_file::NewFile;
use signals::stop_on_signals;
use std::ffi::OsString;
use std::io::{self, BufWriter, StdoutLock, Write};
use std::path::Path;
use std::time::Duration;

use anstyle::AnsiColor;
use bench_dragon::messages::sentence::{self, number};
use bench_dragon::messages::state::Severity;
use bench_dragon::motion::solve::{Solver, Velocities};
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::show::results::figure;
use bench_dragon::show::scene::{RangeError, Scene, SceneError, SceneText};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

/// Options before or after every subcommand.
#[derive(Debug, Clone, clap::Args)]
pub struct Common {
    /// The scene (TOML), of commands that take it as their argument; by default the paper's, which is built in
    #[arg(long, value_name = "FILE", global = true)]
    pub scene: Option<std::path::PathBuf>,
    /// The name under which services and topics appear; view, send and metrics take several, soak has "soak" of its own
    #[arg(long = "name", value_name = "NAME", global = true, default_value = "bench_dragon")]
    pub names: Vec<String>,
    /// Print JSON lines for machines
    #[arg(long, global = true)]
    pub json: bool,
    /// Log more to standard error (twice for everything)
    #[arg(short, long, action = clap::ArgAction::Count, global = true)]
    pub verbose: u8,
    /// Log errors only
    #[arg(long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
}

impl Common {
    /// The first name; the only one for a command of one publisher.
    pub fn name(&self) -> &str {
        self.names.first().map_or("", String::as_str)
    }

    /// Tests the names. Each name is given once, and a command of one publisher has one name. All names stand in one
    /// place, since clap replaces names before the command by names after it.
    ///
    /// # Errors
    /// Bad input: the sentence states what was expected.
    pub fn check_names(&self, takes_several: bool) -> Result<(), CommandError> {
        let refused = |sentence: String| Err(CommandError::BadInput(sentence));
        let is_option =
            |argument: &OsString| argument.to_str().is_some_and(|text| text == "--name" || text.starts_with("--name="));
        let given = std::env::args_os().skip(1).take_while(|argument| argument != "--").filter(is_option).count();
        let count = self.names.len();
        if !takes_several && count.max(given) > 1 {
            return refused(format!(
                "--name is given {} times, expected one: this command is of one publisher; view, send and metrics take \
                 several",
                count.max(given)
            ));
        }
        if given > count {
            return refused("--name stands before and after the command, expected all of them in one place".to_owned());
        }
        match self.names.iter().enumerate().find(|(at, name)| self.names[..*at].contains(name)) {
            Some((_, name)) => refused(format!("--name {name} is given twice, expected each name once")),
            None => Ok(()),
        }
    }

    /// Returns the names for a sentence, each in quotation marks.
    pub fn quoted_names(&self) -> String {
        self.names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ")
    }

    /// Reads the scene that the command line names.
    ///
    /// # Errors
    /// Bad input: the sentence names the file, the line and the field.
    pub fn load_scene(&self) -> Result<Scene, CommandError> {
        Ok(self.scene_text()?.parse()?)
    }

    /// Returns the text of that scene.
    ///
    /// # Errors
    /// Bad input: the file cannot be read.
    pub fn scene_text(&self) -> Result<SceneText, CommandError> {
        Ok(match &self.scene {
            Some(path) => SceneText::load(path)?,
            None => SceneText::paper(),
        })
    }
}

/// The failure of a command.
#[derive(Debug)]
pub enum CommandError {
    /// Invalid input of the user; one sentence with the place and what was expected. Exit code 2.
    BadInput(String),
    /// Anything else, in one sentence. Exit code 1.
    Failed(String),
    /// The reader of the output has closed it: the command ends without a message. Exit code 0.
    ClosedPipe,
}

impl From<SceneError> for CommandError {
    fn from(error: SceneError) -> Self {
        Self::BadInput(error.to_string())
    }
}

impl From<RangeError> for CommandError {
    fn from(error: RangeError) -> Self {
        Self::BadInput(error.to_string())
    }
}

impl From<io::Error> for CommandError {
    fn from(error: io::Error) -> Self {
        if error.kind() == io::ErrorKind::BrokenPipe { Self::ClosedPipe } else { Self::Failed(error.to_string()) }
    }
}

/// Refuses the name of a picture of another kind: an SVG in it would open nowhere.
///
/// # Errors
/// Bad input: the name ends as that of another kind of picture.
pub fn svg_file(option: &str, file: Option<&Path>) -> Result<(), CommandError> {
    const OTHERS: [&str; 9] = ["png", "jpg", "jpeg", "gif", "webp", "bmp", "tif", "tiff", "pdf"];
    let Some(file) = file else { return Ok(()) };
    let end = file.extension().map(|end| end.to_string_lossy().to_lowercase()).unwrap_or_default();
    if !OTHERS.contains(&&*end) {
        return Ok(());
    }
    Err(CommandError::BadInput(format!(
        "{option} {}: pictures are SVG alone, expected {}, which rsvg-convert or a browser makes into other kinds",
        file.display(),
        file.with_extension("svg").display()
    )))
}

/// Returns the error for a `file` that cannot be created.
pub fn not_writable(file: impl std::fmt::Display, error: &io::Error) -> CommandError {
    CommandError::BadInput(sentence::not_writable(file, error))
}

/// The destination of a command's result: standard output, or a file that the user named.
pub struct Output {
    writer: BufWriter<Destination>,
}

enum Destination {
    Standard(StdoutLock<'static>),
    File(NewFile),
}

impl Write for Destination {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Standard(output) => output.write(bytes),
            Self::File(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Standard(output) => output.flush(),
            Self::File(file) => file.flush(),
        }
    }
}

impl Output {
    /// Creates an output to standard output.
    pub fn standard() -> Self {
        Self { writer: BufWriter::new(Destination::Standard(io::stdout().lock())) }
    }

    /// Creates an output to a new file.
    ///
    /// # Errors
    /// Bad input: the file cannot be written.
    pub fn file(file: &Path) -> Result<Self, CommandError> {
        Ok(Self { writer: BufWriter::new(Destination::File(NewFile::create(file)?)) })
    }

    /// Writes lines that have their line feeds.
    pub fn text(&mut self, lines: &str) -> Result<(), CommandError> {
        Ok(self.writer.write_all(lines.as_bytes())?)
    }

    /// Writes a line.
    pub fn line(&mut self, text: &str) -> Result<(), CommandError> {
        Ok(writeln!(self.writer, "{text}")?)
    }

    /// Writes a JSON line. NaN becomes null.
    pub fn json(&mut self, value: &impl Serialize) -> Result<(), CommandError> {
        serde_json::to_writer(&mut self.writer, value).map_err(io::Error::from)?;
        Ok(writeln!(self.writer)?)
    }

    /// Writes the buffered rest, and completes a file.
    pub fn finish(mut self) -> Result<(), CommandError> {
        self.writer.flush()?;
        match self.writer.into_inner().map_err(io::Error::from)? {
            Destination::Standard(_) => Ok(()),
            Destination::File(file) => file.finish(),
        }
    }
}

/// Returns the colour of a state or level on the terminal.
pub fn severity_colour(severity: Severity) -> AnsiColor {
    match severity {
        Severity::Ok => AnsiColor::Green,
        Severity::Warning => AnsiColor::Yellow,
        Severity::Error => AnsiColor::Red,
    }
}

/// Creates a progress bar on standard error, hidden if that is no terminal.
pub fn progress_bar(length: u64, common: &Common) -> ProgressBar {
    if common.quiet {
        return ProgressBar::hidden();
    }
    // The template is a constant of known keys: the fallback is never used.
    let style = ProgressStyle::with_template("{spinner} {msg} {wide_bar} {percent} % {elapsed} ({eta})");
    let bar = ProgressBar::new(length).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    // A search may stay at one place of the motion for long: the elapsed time still moves.
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// Returns all events of a scene, with a progress bar for the long searches.
pub fn search_timeline(scene: &Scene, common: &Common) -> Timeline {
    let bar = progress_bar(1000, common).with_message("searching for contact");
    let timeline = scene.ensemble.timeline(&mut |share| signals::report(&bar, share));
    bar.finish_and_clear();
    warn_of_gap(&timeline);
    timeline
}

/// Makes the solver of a scene, with a progress bar for the tables of large teams.
///
/// # Errors
/// A signal has stopped it.
pub fn make_solver(scene: &Scene, velocities: Velocities, common: &Common) -> Result<Box<dyn Solver>, CommandError> {
    let bar = table_bar(common);
    let solver = scene.ensemble.solver_unless_stopped(velocities, &mut |share| signals::report(&bar, share));
    bar.finish_and_clear();
    solver.ok_or_else(signals::stopped)
}

/// Returns the progress bar of the making of a table.
fn table_bar(common: &Common) -> ProgressBar {
    progress_bar(1000, common).with_message("making the table of the followers")
}

/// Warns of numbers of a scene that are hardly meant.
pub fn warn_of_doubts(scene: &Scene) {
    scene.doubts.iter().for_each(|doubt| log::warn!("{doubt}"));
}

/// Warns that a search gave up, with the time that the search reached.
pub fn warn_of_gap(timeline: &Timeline) {
    if let Some(until) = timeline.searched_until() {
        log::warn!(
            "the search for events {}: searched up to t = {} s, later events may be missing",
            signals::gave_up(),
            figure(until)
        );
    }
}

/// Returns true if a stream is a terminal and colour is not switched off (`NO_COLOR`, see no-color.org).
pub fn shows_colour(stream: &impl io::IsTerminal) -> bool {
    stream.is_terminal() && !anstyle_query::no_color()
}

/// Refuses a scene with the paper's solver, since its motion has no proof.
pub fn expect_exact_motion(scene: &Scene) -> Result<(), CommandError> {
    if scene.ensemble.is_exact() {
        return Ok(());
    }
    let sentence = "the scene names the solver \"paper\", whose head is too fast: only exact motion can be certified, \
                    expected motion.accuracy or another solver";
    Err(CommandError::BadInput(sentence.to_owned()))
}

/// Ends this program with a sentence if no page of shared memory is available, which Linux signals by SIGBUS. Other
/// processes have then filled /dev/shm since the last test.
pub fn end_when_shared_memory_is_full() -> Result<(), CommandError> {
    const SENTENCE: &[u8] = b"error: /dev/shm is full: remove what fills it, or make it larger\n";
    let end = || {
        watch::terminal::restore();
        // A failing standard error cannot be reported.
        let _ = nix::unistd::write(io::stderr(), SENTENCE);
        // SAFETY: async-signal-safe, and ends the process without unwinding.
        unsafe { nix::libc::_exit(1) };
    };
    // SAFETY: the action calls tcsetattr, write and _exit only, all async-signal-safe; `io::stdin` and `io::stderr`
    // serve as descriptors.
    unsafe { signal_hook::low_level::register(signal_hook::consts::SIGBUS, end) }?;
    Ok(())
}
