//! Changes of a text: numbers replaced at their bytes, tables added and removed.
//!
//! In: a scene with its text, and the changes. Out: another text, in which all other bytes are the same.

use std::collections::BTreeMap;

use toml_edit::DocumentMut;

use crate::request::Setting;
use crate::scene::{DesignedScene, Fault, written};
use crate::tables::Path;
use crate::text::{Found, Value};
use bench_dragon_motion::model::Point;

/// A change of the text.
#[derive(Debug, Clone)]
pub enum Change {
    /// A number.
    Number {
        /// The name of the number.
        name: String,
        /// The new number.
        value: f64,
    },
    /// A pair of numbers.
    Place {
        /// The name of the pair.
        name: String,
        /// The new place.
        value: Point,
    },
    /// A word, or true or false.
    Word {
        /// The name of the value.
        name: String,
        /// The new value.
        value: toml_edit::Value,
    },
}

impl Change {
    /// Creates the change of a number, rounded to as few decimals as keep it within half of `step`.
    pub fn number(name: &str, value: f64, step: f64) -> Self {
        Self::Number { name: name.to_owned(), value: rounded(value, step) }
    }

    /// Creates the change of a place, rounded to a tenth of a millimetre.
    pub fn place(name: &str, value: Point) -> Self {
        Self::Place { name: name.to_owned(), value: value.map(|metres| rounded(metres, 1e-4)) }
    }

    /// Creates the change of a word.
    pub fn word(name: &str, value: &'static str) -> Self {
        Self::Word { name: name.to_owned(), value: value.into() }
    }
}

/// Returns a number rounded to as few decimals as keep it within half of `step`, at most 15.
fn rounded(value: f64, step: f64) -> f64 {
    let decimals = (-step.log10()).ceil().clamp(0.0, 15.0) as usize;
    // Text of a number reads back. Zero has no sign.
    format!("{value:.decimals$}").parse().unwrap_or(value) + 0.0
}

/// Replaces values of a text by others, and adds those that the text leaves to their defaults.
///
/// # Errors
/// [`Fault`] for a number that its field cannot have, or a name without a table.
pub fn set(scene: &DesignedScene, values: &BTreeMap<String, Setting>) -> Result<String, Fault> {
    let changes = values.iter().map(|(name, value)| match value {
        Setting::Number(value) => Change::Number { name: name.clone(), value: *value },
        Setting::Switch(value) => Change::Word { name: name.clone(), value: (*value).into() },
        Setting::Word(value) => Change::Word { name: name.clone(), value: value.into() },
    });
    apply(scene, &changes.collect::<Vec<_>>())
}

/// Applies changes to the text of a scene.
///
/// # Errors
/// As [`set`].
pub fn apply(scene: &DesignedScene, changes: &[Change]) -> Result<String, Fault> {
    let (mut spans, mut missing) = (Vec::new(), Vec::new());
    for change in changes {
        match change {
            Change::Number { name, value } => match number_at(scene, name, *value)? {
                Some(replaced) => spans.push(replaced),
                None => missing.push((name.as_str(), toml_edit::Value::from(*value))),
            },
            Change::Place { name, value } => {
                let [x, y] = [(0, value.x), (1, value.y)].map(|(k, metres)| (format!("{name}[{k}]"), metres));
                match (number_at(scene, &x.0, x.1)?, number_at(scene, &y.0, y.1)?) {
                    (Some(x), Some(y)) => spans.extend([x, y]),
                    _ => missing.push((name.as_str(), toml_edit::Value::from_iter([value.x, value.y]))),
                }
            }
            Change::Word { name, value } => match scene.values.get(name) {
                Some(Found { value: Value::Array(_) | Value::Other, .. }) => {
                    return Err(format!("{name} is no word of the text").into());
                }
                Some(found) => spans.push((found.span.clone(), value.to_string())),
                None => missing.push((name.as_str(), value.clone())),
            },
        }
    }
    spans.sort_by_key(|(span, _)| span.start);
    let mut text = scene.text.clone();
    for (span, new) in spans.into_iter().rev() {
        text.replace_range(span, &new);
    }
    if missing.is_empty() {
        return Ok(text);
    }
    let mut document = document(&text)?;
    for (name, value) in missing {
        Path::of(name)?.insert(&mut document, value)?;
    }
    Ok(document.to_string())
}

/// Returns the bytes of a number and what replaces them; `None` for a number that the text does not have.
fn number_at(scene: &DesignedScene, name: &str, value: f64) -> Result<Option<(std::ops::Range<usize>, String)>, Fault> {
    let Some(found) = scene.values.get(name) else { return Ok(None) };
    if scene.values.number(name).is_none() {
        return Err(format!("{name} is no number of the text").into());
    }
    let is_whole = scene.fields.iter().any(|field| field.integer && field.name == name);
    let new = written(name, value, is_whole, &scene.text[found.span.clone()])?;
    Ok(Some((found.span.clone(), new)))
}

/// Parses a text whose tables change.
///
/// # Errors
/// [`Fault`] for a text that is not TOML, which no scene is.
pub(crate) fn document(text: &str) -> Result<DocumentMut, Fault> {
    text.parse().map_err(|error: toml_edit::TomlError| error.message().to_owned().into())
}
