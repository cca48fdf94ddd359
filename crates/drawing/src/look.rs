//! The look of a picture: colours, framing, surroundings, size.

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
    /// Light, or dark if the viewer prefers dark and knows style rules, as browsers do.
    Auto,
}

impl Theme {
    /// Returns the palette of the picture.
    pub(super) fn palette(self) -> &'static Palette {
        match self {
            Self::Light | Self::Auto => &palette::LIGHT,
            Self::Dark => &palette::DARK,
        }
    }
}

/// A place in the audience.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seat {
    /// The place of the seat, in turns around the stage from its south.
    pub turns: f64,
    /// The distance from the dragon's middle, in metres; by default it follows from the dragon's reach.
    pub distance: Option<f64>,
    /// The height of the eye, in metres.
    pub height: f64,
}

/// The manner in which the stage is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Style {
    /// Boards in the colours of their speeds.
    Plan,
    /// The stage at night in the light of the dragon's lanterns, without theme, surroundings and animation.
    Lanterns,
    /// The stage at night from a seat, without theme, framing, surroundings and animation.
    Seat(Seat),
}

/// The part of the stage to show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Framing {
    /// The box of every board at every time of the picture.
    Everything,
    /// The square about the origin with this half width, in metres.
    Radius(f64),
    /// A width in metres about a point, and a height; without it, that of the sheet.
    View(Point, f64, Option<f64>),
}

/// The content around the stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Surroundings {
    /// Title, axes and legend.
    Words,
    /// The stage fills the sheet, with text over it: the countdown of an animation.
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

    /// Returns a part of this length as the value of an attribute.
    pub(super) fn attribute(self, part: f64) -> String {
        match self {
            Self::Millimetres(length) => rounded(part * length, 4) + "mm",
            Self::Pixels(length) => rounded(part * length, 4),
        }
    }
}

/// The look of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// The manner of drawing.
    pub style: Style,
    /// The colours.
    pub theme: Theme,
    /// The part of the stage.
    pub framing: Framing,
    /// The content around the stage.
    pub surroundings: Surroundings,
    /// The width.
    pub width: Length,
    /// The height. By default it follows from the content.
    pub height: Option<Length>,
}

impl Look {
    /// Returns the sheet's height in sheet units, if a height is given.
    pub(super) fn sheet_height(&self) -> Option<f64> {
        self.height.map(|height| WIDTH * height.pixels() / self.width.pixels())
    }
}
