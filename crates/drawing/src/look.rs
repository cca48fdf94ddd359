//! How a picture looks: its colours, what it shows, what stands about that, its size. What `draw` reads from its
//! options.

use super::WIDTH;
use super::palette::{self, Palette};
use bench_dragon_messages::sentence::rounded;
use bench_dragon_motion::model::Point;

/// The colours of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Theme {
    /// On a light ground.
    Light,
    /// On a dark ground.
    Dark,
    /// Light, and dark where the viewer prefers that and knows style rules, as browsers do.
    Auto,
}

impl Theme {
    /// The palette in which the picture is drawn.
    pub(super) fn palette(self) -> &'static Palette {
        match self {
            Self::Light | Self::Auto => &palette::LIGHT,
            Self::Dark => &palette::DARK,
        }
    }
}

/// Which part of the stage is shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Framing {
    /// The box of every board at every time of the picture.
    Everything,
    /// The square about the origin that reaches so many metres to each side.
    Radius(f64),
    /// So many metres across about a point.
    View(Point, f64),
}

/// What stands about the stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Surroundings {
    /// Title, axes and legend.
    Words,
    /// The stage fills the sheet, with words over it: the countdown of a picture that moves.
    Caption,
    /// Nothing: the stage fills the sheet.
    Nothing,
}

/// A length on paper or on a screen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Length {
    /// Millimetres.
    Millimetres(f64),
    /// Pixels of a screen, 96 to the inch.
    Pixels(f64),
}

impl Length {
    fn pixels(self) -> f64 {
        match self {
            Self::Millimetres(length) => length * 96.0 / 25.4,
            Self::Pixels(length) => length,
        }
    }

    /// A part of this length as an attribute's value.
    pub(super) fn attribute(self, part: f64) -> String {
        match self {
            Self::Millimetres(length) => rounded(part * length, 4) + "mm",
            Self::Pixels(length) => rounded(part * length, 4),
        }
    }
}

/// How a picture looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// Its colours.
    pub theme: Theme,
    /// Which part of the stage it shows.
    pub framing: Framing,
    /// What stands about the stage.
    pub surroundings: Surroundings,
    /// How wide it is.
    pub width: Length,
    /// How high it is; as high as what it shows where nothing is given.
    pub height: Option<Length>,
}

impl Look {
    /// Units of the sheet's height, where one is given.
    pub(super) fn sheet_height(&self) -> Option<f64> {
        self.height.map(|height| WIDTH * height.pixels() / self.width.pixels())
    }
}
