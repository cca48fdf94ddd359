//! Reads a scene from its text.
//!
//! In: TOML text. Out: the tables as serde reads them, checked; or one sentence, which names the remedy of a usual
//! mistake.

use serde::Deserialize;

use super::source::Source;
use super::{Scene, SceneError, mend};

impl Source<'_> {
    /// Reads and checks a scene. An error that follows doubts may come from the first of them.
    pub fn scene<T: for<'de> Deserialize<'de>>(
        &self,
        validated: impl FnOnce(T) -> Result<Scene, SceneError>,
    ) -> Result<Scene, SceneError> {
        let result = validated(self.read()?);
        let doubts = self.doubts.take();
        match (result, doubts.first()) {
            (Ok(scene), _) => Ok(Scene { doubts, ..scene }),
            (Err(SceneError { sentence, at }), Some(doubt)) => {
                Err(SceneError { sentence: format!("{sentence} ({doubt})"), at })
            }
            (Err(error), None) => Err(error),
        }
    }

    fn read<T: for<'de> Deserialize<'de>>(&self) -> Result<T, SceneError> {
        let deserializer = toml::Deserializer::parse(self.text).map_err(|error| self.toml_error(&error, ""))?;
        serde_path_to_error::deserialize(deserializer)
            .map_err(|error| self.toml_error(error.inner(), &error.path().to_string()))
    }

    /// Converts an error of the TOML reader into one sentence.
    fn toml_error(&self, error: &toml::de::Error, field: &str) -> SceneError {
        let at = error.span().map(|span| span.start);
        let place = at.map_or(String::new(), |at| format!(", line {}", self.line(at)));
        // `Spanned` values are wrapped in a field that no user wrote.
        let field = field.replace(".$__serde_spanned_private_value", "");
        let line = at.map(|at| self.line(at));
        let line = line.and_then(|line| self.text.lines().nth(line - 1)).unwrap_or_default();
        if let Some(sentence) = mend::sentence(error.message(), &field, line) {
            return SceneError { sentence: format!("{}{place}: {sentence}", self.file), at };
        }
        let field = if field.is_empty() || field == "." { String::new() } else { format!("{field}: ") };
        let message = error.message().trim().replace('\n', ", ");
        let message =
            message.replace("expected i64", "expected an integer").replace("expected f64", "expected a number");
        SceneError { sentence: format!("{}{place}: {field}{message}", self.file), at }
    }
}
