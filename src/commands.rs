//! The subcommands, one file each: what a person types becomes calls of the library. Called by `main` only.

pub mod watch;

use bench_dragon::scene::{Scene, SceneError};

/// What stands before or after every subcommand.
#[derive(Debug, Clone, clap::Args)]
pub struct Common {
    /// The scene to play (TOML); without it, the paper's, which is built in
    #[arg(long, value_name = "FILE", global = true)]
    pub scene: Option<std::path::PathBuf>,
    /// The name under which services and topics appear
    #[arg(long, value_name = "NAME", global = true, default_value = "bench_dragon")]
    pub name: String,
    /// Print JSON lines for machines
    #[arg(long, global = true)]
    pub json: bool,
    /// Log more to standard error (twice for everything)
    #[arg(short, long, action = clap::ArgAction::Count, global = true)]
    pub verbose: u8,
    /// Log errors only
    #[arg(long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
}

impl Common {
    /// The scene asked for.
    ///
    /// # Errors
    /// Bad input: the sentence names the file, the line and the field.
    pub fn load_scene(&self) -> Result<Scene, CommandError> {
        Ok(match &self.scene {
            Some(path) => Scene::load(path)?,
            None => Scene::paper(),
        })
    }
}

/// Why a command did not do what it was asked.
#[derive(Debug)]
pub enum CommandError {
    /// The user's input cannot be used; one sentence that names the place and what was expected. Exit code 2.
    BadInput(String),
    /// Anything else, in one sentence. Exit code 1.
    Failed(String),
    /// The command did its work and its verdict is negative; it has said so itself. Exit code 1.
    NegativeVerdict,
}

impl From<SceneError> for CommandError {
    fn from(error: SceneError) -> Self {
        Self::BadInput(error.to_string())
    }
}

impl From<std::io::Error> for CommandError {
    fn from(error: std::io::Error) -> Self {
        Self::Failed(error.to_string())
    }
}
