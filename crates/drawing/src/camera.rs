//! From metres of the stage to units of the sheet: which part of the stage a picture shows, and where on the sheet.

use super::rounded;
use bench_dragon_motion::model::Point;

/// A rectangle of the stage, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageBox {
    /// The least x and y.
    pub least: Point,
    /// The greatest x and y.
    pub greatest: Point,
}

impl StageBox {
    /// The box of nothing.
    pub const EMPTY: Self = Self {
        least: Point::new(f64::INFINITY, f64::INFINITY),
        greatest: Point::new(f64::NEG_INFINITY, f64::NEG_INFINITY),
    };

    /// The box of a width and a height about a point.
    pub fn around(centre: Point, width: f64, height: f64) -> Self {
        let half = nalgebra::Vector2::new(0.5 * width, 0.5 * height);
        Self { least: centre - half, greatest: centre + half }
    }

    /// Makes the box hold a point.
    pub fn include(&mut self, point: Point) {
        self.least = self.least.inf(&point);
        self.greatest = self.greatest.sup(&point);
    }

    /// Metres across.
    pub fn width(&self) -> f64 {
        self.greatest.x - self.least.x
    }

    /// Metres from the bottom to the top.
    pub fn height(&self) -> f64 {
        self.greatest.y - self.least.y
    }

    /// The point in the middle.
    pub fn centre(&self) -> Point {
        nalgebra::center(&self.least, &self.greatest)
    }

    /// The same middle, larger by a margin on every side.
    pub fn padded(&self, margin: f64) -> Self {
        Self::around(self.centre(), self.width() + 2.0 * margin, self.height() + 2.0 * margin)
    }

    /// Returns true if a point lies in it.
    pub fn contains(&self, point: Point) -> bool {
        (self.least.x..=self.greatest.x).contains(&point.x) && (self.least.y..=self.greatest.y).contains(&point.y)
    }

    /// Returns true if two boxes have a point in common.
    pub fn meets(&self, other: &Self) -> bool {
        self.least.x <= other.greatest.x
            && other.least.x <= self.greatest.x
            && self.least.y <= other.greatest.y
            && other.least.y <= self.greatest.y
    }

    /// The least and the greatest distance from the origin of a point in it, metres.
    pub fn radii(&self) -> (f64, f64) {
        let nearest = Point::origin().sup(&self.least).inf(&self.greatest);
        let farthest = self.least.coords.abs().sup(&self.greatest.coords.abs());
        (nearest.coords.norm(), farthest.norm())
    }
}

/// A rectangle of the sheet in its own units, y downward.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Viewport {
    /// Its left edge.
    pub left: f64,
    /// Its upper edge.
    pub top: f64,
    /// How wide it is.
    pub width: f64,
    /// How high it is.
    pub height: f64,
}

impl Viewport {
    /// Its right edge.
    pub fn right(&self) -> f64 {
        self.left + self.width
    }

    /// Its lower edge.
    pub fn bottom(&self) -> f64 {
        self.top + self.height
    }
}

/// Which part of the stage stands in which frame of the sheet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Where on the sheet.
    pub frame: Viewport,
    /// The point of the stage in the middle of the frame.
    pub centre: Point,
    /// Units of the sheet for a metre.
    pub scale: f64,
}

impl Camera {
    /// A camera that shows all of a box, and more of the stage where the frame has another shape.
    pub fn showing(shown: &StageBox, frame: Viewport) -> Self {
        let scale = (frame.width / shown.width()).min(frame.height / shown.height());
        Self { frame, centre: shown.centre(), scale }
    }

    /// What is in the frame.
    pub fn view(&self) -> StageBox {
        StageBox::around(self.centre, self.frame.width / self.scale, self.frame.height / self.scale)
    }

    /// Where a point of the stage stands on the sheet.
    pub fn sheet(&self, point: Point) -> (f64, f64) {
        let away = self.scale * (point - self.centre);
        (self.frame.left + 0.5 * self.frame.width + away.x, self.frame.top + 0.5 * self.frame.height - away.y)
    }

    /// The attribute `transform` of a group that is drawn in metres, y upward.
    pub fn transform(&self) -> String {
        let (x, y) = self.sheet(Point::origin());
        format!("matrix({scale} 0 0 -{scale} {x} {y})", scale = self.scale)
    }

    /// So many units of the sheet in metres, for widths of lines in that group.
    pub fn metres(&self, units: f64) -> String {
        let metres = units / self.scale;
        // Six digits, however far away the camera is.
        let decimals = (6.0 - metres.abs().log10().floor()).clamp(0.0, 15.0);
        rounded(metres, decimals as usize)
    }
}
