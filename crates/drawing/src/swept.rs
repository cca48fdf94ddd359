//! [`SweptArea`]: the ground that boards cover during a stretch of a motion, as polygons. `draw --swept` and `check
//! --swept` call it.
//!
//! Because boards ride on the path here, a tail that whips by its momentum covers more.

use std::ops::Range;

use bench_dragon_motion::Motion;
use bench_dragon_motion::event::Progress;
use bench_dragon_motion::model::Point;
use bench_dragon_motion::sweep::{Moved, SweepError, sweep};
use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay::IntOverlayOptions;
use i_overlay::core::simplify::Simplify;
use i_overlay::i_float::int::point::IntPoint;

/// The greatest distance of the outline from the true one, in metres.
pub const TOLERANCE: f64 = 1e-3;

/// The greatest distance of a corner from the straight line of its step, in metres. An edge that turns by an angle a
/// within the step bulges beyond the step's polygons by up to its length times a^2 / 8. Its corners leave their lines
/// by as much.
const STRAIGHT: f64 = 0.1 * TOLERANCE;

/// The step of the grid to which corners are rounded, in metres. On a grid, the union has no corner but the corners of
/// its rings.
const GRID: f64 = 1e-6;

/// Polygons that are united first: few, since the positions of a board overlap many others and every edge crosses
/// theirs.
const TOGETHER: usize = 24;

/// A polygon's ring of corners, without the first one again at the end.
pub type Ring = Vec<[f64; 2]>;

/// Boards of one dragon, and the stretch of its motion.
#[derive(Debug, Clone)]
pub struct SweptStretch<'a> {
    /// The motion.
    pub motion: &'a Motion,
    /// The distances that its head has travelled at the beginning and at the end, in metres; equal for a dragon that
    /// stands.
    pub travelled: (f64, f64),
    /// The benches, counted from 0.
    pub benches: Range<usize>,
}

/// The ground that boards cover.
#[derive(Debug, Clone, PartialEq)]
pub struct SweptArea {
    shapes: Vec<Vec<Ring>>,
}

impl SweptArea {
    /// Unites the positions of the boards of all stretches. `progress` receives the share that is done, from 0 to 1.
    ///
    /// # Errors
    /// A handle has no place before the end of its stretch, or `progress` has stopped the search.
    pub fn new(stretches: &[SweptStretch<'_>], progress: Progress<'_>) -> Result<Self, SweepError> {
        let mut union = Union { waiting: Vec::new(), levels: Vec::new() };
        let share = 1.0 / stretches.len() as f64;
        for (k, SweptStretch { motion, travelled, benches }) in stretches.iter().enumerate() {
            let mut of_all = |part| progress(share * (k as f64 + part));
            sweep(motion, *travelled, benches.clone(), STRAIGHT, &mut of_all, &mut |moved| union.add(moved))?;
        }
        let metres = |corner: &IntPoint<i64>| [corner.x as f64 * GRID, corner.y as f64 * GRID];
        let in_metres = |ring: &GridRing| ring.iter().map(metres).collect();
        let polygons = union.finish();
        let mut shapes: Vec<Vec<Ring>> = polygons.iter().map(|rings| rings.iter().map(in_metres).collect()).collect();
        shapes.retain(|rings| rings.first().is_some_and(|outer| !is_line(outer)));
        shapes.iter_mut().for_each(|rings| rings.retain(|ring| !is_line(ring)));
        Ok(Self { shapes })
    }

    /// Returns the polygons, metres on the stage: of each the outer ring, counter-clockwise, then its holes, clockwise.
    /// Rings narrower than [`TOLERANCE`] are left out.
    pub fn polygons(&self) -> &[Vec<Ring>] {
        &self.shapes
    }

    /// Returns the area in square metres.
    pub fn area(&self) -> f64 {
        self.shapes.iter().flatten().map(|ring| signed_area(ring)).sum()
    }
}

/// Returns the area within a ring, negative if the ring is clockwise.
fn signed_area(ring: &[[f64; 2]]) -> f64 {
    let Some([x0, y0]) = ring.first() else { return 0.0 };
    let next = ring.iter().cycle().skip(1);
    // Relative to a corner of the ring, for the digits.
    ring.iter().zip(next).map(|([x, y], [u, v])| 0.5 * ((x - x0) * (v - y0) - (u - x0) * (y - y0))).sum()
}

/// Returns true if a ring is narrower than the tolerance: the outline does not distinguish the ring from a line.
fn is_line(ring: &Ring) -> bool {
    let next = ring.iter().cycle().skip(1);
    let around: f64 = ring.iter().zip(next).map(|([x, y], [u, v])| (x - u).hypot(y - v)).sum();
    signed_area(ring).abs() < 0.5 * TOLERANCE * around
}

/// A ring on the grid.
type GridRing = Vec<IntPoint<i64>>;

/// A union under construction: results of equally many polygons are united in pairs, so that each corner is handled a
/// logarithmic number of times.
struct Union {
    waiting: Vec<GridRing>,
    /// Rings of 1, 2, 4, ... times [`TOGETHER`] polygons.
    levels: Vec<Option<Vec<GridRing>>>,
}

impl Union {
    fn add(&mut self, moved: &Moved) {
        let [before, after] = moved;
        self.waiting.push(ring(before));
        self.waiting.push(ring(after));
        for corner in 0..4 {
            let next = (corner + 1) % 4;
            let [a, b] = [corner, next].map(|corner| before[corner]);
            let [c, d] = [corner, next].map(|corner| after[corner]);
            // An edge that turns about a point of its own covers two triangles.
            match crossing((a, b), (c, d)) {
                Some(middle) => self.waiting.extend([ring(&[a, c, middle]), ring(&[b, d, middle])]),
                None => self.waiting.push(ring(&[a, b, d, c])),
            }
        }
        if self.waiting.len() >= TOGETHER {
            self.carry();
        }
    }

    /// Unites the waiting polygons, and levels of equally many polygons in pairs.
    fn carry(&mut self) {
        let mut rings = united(&std::mem::take(&mut self.waiting)).concat();
        for level in &mut self.levels {
            let Some(other) = level.take() else {
                *level = Some(rings);
                return;
            };
            rings.extend(other);
            rings = united(&rings).concat();
        }
        self.levels.push(Some(rings));
    }

    fn finish(mut self) -> Vec<Vec<GridRing>> {
        let rest: Vec<GridRing> = self.levels.drain(..).flatten().flatten().chain(self.waiting).collect();
        united(&rest)
    }
}

/// Returns the union of rings that are counter-clockwise, or holes of others and clockwise.
fn united(rings: &[GridRing]) -> Vec<Vec<GridRing>> {
    rings.simplify(FillRule::NonZero, IntOverlayOptions::ogc())
}

/// Returns corners as a counter-clockwise ring on the grid.
fn ring(corners: &[Point]) -> GridRing {
    let on_grid = |metres: f64| (metres / GRID).round() as i64;
    let mut ring: GridRing = corners.iter().map(|corner| IntPoint::new(on_grid(corner.x), on_grid(corner.y))).collect();
    let area: i128 = (0..ring.len()).map(|at| doubled_area(ring[0], ring[at], ring[(at + 1) % ring.len()])).sum();
    if area < 0 {
        ring.reverse();
    }
    ring
}

/// Returns twice the signed area of a triangle, in units of the grid.
fn doubled_area(a: IntPoint<i64>, b: IntPoint<i64>, c: IntPoint<i64>) -> i128 {
    let [bx, by, cx, cy] = [b.x - a.x, b.y - a.y, c.x - a.x, c.y - a.y].map(i128::from);
    bx * cy - cx * by
}

/// Returns the point in which two segments cross.
fn crossing((a, b): (Point, Point), (c, d): (Point, Point)) -> Option<Point> {
    let (along, other) = (b - a, d - c);
    let across = along.perp(&other);
    let from = c - a;
    let (s, t) = (from.perp(&other) / across, from.perp(&along) / across);
    let inside = 0.0..=1.0;
    (inside.contains(&s) && inside.contains(&t)).then(|| a + s * along)
}
