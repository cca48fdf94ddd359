//! The text of a scene while it is read: checks of its fields, whose errors name the file and the line.
//!
//! In: TOML text and fields from serde. Out: checked numbers, or one sentence about the wrong field.

use std::cell::RefCell;
use std::ops::Range;
use std::rc::Rc;

use toml::Spanned;

use super::{Accepted, SceneError};
use bench_dragon_motion::model::Vector;

/// A number of the text, or a pair of numbers that is a place, and the range in which it is accepted.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedNumber {
    /// Its bytes in the text.
    pub span: Range<usize>,
    /// The range in which it is accepted.
    pub accepted: Accepted,
    /// True for a number that has to be whole.
    pub is_whole: bool,
}

/// The text being read, for line numbers.
#[derive(Clone)]
pub(super) struct Source<'a> {
    pub(super) text: &'a str,
    pub(super) file: &'a str,
    /// The dragon whose tables are checked, if it has a name.
    dragon: Option<&'a str>,
    /// The sentences of [`Scene::doubts`](super::Scene::doubts).
    pub(super) doubts: Rc<RefCell<Vec<String>>>,
    /// The numbers that were checked.
    pub(super) numbers: Rc<RefCell<Vec<CheckedNumber>>>,
}

impl<'a> Source<'a> {
    pub fn new(text: &'a str, file: &'a str) -> Self {
        Self { text, file, dragon: None, doubts: Rc::default(), numbers: Rc::default() }
    }

    /// Returns the text of a dragon's tables, whose errors name the dragon.
    pub fn of_dragon(&self, name: &'a str) -> Self {
        Self { dragon: Some(name), ..self.clone() }
    }

    /// Notes that a number is accepted, and hardly meant.
    pub fn doubt<T>(&self, value: &Spanned<T>, sentence: &str) {
        let SceneError { sentence, .. } = self.field_error(value, sentence);
        self.doubts.borrow_mut().push(sentence);
    }

    /// Returns the number of the line with a byte, from 1.
    pub fn line(&self, offset: usize) -> usize {
        self.text.as_bytes().iter().take(offset).filter(|byte| **byte == b'\n').count() + 1
    }

    pub fn field_error<T>(&self, value: &Spanned<T>, sentence: &str) -> SceneError {
        self.field_error_at(value.span().start, sentence)
    }

    pub fn field_error_at(&self, offset: usize, sentence: &str) -> SceneError {
        let whose = self.dragon.map_or(String::new(), |dragon| format!("dragon \"{dragon}\": "));
        let sentence = format!("{}, line {}: {whose}{sentence}", self.file, self.line(offset));
        SceneError { sentence, at: Some(offset) }
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

    /// Notes a number whose range is known.
    fn note<T>(&self, value: &Spanned<T>, accepted: Accepted, is_whole: bool) {
        self.numbers.borrow_mut().push(CheckedNumber { span: value.span(), accepted, is_whole });
    }

    pub fn check(&self, field: &str, value: &Spanned<f64>, accepted: Accepted) -> Result<f64, SceneError> {
        self.note(value, accepted, false);
        accepted.check(field, *value.get_ref()).map_err(|error| self.field_error(value, &error.to_string()))
    }

    /// Returns a place of the stage; by default the origin.
    pub fn place(&self, field: &str, value: Option<&Spanned<[f64; 2]>>) -> Result<Vector, SceneError> {
        let Some(given) = value else { return Ok(Vector::zeros()) };
        self.note(given, Accepted::PLACE, false);
        for number in given.get_ref() {
            let checked = Accepted::PLACE.check(field, *number);
            checked.map_err(|error| self.field_error(given, &error.to_string()))?;
        }
        Ok(Vector::from(*given.get_ref()))
    }

    pub fn check_count(&self, field: &str, value: &Spanned<i64>, accepted: Accepted) -> Result<usize, SceneError> {
        self.note(value, accepted, true);
        let checked = accepted.check(field, *value.get_ref() as f64);
        Ok(checked.map_err(|error| self.field_error(value, &error.to_string()))? as usize)
    }
}
