//! The commands of browsers to `<name>/control`: their authorization, their parsing, and their answers.
//!
//! In: the text of a message. Out: JSON. An [`Authorization`] exists only with `--control`. Its command client has a
//! separate thread, so that no command delays a picture.

use serde::Deserialize;
use serde_json::{Value, json};
use subtle::ConstantTimeEq;
use tokio::sync::mpsc::UnboundedSender;

use bench_dragon_client::control::command_client::{Action, ActionResult, CommandClient};
use bench_dragon_client::control::refusal;
use bench_dragon_messages::control::{Code, Command, CommandEntry, CommandValue, MOST_PERIODS};
use bench_dragon_messages::state::PlaybackState;

/// Commands of one browser that may be unanswered.
pub(super) const MOST_UNANSWERED: usize = 8;
/// Random bytes of a token.
const TOKEN_BYTES: usize = 16;

const OFF: &str = "this server was started without --control: it takes no commands";

/// The channel of an answer, and the browser's number of the command.
pub(super) struct Tag {
    id: Value,
    answers: UnboundedSender<String>,
}

/// The token that authorizes commands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Token(String);

impl Token {
    /// Creates a random token.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn random() -> Result<Self, getrandom::Error> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes)?;
        Ok(Self(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// Returns its letters.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Returns true if a text is this token, in a time that does not depend on the matching letters.
    pub(crate) fn is(&self, text: &str) -> bool {
        self.0.as_bytes().ct_eq(text.as_bytes()).into()
    }
}

/// The authorization for `<name>/control`, and the client that sends the commands.
pub(super) struct Authorization {
    client: CommandClient<Tag>,
    token: Option<Token>,
}

impl Authorization {
    /// Creates the authorization for the publisher of `name`: for browsers with the token, or for all browsers without
    /// a token.
    ///
    /// # Errors
    /// The system has no thread left.
    pub(super) fn new(name: &str, token: Option<Token>) -> std::io::Result<Self> {
        let client = CommandClient::start(name, |Tag { id, answers }, result| {
            // A browser that has gone needs no answer.
            let _ = answers.send(answer(&id, result));
        })?;
        Ok(Self { client, token })
    }

    /// Returns true if browsers may command without a token.
    pub(super) fn is_open(&self) -> bool {
        self.token.is_none()
    }
}

/// One browser.
pub(super) struct Visitor<'a> {
    authorization: Option<&'a Authorization>,
    allowed: bool,
    answers: UnboundedSender<String>,
    /// Commands whose answers have not come.
    pub(super) unanswered: usize,
}

/// A message of a browser.
#[derive(Deserialize)]
#[serde(untagged, deny_unknown_fields)]
enum Request {
    Command {
        command: String,
        value: Option<f64>,
        #[serde(default)]
        id: Value,
    },
    Token {
        token: String,
    },
}

impl<'a> Visitor<'a> {
    /// Creates a browser that has sent no token yet; the results of its commands go to `answers`.
    pub(super) fn new(authorization: Option<&'a Authorization>, answers: UnboundedSender<String>) -> Self {
        Self { authorization, allowed: authorization.is_some_and(Authorization::is_open), answers, unanswered: 0 }
    }

    /// Returns the message that this browser may command or not; `None` if no browser may.
    pub(super) fn permission(&self) -> Option<String> {
        self.authorization?;
        let reason = (!self.allowed).then_some("commands need the token of the address that view printed");
        Some(json!({"type": "control", "allowed": self.allowed, "reason": reason}).to_string())
    }

    /// Handles a message. Returns a response if one is ready; other responses go to `answers`.
    pub(super) fn receive(&mut self, text: &str) -> Option<String> {
        let request = match serde_json::from_str(text) {
            Ok(request) => request,
            Err(_) => return Some(refused(&Value::Null, &expected())),
        };
        match (request, self.authorization) {
            (Request::Command { id, .. }, None) => Some(refused(&id, OFF)),
            (Request::Token { .. }, None) => Some(refused(&Value::Null, OFF)),
            (Request::Token { token }, Some(authorization)) => {
                self.allowed = authorization.token.as_ref().is_none_or(|right| right.is(&token));
                self.permission()
            }
            (Request::Command { id, .. }, Some(_)) if !self.allowed => {
                Some(refused(&id, "commands need the token of the address that view printed"))
            }
            (Request::Command { command, value, id }, Some(authorization)) => match action(&command, value) {
                Err(error) => Some(refused(&id, &error.to_string())),
                Ok(action) => self.pass_on(authorization, id, action),
            },
        }
    }

    fn pass_on(&mut self, authorization: &Authorization, id: Value, action: Action) -> Option<String> {
        let too_many = "too many commands are waiting";
        // A hold has one place more than the other commands.
        let most = if action == Action::Send(Command::Hold) { MOST_UNANSWERED + 1 } else { MOST_UNANSWERED };
        if self.unanswered >= most {
            return Some(refused(&id, too_many));
        }
        let tag = Tag { id: id.clone(), answers: self.answers.clone() };
        match authorization.client.request(tag, action) {
            Ok(()) => {
                self.unanswered += 1;
                None
            }
            Err(_) => Some(refused(&id, too_many)),
        }
    }
}

/// Returns true for a command that means nothing without a value.
fn needs_value(entry: &CommandEntry) -> bool {
    matches!(entry.value, CommandValue::Rate | CommandValue::Seconds)
}

/// Returns the sentence about a message that is no command.
fn expected() -> String {
    let names = Command::TABLE.iter().map(|entry| entry.name).collect::<Vec<_>>().join(", ");
    let with_value = Command::TABLE.iter().filter(|entry| needs_value(entry)).map(|entry| entry.name);
    let with_value = with_value.collect::<Vec<_>>().join(" and ");
    format!(
        "expected JSON such as {{\"command\":\"seek\",\"value\":400}}; the commands are toggle, {names}; \
         {with_value} have a value"
    )
}

/// A command that is not understood.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
enum ActionError {
    /// There is no such command, or it lacks its value.
    #[error("{}", expected())]
    Unknown,
    /// The command of this name has another number of periods.
    #[error("{0} is refused: expected a whole number of periods from 1 to {MOST_PERIODS}")]
    Periods(&'static str),
}

/// Returns the action of a command's name and value.
fn action(name: &str, value: Option<f64>) -> Result<Action, ActionError> {
    if name == "toggle" {
        return Ok(Action::Toggle);
    }
    let entry = Command::named(name).ok_or(ActionError::Unknown)?;
    let value = match value {
        None if needs_value(entry) => return Err(ActionError::Unknown),
        None if entry.value == CommandValue::Periods => 1.0,
        value => value.unwrap_or_default(),
    };
    match Command::of_number(entry.number, value) {
        Ok(command) => Ok(Action::Send(command)),
        Err(_) => Err(ActionError::Periods(entry.name)),
    }
}

/// Returns the response to a command that the publisher has not answered.
fn refused(id: &Value, sentence: &str) -> String {
    json!({"type": "answer", "id": id, "code": null, "sentence": sentence}).to_string()
}

/// Returns the answer to a command.
fn answer(id: &Value, result: ActionResult) -> String {
    let (command, response) = match result {
        Ok(done) => done,
        Err(error) => return refused(id, &error.to_string()),
    };
    json!({"type": "answer", "id": id, "command": command.name(),
        "code": response.result().map_or("unknown", Code::name), "tick": response.tick, "sim_time": response.sim_time,
        "time_scale": response.time_scale, "playback": response.playback_state().map_or("unknown", PlaybackState::name),
        "cue": response.cue, "sentence": refusal(&response, command)})
    .to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_is_random_and_only_itself() {
        let (one, other) = (Token::random().unwrap(), Token::random().unwrap());
        assert_eq!(one.as_str().len(), 2 * TOKEN_BYTES);
        assert!(one.is(one.as_str()) && !one.is(other.as_str()) && !one.is("") && !one.is(&one.as_str()[1..]));
    }

    #[test]
    fn a_message_names_its_command() {
        assert_eq!(action("seek", Some(2.5)), Ok(Action::Send(Command::Seek(2.5))));
        assert_eq!(action("step", None), Ok(Action::Send(Command::Step(1))));
        assert_eq!(action("step", Some(3.0)), Ok(Action::Send(Command::Step(3))));
        assert_eq!(action("hold", None), Ok(Action::Send(Command::Hold)));
        assert_eq!(action("toggle", None), Ok(Action::Toggle));
        let sentence = "expected JSON such as {\"command\":\"seek\",\"value\":400}; the commands are toggle, state, pause, \
                        resume, rate, seek, step, restart, hold, release, go; rate and seek have a value";
        assert_eq!(action("seek", None).unwrap_err().to_string(), sentence);
        assert!(action("rate", None).is_err() && action("jump", None).is_err() && action("step", Some(0.5)).is_err());
    }
}
