//! `publish.precision` and `publish.every`: the service of poses in single precision.

use serde::Deserialize;
use toml::Spanned;

use super::{Accepted, SceneError, Source};

/// The precision of the poses that are published.
#[derive(Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Precision {
    /// Double precision alone.
    #[default]
    F64,
    /// Single precision too, in a service of its own.
    F32,
}

/// The settings of the service of poses in single precision.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SinglePrecision {
    /// The stride of the handles from the head on, at least 1. The tail is always included.
    pub every: usize,
}

impl std::fmt::Display for SinglePrecision {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.every {
            1 => write!(formatter, "every handle in f32"),
            every => write!(formatter, "one handle in {every} and the tail, in f32"),
        }
    }
}

impl Precision {
    /// Returns the settings of single precision, if requested.
    pub(super) fn single(
        self,
        every: Option<&Spanned<i64>>,
        source: &Source,
    ) -> Result<Option<SinglePrecision>, SceneError> {
        let number = every.map_or(Ok(1), |every| source.check_count("publish.every", every, Accepted::EVERY))?;
        match (self, every) {
            (Precision::F32, _) => Ok(Some(SinglePrecision { every: number })),
            (Precision::F64, Some(given)) if number > 1 => {
                let sentence = format!(
                    "publish.every is {number} and publish.precision is not \"f32\", expected both or neither: only \
                     the poses in f32 leave handles out"
                );
                Err(source.field_error(given, &sentence))
            }
            (Precision::F64, _) => Ok(None),
        }
    }
}
