//! The eye of a spectator: places of the stage on the sheet.

use std::f64::consts::TAU;

use super::WIDTH;
use super::camera::StageBox;
use super::look::Seat;
use bench_dragon_motion::model::Point;

/// The usual distance as a multiple of the stage's reach, and the least, in metres.
const DISTANCE: (f64, f64) = (1.9, 19.0);
/// The nearest that is drawn, in metres.
const NEAREST: f64 = 0.5;

/// A place on the sheet: its units, units a metre there, and the depth in metres.
#[derive(Debug, Clone, Copy)]
pub struct Spot {
    /// Sheet units from the left.
    pub x: f64,
    /// Sheet units from the top.
    pub y: f64,
    /// Sheet units a metre.
    pub scale: f64,
    /// The distance along the line of sight, in metres.
    pub depth: f64,
}

/// The eye of a spectator.
#[derive(Debug, Clone, Copy)]
pub struct Eye {
    pub(super) at: Point,
    pub(super) height: f64,
    pub(super) right: (f64, f64),
    pub(super) tilt: (f64, f64),
    pub(super) focus: f64,
    pub(super) middle: (f64, f64),
    pub(super) village: f64,
}

impl Eye {
    pub(super) fn new(seat: Seat, stage: &StageBox, sheet_height: f64) -> Self {
        // Whole metres: the seat stays while the dragon moves.
        let middle = Point::new(stage.centre().x.round(), stage.centre().y.round());
        let reach = 0.5 * stage.width().max(stage.height()) + 1.0;
        let distance = seat.distance.unwrap_or((DISTANCE.0 * reach).max(DISTANCE.1));
        let (sine, cosine) = (TAU * seat.turns).sin_cos();
        let pitch = 0.6 * (seat.height - 0.9).atan2(distance);
        Self {
            at: Point::new(middle.x + sine * distance, middle.y - cosine * distance),
            height: seat.height,
            right: (cosine, sine),
            tilt: (pitch.cos(), pitch.sin()),
            focus: 0.5 * WIDTH / 27.0_f64.to_radians().tan(),
            middle: (0.5 * WIDTH, 0.5 * sheet_height),
            village: (distance + reach + 9.0).max(38.0),
        }
    }

    /// Returns the place of a point of the stage at a height; `None` if it is behind the eye.
    pub fn spot(&self, at: Point, height: f64) -> Option<Spot> {
        let (dx, dy) = (at.x - self.at.x, at.y - self.at.y);
        let (right, away) = (dx * self.right.0 + dy * self.right.1, dy * self.right.0 - dx * self.right.1);
        let down = self.height - height;
        let depth = away * self.tilt.0 + down * self.tilt.1;
        let scale = self.focus / depth;
        (depth >= NEAREST).then_some(Spot {
            x: self.middle.0 + right * scale,
            y: self.middle.1 + (down * self.tilt.0 - away * self.tilt.1) * scale,
            scale,
            depth,
        })
    }

    /// Returns the foot of the village in the middle of the picture.
    pub fn foot(&self) -> Option<Spot> {
        let away = self.village;
        self.spot(Point::new(self.at.x - self.right.1 * away, self.at.y + self.right.0 * away), 0.0)
    }

    /// Returns the ratio of height to width of a circle on the floor, as seen from the eye.
    pub(super) fn flat(&self, depth: f64) -> f64 {
        (self.height / depth).min(1.0)
    }

    pub(super) fn is_seen(spot: &Spot, metres: f64) -> bool {
        let reach = metres * spot.scale;
        (-reach..WIDTH + reach).contains(&spot.x)
    }
}
