//! The pieces of a path as feet know them: straight on, round a circle, into or out of a coil.
//!
//! In: a path. Out: its pieces, told by their tangents alone, so that a curve of another kind needs no change here.

use std::f64::consts::{PI, TAU};

use bench_dragon_motion::Motion;

/// The way in which the feet move on a piece.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Feet {
    Straight,
    Circle,
    CoilIn,
    CoilOut,
}

/// A piece of the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Piece {
    /// The metres of travel at which it begins; the first one reaches back to the place of the tail.
    pub begin: f64,
    /// The metres of travel at which it ends.
    pub end: f64,
    pub feet: Feet,
}

/// The greatest number of tangents of a piece.
const MOST_TANGENTS: f64 = 50_000.0;
/// The metres between two tangents of a piece, if it is not too long.
const STEP: f64 = 0.1;
/// The curvature in 1/m below which feet go straight.
const STRAIGHT: f64 = 1e-4;
/// The relative change of curvature up to which a piece is a circle.
const ROUND: f64 = 1e-3;

/// Returns the pieces of a motion's path.
pub(crate) fn pieces(motion: &Motion) -> Vec<Piece> {
    let path = motion.path();
    let begins: Vec<f64> = [0.0].into_iter().chain(path.junctions().filter(|at| *at > 0.0)).collect();
    let ends = begins[1..].iter().copied().chain([path.length()]);
    let mut pieces: Vec<Piece> = begins.iter().zip(ends).map(|(begin, end)| piece(motion, *begin, end)).collect();
    // Behind the start of a route, the team stands on a line.
    if motion.description().pitch().is_none() && pieces[0].feet != Feet::Straight {
        pieces.insert(0, Piece { begin: f64::NEG_INFINITY, end: 0.0, feet: Feet::Straight });
    }
    pieces[0].begin = f64::NEG_INFINITY;
    pieces
}

fn piece(motion: &Motion, begin: f64, end: f64) -> Piece {
    let changes = turning(motion, begin, end);
    let per_metre = changes.len() as f64 / (end - begin);
    let [first, last] = [changes[0], changes[changes.len() - 1]].map(|change| (change * per_metre).abs());
    let feet = match (first.max(last) < STRAIGHT, (last - first).abs() <= ROUND * first.max(last)) {
        (true, _) => Feet::Straight,
        (_, true) => Feet::Circle,
        _ if last > first => Feet::CoilIn,
        _ => Feet::CoilOut,
    };
    Piece { begin, end, feet }
}

/// Returns the turns to the left on the stage between two places of one piece.
pub(crate) fn turns_between(motion: &Motion, from: f64, to: f64) -> f64 {
    let side = if motion.placement().is_mirrored() { -1.0 } else { 1.0 };
    side * turning(motion, from, to).iter().sum::<f64>() / TAU
}

/// Returns the changes of direction over equal parts of a piece, in radians to the left of the path's own coordinates.
fn turning(motion: &Motion, from: f64, to: f64) -> Vec<f64> {
    let (path, length) = (motion.path(), to - from);
    let steps = (length / STEP).ceil().clamp(16.0, MOST_TANGENTS);
    let heading = |step: f64| {
        // Not at a joint, whose tangent may be of the neighbour.
        let tangent = path.tangent(path.param_at(from + length * (1e-6 + (1.0 - 2e-6) * step / steps)));
        tangent.y.atan2(tangent.x)
    };
    let headings: Vec<f64> = (0..=steps as usize).map(|step| heading(step as f64)).collect();
    headings.windows(2).map(|pair| (pair[1] - pair[0] + PI).rem_euclid(TAU) - PI).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench_dragon_show::scene::Scene;

    fn of(route: &str) -> Vec<(Feet, f64)> {
        let text = format!("[team]\nbenches = 9\n[path]\n{route}\n[motion]\nhead_speed = 1.0\n");
        let scene = Scene::parse(&text, "a.toml", "a").unwrap();
        let motion = scene.ensemble.only().unwrap();
        let turns = |piece: &Piece| turns_between(motion, piece.begin.max(0.0), piece.end);
        pieces(motion).iter().map(|piece| (piece.feet, turns(piece))).collect()
    }

    #[test]
    fn a_route_is_told_by_its_tangents() {
        let found =
            of("kind = \"pieces\"\nstart = [0, 0]\nheading_turns = 0.3\npieces = [{ kind = \"line\", length = 5.0 }, \
                        { kind = \"arc\", radius = 4.0, side = \"right\", turns = 0.75 }, { kind = \"spiral\", \
                        direction = \"in\", side = \"left\", pitch = 1.0, radius = 6.0, to_radius = 3.0 }]");
        let kinds: Vec<Feet> = found.iter().map(|(feet, _)| *feet).collect();
        assert_eq!(kinds, [Feet::Straight, Feet::Circle, Feet::CoilIn]);
        // Three metres of radius are three rounds of the coil; a spiral's tangent turns a little more.
        assert!((found[1].1 + 0.75).abs() < 1e-3 && (found[2].1 - 3.0).abs() < 0.02, "{found:?}");
    }

    #[test]
    fn a_turnaround_goes_in_round_both_ways_and_out() {
        let found = of("kind = \"turnaround\"\npitch = 1.7\nturn_radius = 4.5\narc_ratio = 2.0\nlead_in = 20.0");
        let kinds: Vec<Feet> = found.iter().map(|(feet, _)| *feet).collect();
        assert_eq!(kinds, [Feet::CoilIn, Feet::Circle, Feet::Circle, Feet::CoilOut]);
        // Clockwise in, counter-clockwise out.
        let left: Vec<bool> = found.iter().map(|(_, turns)| *turns > 0.0).collect();
        assert_eq!(left, [false, false, true, true]);
    }
}
