//! The values of a TOML text, each with its name and its bytes.
//!
//! In: a text. Out: the names of its values, such as `path.pieces[2].radius`, and the lines of bytes.

use std::collections::BTreeMap;
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A value of the text.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A number, whole or not.
    Number(f64),
    /// A text.
    Words(String),
    /// True or false.
    Switch(bool),
    /// An array, with the number of its elements.
    Array(usize),
    /// A table, or a value that is none of these.
    Other,
}

/// A value and its bytes.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The name, such as `dragons[1].path.pitch`.
    pub name: String,
    /// The value.
    pub value: Value,
    /// The bytes of the value in the text.
    pub span: Range<usize>,
}

/// The values of a text, by their names and by their first bytes.
#[derive(Debug, Clone, Default)]
pub struct Values {
    found: Vec<Found>,
    by_name: BTreeMap<String, usize>,
    by_start: BTreeMap<usize, usize>,
}

impl Values {
    /// Finds the values of a text; none in a text that is not TOML.
    pub fn of(text: &str) -> Self {
        let mut values = Self::default();
        if let Ok(table) = DeTable::parse(text) {
            values.add_table("", table.get_ref());
        }
        values
    }

    fn add_table(&mut self, prefix: &str, table: &DeTable<'_>) {
        for (key, value) in table {
            let key = key.get_ref();
            self.add(if prefix.is_empty() { key.to_string() } else { format!("{prefix}.{key}") }, value);
        }
    }

    fn add(&mut self, name: String, spanned: &Spanned<DeValue<'_>>) {
        let value = match spanned.get_ref() {
            DeValue::Integer(given) => i64::from_str_radix(given.as_str(), given.radix())
                .map_or(Value::Other, |number| Value::Number(number as f64)),
            DeValue::Float(given) => given.as_str().parse().map_or(Value::Other, Value::Number),
            DeValue::String(words) => Value::Words(words.to_string()),
            DeValue::Array(elements) => {
                let elements = elements.iter().enumerate();
                let count = elements.map(|(k, element)| self.add(format!("{name}[{k}]"), element)).count();
                Value::Array(count)
            }
            DeValue::Table(table) => {
                self.add_table(&name, table);
                Value::Other
            }
            DeValue::Boolean(value) => Value::Switch(*value),
            DeValue::Datetime(_) => Value::Other,
        };
        let (span, index) = (spanned.span(), self.found.len());
        self.by_name.insert(name.clone(), index);
        // A table may begin where its first key does.
        if matches!(value, Value::Number(_) | Value::Array(_)) {
            self.by_start.insert(span.start, index);
        }
        self.found.push(Found { name, value, span });
    }

    /// Returns all values.
    pub fn all(&self) -> &[Found] {
        &self.found
    }

    /// Returns a value by its name.
    pub fn get(&self, name: &str) -> Option<&Found> {
        self.by_name.get(name).map(|index| &self.found[*index])
    }

    /// Returns the value that begins at a byte.
    pub fn starting_at(&self, byte: usize) -> Option<&Found> {
        self.by_start.get(&byte).map(|index| &self.found[*index])
    }

    /// Returns the innermost value whose bytes hold a byte.
    pub fn holding(&self, byte: usize) -> Option<&Found> {
        let holds = |found: &&Found| found.span.contains(&byte);
        self.found.iter().filter(holds).min_by_key(|found| found.span.len())
    }

    /// Returns a number by its name.
    pub fn number(&self, name: &str) -> Option<f64> {
        match self.get(name)?.value {
            Value::Number(number) => Some(number),
            _ => None,
        }
    }

    /// Returns a text by its name.
    pub fn words(&self, name: &str) -> Option<&str> {
        match &self.get(name)?.value {
            Value::Words(words) => Some(words),
            _ => None,
        }
    }

    /// Returns the number of elements of an array, 0 where there is none.
    pub fn count(&self, name: &str) -> usize {
        match self.get(name) {
            Some(Found { value: Value::Array(count), .. }) => *count,
            _ => 0,
        }
    }
}

/// The first bytes of the lines of a text.
#[derive(Debug, Clone)]
pub struct Lines(Vec<usize>);

impl Lines {
    /// Finds the lines of a text.
    pub fn of(text: &str) -> Self {
        Self(text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(at, _)| at).collect())
    }

    /// Returns the number of the line with a byte, from 1.
    pub fn line(&self, byte: usize) -> usize {
        self.0.partition_point(|end| *end < byte) + 1
    }
}
