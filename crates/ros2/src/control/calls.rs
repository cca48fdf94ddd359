//! Converts a service call to commands of the show, and their results to the response.
//!
//! Pure: [`ServiceAdapter`] returns the next action for a call.

use super::services::{Call, CallResult, Features, Response, result, scope, state};
use bench_dragon_messages::control::{Code, Command, RATES};
use bench_dragon_messages::state::PlaybackState;
use bench_dragon_show::Outcome;

/// The next action for a call.
#[derive(Debug, Clone, PartialEq)]
pub enum Next {
    /// Execute this command, and continue with its result.
    Execute(Command),
    /// Send this response.
    Answer(Response),
}

/// The refusal of a held show.
const HELD: &str = "the show is held: only hold, release and state queries are obeyed until it is released";

/// Converts calls to commands. The adapter stores a distinction that the standard makes and the show does not: whether
/// a paused simulation counts as stopped.
#[derive(Debug, Default)]
pub struct ServiceAdapter {
    /// The simulated seconds of a paused show after the last reset.
    stopped_at: Option<f64>,
}

impl ServiceAdapter {
    /// Returns the first action of a call.
    pub fn begin(&self, call: Call) -> Next {
        let command = match call {
            Call::GetFeatures => return Next::Answer(features()),
            Call::GetState | Call::IsPaused | Call::GetRate | Call::TogglePaused => Command::State,
            Call::SetState(state::STOPPED | state::PAUSED) | Call::Pause => Command::Pause,
            Call::SetState(state::PLAYING) | Call::Resume => Command::Resume,
            Call::SetState(state::QUITTING) => {
                let sentence = "a publisher is not ended from the network: end its process";
                return Next::Answer(failure(result::FEATURE_UNSUPPORTED, sentence));
            }
            Call::SetState(state::NO_WORLD | state::LOADING_WORLD) => {
                let sentence = "worlds are neither loaded nor unloaded here";
                return Next::Answer(failure(result::FEATURE_UNSUPPORTED, sentence));
            }
            Call::SetState(other) => {
                let sentence = format!("the state is {other}, expected 0 (stopped), 1 (playing) or 2 (paused)");
                return Next::Answer(failure(result::OPERATION_FAILED, &sentence));
            }
            Call::Step(steps) => match Command::of_number(STEP, steps as f64) {
                Ok(step) => step,
                Err(_) => {
                    let sentence = format!("steps is {steps}, expected a whole number from 1 to 2^53");
                    return Next::Answer(failure(result::OPERATION_FAILED, &sentence));
                }
            },
            Call::Reset(scope::ALL) => Command::Restart,
            Call::Reset(bits) if bits & !(scope::TIME | scope::STATE) == scope::DEFAULT => Command::Restart,
            Call::Reset(bits) => {
                let sentence =
                    format!("scope is {bits}, expected 0 or 255 (all), 1 (time) or 2 (state): nothing spawns here");
                return Next::Answer(failure(result::FEATURE_UNSUPPORTED, &sentence));
            }
            Call::SetRate(rate) => Command::Rate(rate),
            Call::Seek(time) => Command::Seek(time),
            Call::PlayNext => Command::Step(1),
            Call::Hold => Command::Hold,
            Call::Release => Command::Release,
            Call::Go => Command::Go,
            Call::Parameters(call) => return Next::Answer(Response::Parameters(call.response())),
        };
        Next::Execute(command)
    }

    /// Returns the next action of a call after the result of its command.
    pub fn proceed(&mut self, call: Call, command: Command, outcome: &Outcome) -> Next {
        let succeeded = matches!(outcome.code, Code::Done | Code::Already);
        let paused = outcome.playback == PlaybackState::Paused;
        let stopped = paused && self.stopped_at == Some(outcome.sim_time);
        if command == Command::Restart && succeeded {
            self.stopped_at = paused.then_some(outcome.sim_time);
        }
        Next::Answer(match (call, command) {
            (Call::GetState, _) => Response::State(simulation_state(outcome.playback, stopped), done()),
            (Call::SetState(state::STOPPED), Command::Pause) if succeeded && !stopped => {
                return Next::Execute(Command::Restart);
            }
            (Call::SetState(state::STOPPED), Command::Restart) if succeeded && !paused => {
                failure(result::STATE_TRANSITION_ERROR, "another client resumed the show meanwhile")
            }
            (Call::SetState(state::PAUSED), _) if stopped => {
                self.stopped_at = None;
                Response::Result(done())
            }
            (Call::SetState(_), Command::Pause | Command::Resume) if outcome.code == Code::Already => {
                failure(result::ALREADY_IN_TARGET_STATE, "the simulation is in that state already")
            }
            (Call::SetState(_), _) if !succeeded => failure(result::INCORRECT_TRANSITION, HELD),
            (Call::Reset(_), _) if !succeeded => failure(result::INCORRECT_STATE, HELD),
            (Call::Step(_), _) if !succeeded => match outcome.playback {
                PlaybackState::Held => failure(result::INCORRECT_STATE, HELD),
                PlaybackState::Paused => {
                    failure(result::OPERATION_FAILED, "another command broke the steps off before they were over")
                }
                _ => failure(result::OPERATION_FAILED, "the simulation is not paused: pause it first"),
            },
            (Call::SetState(_) | Call::Reset(_) | Call::Step(_), _) => Response::Result(done()),
            (Call::TogglePaused, Command::State) => {
                return Next::Execute(if stands_still(outcome.playback) { Command::Resume } else { Command::Pause });
            }
            (Call::IsPaused, _) => Response::Flag(stands_still(outcome.playback)),
            (Call::GetRate, _) => Response::Rate(outcome.playing_rate),
            (Call::SetRate(_) | Call::Seek(_) | Call::PlayNext, _) => Response::Flag(succeeded),
            (Call::Hold | Call::Release | Call::Go, _) => Response::Trigger(succeeded, sentence(command, outcome)),
            (Call::Pause | Call::Resume | Call::TogglePaused | Call::GetFeatures, _) => Response::Empty(0),
            (Call::Parameters(call), _) => Response::Parameters(call.response()),
        })
    }
}

/// Returns the response to a call that the show has not answered. Returns `None` if the response type cannot express a
/// refusal.
pub fn refusal(call: Call, sentence: &str) -> Option<Response> {
    Some(match call {
        Call::GetFeatures => features(),
        Call::Parameters(call) => Response::Parameters(call.response()),
        Call::GetState => Response::State(state::STOPPED, outcome_of(result::OPERATION_FAILED, sentence)),
        Call::SetState(_) | Call::Step(_) | Call::Reset(_) => failure(result::OPERATION_FAILED, sentence),
        Call::SetRate(_) | Call::Seek(_) | Call::PlayNext => Response::Flag(false),
        Call::Hold | Call::Release | Call::Go => Response::Trigger(false, sentence.to_owned()),
        Call::Pause | Call::Resume | Call::TogglePaused | Call::IsPaused | Call::GetRate => return None,
    })
}

/// The number of [`Command::Step`].
const STEP: u32 = 5;

fn stands_still(playback: PlaybackState) -> bool {
    matches!(playback, PlaybackState::Paused | PlaybackState::Held)
}

/// Returns the simulation state. A show that has ended counts as playing: it waits at its end for a reset or a loop.
fn simulation_state(playback: PlaybackState, stopped: bool) -> u8 {
    match playback {
        PlaybackState::Playing | PlaybackState::Ended => state::PLAYING,
        PlaybackState::Paused if stopped => state::STOPPED,
        PlaybackState::Paused | PlaybackState::Held => state::PAUSED,
    }
}

/// Returns the result of a command in words, for std_srvs/Trigger.
pub fn sentence(command: Command, outcome: &Outcome) -> String {
    match (outcome.code, command) {
        (Code::Done, Command::Hold) => "the show is held".to_owned(),
        (Code::Done, Command::Release) => "the show is paused".to_owned(),
        (Code::Done, _) => "the show plays".to_owned(),
        (Code::Already, _) => "the show was held already".to_owned(),
        (_, Command::Release) => "refused: the show is not held".to_owned(),
        (Code::OutOfRange, Command::Rate(_)) => {
            format!("refused: the rate is out of range, expected {} to {}", RATES.start(), RATES.end())
        }
        (Code::OutOfRange, _) => "refused: the time is before 0 or past the end of the show".to_owned(),
        _ if outcome.playback == PlaybackState::Held => format!("refused: {HELD}"),
        (_, Command::Go) => "refused: the show waits for nothing".to_owned(),
        _ => "refused: the show is not paused, or another command broke it off".to_owned(),
    }
}

fn done() -> CallResult {
    outcome_of(result::OK, "")
}

fn failure(code: u8, sentence: &str) -> Response {
    Response::Result(outcome_of(code, sentence))
}

fn outcome_of(code: u8, sentence: &str) -> CallResult {
    CallResult { result: code, error_message: sentence.to_owned() }
}

fn features() -> Response {
    let custom_info = format!(
        "bench-dragon {}: a step is one period of the publisher; rosbag2_interfaces and std_srvs/Trigger services beside \
         these set the rate, seek, hold, release and go",
        env!("CARGO_PKG_VERSION")
    );
    Response::Features(Features {
        features: vec![20, 21, 22, 24, 25, 26, 31, 32],
        spawn_formats: Vec::new(),
        custom_info,
    })
}

#[cfg(test)]
mod tests;
