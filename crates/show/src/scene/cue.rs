//! Cues: named times of a show that are announced, with an optional pause: `[[cues]]`.
//!
//! In: the tables of the file. Out: checked [`Cue`]s, whose times the show computes.

use serde::Deserialize;
use toml::Spanned;

use super::{Accepted, SceneError, Source};
use bench_dragon_messages::SceneName;
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::ensemble::Ensemble;
use bench_dragon_motion::timeline::Timeline;

/// A named time of the show.
#[derive(Debug, Clone, PartialEq)]
pub struct Cue {
    /// Its name.
    pub name: String,
    /// The cue's time, as the scene states it.
    pub moment: CueMoment,
    /// The show's action at the cue.
    pub then: CueAction,
}

/// The ways to state the time of a cue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CueMoment {
    /// A time, simulated seconds since the start of the scene.
    At(f64),
    /// A time before an event.
    Before {
        /// The event.
        event: EventKind,
        /// Simulated seconds before it.
        seconds: f64,
    },
    /// The travel of the head of `[team]` along the path, in metres.
    Travelled(f64),
}

/// The show's action at a cue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CueAction {
    /// The show announces the cue.
    Mark,
    /// The show announces the cue and pauses until the command `go`.
    Pause,
}

impl Cue {
    /// Returns the simulated time of the cue. Returns `None` for a cue before an event that does not happen, or that
    /// would be before the start.
    pub fn time(&self, ensemble: &Ensemble, timeline: &Timeline) -> Option<f64> {
        let time = match self.moment {
            CueMoment::At(time) => time,
            CueMoment::Before { event, seconds } => timeline.find(event)?.time - seconds,
            CueMoment::Travelled(metres) => ensemble.only()?.time_at(metres),
        };
        (time >= 0.0).then_some(time)
    }
}

/// The name of an event in a cue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum CueEvent {
    Contact,
    Obstacle,
    Stall,
    Lock,
    PathEnd,
}

/// A table of the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCue {
    name: Spanned<String>,
    at: Option<Spanned<f64>>,
    before: Option<Spanned<CueEvent>>,
    seconds: Option<Spanned<f64>>,
    travelled: Option<Spanned<f64>>,
    then: Option<CueAction>,
}

impl RawCue {
    /// Returns the metres of the head's travel, if they are given.
    pub(super) fn travelled(&self) -> Option<&Spanned<f64>> {
        self.travelled.as_ref()
    }

    pub(super) fn validated(&self, source: &Source, alerts: bool) -> Result<Cue, SceneError> {
        let name = self.name.get_ref().trim();
        if name.is_empty() {
            return Err(source.field_error(&self.name, "cues.name is empty, expected a name"));
        }
        source.printable("cues.name", &self.name)?;
        if name.len() > SceneName::CAPACITY {
            let (bytes, most) = (name.len(), SceneName::CAPACITY);
            let sentence =
                format!("cues.name has {bytes} bytes, expected at most {most}: messages hold no longer name");
            return Err(source.field_error(&self.name, &sentence));
        }
        let moment = match (&self.at, &self.before, &self.travelled) {
            (Some(at), None, None) => CueMoment::At(source.check("cues.at", at, Accepted::CUE)?),
            (None, Some(before), None) => self.before_event(before, source, alerts)?,
            (None, None, Some(travelled)) => {
                CueMoment::Travelled(source.check("cues.travelled", travelled, Accepted::ROUTE)?)
            }
            _ => {
                let sentence = format!("cue \"{name}\" has to be given one of at, before and travelled");
                return Err(source.field_error(&self.name, &sentence));
            }
        };
        match &self.seconds {
            Some(seconds) if self.before.is_none() => {
                let sentence = "cues.seconds is given without cues.before, expected both or neither";
                Err(source.field_error(seconds, sentence))
            }
            _ => Ok(Cue { name: name.to_owned(), moment, then: self.then.unwrap_or(CueAction::Mark) }),
        }
    }

    fn before_event(&self, before: &Spanned<CueEvent>, source: &Source, alerts: bool) -> Result<CueMoment, SceneError> {
        let event = match before.get_ref() {
            CueEvent::Contact => EventKind::Contact,
            CueEvent::Obstacle => EventKind::Obstacle,
            CueEvent::Stall => EventKind::Stall,
            CueEvent::Lock => EventKind::Lock,
            CueEvent::PathEnd => EventKind::PathEnd,
        };
        if !alerts && matches!(event, EventKind::Contact | EventKind::Obstacle | EventKind::Stall) {
            let sentence = format!(
                "cues.before is \"{}\", which a scene without [alerts] does not compute, expected such a table",
                event.name()
            );
            return Err(source.field_error(before, &sentence));
        }
        let seconds = self.seconds.as_ref().map_or(Ok(0.0), |of| source.check("cues.seconds", of, Accepted::CUE))?;
        Ok(CueMoment::Before { event, seconds })
    }
}
