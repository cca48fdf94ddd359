//! A scene with its text: the fields of its numbers, and what stands in the text beside them.
//!
//! In: a text. Out: a [`DesignedScene`], or a [`Fault`] with its line and field.

use std::ops::Range;

use serde::Serialize;
use serde_json::json;

use bench_dragon_messages::sentence::number;
use bench_dragon_motion::ensemble::Dragon;
use bench_dragon_motion::model::shape::ShapeKind;
use bench_dragon_show::scene::cue::CueMoment;
use bench_dragon_show::scene::values::{Found, Lines, Value, Values};
use bench_dragon_show::scene::{CheckedNumber, Scene, printable};

/// The greatest length of a text, in bytes.
pub const MOST_BYTES: usize = 256 * 1024;
/// The greatest number of benches that a page is shown.
pub const MOST_BENCHES: usize = 5000;
/// The factors of a number between which a slider moves it.
const SLIDER: [f64; 2] = [0.8, 1.25];

/// A text that is no scene, or a change that is not possible.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, thiserror::Error)]
#[error("{sentence}")]
pub struct Fault {
    /// One sentence.
    pub sentence: String,
    /// The line of the text, from 1.
    pub line: Option<usize>,
    /// The name of the value.
    pub field: Option<String>,
}

impl From<String> for Fault {
    /// Creates the fault of a request, whose words may be in the sentence.
    fn from(sentence: String) -> Self {
        Self { sentence: printable(&sentence), line: None, field: None }
    }
}

/// A number of the text.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Field {
    /// Its name, such as `path.pieces[2].radius`.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// The unit, as in "metres".
    pub unit: &'static str,
    /// The least number accepted.
    pub min: f64,
    /// The greatest number accepted.
    pub max: f64,
    /// The range of a slider.
    pub slider: [f64; 2],
    /// True for a number that has to be whole.
    pub integer: bool,
    /// The line, from 1.
    pub line: usize,
    /// Its bytes in the text.
    #[serde(flatten)]
    pub span: Span,
}

/// A word, or true or false, of the text, with the words that it may be.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Choice<'t> {
    name: &'t str,
    value: serde_json::Value,
    unit: &'static str,
    choices: &'static [&'static str],
    line: usize,
    #[serde(flatten)]
    span: Span,
}

/// The words of the text that a page offers, by the ends of their names.
const CHOICES: [(&str, &[&str]); 5] = [
    (".side", &["left", "right"]),
    (".direction", &["in", "out"]),
    ("motion.on_contact", &["stop", "continue"]),
    ("motion.at_end", &["hold", "loop"]),
    (".then", &["mark", "pause"]),
];

/// The bytes of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Span {
    /// The first byte.
    pub start: usize,
    /// The byte after the last one.
    pub end: usize,
}

impl From<Range<usize>> for Span {
    fn from(Range { start, end }: Range<usize>) -> Self {
        Self { start, end }
    }
}

/// A cue in the text.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CueLine {
    /// Its name.
    pub name: String,
    /// Its time, in simulated seconds; `None` before an event, whose time is not known yet.
    pub at: Option<f64>,
    /// The line, from 1.
    pub line: usize,
}

/// A table of the text that a page lists.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Listed {
    /// The name of the table, such as `path.pieces[2]`.
    pub name: String,
    /// The name that people gave, if it has one.
    pub title: Option<String>,
    /// The kind: of a piece as in the text, of an obstacle its shape.
    pub kind: String,
    /// The line, from 1.
    pub line: usize,
}

/// A scene with its text.
#[derive(Debug, Clone)]
pub struct DesignedScene {
    /// The text.
    pub text: String,
    /// The scene.
    pub scene: Scene,
    /// The numbers of the text, in its order.
    pub fields: Vec<Field>,
    pub(crate) values: Values,
    pub(crate) lines: Lines,
}

impl DesignedScene {
    /// Reads a text. `file` is the name in sentences.
    ///
    /// # Errors
    /// [`Fault`] for a text that is no scene, or too large for a page.
    pub fn read(text: &str, file: &str) -> Result<Self, Fault> {
        if text.len() > MOST_BYTES {
            let sentence = format!("{file} has {} bytes, expected at most {MOST_BYTES} of a scene", text.len());
            return Err(sentence.into());
        }
        let (scene, numbers) = Scene::parse_with_numbers(text, file, "scene").map_err(|error| {
            let field = error.at().and_then(|at| Some(Values::of(text).holding(at)?.name.clone()));
            Fault { line: error.at().map(|at| Lines::of(text).line(at)), field, sentence: error.to_string() }
        })?;
        let benches = scene.ensemble.benches();
        let (values, lines) = (Values::of(text), Lines::of(text));
        if benches > MOST_BENCHES {
            let sentence = format!("the scene has {benches} benches, expected at most {MOST_BENCHES} on this page");
            let field = ["team.benches", "dragons"].into_iter().find_map(|name| values.get(name));
            let line = field.map(|field| lines.line(field.span.start));
            return Err(Fault { line, field: field.map(|field| field.name.clone()), sentence });
        }
        let fields = fields(&numbers, &values, &lines);
        Ok(Self { text: text.to_owned(), scene, fields, values, lines })
    }

    /// Returns the beginning of the names of a dragon's values: `dragons[1].`, or nothing with `[team]`.
    pub fn prefix(&self, dragon: usize) -> String {
        if self.scene.ensemble.only().is_some() { String::new() } else { format!("dragons[{dragon}].") }
    }

    /// Returns the line of a value, from 1.
    pub(crate) fn line_of(&self, name: &str) -> Option<usize> {
        self.values.get(name).map(|found| self.lines.line(found.span.start))
    }

    /// Returns the fields of the numbers, and of the words and switches of the text, in its order.
    pub(crate) fn listed_fields(&self) -> Vec<serde_json::Value> {
        let numbers = self.fields.iter().map(|field| (field.span.start, json!(field)));
        let choice = |found: &Found| {
            let (value, choices): (serde_json::Value, &[&str]) = match &found.value {
                Value::Switch(value) => ((*value).into(), &[]),
                Value::Words(words) => {
                    let (_, choices) = CHOICES.into_iter().find(|(end, _)| found.name.ends_with(end))?;
                    (words.as_str().into(), choices)
                }
                Value::Number(_) | Value::Array(_) | Value::Other => return None,
            };
            let (line, span) = (self.lines.line(found.span.start), found.span.clone().into());
            Some((found.span.start, json!(Choice { name: &found.name, value, unit: "", choices, line, span })))
        };
        let mut listed: Vec<_> = numbers.chain(self.values.all().iter().filter_map(choice)).collect();
        listed.sort_by_key(|(start, _)| *start);
        listed.into_iter().map(|(_, field)| field).collect()
    }

    /// Returns the pieces of all routes.
    pub fn pieces(&self) -> Vec<Listed> {
        let of_dragon = |dragon: usize| {
            let route = format!("{}path.pieces", self.prefix(dragon));
            (0..self.values.count(&route)).filter_map(move |k| self.listed(format!("{route}[{k}]"), None))
        };
        (0..self.scene.ensemble.dragons().len()).flat_map(of_dragon).collect()
    }

    /// Returns the obstacles, the boundary last.
    pub fn obstacles(&self) -> Vec<Listed> {
        let listed = |(k, obstacle): (usize, &bench_dragon_motion::ground::Obstacle)| {
            let (kind, name) = match obstacle.shape.kind() {
                ShapeKind::Circle => ("circle", format!("stage.obstacles[{k}]")),
                ShapeKind::Polygon => ("polygon", format!("stage.obstacles[{k}]")),
                ShapeKind::Line => ("line", format!("stage.obstacles[{k}]")),
                ShapeKind::Boundary => ("boundary", "stage.boundary".to_owned()),
            };
            Some(Listed { title: Some(obstacle.name.clone()), ..self.listed(name, Some(kind))? })
        };
        self.scene.ensemble.ground().obstacles().iter().enumerate().filter_map(listed).collect()
    }

    fn listed(&self, name: String, kind: Option<&str>) -> Option<Listed> {
        let line = self.line_of(&name)?;
        let kind = kind.or_else(|| self.values.words(&format!("{name}.kind")))?.to_owned();
        Some(Listed { name, title: None, kind, line })
    }

    /// Returns the cues of the text.
    pub fn cues(&self) -> Vec<CueLine> {
        let ensemble = &self.scene.ensemble;
        let cue = |(k, cue): (usize, &bench_dragon_show::scene::cue::Cue)| CueLine {
            name: cue.name.clone(),
            at: match cue.moment {
                CueMoment::At(time) => Some(time),
                CueMoment::Travelled(metres) => ensemble.only().map(|motion| motion.time_at(metres)),
                CueMoment::Before { .. } => None,
            },
            line: self.line_of(&format!("cues[{k}]")).unwrap_or(1),
        };
        self.scene.cues.iter().enumerate().map(cue).collect()
    }

    /// Returns the simulated time at which the last head reaches the end of its path.
    pub fn path_end(&self) -> f64 {
        let end = |Dragon { delay, motion, .. }: &Dragon| delay + motion.time_at(motion.bare_path().length());
        self.scene.ensemble.dragons().iter().map(end).fold(0.0, f64::max)
    }
}

/// Returns the fields of the numbers that were checked, in the order of the text.
fn fields(numbers: &[CheckedNumber], values: &Values, lines: &Lines) -> Vec<Field> {
    let mut fields = Vec::with_capacity(numbers.len());
    for CheckedNumber { span, accepted, is_whole } in numbers {
        let Some(found) = values.starting_at(span.start) else { continue };
        let names = match values.count(&found.name) {
            0 => vec![found.name.clone()],
            count => (0..count).map(|k| format!("{}[{k}]", found.name)).collect(),
        };
        for found in names.iter().filter_map(|name| values.get(name)) {
            let Some(value) = values.number(&found.name) else { continue };
            fields.push(Field {
                name: found.name.clone(),
                value,
                unit: accepted.unit,
                min: accepted.least,
                max: accepted.greatest,
                slider: slider(value, accepted.least, accepted.greatest, *is_whole),
                integer: *is_whole,
                line: lines.line(found.span.start),
                span: found.span.clone().into(),
            });
        }
    }
    fields.sort_by_key(|field| field.span.start);
    fields.dedup_by_key(|field| field.span.start);
    fields
}

/// Returns the range of a slider about a number.
fn slider(value: f64, least: f64, greatest: f64, is_whole: bool) -> [f64; 2] {
    let ends = if value == 0.0 { [-1.0, 1.0] } else { SLIDER.map(|factor| factor * value) };
    let [low, high] = if ends[0] <= ends[1] { ends } else { [ends[1], ends[0]] };
    let [low, high] = if is_whole { [low.floor(), high.ceil()] } else { [low, high] };
    [low.max(least), high.min(greatest)]
}

/// Returns a number as TOML, in the style of the number that it replaces: without a point if that one had none and both
/// are whole. It reads back to the same bits.
///
/// # Errors
/// A sentence for a number that the field cannot have.
pub(crate) fn written(name: &str, value: f64, is_whole: bool, old: &str) -> Result<String, Fault> {
    let refused = |expected: &str| Fault {
        sentence: format!("{name} is {}, expected {expected}", number(value)),
        line: None,
        field: Some(name.to_owned()),
    };
    if !value.is_finite() {
        return Err(refused("a number"));
    }
    let has_no_point = !old.is_empty() && old.bytes().all(|byte| byte.is_ascii_digit() || b"+-_".contains(&byte));
    let is_integer = value.fract() == 0.0 && value.abs() < 9e15 && !(value == 0.0 && value.is_sign_negative());
    match (is_whole, is_integer) {
        (true, false) => Err(refused("a whole number")),
        (false, true) if !has_no_point => Ok(format!("{value:?}")),
        (_, true) => Ok(format!("{value:.0}")),
        (false, false) => Ok(format!("{value:?}")),
    }
}
