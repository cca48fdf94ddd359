//! The `[stage]` table: the boundary and the obstacles.
//!
//! In: the table from serde. Out: a [`Ground`] in stage coordinates, or one sentence about the wrong field.

use robust::{Coord, orient2d};
use serde::Deserialize;
use toml::Spanned;

use super::{Accepted, SceneError, Source, printable};
use bench_dragon_motion::ground::{BOUNDARY, Ground, Obstacle};
use bench_dragon_motion::model::Point;
use bench_dragon_motion::model::shape::{MOST_CORNERS, Shape};

/// The greatest number of obstacles, the boundary not counted.
pub const MOST_OBSTACLES: usize = 64;
/// The greatest number of bytes of an obstacle's name: the stage message has no room for more.
const MOST_NAME_BYTES: usize = 64;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawStage {
    boundary: Option<RawBoundary>,
    #[serde(default)]
    obstacles: Vec<RawObstacle>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawBoundary {
    polygon: Spanned<Vec<Spanned<[f64; 2]>>>,
    keep_out: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawObstacle {
    name: Spanned<String>,
    circle: Option<RawCircle>,
    polygon: Option<Spanned<Vec<Spanned<[f64; 2]>>>>,
    line: Option<Spanned<Vec<Spanned<[f64; 2]>>>>,
    keep_out: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCircle {
    center: Spanned<[f64; 2]>,
    radius: Spanned<f64>,
}

impl RawStage {
    /// Checks the table and returns its shapes.
    pub(super) fn validated(&self, source: &Source) -> Result<Ground, SceneError> {
        if let Some(first_beyond) = self.obstacles.get(MOST_OBSTACLES) {
            let count = self.obstacles.len();
            let sentence = format!("stage.obstacles has {count} entries, expected at most {MOST_OBSTACLES}");
            return Err(source.field_error(&first_beyond.name, &sentence));
        }
        let mut obstacles: Vec<Obstacle> = Vec::with_capacity(self.obstacles.len() + 1);
        for raw in &self.obstacles {
            let obstacle = raw.validated(source)?;
            if obstacles.iter().any(|other| other.name == obstacle.name) {
                let sentence = format!("obstacle \"{}\" is given twice, expected each name once", obstacle.name);
                return Err(source.field_error(&raw.name, &sentence));
            }
            obstacles.push(obstacle);
        }
        if let Some(RawBoundary { polygon, keep_out }) = &self.boundary {
            let corners = corners(source, "stage.boundary.polygon", polygon, 3)?;
            simple(source, "stage.boundary.polygon", polygon, &corners)?;
            let keep_out = distance(source, "stage.boundary.keep_out", keep_out.as_ref())?;
            obstacles.push(Obstacle { name: BOUNDARY.to_owned(), shape: Shape::boundary(corners), keep_out });
        }
        Ok(Ground::new(obstacles))
    }
}

impl RawObstacle {
    fn validated(&self, source: &Source) -> Result<Obstacle, SceneError> {
        let name = source.printable("stage.obstacles.name", &self.name)?.trim().to_owned();
        if name.is_empty() {
            return Err(source.field_error(&self.name, "stage.obstacles.name is empty, expected a name"));
        }
        if name == BOUNDARY {
            let sentence = "stage.obstacles.name is \"boundary\", the name of stage.boundary, expected another name";
            return Err(source.field_error(&self.name, sentence));
        }
        if name.len() > MOST_NAME_BYTES {
            let bytes = name.len();
            let sentence =
                format!("stage.obstacles.name has {bytes} bytes, expected at most {MOST_NAME_BYTES} bytes of UTF-8");
            return Err(source.field_error(&self.name, &sentence));
        }
        let of = |field: &str| format!("{field} of obstacle \"{}\"", printable(&name));
        let shape = match (&self.circle, &self.polygon, &self.line) {
            (Some(RawCircle { center, radius }), None, None) => {
                let centre = source.place(&of("circle.center"), Some(center))?;
                Shape::circle(centre.into(), source.check(&of("circle.radius"), radius, Accepted::RADIUS)?)
            }
            (None, Some(polygon), None) => {
                let corners = corners(source, &of("polygon"), polygon, 3)?;
                simple(source, &of("polygon"), polygon, &corners)?;
                Shape::polygon(corners)
            }
            (None, None, Some(line)) => Shape::line(corners(source, &of("line"), line, 2)?),
            _ => {
                let sentence = format!("obstacle \"{name}\" has to be given one of circle, polygon and line");
                return Err(source.field_error(&self.name, &sentence));
            }
        };
        let keep_out = distance(source, &of("keep_out"), self.keep_out.as_ref())?;
        Ok(Obstacle { name, shape, keep_out })
    }
}

/// Returns a keep-out; by default 0.
fn distance(source: &Source, field: &str, value: Option<&Spanned<f64>>) -> Result<f64, SceneError> {
    value.map_or(Ok(0.0), |value| source.check(field, value, Accepted::KEEP_OUT))
}

/// Returns the corners of a line or polygon, no two in succession equal.
fn corners(
    source: &Source,
    field: &str,
    list: &Spanned<Vec<Spanned<[f64; 2]>>>,
    least: usize,
) -> Result<Vec<Point>, SceneError> {
    let given = list.get_ref();
    if !(least..=MOST_CORNERS).contains(&given.len()) {
        let count = given.len();
        let sentence = format!("{field} has {count} corners, expected {least} to {MOST_CORNERS}");
        return Err(source.field_error(list, &sentence));
    }
    let place = |corner: &Spanned<[f64; 2]>| source.place(&format!("a corner of {field}"), Some(corner));
    let corners = given.iter().map(|corner| place(corner).map(Point::from)).collect::<Result<Vec<_>, _>>()?;
    match (1..corners.len()).find(|k| corners[*k] == corners[k - 1]) {
        Some(k) => {
            let sentence = format!("corners {k} and {} of {field} are equal, expected two places", k + 1);
            Err(source.field_error(&given[k], &sentence))
        }
        None => Ok(corners),
    }
}

/// Refuses a polygon whose sides meet elsewhere than at their common corners.
fn simple(
    source: &Source,
    field: &str,
    list: &Spanned<Vec<Spanned<[f64; 2]>>>,
    corners: &[Point],
) -> Result<(), SceneError> {
    let count = corners.len();
    let side = |k: usize| (corners[k], corners[(k + 1) % count]);
    let refused = |k: usize, sentence: String| Err(source.field_error(&list.get_ref()[k], &sentence));
    if corners[0] == corners[count - 1] {
        let sentence = format!("corners {count} and 1 of {field} are equal, expected each corner once");
        return refused(count - 1, sentence);
    }
    for a in 0..count {
        for b in a + 1..count {
            let meets = match (b - a, a + count - b) {
                (1, _) => folds_back(side(a).0, side(a).1, side(b).1),
                (_, 1) => folds_back(side(b).0, side(b).1, side(a).1),
                _ => meet(side(a), side(b)),
            };
            if meets {
                let sentence = format!(
                    "sides {} and {} of {field} meet, expected a polygon whose sides meet at its corners only",
                    a + 1,
                    b + 1
                );
                return refused(b, sentence);
            }
        }
    }
    Ok(())
}

/// Returns the side of the line from `a` to `b` on which `c` lies, exactly: its sign.
fn side_of(a: Point, b: Point, c: Point) -> f64 {
    let [a, b, c] = [a, b, c].map(|point| Coord { x: point.x, y: point.y });
    orient2d(a, b, c)
}

/// Returns true if the side from `middle` to `to` lies on the side from `from` to `middle`.
fn folds_back(from: Point, middle: Point, to: Point) -> bool {
    side_of(from, middle, to) == 0.0 && (middle - from).dot(&(to - middle)) <= 0.0
}

/// Returns true if two segments have a common point.
fn meet((a, b): (Point, Point), (c, d): (Point, Point)) -> bool {
    let across = |one: f64, other: f64| (one > 0.0 && other < 0.0) || (one < 0.0 && other > 0.0);
    let ends = [side_of(a, b, c), side_of(a, b, d), side_of(c, d, a), side_of(c, d, b)];
    let within = |from: Point, to: Point, point: Point| {
        let between = |from: f64, to: f64, at: f64| from.min(to) <= at && at <= from.max(to);
        between(from.x, to.x, point.x) && between(from.y, to.y, point.y)
    };
    (across(ends[0], ends[1]) && across(ends[2], ends[3]))
        || (ends[0] == 0.0 && within(a, b, c))
        || (ends[1] == 0.0 && within(a, b, d))
        || (ends[2] == 0.0 && within(c, d, a))
        || (ends[3] == 0.0 && within(c, d, b))
}
