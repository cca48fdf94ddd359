//! The scene as the argument of a command, `bench-dragon run my.toml`: one definition for every command that reads a
//! scene. `main` stores the file as that of `--scene`.

use std::path::PathBuf;

use clap::{Arg, ArgMatches, Command, value_parser};

use super::CommandError;

/// The name of the argument.
const SCENE: &str = "SCENE";

/// Returns the argument of a command that reads a scene.
pub fn scene_argument() -> Arg {
    let help = "The scene (TOML), as with --scene; by default the paper's, which is built in";
    // Without a heading of its own it would stand below the command's last one.
    Arg::new(SCENE).value_parser(value_parser!(PathBuf)).help(help).help_heading(None::<&str>)
}

/// Sets the file of `--scene` from the argument.
///
/// # Errors
/// Bad input: the scene is given twice, or to a command that reads none.
pub fn resolve(scene: &mut Option<PathBuf>, definition: &Command, matches: &ArgMatches) -> Result<(), CommandError> {
    let (mut command, mut matches, mut names) = (definition, matches, Vec::new());
    while let Some((name, inner)) = matches.subcommand() {
        // A name that was matched is defined.
        command = command.find_subcommand(name).unwrap_or(command);
        matches = inner;
        names.push(name);
    }
    let takes = takes_scene(command);
    let argument = takes.then(|| matches.get_one::<PathBuf>(SCENE)).flatten();
    match (&*scene, argument) {
        (Some(option), Some(argument)) => Err(CommandError::BadInput(format!(
            "the scene is given twice, {} and --scene {}, expected one of them",
            argument.display(),
            option.display()
        ))),
        (Some(option), None) if !takes => {
            Err(CommandError::BadInput(takes_none(&names, &option.display().to_string())))
        }
        (_, argument) => {
            *scene = argument.cloned().or(scene.take());
            Ok(())
        }
    }
}

/// Returns the sentence for a scene that a command does not read. `names` lead to the command.
pub fn takes_none(names: &[&str], scene: &str) -> String {
    format!("{} takes no scene, expected it without {scene}, or a command that reads a scene", names.join(" "))
}

/// Returns true if a command reads a scene.
pub fn takes_scene(command: &Command) -> bool {
    command.get_arguments().any(|argument| argument.get_id() == SCENE)
}
