//! The handles of obstacles and of the boundary.

use super::{Found, Ray, Track};
use crate::edit::Change;
use bench_dragon_motion::ground::{Ground, Obstacle};
use bench_dragon_motion::model::shape::ShapeKind;
use bench_dragon_motion::model::{Point, Vector};

/// Adds the handles of a ground.
pub(super) fn add(found: &mut Found<'_>, ground: &Ground) {
    for (k, obstacle) in ground.obstacles().iter().enumerate() {
        let name = format!("stage.obstacles[{k}]");
        match obstacle.shape.kind() {
            ShapeKind::Circle => add_circle(found, &name, obstacle),
            ShapeKind::Polygon => add_corners(found, &name, "polygon", obstacle),
            ShapeKind::Line => add_corners(found, &name, "line", obstacle),
            ShapeKind::Boundary => add_corners(found, "stage.boundary", "polygon", obstacle),
        }
    }
}

fn add_circle(found: &mut Found<'_>, name: &str, obstacle: &Obstacle) {
    let (centre, radius) = (obstacle.shape.points()[0], obstacle.shape.radius());
    found.add_place(format!("{name}.circle.center"), "centre", centre);
    let field = format!("{name}.circle.radius");
    let rim = Track { ray: Ray { origin: centre, direction: Vector::x() }, at: radius, step: 1.0 };
    found.add_on_track(field.clone(), "rim", field, rim, |metres| metres);
    let outward = Ray { origin: centre, direction: Vector::y() };
    add_keep_out(found, name, outward, radius, obstacle.keep_out);
}

/// Adds the handle of a keep-out that the text states. `ray` meets the shape at `begin`.
fn add_keep_out(found: &mut Found<'_>, name: &str, ray: Ray, begin: f64, keep_out: f64) {
    let field = format!("{name}.keep_out");
    if found.scene.values.number(&field).is_some() {
        let track = Track { ray, at: begin + keep_out, step: 1.0 };
        found.add_on_track(field.clone(), "keep_out", field, track, move |metres| metres - begin);
    }
}

/// Adds the handles of a shape with corners.
fn add_corners(found: &mut Found<'_>, name: &str, list: &str, obstacle: &Obstacle) {
    let corners = obstacle.shape.points();
    let (is_boundary, is_line) = (obstacle.shape.kind() == ShapeKind::Boundary, list == "line");
    let kind = if is_boundary { "boundary" } else { "corner" };
    let names: Vec<String> = (0..corners.len()).map(|k| format!("{name}.{list}[{k}]")).collect();
    if !is_boundary {
        let middle = Point::from(corners.iter().map(|corner| corner.coords).sum::<Vector>() / corners.len() as f64);
        let whole: Vec<(String, Point)> = names.iter().cloned().zip(corners.iter().copied()).collect();
        found.add(format!("{name}.{list}"), "centre", middle, Vec::new(), move |pull| {
            let by = pull.place() - middle;
            whole.iter().map(|(name, corner)| Change::place(name, corner + by)).collect()
        });
    }
    for (name, corner) in names.into_iter().zip(corners) {
        found.add_place(name, kind, *corner);
    }
    let by = corners[1] - corners[0];
    // A polygon has its inside to the left if it turns counter-clockwise; a line has no inside.
    let turns_left = signed_area(corners) > 0.0;
    let outward = if turns_left { Vector::new(by.y, -by.x) } else { Vector::new(-by.y, by.x) };
    let direction = if is_boundary && !is_line { -outward } else { outward };
    let ray = Ray::towards(middle_of(corners[0], corners[1]), middle_of(corners[0], corners[1]) + direction);
    add_keep_out(found, name, ray, 0.0, obstacle.keep_out);
}

fn middle_of(one: Point, other: Point) -> Point {
    one + 0.5 * (other - one)
}

/// Returns twice the area of a polygon, positive if it turns counter-clockwise.
fn signed_area(corners: &[Point]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(one, other)| one.coords.perp(&other.coords)).sum()
}
