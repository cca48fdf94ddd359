//! The text of a scene while it is read: checks of its fields, whose errors name the file and the line.
//!
//! In: TOML text and fields from serde. Out: checked numbers, or one sentence about the wrong field.

use std::cell::RefCell;
use std::rc::Rc;

use serde::Deserialize;
use toml::Spanned;

use super::{Accepted, Scene, SceneError, mend};
use bench_dragon_motion::model::Vector;

/// The text being read, for line numbers.
#[derive(Clone)]
pub(super) struct Source<'a> {
    text: &'a str,
    file: &'a str,
    /// The dragon whose tables are checked, if it has a name.
    dragon: Option<&'a str>,
    /// The sentences of [`Scene::doubts`].
    doubts: Rc<RefCell<Vec<String>>>,
}

impl<'a> Source<'a> {
    pub fn new(text: &'a str, file: &'a str) -> Self {
        Self { text, file, dragon: None, doubts: Rc::default() }
    }

    /// Returns the text of a dragon's tables, whose errors name the dragon.
    pub fn of_dragon(&self, name: &'a str) -> Self {
        Self { dragon: Some(name), ..self.clone() }
    }

    /// Reads and checks a scene. An error that follows doubts may come from the first of them.
    pub fn scene<T: for<'de> Deserialize<'de>>(
        &self,
        validated: impl FnOnce(T) -> Result<Scene, SceneError>,
    ) -> Result<Scene, SceneError> {
        let result = validated(self.read()?);
        let doubts = self.doubts.take();
        match (result, doubts.first()) {
            (Ok(scene), _) => Ok(Scene { doubts, ..scene }),
            (Err(SceneError(sentence)), Some(doubt)) => Err(SceneError(format!("{sentence} ({doubt})"))),
            (Err(error), None) => Err(error),
        }
    }

    /// Notes that a number is accepted, and hardly meant.
    pub fn doubt<T>(&self, value: &Spanned<T>, sentence: &str) {
        let SceneError(sentence) = self.field_error(value, sentence);
        self.doubts.borrow_mut().push(sentence);
    }

    fn read<T: for<'de> Deserialize<'de>>(&self) -> Result<T, SceneError> {
        let deserializer = toml::Deserializer::parse(self.text).map_err(|error| self.toml_error(&error, ""))?;
        serde_path_to_error::deserialize(deserializer)
            .map_err(|error| self.toml_error(error.inner(), &error.path().to_string()))
    }

    fn line(&self, offset: usize) -> usize {
        self.text.as_bytes().iter().take(offset).filter(|byte| **byte == b'\n').count() + 1
    }

    /// Converts an error of the TOML reader into one sentence.
    fn toml_error(&self, error: &toml::de::Error, field: &str) -> SceneError {
        let place = error.span().map_or(String::new(), |span| format!(", line {}", self.line(span.start)));
        // `Spanned` values are wrapped in a field that no user wrote.
        let field = field.replace(".$__serde_spanned_private_value", "");
        let line = error.span().map(|span| self.line(span.start));
        let line = line.and_then(|line| self.text.lines().nth(line - 1)).unwrap_or_default();
        if let Some(sentence) = mend::sentence(error.message(), &field, line) {
            return SceneError(format!("{}{place}: {sentence}", self.file));
        }
        let field = if field.is_empty() || field == "." { String::new() } else { format!("{field}: ") };
        let message = error.message().trim().replace('\n', ", ");
        let message =
            message.replace("expected i64", "expected an integer").replace("expected f64", "expected a number");
        SceneError(format!("{}{place}: {field}{message}", self.file))
    }

    pub fn field_error<T>(&self, value: &Spanned<T>, sentence: &str) -> SceneError {
        self.field_error_at(value.span().start, sentence)
    }

    pub fn field_error_at(&self, offset: usize, sentence: &str) -> SceneError {
        let whose = self.dragon.map_or(String::new(), |dragon| format!("dragon \"{dragon}\": "));
        SceneError(format!("{}, line {}: {whose}{sentence}", self.file, self.line(offset)))
    }

    /// Returns a name without control characters, since it is printed unchanged.
    pub fn printable(&self, field: &str, value: &Spanned<String>) -> Result<String, SceneError> {
        let name = value.get_ref();
        if name.chars().any(char::is_control) {
            let sentence = format!("{field} has a control character in it, expected text of one line");
            return Err(self.field_error(value, &sentence));
        }
        Ok(name.clone())
    }

    pub fn check(&self, field: &str, value: &Spanned<f64>, accepted: Accepted) -> Result<f64, SceneError> {
        accepted.check(field, *value.get_ref()).map_err(|sentence| self.field_error(value, &sentence))
    }

    /// Returns a place of the stage; by default the origin.
    pub fn place(&self, field: &str, value: Option<&Spanned<[f64; 2]>>) -> Result<Vector, SceneError> {
        let Some(given) = value else { return Ok(Vector::zeros()) };
        for number in given.get_ref() {
            let checked = Accepted::PLACE.check(field, *number);
            checked.map_err(|sentence| self.field_error(given, &sentence))?;
        }
        Ok(Vector::from(*given.get_ref()))
    }

    pub fn check_count(&self, field: &str, value: &Spanned<i64>, accepted: Accepted) -> Result<usize, SceneError> {
        let number =
            accepted.check(field, *value.get_ref() as f64).map_err(|sentence| self.field_error(value, &sentence))?;
        Ok(number as usize)
    }
}
