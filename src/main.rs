//! The command line: reads arguments, sets up the log, runs one subcommand, converts its error to an exit code.
//!
//! A subcommand that reads a scene has `arg = scene_argument()`. The others refuse one.

#[macro_use]
pub(crate) mod commands;
mod logging;

use std::io::{self, IsTerminal, Write};
use std::process::ExitCode;

use clap::parser::ValueSource;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use commands::folded::{COLUMNS, folded};
pub use commands::ros_args;
use commands::scene_argument::{self, scene_argument};
use commands::{CommandError, Common, argument_errors};

/// Publishes a bench dragon live: handle poses and collision alerts at a fixed rate, over iceoryx2 shared memory and,
/// on request, as ROS 2 topics.
#[derive(Debug, Parser)]
#[command(version, long_version = versions(), propagate_version = true, arg_required_else_help = true)]
pub struct CommandLine {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Publish a scene live
    #[command(arg = scene_argument())]
    Run(commands::run::RunArguments),
    /// List the shows that run on this machine
    List(commands::list::ListArguments),
    /// Conduct a running publisher: pause, rate, seek, step, hold
    Control(commands::control::ControlArguments),
    /// Record a running publisher as MCAP, or repair a recording that was cut
    Record(commands::record::RecordArguments),
    /// Publish a recording again, as the show was
    #[command(arg = scene_argument())]
    Replay(commands::replay::ReplayArguments),
    /// Compare every bit of a log, check every line of a certificate, or compare every pose of a recording
    Verify(commands::verify::VerifyArguments),
    /// Watch a running publisher from another process
    Watch(commands::watch::WatchArguments),
    /// Serve the live stage picture to a browser
    View(commands::view::ViewArguments),
    /// Serve the page on which a scene is made: text and picture side by side
    #[command(arg = scene_argument())]
    Design(commands::design::DesignArguments),
    /// Send a running publisher's dragon to lighting desks and other hosts
    Send(commands::send::SendArguments),
    /// Make a running publisher follow timecode, or a performer with a tracker
    Chase(commands::chase::ChaseArguments),
    /// Serve a running publisher's figures to Prometheus
    Metrics(commands::metrics::MetricsArguments),
    /// Solve a scene offline and print every handle as a table
    #[command(arg = scene_argument())]
    Solve(commands::solve::SolveArguments),
    /// Find contact, touch of an obstacle, stall, lock and path end; with --certify, prove them
    #[command(arg = scene_argument())]
    Events(commands::events::EventsArguments),
    /// Draw the stage at a time as an SVG
    #[command(arg = scene_argument())]
    Draw(commands::draw::DrawArguments),
    /// Write hand-outs for the people who carry the benches, to print
    #[command(arg = scene_argument())]
    Sheets(commands::sheets::SheetsArguments),
    /// Measure accuracy against cost for every solver on this scene and machine
    #[command(arg = scene_argument())]
    Trade(commands::trade::TradeArguments),
    /// Plan a choreography: the least pitch, the least turn radius, the greatest speed, numbers that fit
    Plan(commands::plan::PlanArguments),
    /// Soak-test: publish for hours to real subscriber processes and give a verdict
    #[command(arg = scene_argument())]
    Soak(commands::soak::SoakArguments),
    /// A subscriber process of soak
    #[command(hide = true, arg = scene_argument())]
    SoakSubscriber(commands::soak::SoakSubscriberArguments),
    /// The commanding process of soak --conduct
    #[command(hide = true, arg = scene_argument())]
    SoakLoadGenerator(commands::soak_load_generator::SoakLoadGeneratorArguments),
    /// A client that soak --conduct kills
    #[command(hide = true, arg = scene_argument())]
    SoakClient(commands::soak_load_generator::SoakClientArguments),
    /// Write man pages and shell completions for a package
    #[command(hide = true)]
    WriteManual(commands::write_manual::WriteManualArguments),
    /// Validate a scene and print what it models
    #[command(arg = scene_argument())]
    Check(commands::check::CheckArguments),
}

/// The version of iceoryx2, with which publisher and subscribers share memory.
const ICEORYX2: &str = "0.10.0";

/// Returns the versions that must agree between publisher and subscribers: program, iceoryx2, layouts.
fn versions() -> String {
    let layouts =
        bench_dragon::client::layouts::names().map(|name| name.trim_start_matches("bench_dragon/")).join(", ");
    format!("{}\niceoryx2 {ICEORYX2}\nlayouts {layouts}", env!("CARGO_PKG_VERSION"))
}

fn main() -> ExitCode {
    let (arguments, names) = match ros_args::translated(std::env::args_os()) {
        Ok(translated) => translated,
        Err(error) => return exit_code(Err(error)),
    };
    let mut definition = CommandLine::command();
    let parsed = definition.try_get_matches_from_mut(&arguments).and_then(|matches| {
        let CommandLine { common, command } = CommandLine::from_arg_matches(&matches)?;
        Ok((common, command, matches))
    });
    let (mut common, command, matches) = match parsed {
        Ok(parsed) => parsed,
        Err(error) => match argument_errors::sentence(&error, &definition, &arguments) {
            Some(sentence) => return exit_code(Err(CommandError::BadInput(sentence))),
            None => error.format(&mut definition).exit(),
        },
    };
    if let Err(error) = scene_argument::resolve(&mut common.scene, &definition, &matches) {
        return exit_code(Err(error));
    }
    if matches!(command, Command::Soak(_)) && matches.value_source("names") == Some(ValueSource::DefaultValue) {
        common.names = vec![commands::soak::NAME.to_owned()];
    }
    logging::set_up(&common);
    if let [name] = &mut common.names[..] {
        *name = names.applied_to(name);
    }
    let takes_several = matches!(command, Command::View(_) | Command::Send(_) | Command::Metrics(_));
    let ready = common.check_names(takes_several).and_then(|()| commands::end_when_shared_memory_is_full());
    let done = ready.and_then(|()| match &command {
        Command::Run(arguments) => commands::run::run(&common, arguments),
        Command::List(arguments) => commands::list::list(&common, arguments),
        Command::Control(arguments) => commands::control::control(&common, arguments),
        Command::Record(arguments) => commands::record::record(&common, arguments),
        Command::Replay(arguments) => commands::replay::replay(&common, arguments),
        Command::Verify(arguments) => commands::verify::verify(&common, arguments),
        Command::Watch(arguments) => commands::watch::watch(&common, arguments),
        Command::View(arguments) => commands::view::view(&common, arguments),
        Command::Design(arguments) => commands::design::design(&common, arguments),
        Command::Send(arguments) => commands::send::send(&common, arguments),
        Command::Chase(arguments) => commands::chase::chase(&common, arguments),
        Command::Metrics(arguments) => commands::metrics::metrics(&common, arguments),
        Command::Solve(arguments) => commands::solve::solve(&common, arguments),
        Command::Events(arguments) => commands::events::events(&common, arguments),
        Command::Draw(arguments) => commands::draw::draw(&common, arguments),
        Command::Sheets(arguments) => commands::sheets::sheets(&common, arguments),
        Command::Trade(arguments) => commands::trade::trade(&common, arguments),
        Command::Plan(arguments) => commands::plan::plan(&common, arguments),
        Command::Soak(arguments) => commands::soak::soak(&common, arguments),
        Command::SoakSubscriber(arguments) => commands::soak::subscribe(&common, arguments),
        Command::SoakLoadGenerator(arguments) => commands::soak_load_generator::conduct(&common, arguments),
        Command::SoakClient(arguments) => commands::soak_load_generator::client(&common, arguments),
        Command::WriteManual(arguments) => commands::write_manual::write_manual(CommandLine::command(), arguments),
        Command::Check(arguments) => commands::check::check(&common, arguments),
    });
    exit_code(done)
}

/// Prints the error of a command. Returns the exit code.
fn exit_code(done: Result<(), CommandError>) -> ExitCode {
    match done {
        Ok(()) | Err(CommandError::ClosedPipe) => ExitCode::SUCCESS,
        Err(CommandError::BadInput(sentence)) => {
            print_error(&sentence);
            ExitCode::from(2)
        }
        Err(CommandError::Failed(sentence)) => {
            print_error(&sentence);
            ExitCode::FAILURE
        }
    }
}

/// Prints an error: folded for a terminal, a line for programs and journals.
fn print_error(sentence: &str) {
    let mut stderr = io::stderr();
    let label = if commands::shows_colour(&stderr) { "\x1b[1;31merror\x1b[0m" } else { "error" };
    let line = format!("{label}: {sentence}");
    let line = if stderr.is_terminal() { folded(&line, COLUMNS) } else { line };
    // A closed standard error has no reader.
    let _ = writeln!(stderr, "{line}");
}
