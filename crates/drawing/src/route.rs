//! The path as the data of an SVG path element, in metres, as far as the picture shows it.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::fmt::Write;

use super::camera::Camera;
use super::metres;
use bench_dragon_motion::Motion;
use bench_dragon_motion::model::description::PathDescription;
use bench_dragon_motion::model::segment::{OutlineKind, SegmentOutline};
use bench_dragon_motion::model::spiral::Direction;
use bench_dragon_motion::model::{Point, Vector};
use bench_dragon_motion::placement::Placement;

/// Cubic curves per turn of a spiral: their error is at most 0.02 mm at the paper's scale.
const CURVES_PER_TURN: f64 = 24.0;

/// Sheet units between turns below which a spiral is not drawn: it would be a grey disc.
const LEAST_PITCH: f64 = 1.5;

/// Returns the data of the path in the picture of a camera. The path behind the start, where the team stands, is drawn
/// to the edge of the picture.
pub fn data(motion: &Motion, camera: &Camera) -> String {
    let (view, outline) = (camera.view(), motion.outline());
    let mut data = String::new();
    let mut is_route = false;
    match motion.description() {
        PathDescription::Spiral { pitch, .. } => {
            spiral(&mut data, Direction::Inward, *pitch, (0.0, f64::MAX), motion.placement(), camera);
        }
        PathDescription::Turnaround { pitch, turn_radius, .. } => {
            let turn = TAU * turn_radius / pitch;
            spiral(&mut data, Direction::Inward, *pitch, (turn, f64::MAX), motion.placement(), camera);
        }
        PathDescription::Route { .. } => {
            is_route = true;
            if let Some(SegmentOutline { start, heading, .. }) = outline.first() {
                let reach = (view.centre() - start).norm() + view.width() + view.height();
                line(&mut data, start - reach * direction(*heading), *start);
            }
        }
    }
    for segment in outline {
        match segment.kind {
            OutlineKind::Line => {
                line(&mut data, segment.start, segment.start + segment.length * direction(segment.heading));
            }
            OutlineKind::Arc { curvature } => arc(&mut data, &segment, curvature),
            // Drawn above, with the path behind the start.
            OutlineKind::Spiral { direction: Direction::Inward, .. } if !is_route => {}
            OutlineKind::Spiral { direction, pitch, first, last, .. } => {
                if let Some(placement) = Placement::of_spiral(&segment) {
                    spiral(&mut data, direction, pitch, (first.min(last), first.max(last)), &placement, camera);
                }
            }
        }
    }
    data
}

fn direction(heading: f64) -> Vector {
    Vector::new(heading.cos(), heading.sin())
}

fn pair(point: Point) -> String {
    format!("{} {}", metres(point.x), metres(point.y))
}

fn line(data: &mut String, from: Point, to: Point) {
    // Writing to a String cannot fail, here and below.
    let _ = write!(data, "M{}L{}", pair(from), pair(to));
}

/// Returns the point of an arc after a part of its length.
fn arc_point(segment: &SegmentOutline, curvature: f64, part: f64) -> Point {
    let left = direction(segment.heading + FRAC_PI_2);
    let centre = segment.start + left / curvature;
    centre + nalgebra::Rotation2::new(part * curvature * segment.length) * (segment.start - centre)
}

fn arc(data: &mut String, segment: &SegmentOutline, curvature: f64) {
    let radius = metres(1.0 / curvature.abs());
    let left = u8::from(curvature > 0.0);
    // Each arc is at most a third of a turn, so that the large-arc flag is never needed. SVG does not allow a whole
    // circle as one arc.
    let steps = (curvature.abs() * segment.length / (TAU / 3.0)).ceil().max(1.0);
    let _ = write!(data, "M{}", pair(segment.start));
    for step in 1..=steps as u64 {
        let to = arc_point(segment, curvature, step as f64 / steps);
        let _ = write!(data, "A{radius} {radius} 0 0 {left} {}", pair(to));
    }
}

/// Returns a e(theta), metres per radian outward, in the direction of a polar angle.
fn unwound(way: Direction, pitch: f64, theta: f64) -> Vector {
    let radius_per_radian = match way {
        Direction::Inward => pitch / TAU,
        Direction::Outward => -pitch / TAU,
    };
    radius_per_radian * direction(theta)
}

fn spiral_point(way: Direction, pitch: f64, theta: f64) -> Point {
    Point::from(theta * unwound(way, pitch, theta))
}

/// Appends the turns of a placed spiral between two polar angles that the picture can show, as cubic curves.
fn spiral(
    data: &mut String,
    direction: Direction,
    pitch: f64,
    (from, to): (f64, f64),
    placement: &Placement,
    camera: &Camera,
) {
    if pitch * camera.scale < LEAST_PITCH {
        return;
    }
    let (near, far) = camera.view().radii(placement.origin());
    let (from, to) = (from.max(TAU * near / pitch - TAU), to.min(TAU * far / pitch + TAU));
    if from >= to {
        return;
    }
    let steps = ((to - from) / TAU * CURVES_PER_TURN).ceil();
    let step = (to - from) / steps;
    // The handles of a circle's cubic, 4/3 tan(step / 4) of its radius, in place of a third of the step: three more
    // digits.
    let handle = 4.0 / 3.0 * (0.25 * step).tan();
    let at = |theta: f64| {
        // d/dtheta of a theta e(theta) is a e + a theta e'.
        let (point, outward) = (spiral_point(direction, pitch, theta), unwound(direction, pitch, theta));
        (placement.point(point), placement.vector(outward + Vector::new(-point.y, point.x)))
    };
    let (mut point, mut rate) = at(from);
    let _ = write!(data, "M{}", pair(point));
    for k in 1..=steps as u64 {
        let (next, next_rate) = at(from + k as f64 * step);
        let _ = write!(data, "C{} {} {}", pair(point + handle * rate), pair(next - handle * next_rate), pair(next));
        (point, rate) = (next, next_rate);
    }
}

#[cfg(test)]
mod tests {
    use super::super::camera::{StageBox, Viewport};
    use super::*;
    use bench_dragon_motion::Method;
    use bench_dragon_motion::model::curve::Side;
    use bench_dragon_motion::model::description::RouteStep;
    use bench_dragon_motion::model::team::{Ends, Team};

    const TEAM: Team =
        Team { benches: 20, head_length: 3.41, body_length: 2.2, width: 0.3, hole_inset: 0.275, ends: Ends::NONE };

    fn camera(width: f64) -> Camera {
        let viewport = Viewport { left: 0.0, top: 0.0, width: 1000.0, height: 1000.0 };
        Camera::showing(&StageBox::around(Point::origin(), width, width), viewport)
    }

    /// Returns the points of the data of cubic curves, four for each.
    fn curves(data: &str) -> Vec<[Point; 4]> {
        let numbers: Vec<f64> = data.split(['M', 'C', ' ']).filter_map(|number| number.parse().ok()).collect();
        let points: Vec<Point> = numbers.chunks(2).map(|pair| Point::new(pair[0], pair[1])).collect();
        (0..points.len() / 3)
            .map(|k| [points[3 * k], points[3 * k + 1], points[3 * k + 2], points[3 * k + 3]])
            .collect()
    }

    #[test]
    fn the_curves_lie_on_the_spiral() {
        for pitch in [0.55, 1.7] {
            let description = PathDescription::Spiral { pitch, start_turn: 16.0 };
            let motion = Motion::new(description, TEAM, 1.0, Method::Newton).unwrap();
            let drawn = curves(&data(&motion, &camera(20.0)));
            assert!(drawn.len() as f64 > 10.0 / pitch * CURVES_PER_TURN, "{} curves", drawn.len());
            let mut worst = 0f64;
            for [a, b, c, d] in drawn {
                for part in [0.0, 0.2, 0.5, 0.7] {
                    let [ab, bc, cd] = [(a, b), (b, c), (c, d)].map(|(p, q)| p + part * (q - p));
                    let [abc, bcd] = [(ab, bc), (bc, cd)].map(|(p, q)| p + part * (q - p));
                    let point = abc + part * (bcd - abc);
                    // The spiral has a point at this polar angle every pitch of radius.
                    let turns = point.coords.norm() / pitch - point.y.atan2(point.x) / TAU;
                    worst = worst.max((turns - turns.round()).abs() * pitch);
                }
            }
            assert!(worst < 2e-5 * pitch / 0.55, "{worst} m beside the spiral");
        }
    }

    /// A spiral piece is drawn from its beginning to its end, on the path's own points.
    #[test]
    fn the_spirals_of_a_route_lie_on_the_path() {
        for (side, direction) in [(Side::Left, Direction::Inward), (Side::Right, Direction::Outward)] {
            let piece = RouteStep::Spiral { side, direction, pitch: 1.7, radius: 6.0.into(), turns: 2.25.into() };
            let steps = vec![RouteStep::Line { length: 3.0 }, piece];
            let description = PathDescription::Route { heading_turns: 0.1, steps };
            let motion = Motion::new(description, TEAM, 1.0, Method::Newton).unwrap();
            let motion = motion.placed(Placement::new(Vector::new(2.0, -1.0), 0.3, true));
            let drawn = data(&motion, &camera(60.0));
            // The line behind the start, the line, the spiral.
            let moves: Vec<usize> = drawn.match_indices('M').map(|(at, _)| at).collect();
            let drawn = curves(&drawn[moves[2]..]);
            let path = motion.path();
            let ends = [3.0, path.length()].map(|s| motion.placement().point(path.point(path.param_at(s))));
            let has =
                |end: &Point| drawn.iter().any(|curve| [curve[0], curve[3]].iter().any(|p| (p - end).norm() < 1e-6));
            assert!(ends.iter().all(has));
            let on_path: Vec<Point> = (0..200_000)
                .map(|k| path.point(path.param_at(3.0 + f64::from(k) * (path.length() - 3.0) / 199_999.0)))
                .map(|point| motion.placement().point(point))
                .collect();
            for [a, b, c, d] in drawn {
                let middle = Point::from((a.coords + 3.0 * b.coords + 3.0 * c.coords + d.coords) / 8.0);
                let away = on_path.iter().map(|point| (point - middle).norm()).fold(f64::INFINITY, f64::min);
                assert!(away < 4e-4, "{away} m beside the path");
            }
        }
    }

    #[test]
    fn a_spiral_too_fine_for_the_picture_is_left_out_and_a_near_view_has_few_turns() {
        let description = PathDescription::Spiral { pitch: 0.55, start_turn: 2000.0 };
        let motion = Motion::new(description, TEAM, 1.0, Method::Newton).unwrap();
        assert_eq!(data(&motion, &camera(1000.0)), "");
        let viewport = Viewport { left: 0.0, top: 0.0, width: 1000.0, height: 1000.0 };
        let near = Camera::showing(&StageBox::around(Point::new(1000.0, 0.0), 4.0, 4.0), viewport);
        let turns = curves(&data(&motion, &near)).len() as f64 / CURVES_PER_TURN;
        assert!((7.0..12.0).contains(&turns), "{turns} turns");
    }

    #[test]
    fn a_route_comes_from_beyond_the_picture_and_its_arcs_have_both_ends() {
        let steps = vec![
            RouteStep::Line { length: 3.0 },
            RouteStep::Arc { side: Side::Left, radius: 2.0.into(), turns: 1.25.into() },
        ];
        let description = PathDescription::Route { heading_turns: 0.0, steps };
        let motion = Motion::new(description, TEAM, 1.0, Method::Newton).unwrap();
        let motion = motion.placed(Placement::IDENTITY.after_moving_by(Vector::new(1.0, 1.0)));
        let drawn = data(&motion, &camera(20.0));
        let behind: f64 = drawn[1..].split(' ').next().unwrap().parse().unwrap();
        assert!(behind < -10.0 && drawn.contains("L1 1M1 1L4 1M4 1A2 2 0 0 1 "), "{drawn}");
        assert!(drawn.ends_with(" 6 3"), "{drawn}");
    }
}
