//! `write-manual`: the man pages and shell completions of this command line, for packages.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use clap_complete::Shell;

use super::{CommandError, not_writable};

/// Arguments of `write-manual`.
#[derive(Debug, clap::Args)]
pub struct WriteManualArguments {
    /// The folder to write to: `man/` and `completions/` are made in it
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
}

/// Writes a man page for a command line and for each of its commands, and completions for bash, zsh and fish.
pub fn write_manual(mut command: clap::Command, arguments: &WriteManualArguments) -> Result<(), CommandError> {
    let (pages, completions) = (arguments.folder.join("man"), arguments.folder.join("completions"));
    for folder in [&pages, &completions] {
        fs::create_dir_all(folder).map_err(|error| not_writable(folder.display(), &error))?;
    }
    write_completions(&mut command, &completions).map_err(|error| not_writable(completions.display(), &error))?;
    // With the names of the whole line, such as `bench-dragon send osc`.
    command.build();
    write_pages(&command, &pages).map_err(|error| not_writable(pages.display(), &error))
}

fn write_completions(command: &mut clap::Command, folder: &Path) -> std::io::Result<()> {
    for (shell, file) in
        [(Shell::Bash, "bench-dragon"), (Shell::Zsh, "_bench-dragon"), (Shell::Fish, "bench-dragon.fish")]
    {
        clap_complete::generate(shell, command, "bench-dragon", &mut File::create(folder.join(file))?);
    }
    Ok(())
}

/// Writes the page of a command and of its subcommands, except hidden ones.
fn write_pages(command: &clap::Command, folder: &Path) -> std::io::Result<()> {
    let name = command.get_display_name().unwrap_or_else(|| command.get_name()).to_owned();
    let page = clap_mangen::Man::new(command.clone().name(name.clone()));
    page.render(&mut File::create(folder.join(format!("{name}.1")))?)?;
    let subcommands = command.get_subcommands().filter(|each| !each.is_hide_set() && each.get_name() != "help");
    subcommands.into_iter().try_for_each(|each| write_pages(each, folder))
}
