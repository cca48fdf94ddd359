//! The parameters of `-p` and `--params-file`, as rcl 9 reads them: sections that name nodes, and values with the types
//! of rcl_yaml_param_parser.
//!
//! In: rules and files, in the order of the command line. Out: the parameters of one node.

use std::fs::File;
use std::io::Read;

use saphyr_parser::{Event, Parser, ScalarStyle, StrInput, Tag};

/// The most bytes of a file of parameters.
const MOST_BYTES: u64 = 1 << 16;
/// The most levels of mappings in it.
const MOST_LEVELS: usize = 32;
/// The key below a node's name.
const PARAMETERS: &str = "ros__parameters";
/// The section of a rule that names no node.
const ALL_NODES: &str = "/**";

/// A value with the type that rcl_yaml_param_parser gives it.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// True or false.
    Bool(bool),
    /// An integer or a decimal number, in decimal digits.
    Number(String),
    /// Any other scalar, and every quoted one.
    Text(String),
    /// A sequence.
    List,
}

impl Value {
    /// Returns the value in words.
    pub fn described(&self) -> String {
        match self {
            Self::Bool(value) => value.to_string(),
            Self::Number(digits) => format!("the number {digits}"),
            Self::Text(text) => format!("the text \"{text}\""),
            Self::List => "a list".to_owned(),
        }
    }

    /// `get_value` of rcl. Octal and hexadecimal integers, which rcl takes too, are texts here.
    fn of(text: &str, style: ScalarStyle, tag: Option<&Tag>) -> Self {
        let is_tagged = tag.is_some_and(|tag| tag.is_yaml_core_schema() && tag.suffix == "str");
        let is_quoted = matches!(style, ScalarStyle::SingleQuoted | ScalarStyle::DoubleQuoted);
        let digits = text.trim_start_matches(['+', '-']);
        let is_octal = digits.starts_with('0') && digits[1..].starts_with(|c: char| c.is_ascii_digit());
        match text {
            _ if is_tagged || is_quoted => Self::Text(text.to_owned()),
            "Y" | "y" | "yes" | "Yes" | "YES" | "true" | "True" | "TRUE" | "on" | "On" | "ON" => Self::Bool(true),
            "N" | "n" | "no" | "No" | "NO" | "false" | "False" | "FALSE" | "off" | "Off" | "OFF" => Self::Bool(false),
            _ if !is_octal && text.parse::<f64>().is_ok() => Self::Number(text.to_owned()),
            _ => Self::Text(text.to_owned()),
        }
    }
}

/// A file of parameters that is not understood.
#[derive(Debug, thiserror::Error)]
pub enum ParametersError {
    /// The file of this name cannot be read.
    #[error("{0}: {1}, expected a file of parameters (YAML)")]
    Unread(String, #[source] std::io::Error),
    /// The text of the file of this name is not understood.
    #[error("{0}, {1}")]
    Document(String, #[source] DocumentError),
}

/// A YAML text that has no parameters of nodes.
#[derive(Debug, thiserror::Error)]
pub enum DocumentError {
    /// The text is no YAML.
    #[error("line {line}: {problem}")]
    Yaml {
        /// The line, from 1.
        line: usize,
        /// The parser's words.
        problem: String,
    },
    /// The YAML has another form. The line is counted from 1.
    #[error("line {0}, expected names of nodes, below each {PARAMETERS}, and below that NAME: VALUE")]
    Form(usize),
    /// A key is no name of a node.
    #[error("line {line}: \"{word}\" in \"{above}\" is no name of a node")]
    NodeName {
        /// The line, from 1.
        line: usize,
        /// The wrong word of the name.
        word: String,
        /// The name.
        above: String,
    },
}

/// A parameter of a node.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// The name: words joined by dots.
    pub name: String,
    /// The value.
    pub value: Value,
    /// The rule, or the line of the file.
    pub place: String,
}

/// The parameters of all nodes. As in rcl, the sections have the order of their first parameters.
#[derive(Debug, Default)]
pub struct Parameters {
    sections: Vec<(String, Vec<Parameter>)>,
}

impl Parameters {
    /// Adds a rule, `NAME:=VALUE` or `NODE:NAME:=VALUE`. Returns `None` if it has another form.
    pub fn add_rule(&mut self, rule: &str) -> Option<()> {
        let (name, value) = rule.split_once(":=")?;
        let (node, name) = name.split_once(':').unwrap_or((ALL_NODES, name));
        let value = Document::new(value).value().ok().filter(|_| !value.is_empty())?;
        let place = format!("-p {rule}");
        self.section(node).push(Parameter { name: name.to_owned(), value, place });
        Some(())
    }

    /// Adds the parameters of a file.
    ///
    /// # Errors
    /// [`ParametersError`]
    pub fn add_file(&mut self, path: &str) -> Result<(), ParametersError> {
        let text = read(path).map_err(|error| ParametersError::Unread(path.to_owned(), error))?;
        let read = Document::new(&text).read(path, self);
        read.map_err(|error| ParametersError::Document(path.to_owned(), error))
    }

    /// Returns the parameters of the sections that match a node's full name. The last of a name counts.
    pub fn of(self, node: &str) -> impl Iterator<Item = Parameter> {
        let words: Vec<&str> = node.trim_start_matches('/').split('/').collect();
        let sections = self.sections.into_iter().filter(move |(section, _)| matches(section, &words));
        sections.flat_map(|(_, parameters)| parameters)
    }

    fn section(&mut self, node: &str) -> &mut Vec<Parameter> {
        let at = self.sections.iter().position(|(name, _)| name == node).unwrap_or_else(|| {
            self.sections.push((node.to_owned(), Vec::new()));
            self.sections.len() - 1
        });
        &mut self.sections[at].1
    }
}

/// Returns true if a section is for the node of these words: its `*` is one word, its `**` any number of words.
fn matches(section: &str, words: &[&str]) -> bool {
    // Entry k: the section so far matches the first k words.
    let mut reached = vec![false; words.len() + 1];
    reached[0] = true;
    for part in section.trim_start_matches('/').split('/') {
        if part == "**" {
            let first = reached.iter().position(|reached| *reached).unwrap_or(reached.len());
            reached[first..].fill(true);
            continue;
        }
        for (at, word) in words.iter().enumerate().rev() {
            reached[at + 1] = reached[at] && (part == "*" || part == *word);
        }
        reached[0] = false;
    }
    reached[words.len()]
}

/// Reads a regular file of [`MOST_BYTES`] at most.
fn read(path: &str) -> std::io::Result<String> {
    let mut text = String::new();
    let file = File::open(path)?;
    if !file.metadata()?.is_file() {
        return Err(std::io::Error::other("this is no regular file"));
    }
    if file.take(MOST_BYTES + 1).read_to_string(&mut text)? as u64 > MOST_BYTES {
        return Err(std::io::Error::other(format!("it has more than {MOST_BYTES} bytes")));
    }
    Ok(text)
}

/// A YAML text, read event by event as rcl_yaml_param_parser does.
struct Document<'text> {
    parser: Parser<'text, StrInput<'text>>,
    /// The line of the latest event.
    line: usize,
}

impl<'text> Document<'text> {
    fn new(text: &'text str) -> Self {
        Self { parser: Parser::new_from_str(text), line: 1 }
    }

    fn next(&mut self) -> Result<Event<'text>, DocumentError> {
        match self.parser.next_event() {
            None => Ok(Event::StreamEnd),
            Some(Ok((event, span))) => {
                self.line = span.start.line();
                Ok(event)
            }
            Some(Err(error)) => {
                Err(DocumentError::Yaml { line: error.marker().line(), problem: error.info().to_owned() })
            }
        }
    }

    fn unexpected(&self) -> DocumentError {
        DocumentError::Form(self.line)
    }

    /// Reads the only value of a text.
    fn value(&mut self) -> Result<Value, DocumentError> {
        loop {
            match self.next()? {
                Event::StreamStart | Event::DocumentStart(_) => (),
                Event::Scalar(text, style, _, tag) => return Ok(Value::of(&text, style, tag.as_deref())),
                Event::SequenceStart(..) => return Ok(Value::List),
                _ => return Err(self.unexpected()),
            }
        }
    }

    /// Reads a file.
    fn read(mut self, path: &str, into: &mut Parameters) -> Result<(), DocumentError> {
        loop {
            match self.next()? {
                Event::StreamEnd => return Ok(()),
                Event::StreamStart | Event::DocumentStart(_) | Event::DocumentEnd => (),
                Event::Scalar(text, ..) if text.is_empty() => (),
                Event::MappingStart(..) => self.nodes("", MOST_LEVELS, path, into)?,
                _ => return Err(self.unexpected()),
            }
        }
    }

    /// Reads a mapping whose keys are namespaces, names of nodes, or [`PARAMETERS`] of the node `above`.
    fn nodes(&mut self, above: &str, levels: usize, path: &str, into: &mut Parameters) -> Result<(), DocumentError> {
        loop {
            let key = match self.next()? {
                Event::MappingEnd => return Ok(()),
                Event::Scalar(key, ..) if !key.is_empty() => key,
                _ => return Err(self.unexpected()),
            };
            let is_mapping = matches!(self.next()?, Event::MappingStart(..));
            if !is_mapping || levels == 0 || (key == PARAMETERS && above.is_empty()) {
                return Err(self.unexpected());
            }
            if key == PARAMETERS {
                let words = above.strip_prefix('/').unwrap_or(above).split('/');
                let is_word = |word: &str| word.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
                if let Some(word) =
                    words.into_iter().find(|word| word.is_empty() || !(matches!(*word, "*" | "**") || is_word(word)))
                {
                    return Err(DocumentError::NodeName {
                        line: self.line,
                        word: word.to_owned(),
                        above: above.to_owned(),
                    });
                }
                self.parameters("", levels - 1, path, into.section(above))?;
                continue;
            }
            let separator = if above.is_empty() || above.ends_with('/') { "" } else { "/" };
            self.nodes(&format!("{above}{separator}{key}"), levels - 1, path, into)?;
        }
    }

    /// Reads a mapping of parameters. A mapping among them is a namespace of parameters.
    fn parameters(
        &mut self,
        above: &str,
        levels: usize,
        path: &str,
        into: &mut Vec<Parameter>,
    ) -> Result<(), DocumentError> {
        loop {
            let key = match self.next()? {
                Event::MappingEnd => return Ok(()),
                Event::Scalar(key, ..) if !key.is_empty() => key,
                _ => return Err(self.unexpected()),
            };
            let name = format!("{above}{key}");
            let place = format!("{path}, line {}: {name}", self.line);
            let value = match self.next()? {
                Event::Scalar(text, style, _, tag) if !(text.is_empty() && style == ScalarStyle::Plain) => {
                    Value::of(&text, style, tag.as_deref())
                }
                Event::SequenceStart(..) => {
                    self.skip_list()?;
                    Value::List
                }
                Event::MappingStart(..) if levels > 0 => {
                    self.parameters(&format!("{name}."), levels - 1, path, into)?;
                    continue;
                }
                _ => return Err(self.unexpected()),
            };
            into.push(Parameter { name, value, place });
        }
    }

    /// Reads to the end of a list of scalars.
    fn skip_list(&mut self) -> Result<(), DocumentError> {
        loop {
            match self.next()? {
                Event::SequenceEnd => return Ok(()),
                Event::Scalar(..) => (),
                _ => return Err(self.unexpected()),
            }
        }
    }
}
