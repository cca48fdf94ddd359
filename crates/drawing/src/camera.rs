//! Conversion from metres of the stage to units of the sheet.

use super::rounded;
use bench_dragon_motion::model::Point;

/// A rectangle of the stage, in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageBox {
    /// The least x and y.
    pub least: Point,
    /// The greatest x and y.
    pub greatest: Point,
}

impl StageBox {
    /// The box of the whole stage.
    pub const ALL: Self = Self {
        least: Point::new(f64::NEG_INFINITY, f64::NEG_INFINITY),
        greatest: Point::new(f64::INFINITY, f64::INFINITY),
    };
    /// The empty box.
    pub const EMPTY: Self = Self {
        least: Point::new(f64::INFINITY, f64::INFINITY),
        greatest: Point::new(f64::NEG_INFINITY, f64::NEG_INFINITY),
    };

    /// Creates the box with this centre, width and height.
    pub fn around(centre: Point, width: f64, height: f64) -> Self {
        let half = nalgebra::Vector2::new(0.5 * width, 0.5 * height);
        Self { least: centre - half, greatest: centre + half }
    }

    /// Extends the box to a point.
    pub fn include(&mut self, point: Point) {
        self.least = self.least.inf(&point);
        self.greatest = self.greatest.sup(&point);
    }

    /// Returns the width in metres.
    pub fn width(&self) -> f64 {
        self.greatest.x - self.least.x
    }

    /// Returns the height in metres.
    pub fn height(&self) -> f64 {
        self.greatest.y - self.least.y
    }

    /// Returns the centre.
    pub fn centre(&self) -> Point {
        nalgebra::center(&self.least, &self.greatest)
    }

    /// Returns the box with the same centre and a margin on every side.
    pub fn padded(&self, margin: f64) -> Self {
        Self::around(self.centre(), self.width() + 2.0 * margin, self.height() + 2.0 * margin)
    }

    /// Returns true if a point is in the box.
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

    /// Returns the least and the greatest distance from `centre` of a point in the box, in metres.
    pub fn radii(&self, centre: Point) -> (f64, f64) {
        let nearest = centre.sup(&self.least).inf(&self.greatest);
        let farthest = (self.least - centre).abs().sup(&(self.greatest - centre).abs());
        ((nearest - centre).norm(), farthest.norm())
    }
}

/// A rectangle of the sheet in sheet units, y downward.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Viewport {
    /// The left edge.
    pub left: f64,
    /// The upper edge.
    pub top: f64,
    /// The width.
    pub width: f64,
    /// The height.
    pub height: f64,
}

impl Viewport {
    /// Returns the right edge.
    pub fn right(&self) -> f64 {
        self.left + self.width
    }

    /// Returns the lower edge.
    pub fn bottom(&self) -> f64 {
        self.top + self.height
    }
}

/// The mapping of a part of the stage to a viewport of the sheet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// The viewport on the sheet.
    pub viewport: Viewport,
    /// The point of the stage in the middle of the viewport.
    pub centre: Point,
    /// Sheet units per metre.
    pub scale: f64,
}

impl Camera {
    /// Creates a camera that shows all of a box, and more of the stage if the viewport has another aspect ratio.
    pub fn showing(shown: &StageBox, viewport: Viewport) -> Self {
        let scale = (viewport.width / shown.width()).min(viewport.height / shown.height());
        Self { viewport, centre: shown.centre(), scale }
    }

    /// Returns the part of the stage in the viewport.
    pub fn view(&self) -> StageBox {
        StageBox::around(self.centre, self.viewport.width / self.scale, self.viewport.height / self.scale)
    }

    /// Returns the position of a stage point on the sheet.
    pub fn sheet(&self, point: Point) -> (f64, f64) {
        let away = self.scale * (point - self.centre);
        (
            self.viewport.left + 0.5 * self.viewport.width + away.x,
            self.viewport.top + 0.5 * self.viewport.height - away.y,
        )
    }

    /// Returns the attribute `transform` of a group that is drawn in metres, y upward.
    pub fn transform(&self) -> String {
        let (x, y) = self.sheet(Point::origin());
        format!("matrix({scale} 0 0 -{scale} {x} {y})", scale = self.scale)
    }

    /// Returns a width in sheet units as metres, for lines in that group.
    pub fn metres(&self, units: f64) -> String {
        let metres = units / self.scale;
        // Six digits at any distance of the camera.
        let decimals = (6.0 - metres.abs().log10().floor()).clamp(0.0, 15.0);
        rounded(metres, decimals as usize)
    }
}
