//! The team of benches of a scene.

use serde::Deserialize;

use super::interval::Interval;

/// The sizes that a scene may leave out, metres: those of the paper.
const HEAD_LENGTH: f64 = 3.41;
const BODY_LENGTH: f64 = 2.20;
const WIDTH: f64 = 0.30;
const HOLE_INSET: f64 = 0.275;

/// Limit of benches.
const MOST: usize = 1_000_000;

/// The team of benches.
#[derive(Clone)]
pub(super) struct Team {
    pub benches: usize,
    pub width: Interval,
    pub hole_inset: Interval,
    head_link: Interval,
    body_link: Interval,
}

impl Team {
    /// Returns the metres between the two handles of a bench.
    pub fn link(&self, bench: usize) -> &Interval {
        if bench == 0 { &self.head_link } else { &self.body_link }
    }

    /// Returns the same team in units of `unit` metres.
    pub fn in_units(&self, unit: &Interval) -> Self {
        let Self { benches, width, hole_inset, head_link, body_link } = self;
        Self {
            benches: *benches,
            width: width / unit,
            hole_inset: hole_inset / unit,
            head_link: head_link / unit,
            body_link: body_link / unit,
        }
    }

    /// Returns the same team with boards that are larger by `metres` on each side.
    pub fn grown(&self, metres: &Interval) -> Self {
        let Self { benches, width, hole_inset, head_link, body_link } = *self;
        Self {
            benches,
            width: width + metres * Interval::new(2.0),
            hole_inset: hole_inset + metres,
            head_link,
            body_link,
        }
    }

    /// Returns the metres of the links from bench `first` to bench `last` in one line.
    pub fn links(&self, first: usize, last: usize) -> Interval {
        self.link(first) + self.link(1) * Interval::new((last - first) as f64)
    }
}

/// The table `[team]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TeamText {
    benches: usize,
    head_length: Option<f64>,
    body_length: Option<f64>,
    width: Option<f64>,
    hole_inset: Option<f64>,
}

impl TeamText {
    pub fn read(&self) -> Result<Team, String> {
        if self.benches == 0 || self.benches > MOST {
            return Err(format!("team.benches is {}, expected from 1 to {MOST}", self.benches));
        }
        let hole_inset = Interval::positive("team.hole_inset", self.hole_inset.unwrap_or(HOLE_INSET))?;
        let link = |field: &str, length: f64| {
            let link = Interval::positive(field, length)? - Interval::new(2.0) * hole_inset;
            if link.is_positive() { Ok(link) } else { Err(format!("{field} leaves no bench between its holes")) }
        };
        Ok(Team {
            benches: self.benches,
            width: Interval::positive("team.width", self.width.unwrap_or(WIDTH))?,
            head_link: link("team.head_length", self.head_length.unwrap_or(HEAD_LENGTH))?,
            body_link: link("team.body_length", self.body_length.unwrap_or(BODY_LENGTH))?,
            hole_inset,
        })
    }
}
