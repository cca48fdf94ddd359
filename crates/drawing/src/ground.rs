//! The obstacles and the boundary of a stage, with their keep-outs and names.

use svg::node::element::{Circle, Group, Path, Title};

use super::camera::{Camera, StageBox};
use super::palette::Palette;
use super::{metres, sheet, text};
use bench_dragon_motion::ground::{Ground, Obstacle};
use bench_dragon_motion::model::shape::{Shape, ShapeKind};
use bench_dragon_motion::model::{Point, Vector};

/// Adds the obstacles and the boundary to the content of a picture.
pub fn include(ground: &Ground, shown: &mut StageBox) {
    for Obstacle { shape, keep_out, .. } in ground.obstacles() {
        let beyond = shape.radius() + if shape.kind() == ShapeKind::Boundary { 0.0 } else { *keep_out };
        for point in shape.points() {
            shown.include(point - Vector::repeat(beyond));
            shown.include(point + Vector::repeat(beyond));
        }
    }
}

/// Returns the obstacles, in metres: the dashes around all keep-outs, all keep-outs, then all shapes, each titled with
/// its name.
pub fn group(ground: &Ground, camera: &Camera, palette: &Palette) -> Group {
    let (mut rims, dash) = (Group::new().set("id", "keep-out-rims").set("fill", "none"), camera.metres(6.0));
    rims = rims.set("stroke", palette.quiet).set("stroke-width", camera.metres(2.5)).set("stroke-dasharray", dash);
    let (mut keep_outs, mut shapes) = (Group::new(), Group::new().set("stroke-linejoin", "round"));
    for Obstacle { name, shape, keep_out } in ground.obstacles() {
        // Half of a round stroke lies on either side of an outline.
        let around = metres(2.0 * keep_out);
        let round = |path: Path| path.set("stroke-linejoin", "round").set("stroke-linecap", "round");
        if *keep_out > 0.0 {
            rims = rim(shape, *keep_out).into_iter().fold(rims, Group::add);
            keep_outs = match shape.kind() {
                ShapeKind::Circle => keep_outs.add(disc(shape, keep_out + shape.radius())),
                _ => keep_outs.add(round(outline(shape)).set("stroke", palette.line).set("stroke-width", around)),
            };
        }
        let title = Title::new(text(name));
        shapes = match shape.kind() {
            ShapeKind::Circle => shapes.add(disc(shape, shape.radius()).set("fill", palette.still).add(title)),
            ShapeKind::Polygon => shapes.add(outline(shape).set("fill", palette.still).add(title)),
            ShapeKind::Line | ShapeKind::Boundary => {
                let thin = outline(shape).set("stroke", palette.quiet).set("stroke-width", camera.metres(2.0));
                shapes.add(thin.add(title))
            }
        };
    }
    let keep_outs = keep_outs.set("id", "keep-outs").set("fill", palette.line);
    Group::new().set("id", "ground").add(rims).add(keep_outs).add(shapes.set("id", "obstacles"))
}

/// Returns the outline of a keep-out: the outlines of the sides of a shape, one over the other. The keep-out covers
/// their inner parts.
fn rim(shape: &Shape, keep_out: f64) -> Vec<Path> {
    let radius = metres(keep_out);
    let around = |[from, to]: [Point; 2]| {
        let along = to - from;
        let aside = Vector::new(-along.y, along.x) * (keep_out / along.norm());
        let [a, b, c, d] = [from - aside, to - aside, to + aside, from + aside]
            .map(|corner| format!("{} {}", metres(corner.x), metres(corner.y)));
        let arc = format!("A{radius} {radius} 0 0 1");
        Path::new().set("d", format!("M{a}L{b}{arc} {c}L{d}{arc} {a}Z"))
    };
    if shape.kind() == ShapeKind::Circle {
        let (centre, radius) = (shape.points()[0], shape.radius() + keep_out);
        let [left, right] = [-radius, radius].map(|at| format!("{} {}", metres(centre.x + at), metres(centre.y)));
        let arc = format!("A{0} {0} 0 0 1", metres(radius));
        return vec![Path::new().set("d", format!("M{left}{arc} {right}{arc} {left}Z"))];
    }
    let points = shape.points();
    let closing = (shape.kind() != ShapeKind::Line).then(|| [points[points.len() - 1], points[0]]);
    let open = points.windows(2).map(|pair| [pair[0], pair[1]]);
    open.chain(closing).map(around).collect()
}

/// Returns the names of the obstacles, each at a point of its shape, for those in the picture.
pub fn labels(ground: &Ground, camera: &Camera, palette: &Palette) -> Group {
    let named = ground.obstacles().iter().filter(|obstacle| obstacle.shape.kind() != ShapeKind::Boundary);
    let placed = named.map(|obstacle| (obstacle, middle(&obstacle.shape)));
    let seen = placed.filter(|(_, place)| camera.view().contains(*place));
    seen.fold(Group::new().set("id", "obstacle-names"), |group, (obstacle, place)| {
        group.add(label(&text(&obstacle.name), camera.sheet(place), camera, palette))
    })
}

/// Returns a name with a rim in the background's colour, within the viewport.
fn label(name: &str, (x, y): (f64, f64), camera: &Camera, palette: &Palette) -> Group {
    let half = 0.5 * sheet::width_of(name, 16.0) + 6.0;
    let viewport = camera.viewport;
    let x = x.min(viewport.right() - half).max(viewport.left + half);
    let y = y.min(viewport.bottom() - 10.0).max(viewport.top + 20.0);
    let place =
        |colour| sheet::words(name, (x, y + 5.0), 16, colour).set("text-anchor", "middle").set("font-weight", 600);
    let rim = place(palette.ground).set("stroke", palette.ground).set("stroke-width", 5);
    Group::new().add(rim.set("stroke-linejoin", "round")).add(place(palette.quiet))
}

/// Returns a point of a shape for its name: the middle of the corners; for a line, the middle of a side halfway along.
pub fn middle(shape: &Shape) -> Point {
    let points = shape.points();
    match shape.kind() {
        ShapeKind::Line => {
            points[points.len() / 2 - 1] + 0.5 * (points[points.len() / 2] - points[points.len() / 2 - 1])
        }
        _ => Point::from(points.iter().map(|point| point.coords).sum::<Vector>() / points.len() as f64),
    }
}

fn disc(shape: &Shape, radius: f64) -> Circle {
    let centre = shape.points()[0];
    Circle::new().set("cx", metres(centre.x)).set("cy", metres(centre.y)).set("r", metres(radius))
}

fn outline(shape: &Shape) -> Path {
    let corners: Vec<String> =
        shape.points().iter().map(|corner| format!("{} {}", metres(corner.x), metres(corner.y))).collect();
    let close = if shape.kind() == ShapeKind::Line { "" } else { "Z" };
    let fill = if shape.kind() == ShapeKind::Polygon { "inherit" } else { "none" };
    Path::new().set("d", format!("M{}{close}", corners.join("L"))).set("fill", fill)
}
