//! The way from browsers to `<name>/control`: who may command, what a message commands, and the answer to it.
//!
//! In: the text of a message. Out: JSON. A [`Gate`] is there only where the user asked for control; its conductor has a
//! thread of its own, so that no command keeps a picture waiting. Called by the server and by `browser`.

use serde::Deserialize;
use serde_json::{Value, json};
use subtle::ConstantTimeEq;
use tokio::sync::mpsc::UnboundedSender;

use bench_dragon_client::control::conductor::{Action, Conducted, Conductor};
use bench_dragon_client::control::refusal;
use bench_dragon_messages::control::{Code, Command};
use bench_dragon_messages::state::PlaybackState;

/// Commands of one browser that may be unanswered.
pub(super) const MOST_UNANSWERED: usize = 8;
/// Random bytes of a token.
const TOKEN_BYTES: usize = 16;

const OFF: &str = "this server was started without --control: it takes no commands";
const EXPECTED: &str = "expected JSON such as {\"command\":\"seek\",\"value\":400}; the commands are toggle, state, pause, \
                        resume, rate, seek, step, restart, hold, release and go, of which rate and seek have a value";

/// Where an answer goes, and the sender's own number for the command.
pub(super) struct Tag {
    id: Value,
    answers: UnboundedSender<String>,
}

/// What whoever commands has to give.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Token(String);

impl Token {
    /// A new one.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn random() -> Result<Self, getrandom::Error> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes)?;
        Ok(Self(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// Its letters.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Whether a text is this token, in a time that does not depend on how much of it is right.
    fn is(&self, text: &str) -> bool {
        self.0.as_bytes().ct_eq(text.as_bytes()).into()
    }
}

/// A server's way to `<name>/control`.
pub(super) struct Gate {
    conductor: Conductor<Tag>,
    token: Option<Token>,
}

impl Gate {
    /// A gate to the publisher of `name`, for whoever has the token, or for everybody where there is none.
    ///
    /// # Errors
    /// The system has no thread left.
    pub(super) fn new(name: &str, token: Option<Token>) -> std::io::Result<Self> {
        let conductor = Conductor::start(name, |Tag { id, answers }, conducted| {
            // A browser that has gone needs no answer.
            let _ = answers.send(answer(&id, conducted));
        })?;
        Ok(Self { conductor, token })
    }

    /// Whether those who have given no token may command.
    pub(super) fn is_open(&self) -> bool {
        self.token.is_none()
    }
}

/// One browser at the gate.
pub(super) struct Visitor<'a> {
    gate: Option<&'a Gate>,
    allowed: bool,
    answers: UnboundedSender<String>,
    /// Commands whose answers have not come.
    pub(super) unanswered: usize,
}

/// What a browser may send.
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
    /// A browser that has given nothing yet; what becomes of its commands goes to `answers`.
    pub(super) fn new(gate: Option<&'a Gate>, answers: UnboundedSender<String>) -> Self {
        Self { gate, allowed: gate.is_some_and(Gate::is_open), answers, unanswered: 0 }
    }

    /// The message about whether this browser may command; none where nobody may.
    pub(super) fn permission(&self) -> Option<String> {
        self.gate?;
        let reason = (!self.allowed).then_some("commands need the token of the address that view printed");
        Some(json!({"type": "control", "allowed": self.allowed, "reason": reason}).to_string())
    }

    /// Takes in a message; the response that can be given at once. The other is on its way to `answers`.
    pub(super) fn receive(&mut self, text: &str) -> Option<String> {
        let request = match serde_json::from_str(text) {
            Ok(request) => request,
            Err(_) => return Some(refused(&Value::Null, EXPECTED)),
        };
        match (request, self.gate) {
            (Request::Command { id, .. }, None) => Some(refused(&id, OFF)),
            (Request::Token { .. }, None) => Some(refused(&Value::Null, OFF)),
            (Request::Token { token }, Some(gate)) => {
                self.allowed = gate.token.as_ref().is_none_or(|right| right.is(&token));
                self.permission()
            }
            (Request::Command { id, .. }, Some(_)) if !self.allowed => {
                Some(refused(&id, "commands need the token of the address that view printed"))
            }
            (Request::Command { command, value, id }, Some(gate)) => match action(&command, value) {
                Err(sentence) => Some(refused(&id, sentence)),
                Ok(action) => self.pass_on(gate, id, action),
            },
        }
    }

    fn pass_on(&mut self, gate: &Gate, id: Value, action: Action) -> Option<String> {
        let too_many = "too many commands are waiting";
        // A hold is accepted always: one more than all others.
        let most = if action == Action::Send(Command::Hold) { MOST_UNANSWERED + 1 } else { MOST_UNANSWERED };
        if self.unanswered >= most {
            return Some(refused(&id, too_many));
        }
        let tag = Tag { id: id.clone(), answers: self.answers.clone() };
        match gate.conductor.request(tag, action) {
            Ok(()) => {
                self.unanswered += 1;
                None
            }
            Err(_) => Some(refused(&id, too_many)),
        }
    }
}

/// What a command's name and value ask for.
fn action(name: &str, value: Option<f64>) -> Result<Action, &'static str> {
    if name == "toggle" {
        return Ok(Action::Toggle);
    }
    let number = Command::named(name).ok_or(EXPECTED)?.number;
    let value = match (name, value) {
        ("step", None) => 1.0,
        ("rate" | "seek", None) => return Err(EXPECTED),
        (_, value) => value.unwrap_or_default(),
    };
    match Command::of_number(number, value) {
        Ok(command) => Ok(Action::Send(command)),
        Err(_) => Err("step is refused: expected a whole number of periods from 1"),
    }
}

/// The response to what never reaches the publisher.
fn refused(id: &Value, sentence: &str) -> String {
    json!({"type": "answer", "id": id, "code": null, "sentence": sentence}).to_string()
}

/// What became of a command.
fn answer(id: &Value, conducted: Conducted) -> String {
    let (command, response) = match conducted {
        Ok(conducted) => conducted,
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
        assert!(action("rate", None).is_err() && action("jump", None).is_err() && action("step", Some(0.5)).is_err());
    }
}
