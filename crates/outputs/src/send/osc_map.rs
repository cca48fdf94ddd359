//! OSC addresses and arguments that a user gives to cues, levels and events. In: the text of a file (TOML). Out: the
//! messages of each, or one sentence that names the file and the line. Pure.

use rosc::{OscMessage, OscType};
use serde::Deserialize;
use toml::Spanned;

use bench_dragon_messages::Cue;
use bench_dragon_messages::state::{FrameState, Level};

/// The most bytes of an address, and of a text.
const MOST_BYTES: usize = 255;

/// The messages of a file, in its order.
#[derive(Debug, Clone, PartialEq)]
pub struct OscMap(Vec<(Trigger, OscMessage)>);

/// The occasion of a message.
#[derive(Debug, Clone, PartialEq)]
enum Trigger {
    CueNumber(u32),
    CueName(String),
    Level(Level),
    Event(FrameState),
}

/// A file that is no map, in one sentence.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct MapError(String);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMap {
    #[serde(default)]
    messages: Vec<Spanned<RawMessage>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMessage {
    cue: Option<Spanned<toml::Value>>,
    level: Option<Spanned<String>>,
    event: Option<Spanned<String>>,
    address: Spanned<String>,
    #[serde(default)]
    arguments: Vec<Spanned<toml::Value>>,
}

impl OscMap {
    /// Reads a map. `file` names it in errors.
    ///
    /// # Errors
    /// [`MapError`]
    pub fn parse(text: &str, file: &str) -> Result<Self, MapError> {
        let line = |offset: usize| text.bytes().take(offset).filter(|byte| *byte == b'\n').count() + 1;
        let raw: RawMap = toml::from_str(text).map_err(|error| {
            let place = error.span().map_or(String::new(), |span| format!(", line {}", line(span.start)));
            MapError(format!("{file}{place}: {}", error.message().trim().replace('\n', ", ")))
        })?;
        if raw.messages.is_empty() {
            return Err(MapError(format!("{file}: expected one [[messages]] or more, each with an address")));
        }
        let message = |raw: &Spanned<RawMessage>| {
            raw.get_ref()
                .message(raw.span().start)
                .map_err(|(offset, sentence)| MapError(format!("{file}, line {}: {sentence}", line(offset))))
        };
        Ok(Self(raw.messages.iter().map(message).collect::<Result<_, _>>()?))
    }

    /// Returns the messages of a cue.
    pub fn of_cue<'a>(&'a self, cue: &'a Cue) -> impl Iterator<Item = OscMessage> + 'a {
        self.of(move |trigger| match trigger {
            Trigger::CueNumber(number) => *number == cue.number,
            Trigger::CueName(name) => name == cue.name.as_str(),
            Trigger::Level(_) | Trigger::Event(_) => false,
        })
    }

    /// Returns the messages of a level that has come.
    pub fn of_level(&self, level: Level) -> impl Iterator<Item = OscMessage> + '_ {
        self.of(move |trigger| *trigger == Trigger::Level(level))
    }

    /// Returns the messages of an event, by the state to which it leads.
    pub fn of_event(&self, state: u32) -> impl Iterator<Item = OscMessage> + '_ {
        self.of(move |trigger| matches!(trigger, Trigger::Event(of) if *of as u32 == state))
    }

    fn of<'a>(&'a self, is_it: impl Fn(&Trigger) -> bool + 'a) -> impl Iterator<Item = OscMessage> + 'a {
        self.0.iter().filter(move |(trigger, _)| is_it(trigger)).map(|(_, message)| message.clone())
    }
}

/// The place of an error in the text, and its sentence.
type Refused = (usize, String);

impl RawMessage {
    fn message(&self, begin: usize) -> Result<(Trigger, OscMessage), Refused> {
        let refused = |at: usize, sentence: &str| Err((at, sentence.to_owned()));
        let trigger = match (&self.cue, &self.level, &self.event) {
            (Some(cue), None, None) => match cue.get_ref() {
                toml::Value::String(name) => Trigger::CueName(name.clone()),
                toml::Value::Integer(number @ 1..=0xffff_ffff) => Trigger::CueNumber(*number as u32),
                _ => return refused(cue.span().start, "cue: expected its name, or its number from 1"),
            },
            (None, Some(level), None) => Trigger::Level(named("level", level, &Level::ALL, Level::name)?),
            (None, None, Some(event)) => {
                let events = FrameState::ALL.map(|state| state.event().map(|_| state));
                let events = Vec::from_iter(events.into_iter().flatten());
                Trigger::Event(named("event", event, &events, FrameState::name)?)
            }
            _ => return refused(begin, "[[messages]]: expected one of cue, level and event"),
        };
        let address = self.address.get_ref();
        let allowed = |byte: u8| byte.is_ascii_graphic() && !b"#*,?[]{}".contains(&byte);
        if !address.starts_with('/') || address.len() > MOST_BYTES || !address.bytes().all(allowed) {
            let sentence = "address: expected a slash and then characters without spaces and # * , ? [ ] { }";
            return refused(self.address.span().start, sentence);
        }
        let args = self.arguments.iter().map(argument).collect::<Result<_, _>>()?;
        Ok((trigger, OscMessage { addr: address.clone(), args }))
    }
}

/// Returns the value of a name.
fn named<T: Copy>(
    field: &str,
    given: &Spanned<String>,
    all: &[T],
    name: impl Fn(T) -> &'static str,
) -> Result<T, Refused> {
    let found = all.iter().find(|value| name(**value) == given.get_ref());
    found.copied().ok_or_else(|| {
        let names = Vec::from_iter(all.iter().map(|value| name(*value))).join(", ");
        (given.span().start, format!("{field}: expected one of {names}"))
    })
}

fn argument(given: &Spanned<toml::Value>) -> Result<OscType, Refused> {
    let refused = |expected: &str| Err((given.span().start, format!("arguments: expected {expected}")));
    match given.get_ref() {
        toml::Value::String(text) if text.contains('\0') || text.len() > MOST_BYTES => {
            refused("text of at most 255 bytes without a zero byte")
        }
        toml::Value::String(text) => Ok(OscType::String(text.clone())),
        toml::Value::Boolean(value) => Ok(OscType::Bool(*value)),
        toml::Value::Float(value) => Ok(OscType::Float(*value as f32)),
        toml::Value::Integer(value) => match i32::try_from(*value) {
            Ok(value) => Ok(OscType::Int(value)),
            Err(_) => refused("an integer of 32 bits, or a number with a point"),
        },
        _ => refused("numbers, texts, true and false"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench_dragon_messages::SceneName;

    #[test]
    fn each_occasion_has_its_messages_in_the_order_of_the_file() {
        let text = "[[messages]]\ncue = \"lights\"\naddress = \"/cue/12/start\"\n\
                    [[messages]]\ncue = 2\naddress = \"/cue/13/start\"\narguments = [1, 0.5, \"go\", true]\n\
                    [[messages]]\nlevel = \"approaching\"\naddress = \"/fog/stop\"\n\
                    [[messages]]\nevent = \"path_end\"\naddress = \"/house\"\narguments = [-3]\n";
        let map = OscMap::parse(text, "map.toml").unwrap();
        let cue = |number, name: &str| Cue { number, name: SceneName::new(name), ..Cue::default() };
        let addresses = |messages: Vec<OscMessage>| Vec::from_iter(messages.into_iter().map(|message| message.addr));
        assert_eq!(addresses(map.of_cue(&cue(2, "lights")).collect()), ["/cue/12/start", "/cue/13/start"]);
        assert_eq!(addresses(map.of_cue(&cue(1, "other")).collect()), [""; 0]);
        assert_eq!(addresses(map.of_level(Level::Approaching).collect()), ["/fog/stop"]);
        assert_eq!(map.of_level(Level::Contact).count(), 0);
        let end = Vec::from_iter(map.of_event(FrameState::PathEnd as u32));
        assert_eq!(end, [OscMessage { addr: "/house".to_owned(), args: vec![OscType::Int(-3)] }]);
        let second = map.of_cue(&cue(2, "")).next().unwrap();
        let text = |text: &str| OscType::String(text.to_owned());
        assert_eq!(second.args, [OscType::Int(1), OscType::Float(0.5), text("go"), OscType::Bool(true)]);
    }

    #[test]
    fn a_wrong_map_is_refused_with_the_line() {
        for (text, expected) in [
            ("", "map.toml: expected one [[messages]]"),
            ("[[messages]]\nadress = \"/a\"\n", "line 2: unknown field `adress`"),
            ("[[messages]]\naddress = \"/a\"\n", "line 1: [[messages]]: expected one of cue, level and event"),
            ("[[messages]]\ncue = 1\nlevel = \"clear\"\naddress = \"/a\"\n", "expected one of cue, level and event"),
            ("[[messages]]\ncue = 0\naddress = \"/a\"\n", "line 2: cue: expected its name, or its number from 1"),
            ("[[messages]]\nlevel = \"near\"\naddress = \"/a\"\n", "line 2: level: expected one of clear, approaching"),
            ("[[messages]]\nevent = \"moving\"\naddress = \"/a\"\n", "line 2: event: expected one of contact, stall"),
            ("[[messages]]\ncue = 1\naddress = \"cue 1\"\n", "line 3: address: expected a slash"),
            ("[[messages]]\ncue = 1\naddress = \"/a\"\narguments = [1, [2]]\n", "line 4: arguments: expected numbers"),
            (
                "[[messages]]\ncue = 1\naddress = \"/a\"\narguments = [5000000000]\n",
                "line 4: arguments: expected an int",
            ),
        ] {
            let sentence = OscMap::parse(text, "map.toml").unwrap_err().to_string();
            assert!(sentence.starts_with("map.toml") && sentence.contains(expected), "{text:?}: {sentence}");
        }
    }
}
