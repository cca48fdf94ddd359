//! Cues: moments of a show that are announced, and at which it may wait: `[[cues]]`.
//!
//! In: the tables as written. Out: [`Cue`]s, checked. Called by the scene; the show works out their times.

use serde::Deserialize;
use toml::Spanned;

use super::{Accepted, SceneError, Source};
use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::Motion;
use bench_dragon_motion::timeline::Timeline;

/// A moment of the show that has a name.
#[derive(Debug, Clone, PartialEq)]
pub struct Cue {
    /// Its name.
    pub name: String,
    /// When it is.
    pub moment: CueMoment,
    /// What the show does then.
    pub then: CueAction,
}

/// How a scene states when a cue is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CueMoment {
    /// At simulated seconds since the start of the scene.
    At(f64),
    /// So many simulated seconds before an event.
    Before {
        /// The event.
        event: EventKind,
        /// Simulated seconds.
        seconds: f64,
    },
    /// Once the head has travelled so many metres along the path.
    Travelled(f64),
}

/// What the show does at a cue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CueAction {
    /// It announces the cue.
    Mark,
    /// It announces the cue and pauses until the command `go`.
    Pause,
}

impl Cue {
    /// Simulated seconds of the cue; `None` before an event that does not happen, or that happens sooner after the
    /// start than the cue would be before it.
    pub fn time(&self, motion: &Motion, timeline: &Timeline) -> Option<f64> {
        let time = match self.moment {
            CueMoment::At(time) => time,
            CueMoment::Before { event, seconds } => timeline.find(event)?.time - seconds,
            CueMoment::Travelled(metres) => motion.time_at(metres),
        };
        (time >= 0.0).then_some(time)
    }
}

/// An event as a cue names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum CueEvent {
    Contact,
    Stall,
    Lock,
    PathEnd,
}

/// A table as written.
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
    pub(super) fn validated(&self, source: &Source, alerts: bool) -> Result<Cue, SceneError> {
        let name = self.name.get_ref().trim();
        if name.is_empty() {
            return Err(source.field_error(&self.name, "cues.name is empty, expected a name"));
        }
        source.printable("cues.name", &self.name)?;
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
            CueEvent::Stall => EventKind::Stall,
            CueEvent::Lock => EventKind::Lock,
            CueEvent::PathEnd => EventKind::PathEnd,
        };
        if !alerts && matches!(event, EventKind::Contact | EventKind::Stall) {
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
