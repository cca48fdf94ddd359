//! The `[require]` table: the clearances that a show must keep.
//!
//! In: the table from serde. Out: [`Requirements`], or one sentence about the wrong field.

use serde::Deserialize;
use toml::Spanned;

use super::{Accepted, SceneError, Source};

/// The clearances that a show must keep over its whole route. Of each obstacle it must keep the keep-out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Requirements {
    /// The distance between any two boards that share no handle, in metres; `None` requires nothing of boards.
    pub clearance: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRequire {
    clearance: Option<Spanned<f64>>,
}

impl RawRequire {
    /// Checks the table.
    pub(super) fn validated(&self, source: &Source) -> Result<Requirements, SceneError> {
        let check = |metres| source.check("require.clearance", metres, Accepted::KEEP_OUT);
        Ok(Requirements { clearance: self.clearance.as_ref().map(check).transpose()? })
    }
}
