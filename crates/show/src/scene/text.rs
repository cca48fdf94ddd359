//! The text of a scene before parsing. A recording keeps it, so that the same scene can be read again.

use std::path::Path as FilePath;

use super::source::Source;
use super::{PAPER, Scene, SceneError, dragons_in};
use bench_dragon_motion::Motion;

/// The text of a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SceneText {
    /// The text, TOML.
    pub text: String,
    /// The file's name in errors.
    pub file: String,
    /// The scene's name if the text gives none.
    pub stem: String,
}

impl SceneText {
    /// Returns the text of the built-in scene.
    pub fn paper() -> Self {
        Self { text: PAPER.to_owned(), file: "paper.toml (built in)".to_owned(), stem: "paper".to_owned() }
    }

    /// Reads a file.
    ///
    /// # Errors
    /// One sentence for a file that cannot be read.
    pub fn load(file: &FilePath) -> Result<Self, SceneError> {
        let shown = file.display().to_string();
        let text = std::fs::read_to_string(file).map_err(|error| {
            let reason = match error.kind() {
                std::io::ErrorKind::NotFound => "there is no such file".to_owned(),
                std::io::ErrorKind::IsADirectory => "it is a folder".to_owned(),
                std::io::ErrorKind::InvalidData => "it is not UTF-8 text".to_owned(),
                _ => error.to_string(),
            };
            SceneError { sentence: format!("{shown}: {reason}, expected a scene file in TOML"), at: None }
        })?;
        let stem = file.file_stem().map_or("scene".into(), |stem| stem.to_string_lossy().into_owned());
        Ok(Self { text, file: shown, stem })
    }

    /// Parses the text.
    ///
    /// # Errors
    /// As [`Scene::parse`].
    pub fn parse(&self) -> Result<Scene, SceneError> {
        Scene::parse(&self.text, &self.file, &self.stem)
    }

    /// Parses the text of a scene with `[team]`, and returns the scene and the motion of its dragon.
    ///
    /// # Errors
    /// As [`Scene::parse`]. A scene with `[[dragons]]` is refused.
    pub fn parse_only(&self) -> Result<(Scene, Motion), SceneError> {
        if let Some(dragons) = dragons_in(&self.text) {
            let sentence = "the scene has several dragons, which this command does not take, expected one dragon in \
                            [team] and [path]";
            return Err(Source::new(&self.text, &self.file).field_error(&dragons, sentence));
        }
        let scene = self.parse()?;
        // Only `[[dragons]]` gives names.
        let motion = scene.ensemble.only().expect("a scene without [[dragons]] has one dragon without a name").clone();
        Ok((scene, motion))
    }
}

/// Returns text in printable form: line ends and terminal control characters are escaped.
pub fn printable(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for letter in text.chars() {
        if letter.is_control() { shown.extend(letter.escape_default()) } else { shown.push(letter) }
    }
    shown
}
