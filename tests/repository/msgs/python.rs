//! `packaging/python/bench_dragon/layouts.py`: the layouts as classes of ctypes, with type hints.

use crate::msgs::render::{ENUMS, NOTICE, Target, comment, targets, wrapped};
use crate::msgs::source::{Docs, Enumeration, Field, Kind, Layout, Source, links, without_links};

const HEAD: &str = r#""""The memory layouts of bench-dragon's messages, once, for every Python subscriber.

Each class is what iceoryx2 compares with the publisher's type. Its name ends in the layout's version, so that a
publisher with another layout is refused.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any, ClassVar

"#;

const BASE: &str = r#"

class Message(ctypes.Structure):
    """A message in memory, or a part of one."""

    # The version of the layout.
    LAYOUT: ClassVar[int]
    # The names of the values of a field, for people.
    NAMES: ClassVar[dict[str, dict[int, Any]]] = {}

    @classmethod
    def type_name(cls) -> str:
        """Returns the name that iceoryx2 compares with the publisher's."""
        return f"bench_dragon/{cls.__name__}/{cls.LAYOUT}"

    def __repr__(self) -> str:
        """Returns fields and values, states and levels by name."""
        fields = [field[0] for field in self._fields_ if field[0] != "reserved"]
        return f"{type(self).__name__}({', '.join(f'{field}={self._shown(field)}' for field in fields)})"

    def _shown(self, field: str) -> str:
        value = getattr(self, field)
        if field in self.NAMES:
            return str(self.NAMES[field].get(value, value))
        if isinstance(value, ctypes.Array):
            # A name, which zeros follow, or a hash.
            text = bytes(value).rstrip(b"\0").decode(errors="replace")
            return repr(text) if text.isprintable() and "\ufffd" not in text else bytes(value).hex()
        return "NO_BENCH" if "bench" in field and value == NO_BENCH else repr(value)


def _list(element: type[Message], most: int) -> type[ctypes.Structure]:
    """Returns the type of a list with room for `most` elements. `len()`, an index and `for` see those in use."""

    class List(ctypes.Structure):
        ELEMENT = element
        length: int
        items: ctypes.Array[Any]
        _fields_ = [("length", ctypes.c_uint32), ("reserved", ctypes.c_uint32), ("items", element * most)]

        def __len__(self) -> int:
            return min(self.length, most)

        def __getitem__(self, index: int) -> Any:
            return self.items[: len(self)][index]

        def __repr__(self) -> str:
            return repr(self.items[: len(self)])

    return List
"#;

/// Returns the module.
pub fn module(source: &Source) -> String {
    let mut text = format!("{NOTICE}{HEAD}");
    let names: Vec<_> = source.layouts.iter().map(|layout| layout.name.as_str()).collect();
    let mut groups = Vec::new();
    for target in targets(source, &names) {
        match target {
            Target::Constant(constant) if constant.is_on_the_wire => {
                let docs = comment(&plain(source, None, &constant.docs), "");
                text += &format!("{docs}{} = 0x{:08X}\n", constant.name, constant.value);
            }
            Target::Group(prefix) => groups.push(prefix),
            _ => {}
        }
    }
    for names in &ENUMS {
        let item = source.enumeration(names.rust).unwrap();
        text += "\n";
        text += &if names.rust == "EventKind" { events(source, item) } else { states(source, names.python, item) };
    }
    for prefix in groups {
        text += &format!("\n# The values of {}.\n", held_by(source, &format!("{prefix}*")));
        text += &format!("{}S = (\n", prefix.trim_end_matches('_'));
        for (number, constant) in source.group(prefix).into_iter().enumerate() {
            assert_eq!(constant.value, number as u64, "{} is not in order", constant.name);
            text += &comment(&plain(source, None, &constant.docs), "    ");
            text += &format!("    \"{}\",\n", constant.name[prefix.len()..].to_lowercase());
        }
        text += ")\n";
    }
    text += BASE;
    for layout in &source.layouts {
        text += &class(source, layout);
    }
    let is_part = |name: &str| source.layouts.iter().flat_map(|layout| &layout.fields).any(|it| it.kind.holds(name));
    let sent: Vec<_> = names.into_iter().filter(|name| !is_part(name)).collect();
    text += "\n\n# The payloads and headers of all messages.\nMESSAGES: tuple[type[Message], ...] = (\n";
    sent.into_iter().for_each(|name| text += &format!("    {name},\n"));
    text + ")\n"
}

/// Returns the fields whose comments have this link.
fn held_by(source: &Source, link: &str) -> String {
    let fields = source.layouts.iter().flat_map(|layout| layout.fields.iter().map(move |field| (layout, field)));
    let fields = fields.filter(|(_, field)| field.docs.iter().any(|text| links(text).any(|found| found == link)));
    fields.map(|(layout, field)| format!("`{}.{}`", layout.name, field.name)).collect::<Vec<_>>().join(", ")
}

impl Kind {
    /// Returns true if this layout is part of the module.
    fn holds(&self, layout: &str) -> bool {
        match self {
            Kind::Layout(name) => name == layout,
            Kind::Array(element, _) | Kind::List(element, _) => element.holds(layout),
            Kind::Number(_) | Kind::Text(_) => false,
        }
    }
}

fn states(source: &Source, name: &str, item: &Enumeration) -> String {
    let mut text = format!("{}{name} = (\n", comment(&plain(source, None, &item.docs), ""));
    let mut next = 0;
    for variant in &item.variants {
        (next..variant.number).for_each(|_| text += "    # No value has this number.\n    None,\n");
        next = variant.number + 1;
        text += &comment(&plain(source, None, &variant.docs), "    ");
        text += &format!("    \"{}\",\n", variant.name);
    }
    text + ")\n"
}

fn events(source: &Source, item: &Enumeration) -> String {
    let mut text = "# The events of alerts, by the number of the state that each event leads to.\n".to_owned();
    text += "EVENTS = {\n    # No event.\n    0: None,\n";
    for kind in &item.variants {
        text += &comment(&plain(source, None, &kind.docs), "    ");
        text += &format!("    {}: \"{}\",\n", kind.number, kind.name);
    }
    text + "}\n"
}

fn class(source: &Source, layout: &Layout) -> String {
    let mut text = format!("\n\nclass {}(Message):\n", layout.name);
    let mut docs = plain(source, Some(layout), &layout.docs);
    docs[0].insert_str(0, "\"\"\"");
    let docs: Vec<_> = docs.iter().map(|text| wrapped(text, "    ")).collect();
    let docs = docs.join("\n");
    // The quotes are on a separate line after a text of more than one line.
    let one_line = docs.trim();
    if docs.lines().count() == 1 && one_line.len() + 7 <= 120 {
        text += &format!("    {one_line}\"\"\"\n");
    } else {
        text += &format!("    {one_line}\n    \"\"\"\n");
    }
    text += &format!("\n    LAYOUT = {}\n", layout.version);
    let named: Vec<_> = layout.fields.iter().filter_map(|field| names_of(source, field)).collect();
    if !named.is_empty() {
        text += &format!("    NAMES = {{{}}}\n", named.join(", "));
    }
    for field in &layout.fields {
        text += &comment(&plain(source, Some(layout), &field.docs), "    ");
        text += &format!("    {}: {}\n", field.name, type_hint(&field.kind));
    }
    text += "    _fields_ = [\n";
    for field in &layout.fields {
        text += &format!("        (\"{}\", {}),\n", field.name, type_name(&field.kind));
    }
    text + "    ]\n"
}

/// Returns the entry of `NAMES` of a field whose comment has a link to its values.
fn names_of(source: &Source, field: &Field) -> Option<String> {
    let mut targets = field.docs.iter().flat_map(|text| links(text)).map(|link| Target::of(source, link));
    let names = targets.find_map(|target| match target {
        Target::Enum(names) if names.rust == "EventKind" => Some(names.python.to_owned()),
        Target::Enum(names) => Some(format!("dict(enumerate({}))", names.python)),
        Target::Group(prefix) => Some(format!("dict(enumerate({}S))", prefix.trim_end_matches('_'))),
        _ => None,
    })?;
    Some(format!("\"{}\": {names}", field.name))
}

/// Returns comments in the words of Python.
fn plain(source: &Source, own: Option<&Layout>, docs: &Docs) -> Docs {
    let words = |link: &str| match Target::of(source, link) {
        Target::Enum(names) => format!("`{}`", names.python),
        Target::Field(layout, field) if own.is_some_and(|own| own.name == layout) => format!("`{field}`"),
        Target::Field(layout, field) => format!("`{layout}.{field}`"),
        Target::Layout(layout) => format!("`{layout}`"),
        Target::Constant(constant) if constant.is_on_the_wire => format!("`{}`", constant.name),
        Target::Constant(constant) => constant.value.to_string(),
        Target::Group(prefix) => format!("`{}S`", prefix.trim_end_matches('_')),
    };
    docs.iter().map(|text| without_links(text, words)).collect()
}

fn type_name(kind: &Kind) -> String {
    match kind {
        Kind::Number(primitive) => format!("ctypes.{}", primitive.ctypes),
        Kind::Text(bytes) => format!("ctypes.c_uint8 * {bytes}"),
        Kind::Layout(name) => name.clone(),
        Kind::Array(element, length) => format!("{} * {length}", type_name(element)),
        Kind::List(element, most) => format!("_list({}, {most})", type_name(element)),
    }
}

/// Returns the type that Python has for the value of a field.
fn type_hint(kind: &Kind) -> String {
    match kind {
        Kind::Number(primitive) if primitive.rust.starts_with('f') => "float".to_owned(),
        Kind::Number(_) => "int".to_owned(),
        Kind::Text(_) => "ctypes.Array[ctypes.c_uint8]".to_owned(),
        Kind::Layout(name) => name.clone(),
        Kind::Array(element, _) => format!("ctypes.Array[{}]", type_name(element)),
        Kind::List(element, _) => format!("Sequence[{}]", type_name(element)),
    }
}
