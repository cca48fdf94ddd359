//! The common parts of all generated files: their first line, their comments, the names of enums.

use crate::msgs::source::{Constant, Source, links};

/// The longest line of a generated file.
const WIDTH: usize = 120;

/// The first lines of a generated file.
pub const NOTICE: &str = "\
# Generated from crates/messages/src (layouts and state), not written by hand:
# BENCH_DRAGON_WRITE=1 cargo test --test repository msgs::
";

/// The names of an enum in other languages.
pub struct EnumNames {
    pub rust: &'static str,
    /// Prefix of its constants in ROS 2.
    pub ros: &'static str,
    /// The name that converts a number to a name in Python.
    pub python: &'static str,
}

pub const ENUMS: [EnumNames; 4] = [
    EnumNames { rust: "FrameState", ros: "STATE_", python: "STATES" },
    EnumNames { rust: "Level", ros: "LEVEL_", python: "LEVELS" },
    EnumNames { rust: "EventKind", ros: "EVENT_", python: "EVENTS" },
    EnumNames { rust: "PlaybackState", ros: "PLAYBACK_", python: "PLAYBACK" },
];

/// The target of a link in a doc comment.
pub enum Target<'a> {
    Enum(&'static EnumNames),
    /// A layout's field: the layout, the field.
    Field(&'a str, &'a str),
    Layout(&'a str),
    Constant(&'a Constant),
    /// The constants whose names have this prefix.
    Group(&'a str),
}

impl<'a> Target<'a> {
    pub fn of(source: &'a Source, link: &'a str) -> Self {
        if let Some((layout, field)) = link.split_once("::") {
            let fields = source.layout(layout).map_or(&[][..], |layout| &layout.fields);
            assert!(fields.iter().any(|known| known.name == field), "[`{link}`] is no field");
            return Self::Field(layout, field);
        }
        if let Some(prefix) = link.strip_suffix('*') {
            return Self::Group(prefix);
        }
        if let Some(names) = ENUMS.iter().find(|names| names.rust == link) {
            return Self::Enum(names);
        }
        if source.layout(link).is_some() {
            return Self::Layout(link);
        }
        Self::Constant(source.constant(link).unwrap_or_else(|| panic!("[`{link}`] has no counterpart on the wire")))
    }
}

/// Returns the link targets of the fields of some layouts, each once, in order.
pub fn targets<'a>(source: &'a Source, layouts: &[&'a str]) -> Vec<Target<'a>> {
    let layouts = layouts.iter().map(|name| source.layout(name).unwrap());
    let mut found: Vec<&str> = Vec::new();
    for text in layouts.flat_map(|layout| &layout.fields).flat_map(|field| &field.docs) {
        for link in links(text) {
            if !found.contains(&link) {
                found.push(link);
            }
        }
    }
    found.into_iter().map(|link| Target::of(source, link)).collect()
}

/// Returns a text in lines that begin with `prefix`.
pub fn wrapped(text: &str, prefix: &str) -> String {
    let (mut lines, mut line) = (String::new(), prefix.to_owned());
    for word in text.split_whitespace() {
        if line.len() > prefix.len() && line.len() + 1 + word.len() > WIDTH {
            lines += &format!("{}\n", line.trim_end());
            line = prefix.to_owned();
        }
        if line.len() > prefix.len() {
            line.push(' ');
        }
        line += word;
    }
    lines + &format!("{}\n", line.trim_end())
}

/// Returns paragraphs as a comment.
pub fn comment(paragraphs: &[String], indent: &str) -> String {
    let paragraphs: Vec<_> = paragraphs.iter().map(|text| wrapped(text, &format!("{indent}# "))).collect();
    paragraphs.join(&format!("{indent}#\n"))
}
