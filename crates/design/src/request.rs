//! The requests of a page.
//!
//! In: JSON. Out: a [`Request`], or a [`RequestError`].

use std::collections::BTreeMap;

use serde::Deserialize;

const EXPECTED: &str = "expected JSON with an id and one of text, set, drag, add, remove, at, plan, cancel, template, \
                        geojson and file";

/// A text that is no request.
#[derive(Debug, thiserror::Error)]
pub enum RequestError {
    /// The text is no JSON, or has other keys.
    #[error("{0}: {EXPECTED}")]
    Json(#[from] serde_json::Error),
    /// The request has no wish, or several.
    #[error("{EXPECTED}")]
    Wishes,
}

/// A request with its number.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// The number, which answers repeat.
    pub id: u64,
    text: Option<String>,
    set: Option<BTreeMap<String, Setting>>,
    drag: Option<Drag>,
    add: Option<Addition>,
    remove: Option<String>,
    at: Option<f64>,
    plan: Option<String>,
    vary: Option<Vec<String>>,
    cancel: Option<bool>,
    template: Option<String>,
    geojson: Option<String>,
    file: Option<bool>,
}

/// A new value.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Setting {
    /// True or false.
    Switch(bool),
    /// A number.
    Number(f64),
    /// A word.
    Word(String),
}

/// A handle and the place to which it is dragged.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drag {
    /// The name of the handle.
    pub handle: String,
    /// The place on the stage, in metres.
    pub to: [f64; 2],
    /// True without the snap to a tenth of a metre.
    #[serde(default)]
    pub free: bool,
    /// True if an arc may change its side.
    #[serde(default)]
    pub alt: bool,
}

/// A table to add.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Addition {
    /// `piece`, `obstacle`, `corner`, `cue` or `dragon`.
    pub what: String,
    /// The kind of the piece or of the obstacle.
    pub kind: Option<String>,
    /// The place on the stage, in metres.
    pub at: Option<[f64; 2]>,
    /// The dragon of a piece, such as `dragons[1]`.
    pub to: Option<String>,
    /// The corner after which a corner is added.
    pub after: Option<String>,
    /// The time of a cue, in simulated seconds.
    pub time: Option<f64>,
}

/// The wish of a request.
#[derive(Debug, Clone, PartialEq)]
pub enum Wish {
    /// A new text.
    Text(String),
    /// Other numbers, words and switches in the text.
    Set(BTreeMap<String, Setting>),
    /// A handle at another place.
    Drag(Drag),
    /// A new table.
    Add(Addition),
    /// Without a table or a corner.
    Remove(String),
    /// The picture at another time.
    At(f64),
    /// A plan of this kind, which may vary these fields.
    Plan(String, Vec<String>),
    /// No plan any longer.
    Cancel,
    /// The text of a template.
    Template(String),
    /// The polygons of a GeoJSON text as obstacles.
    GeoJson(String),
    /// The text of the file.
    File,
}

impl Request {
    /// Reads a request.
    ///
    /// # Errors
    /// [`RequestError`]
    pub fn read(json: &str) -> Result<(u64, Wish), RequestError> {
        let request: Self = serde_json::from_str(json)?;
        let id = request.id;
        let vary = request.vary.unwrap_or_default();
        let wishes = [
            request.text.map(Wish::Text),
            request.set.map(Wish::Set),
            request.drag.map(Wish::Drag),
            request.add.map(Wish::Add),
            request.remove.map(Wish::Remove),
            request.at.map(Wish::At),
            request.plan.map(|plan| Wish::Plan(plan, vary)),
            request.cancel.map(|_| Wish::Cancel),
            request.template.map(Wish::Template),
            request.geojson.map(Wish::GeoJson),
            request.file.map(|_| Wish::File),
        ];
        let mut given = wishes.into_iter().flatten();
        match (given.next(), given.next()) {
            (Some(wish), None) => Ok((id, wish)),
            _ => Err(RequestError::Wishes),
        }
    }
}
