//! `control`: conducts a running publisher.

mod osc;

use std::time::Duration;

use bench_dragon::client::control::command_client::Action as StateAction;
use bench_dragon::client::control::{ControlError, Controller, refusal, standing};
use bench_dragon::messages::ControlResponse;
use bench_dragon::messages::control::{Code, Command, MOST_PERIODS, RATES};
use bench_dragon::messages::sentence::Expected;
use bench_dragon::messages::state::PlaybackState;
use serde::Serialize;

use super::{CommandError, Common, Output, number, seconds};

/// Arguments of `control`.
#[derive(Debug, clap::Args)]
pub struct ControlArguments {
    #[command(subcommand)]
    kind: Kind,
    /// Longest wait for the answer; by default 30 s, and for a step as long as it makes progress
    #[arg(long, value_name = "TIME", value_parser = seconds, global = true, allow_negative_numbers = true)]
    timeout: Option<f64>,
}

#[derive(Debug, clap::Subcommand)]
enum Kind {
    #[command(flatten)]
    Once(Action),
    /// Stay running, and let OSC messages conduct the show: /go, /hold, /release, /pause, /resume, /seek, /rate
    Osc(osc::OscArguments),
}

#[derive(Debug, Clone, Copy, PartialEq, clap::Subcommand)]
enum Action {
    #[command(about = Command::State.entry().help)]
    State,
    #[command(about = Command::Pause.entry().help)]
    Pause,
    #[command(about = Command::Resume.entry().help)]
    Resume,
    /// Pause a playing show, resume a paused one
    Toggle,
    #[command(about = Command::Rate(1.0).entry().help, allow_negative_numbers = true)]
    Rate {
        #[arg(help = format!("{:e} to {:e}", RATES.start(), RATES.end()))]
        rate: f64,
    },
    #[command(about = Command::Seek(1.0).entry().help, allow_negative_numbers = true)]
    Seek {
        /// Simulated time since the start of the scene: 400, 1:30
        #[arg(value_parser = seconds)]
        time: f64,
    },
    #[command(about = Command::Step(1).entry().help, allow_negative_numbers = true)]
    Step {
        /// Periods of the loop
        #[arg(default_value_t = 1, value_parser = periods)]
        periods: u64,
    },
    #[command(about = Command::Restart.entry().help)]
    Restart,
    #[command(about = Command::Hold.entry().help)]
    Hold,
    #[command(about = Command::Release.entry().help)]
    Release,
    #[command(about = Command::Go.entry().help)]
    Go,
}

fn periods(text: &str) -> Result<u64, Expected> {
    let periods = text.parse().ok().filter(|periods| (1..=MOST_PERIODS).contains(periods));
    periods.ok_or_else(|| Expected(format!("a whole number from 1 to {MOST_PERIODS}").into()))
}

/// The line of `control --json`.
#[derive(Serialize)]
struct ResponseLine {
    code: &'static str,
    tick: u64,
    sim_time: f64,
    time_scale: f64,
    playback: &'static str,
    cue: u32,
}

impl From<&ControlResponse> for ResponseLine {
    fn from(response: &ControlResponse) -> Self {
        let code = response.result().map_or("unknown", Code::name);
        let playback = response.playback_state().map_or("unknown", PlaybackState::name);
        let ControlResponse { id: _, tick, sim_time, time_scale, code: _, playback: _, cue, reserved: _ } = *response;
        Self { code, tick, sim_time, time_scale, playback, cue }
    }
}

/// Sends one command and prints its result, or stays running for OSC.
pub fn control(common: &Common, arguments: &ControlArguments) -> Result<(), CommandError> {
    let action = match &arguments.kind {
        Kind::Once(action) => *action,
        Kind::Osc(arguments) => return osc::osc(common, arguments),
    };
    let timeout = arguments.timeout.map(|seconds| {
        let sentence =
            || CommandError::BadInput(format!("--timeout is {}, expected a number of seconds", number(seconds)));
        Duration::try_from_secs_f64(seconds).map_err(|_| sentence())
    });
    let timeout = timeout.transpose()?;
    let send = |controller: &mut Controller, command| match timeout {
        Some(timeout) => controller.send(command, timeout),
        None => controller.send_patiently(command),
    };
    let mut controller = Controller::new(common.name())?;
    let command = match action {
        Action::State => Command::State,
        Action::Pause => Command::Pause,
        Action::Resume => Command::Resume,
        Action::Toggle => {
            let state = send(&mut controller, Command::State)?;
            if let Some(sentence) = refusal(&state, Command::State) {
                return Err(CommandError::Failed(sentence));
            }
            StateAction::Toggle.command(&state)
        }
        Action::Rate { rate } => Command::Rate(rate),
        Action::Seek { time } => Command::Seek(time),
        Action::Step { periods } => Command::Step(periods),
        Action::Restart => Command::Restart,
        Action::Hold => Command::Hold,
        Action::Release => Command::Release,
        Action::Go => Command::Go,
    };
    let response = send(&mut controller, command)?;
    print(common, &response)?;
    refusal(&response, command).map_or(Ok(()), |sentence| Err(CommandError::Failed(sentence)))
}

fn print(common: &Common, response: &ControlResponse) -> Result<(), CommandError> {
    let mut output = Output::standard();
    if common.json {
        output.json(&ResponseLine::from(response))?;
    } else if !common.quiet {
        output.line(&standing(response))?;
    }
    output.finish()
}

impl From<ControlError> for CommandError {
    fn from(error: ControlError) -> Self {
        match error {
            ControlError::Open(error) => error.into(),
            other => Self::Failed(other.to_string()),
        }
    }
}
