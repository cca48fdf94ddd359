//! Numbers of a TOML text by their names, such as `path.pieces[2].radius`, and the text with other numbers in their bytes.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A number of a text.
#[derive(Debug, Clone, PartialEq)]
pub struct Number {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its bytes.
    pub span: Range<usize>,
}

/// Returns the numbers of a text in the order of their bytes; none of a text that is not TOML.
pub fn numbers(text: &str) -> Vec<Number> {
    let mut found = Vec::new();
    if let Ok(table) = DeTable::parse(text) {
        of_table("", table.get_ref(), &mut found);
    }
    found.sort_by_key(|number| number.span.start);
    found
}

fn of_table(prefix: &str, table: &DeTable<'_>, found: &mut Vec<Number>) {
    for (key, value) in table {
        let key = key.get_ref();
        of_value(if prefix.is_empty() { key.to_string() } else { format!("{prefix}.{key}") }, value, found);
    }
}

fn of_value(name: String, spanned: &Spanned<DeValue<'_>>, found: &mut Vec<Number>) {
    let value = match spanned.get_ref() {
        DeValue::Integer(given) => i64::from_str_radix(given.as_str(), given.radix()).ok().map(|number| number as f64),
        DeValue::Float(given) => given.as_str().parse().ok(),
        DeValue::Array(elements) => {
            elements.iter().enumerate().for_each(|(k, element)| of_value(format!("{name}[{k}]"), element, found));
            None
        }
        DeValue::Table(table) => {
            of_table(&name, table, found);
            None
        }
        DeValue::String(_) | DeValue::Boolean(_) | DeValue::Datetime(_) => None,
    };
    if let Some(value) = value {
        found.push(Number { name, value, span: spanned.span() });
    }
}

/// Returns the text with other values of some of its numbers; all other bytes are the same.
pub fn replaced(text: &str, values: &[(Range<usize>, f64)]) -> String {
    let mut values: Vec<&(Range<usize>, f64)> = values.iter().collect();
    values.sort_by_key(|(span, _)| span.start);
    let mut changed = text.to_owned();
    for (span, value) in values.into_iter().rev() {
        // A whole number keeps its point, since TOML distinguishes 3 and 3.0.
        changed.replace_range(span.clone(), &format!("{value:?}"));
    }
    changed
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "a = 1 # one\n[b]\n\"c\" = [ 2.50,\t-3 ]\n[[d]]\ne = {f=4e0}\n[[d]]\ng.h = 0x10\n";

    #[test]
    fn numbers_have_the_names_of_their_places() {
        let found: Vec<(String, f64)> = numbers(TEXT).into_iter().map(|number| (number.name, number.value)).collect();
        let expected = [("a", 1.0), ("b.c[0]", 2.5), ("b.c[1]", -3.0), ("d[0].e.f", 4.0), ("d[1].g.h", 16.0)];
        assert_eq!(found, expected.map(|(name, value)| (name.to_owned(), value)));
    }

    #[test]
    fn only_the_bytes_of_a_number_change() {
        let spans: Vec<Range<usize>> = numbers(TEXT).into_iter().map(|number| number.span).collect();
        let changed = replaced(TEXT, &[(spans[3].clone(), 7.0), (spans[1].clone(), 0.0625)]);
        assert_eq!(changed, TEXT.replace("2.50", "0.0625").replace("4e0", "7.0"));
    }
}
