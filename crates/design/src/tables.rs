//! The tables and arrays of a TOML document, by the names of their values.
//!
//! In: a document and a name such as `path.pieces[3]`. Out: the document with a value or a table more, or less.

use toml_edit::{Array, ArrayOfTables, DocumentMut, InlineTable, Item, Table, TableLike, Value};

use crate::scene::Fault;

/// A step on the way to a value.
#[derive(Debug, Clone, PartialEq)]
enum Step {
    Key(String),
    Index(usize),
}

/// The way from the root of a document to a value.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    name: String,
    steps: Vec<Step>,
}

/// A value that has others in it.
enum Holder<'d> {
    Table(&'d mut dyn TableLike),
    Array(&'d mut Array),
    Tables(&'d mut ArrayOfTables),
}

impl Path {
    /// Reads a name.
    ///
    /// # Errors
    /// [`Fault`] for what is no name.
    pub fn of(name: &str) -> Result<Self, Fault> {
        let refused = || Fault::from(format!("{name:?} is no name of a value, expected one such as path.pieces[3]"));
        let mut steps = Vec::new();
        for part in name.split('.') {
            let (key, indices) = part.split_once('[').map_or((part, None), |(key, rest)| (key, Some(rest)));
            if key.is_empty() {
                return Err(refused());
            }
            steps.push(Step::Key(key.to_owned()));
            let Some(indices) = indices else { continue };
            for index in indices.split('[') {
                let index = index.strip_suffix(']').and_then(|index| index.parse().ok());
                steps.push(Step::Index(index.ok_or_else(refused)?));
            }
        }
        Ok(Self { name: name.to_owned(), steps })
    }

    fn missing(&self) -> Fault {
        format!("the text has no {}", self.name).into()
    }

    /// Returns the value that holds the last step, and the last step.
    fn holder<'d>(&self, document: &'d mut DocumentMut) -> Result<(Holder<'d>, &Step), Fault> {
        let (last, way) = self.steps.split_last().ok_or_else(|| self.missing())?;
        let mut holder = Holder::Table(document.as_table_mut());
        for step in way {
            holder = holder.entered(step).ok_or_else(|| self.missing())?;
        }
        Ok((holder, last))
    }

    /// Adds a value of this name, in a table that is made if it is missing.
    ///
    /// # Errors
    /// [`Fault`] for a name without a table.
    pub fn insert(&self, document: &mut DocumentMut, value: Value) -> Result<(), Fault> {
        if let [way @ .., Step::Key(table), Step::Key(_)] = self.steps.as_slice() {
            let name = self.name.rsplit_once('.').map_or("", |(table, _)| table).to_owned();
            let above = Self { name, steps: [way, &[Step::Key(table.clone())]].concat() };
            if let (Holder::Table(holder), _) = above.holder(document)?
                && !holder.contains_key(table)
            {
                holder.insert(table, Item::Table(Table::new()));
            }
        }
        match self.holder(document)? {
            (Holder::Table(table), Step::Key(key)) => {
                table.insert(key, Item::Value(value));
                Ok(())
            }
            _ => Err(self.missing()),
        }
    }

    /// Removes the table, the value or the element of this name.
    ///
    /// # Errors
    /// [`Fault`] where the document has none.
    pub fn remove(&self, document: &mut DocumentMut) -> Result<(), Fault> {
        let removed = match self.holder(document)? {
            (Holder::Table(table), Step::Key(key)) => table.remove(key).is_some(),
            (Holder::Array(array), Step::Index(index)) if *index < array.len() => {
                remove_element(array, *index);
                true
            }
            (Holder::Tables(tables), Step::Index(index)) if *index < tables.len() => {
                tables.remove(*index);
                true
            }
            _ => false,
        };
        if removed { Ok(()) } else { Err(self.missing()) }
    }

    /// Adds a table at the end of the list of this name, in the style of the list; a list that is missing is made of
    /// tables with headers.
    ///
    /// # Errors
    /// [`Fault`] where the name is that of something else.
    pub fn push(&self, document: &mut DocumentMut, table: Table) -> Result<(), Fault> {
        if let [Step::Key(above), Step::Key(_)] = self.steps.as_slice() {
            let root = document.as_table_mut();
            if !root.contains_key(above) {
                let mut implicit = Table::new();
                implicit.set_implicit(true);
                root.insert(above, Item::Table(implicit));
            }
        }
        let (Holder::Table(holder), Step::Key(key)) = self.holder(document)? else { return Err(self.missing()) };
        if !holder.contains_key(key) {
            holder.insert(key, Item::ArrayOfTables(ArrayOfTables::new()));
        }
        match holder.get_mut(key) {
            Some(Item::ArrayOfTables(tables)) => tables.push(table),
            Some(Item::Value(Value::Array(array))) => {
                insert_element(array, array.len(), table.into_inline_table().into())
            }
            _ => return Err(self.missing()),
        }
        Ok(())
    }

    /// Adds a value after the element of this name in its array.
    ///
    /// # Errors
    /// [`Fault`] where the document has no such element.
    pub fn insert_after(&self, document: &mut DocumentMut, value: Value) -> Result<(), Fault> {
        match self.holder(document)? {
            (Holder::Array(array), Step::Index(index)) if *index < array.len() => {
                insert_element(array, index + 1, value);
                Ok(())
            }
            _ => Err(self.missing()),
        }
    }

    /// Returns a copy of the last table of the list of this name.
    pub fn last_table(&self, document: &mut DocumentMut) -> Option<Table> {
        let (Holder::Table(holder), Step::Key(key)) = self.holder(document).ok()? else { return None };
        let Item::ArrayOfTables(tables) = holder.get(key)? else { return None };
        let mut table = tables.get(tables.len().checked_sub(1)?)?.clone();
        forget_positions(&mut table);
        Some(table)
    }
}

impl<'d> Holder<'d> {
    fn entered(self, step: &Step) -> Option<Self> {
        match (self, step) {
            (Self::Table(table), Step::Key(key)) => match table.get_mut(key)? {
                Item::Table(table) => Some(Self::Table(table)),
                Item::ArrayOfTables(tables) => Some(Self::Tables(tables)),
                Item::Value(value) => Self::of_value(value),
                Item::None => None,
            },
            (Self::Array(array), Step::Index(index)) => Self::of_value(array.get_mut(*index)?),
            (Self::Tables(tables), Step::Index(index)) => Some(Self::Table(tables.get_mut(*index)?)),
            _ => None,
        }
    }

    fn of_value(value: &'d mut Value) -> Option<Self> {
        match value {
            Value::Array(array) => Some(Self::Array(array)),
            Value::InlineTable(table) => Some(Self::Table(table)),
            _ => None,
        }
    }
}

/// Makes a copied table stand where it is added, not where the original stands.
fn forget_positions(table: &mut Table) {
    table.set_position(None);
    for (_, item) in table.iter_mut() {
        match item {
            Item::Table(table) => forget_positions(table),
            Item::ArrayOfTables(tables) => tables.iter_mut().for_each(forget_positions),
            Item::None | Item::Value(_) => {}
        }
    }
}

/// Returns the text before an element, of which the first line is a comment on the element before; or the text after
/// the last element.
fn before(array: &Array, index: usize) -> String {
    let raw = match array.get(index) {
        Some(element) => element.decor().prefix(),
        None => Some(array.trailing()),
    };
    raw.and_then(|raw| raw.as_str()).unwrap_or_default().to_owned()
}

fn set_before(array: &mut Array, index: usize, text: String) {
    match array.get_mut(index) {
        Some(element) => element.decor_mut().set_prefix(text),
        None => array.set_trailing(text),
    }
}

/// Splits the text before an element behind the first line.
fn split(text: &str) -> (&str, &str) {
    text.find('\n').map_or(("", text), |end| text.split_at(end))
}

/// Removes an element with the comment behind it.
fn remove_element(array: &mut Array, index: usize) {
    let (own, next) = (before(array, index), before(array, index + 1));
    // A comment after the comma belongs to the element before the comma.
    let kept = if index == 0 && !own.contains('\n') { own } else { format!("{}{}", split(&own).0, split(&next).1) };
    array.remove(index);
    set_before(array, index, kept);
}

/// Inserts an element, in a line of its own if the others have such.
fn insert_element(array: &mut Array, index: usize, mut value: Value) {
    let next = before(array, index);
    let (comment, rest) = split(&next);
    let sample = before(array, index.saturating_sub(1));
    let own = match sample.rfind('\n') {
        Some(line) => format!("{comment}{}", &sample[line..]),
        None if index == 0 => String::new(),
        None => " ".to_owned(),
    };
    let rest = if comment.is_empty() && rest.is_empty() { next.clone() } else { rest.to_owned() };
    *value.decor_mut() = toml_edit::Decor::new(own, "");
    let is_last = index == array.len();
    if let Some(last) = index.checked_sub(1).and_then(|last| array.get_mut(last)) {
        // The space before the closing bracket is behind the last element where no comma follows.
        if is_last {
            let suffix = last.decor().suffix().and_then(|suffix| suffix.as_str()).unwrap_or_default().to_owned();
            last.decor_mut().set_suffix("");
            value.decor_mut().set_suffix(suffix);
        }
    }
    array.insert_formatted(index, value);
    set_before(array, index + 1, rest);
}

/// Creates an inline table or a table from keys and values.
pub fn table(values: impl IntoIterator<Item = (&'static str, Value)>) -> Table {
    let mut inline = InlineTable::new();
    for (key, value) in values {
        inline.insert(key, value);
    }
    inline.into_table()
}
