//! Places in words: from the nearest landmark, by metres and the compass.

use bench_dragon_motion::ensemble::Ensemble;
use bench_dragon_motion::ground::Obstacle;
use bench_dragon_motion::model::board::Board;
use bench_dragon_motion::model::shape::ShapeKind;
use bench_dragon_motion::model::{Point, Vector};

use crate::piece::{Feet, Piece};
use crate::words::Language;

/// The landmarks of a stage.
pub(crate) struct Landmarks<'a> {
    obstacles: Vec<&'a Obstacle>,
    /// Without obstacles: the centres of coils and the start of each path, which can be marked on the ground.
    points: Vec<([&'static str; 2], Point)>,
    language: Language,
}

impl<'a> Landmarks<'a> {
    /// Creates the landmarks: the obstacles, or what the paths mark where there is no obstacle.
    pub fn of(ensemble: &'a Ensemble, pieces: &[Vec<Piece>], language: Language) -> Self {
        let obstacles = ensemble.ground().obstacles().iter();
        let obstacles: Vec<&Obstacle> =
            obstacles.filter(|obstacle| obstacle.shape.kind() != ShapeKind::Boundary).collect();
        let mut points: Vec<([&'static str; 2], Point)> = Vec::new();
        for (dragon, pieces) in ensemble.dragons().iter().zip(pieces) {
            let motion = &dragon.motion;
            let stage = |travelled| motion.placement().point(motion.path().point(motion.path().param_at(travelled)));
            if motion.description().pitch().is_some() {
                points.push((["centre of the coil", "盘心"], motion.placement().origin()));
            } else {
                points.push((["start of the head", "龙头起点"], stage(0.0)));
                let coils = pieces.iter().filter(|piece| piece.feet == Feet::CoilIn);
                points.extend(coils.map(|coil| (["inner end of the coil", "盘的内端"], stage(coil.end))));
            }
        }
        Self { obstacles, points, language }
    }

    /// Returns a place in words.
    pub fn words(&self, place: Point) -> String {
        let away = |from: Point| place - from;
        let of_obstacles = self.obstacles.iter().map(|obstacle| {
            // A board without a size has the nearest points of a place.
            let speck = Board::from_front(place, Vector::new(1.0, 0.0), 0.0, 0.0, 0.0);
            let (_, nearest) = obstacle.shape.nearest_points(&speck);
            let inside = obstacle.shape.signed_distance(&speck) <= 0.0;
            (obstacle.name.as_str(), if inside { Vector::zeros() } else { away(nearest) })
        });
        let of_points = self.points.iter().map(|(name, point)| (self.language.of(*name), away(*point)));
        let named: Vec<(&str, Vector)> =
            if self.obstacles.is_empty() { of_points.collect() } else { of_obstacles.collect() };
        let nearest = named.iter().min_by(|(_, one), (_, other)| one.norm().total_cmp(&other.norm()));
        nearest.map_or(String::new(), |(name, away)| self.language.beside(name, *away))
    }
}
