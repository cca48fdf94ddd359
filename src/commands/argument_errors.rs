//! Sentences for arguments that clap refuses in words which name no remedy.

use std::ffi::OsString;
use std::num::{ParseFloatError, ParseIntError};
use std::path::Path;

use clap::Command;
use clap::error::{ContextKind, ContextValue, ErrorKind};

use super::scene_argument::{takes_none, takes_scene};

/// Returns the sentence for an argument that clap refuses; `None` where clap's own words are good.
pub fn sentence(error: &clap::Error, definition: &Command, arguments: &[OsString]) -> Option<String> {
    let context = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.as_str()),
        _ => None,
    };
    match error.kind() {
        ErrorKind::UnknownArgument => unexpected(context(ContextKind::InvalidArg)?, definition, arguments),
        ErrorKind::InvalidSubcommand => unexpected(context(ContextKind::InvalidSubcommand)?, definition, arguments),
        ErrorKind::ValueValidation => {
            let cause = std::error::Error::source(error)?;
            let expected = if cause.is::<ParseFloatError>() {
                "a number without a unit, such as 60 or 0.5"
            } else if cause.is::<ParseIntError>() {
                "a whole number"
            } else {
                return None;
            };
            let (value, option) = (context(ContextKind::InvalidValue)?, context(ContextKind::InvalidArg)?);
            Some(format!("invalid value '{value}' for '{option}': expected {expected}"))
        }
        _ => None,
    }
}

/// Returns the sentence for a scene where none is expected, or for another word for a command of `control`.
fn unexpected(argument: &str, definition: &Command, arguments: &[OsString]) -> Option<String> {
    let (mut command, mut names) = (definition, Vec::new());
    for word in arguments.iter().skip(1).take_while(|word| *word != argument) {
        if let Some(inner) = command.find_subcommand(word) {
            command = inner;
            names.push(inner.get_name());
        }
    }
    if names == ["control"] {
        let expected = match argument {
            "play" | "start" | "continue" => "resume (after a pause) or go (from a cue, or from --paused)",
            "stop" => "pause, or hold, which only release ends",
            _ => return None,
        };
        return Some(format!("control {argument} is no command, expected {expected}"));
    }
    if argument.starts_with('-') || Path::new(argument).extension().is_none_or(|end| end != "toml") {
        return None;
    }
    Some(match command.get_subcommands().find(|inner| takes_scene(inner)) {
        _ if takes_scene(command) => format!("unexpected argument '{argument}', expected one scene"),
        Some(inner) => {
            names.push(inner.get_name());
            let (program, command) = (definition.get_name(), names.join(" "));
            format!(
                "unexpected argument '{argument}', expected a command before the scene, as in {program} {command} \
                 {argument}"
            )
        }
        None => takes_none(&names, argument),
    })
}
