//! The JSON line of a fit: what `plan fit --json` prints, and what the page of `design` receives beside a sentence.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::search::Fitted;

/// The line of numbers that were fitted. Lengths are in metres.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FitLine<'a> {
    plan: &'static str,
    status: &'static str,
    fields: BTreeMap<&'a str, f64>,
    /// The clearance that is required of boards.
    clearance: f64,
    /// The least margin of all that is required.
    margin: f64,
    /// The least margin of the rest, if the search has left out the boundary.
    #[serde(skip_serializing_if = "Option::is_none")]
    without_boundary: Option<f64>,
}

impl<'a> FitLine<'a> {
    /// Returns the line of an answer for boards that keep a clearance, in metres.
    pub fn new(fitted: &'a Fitted, clearance: f64) -> Self {
        Self {
            plan: "fit",
            status: if fitted.is_found() { "found" } else { "not_found" },
            fields: fitted.fields.iter().map(|(name, value)| (name.as_str(), *value)).collect(),
            clearance,
            margin: fitted.judgement.margin(),
            without_boundary: fitted.without_boundary,
        }
    }
}
