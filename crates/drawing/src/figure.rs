//! The dragon's head and tail in three dimensions for the look from a seat: balls of lit paper and tapered tufts.
//!
//! Lengths are metres along the board, to its left, and upward, as in `crates/outputs/src/view/dragon_figure.js`.

use svg::node::element::{Circle, Group, Path};

use super::eye::{Eye, Spot};
use super::rounded;
use bench_dragon_motion::model::{Point, Vector};

/// The place of a figure on the stage.
#[derive(Debug, Clone, Copy)]
pub struct Placed {
    /// The origin.
    pub origin: Point,
    /// The unit vector forward.
    pub axis: Vector,
}

/// The profile of skull and muzzle: forward, up, radius.
const SKULL: [[f64; 3]; 9] = [
    [-0.12, 2.13, 0.4],
    [0.04, 2.18, 0.44],
    [0.2, 2.22, 0.41],
    [0.36, 2.23, 0.34],
    [0.54, 2.18, 0.285],
    [0.72, 2.13, 0.25],
    [0.9, 2.1, 0.235],
    [1.04, 2.11, 0.215],
    [1.19, 2.13, 0.165],
];
/// The places along a tuft.
const STEPS: u32 = 6;

/// The shapes of a figure with their depths.
struct Shapes<'a> {
    eye: &'a Eye,
    placed: Placed,
    found: Vec<(f64, Group)>,
}

impl<'a> Shapes<'a> {
    fn new(eye: &'a Eye, placed: Placed) -> Self {
        Self { eye, placed, found: Vec::new() }
    }

    fn spot(&self, [u, v, w]: [f64; 3]) -> Option<Spot> {
        let Placed { origin, axis } = self.placed;
        self.eye.spot(origin + u * axis + v * Vector::new(-axis.y, axis.x), w)
    }

    fn ball(&mut self, at: [f64; 3], radius: f64, fill: &str) {
        if let Some(spot) = self.spot(at) {
            let ball = Circle::new().set("cx", rounded(spot.x, 1)).set("cy", rounded(spot.y, 1));
            let ball = ball.set("r", rounded(radius * spot.scale, 2)).set("fill", fill.to_owned());
            self.found.push((spot.depth, Group::new().add(ball)));
        }
    }

    /// Adds a tuft through places of a share from 0 to 1, each with a radius.
    fn tuft(&mut self, colour: &str, rim: &str, at: impl Fn(f64) -> ([f64; 3], f64)) {
        let spots: Option<Vec<(Spot, f64)>> = (0..=STEPS)
            .map(|step| at(f64::from(step) / f64::from(STEPS)))
            .map(|(place, radius)| self.spot(place).map(|spot| (spot, radius * spot.scale)))
            .collect();
        let Some(spots) = spots else { return };
        let (mut left, mut right) = (Vec::new(), Vec::new());
        for (step, (spot, radius)) in spots.iter().enumerate() {
            let (from, to) = (spots[step.saturating_sub(1)].0, spots[(step + 1).min(spots.len() - 1)].0);
            let long = (to.x - from.x).hypot(to.y - from.y).max(1e-9);
            let (across, along) = (radius * (to.y - from.y) / long, radius * (to.x - from.x) / long);
            left.push(format!("{} {}", rounded(spot.x + across, 1), rounded(spot.y - along, 1)));
            right.push(format!("{} {}", rounded(spot.x - across, 1), rounded(spot.y + along, 1)));
        }
        right.reverse();
        left.append(&mut right);
        let path = Path::new().set("d", format!("M{}Z", left.join("L"))).set("fill", colour.to_owned());
        let path = path.set("stroke", rim.to_owned()).set("stroke-width", rounded(0.014 * spots[0].0.scale, 2));
        self.found.push((spots[spots.len() / 2].0.depth, Group::new().add(path)));
    }

    fn group(mut self, name: &str) -> Group {
        self.found.sort_by(|one, other| other.0.total_cmp(&one.0));
        let group = Group::new().set("id", name).set("stroke-linejoin", "round");
        self.found.into_iter().fold(group, |group, (_, shape)| group.add(shape))
    }
}

/// Returns the head, whose origin is 1.1 m behind the end of its board.
pub fn head(eye: &Eye, placed: Placed) -> Group {
    let mut shapes = Shapes::new(eye, placed);
    for k in 0..18 {
        let k = f64::from(k);
        let fill = if k % 4.0 == 1.0 { "url(#lit-gold)" } else { "url(#skin)" };
        shapes.ball([-1.75 + 0.097 * k, 0.0, 1.36 + 0.0026 * k * k], 0.2 + 0.009 * k, fill);
    }
    for pair in SKULL.windows(2) {
        for part in 0..3 {
            let part = f64::from(part) / 3.0;
            let [u, w, radius] = [0, 1, 2].map(|axis| pair[0][axis] + (pair[1][axis] - pair[0][axis]) * part);
            shapes.ball([u, 0.0, w], radius, "url(#skin)");
        }
    }
    shapes.ball([1.19, 0.0, 2.13], 0.165, "url(#skin)");
    for k in 0..9 {
        let k = f64::from(k);
        shapes.ball([0.42 + 0.09 * k, 0.0, 2.46 - 0.031 * k], 0.058, "url(#lit-gold)");
        shapes.ball([0.34 + 0.085 * k, 0.0, 1.8 - 0.0165 * k], 0.2 - 0.0094 * k, "url(#skin)");
    }
    for side in [1.0, -1.0] {
        face(&mut shapes, side);
    }
    for (ring, (reach, out, colour)) in
        [(1.25, 0.46, "#c91a16"), (0.95, 0.4, "#f0501a"), (0.62, 0.36, "#ff9a2e")].into_iter().enumerate()
    {
        for flame in 0..17 {
            let angle = -0.75 + (f64::from(flame) + 0.5 * (ring % 2) as f64) / 16.0 * 4.64;
            let long = reach * (0.9 + 0.2 * f64::from(flame % 3) - 0.1);
            let (sine, cosine) = angle.sin_cos();
            shapes.tuft(colour, "#3a0405", |q| {
                let spread = out + 0.34 * q * q;
                let place = [0.1 * ring as f64 - 0.08 - long * q, cosine * spread, 2.16 + sine * spread];
                (place, 0.1 * (1.0 - q.powf(1.4)))
            });
        }
    }
    shapes.group("head")
}

/// Adds one side of the face: cheek, nostril, teeth, eye, horn, brow, ear, beard, whisker.
fn face(shapes: &mut Shapes, side: f64) {
    shapes.ball([0.24, 0.28 * side, 2.0], 0.24, "url(#skin)");
    shapes.ball([0.08, 0.4 * side, 1.98], 0.13, "url(#lit-gold)");
    shapes.ball([1.2, 0.1 * side, 2.2], 0.095, "url(#lit-gold)");
    shapes.ball([1.27, 0.118 * side, 2.205], 0.042, "#260606");
    for k in 0..7 {
        let k = f64::from(k);
        shapes.ball([0.64 + 0.08 * k, (0.216 - 0.012 * k) * side, 1.94], 0.036, "url(#white)");
    }
    shapes.ball([0.43, 0.265 * side, 2.375], 0.168, "url(#lit-gold)");
    shapes.ball([0.5, 0.292 * side, 2.385], 0.135, "url(#white)");
    shapes.ball([0.6, 0.335 * side, 2.395], 0.064, "#260606");
    let horn = ("#e0a23c", "#331602");
    shapes.tuft(horn.0, horn.1, |q| {
        ([0.02 - 0.95 * q, (0.18 + 0.34 * q) * side, 2.5 + 0.7 * (1.75 * q).sin()], 0.092 * (1.0 - 0.8 * q))
    });
    shapes.tuft(horn.0, horn.1, |q| {
        ([-0.36 - 0.02 * q, (0.31 + 0.24 * q) * side, 2.88 + 0.36 * q], 0.06 * (1.0 - 0.8 * q))
    });
    for k in 0..3 {
        let k = f64::from(k);
        shapes.tuft("#1fae80", "#021d14", |q| {
            let place = [0.66 - 0.64 * q - 0.05 * k, (0.3 + 0.05 * q) * side, 2.5 + 0.05 * k + (0.1 + 0.1 * k) * q];
            (place, 0.07 * (3.1 * (0.2 + 0.8 * q)).sin())
        });
    }
    for k in 0..4 {
        let k = f64::from(k);
        shapes.tuft("#0f8a64", "#021d14", |q| {
            ([0.95 - 0.15 * k - 0.18 * q, (0.1 + 0.02 * k) * side, 1.59 - 0.4 * q], 0.05 * (1.0 - 0.95 * q))
        });
    }
    shapes.tuft("#1fae80", "#021d14", |q| {
        ([-0.05 - 0.44 * q, (0.4 + 0.36 * q) * side, 2.2 + 0.24 * q], 0.1 * (3.1 * (0.3 + 0.7 * q)).sin())
    });
    shapes.tuft("#ffdf90", "#5a2404", |q| {
        let place =
            [1.18 + 0.42 * (2.8 * q).sin() - 0.55 * q, (0.17 + 0.95 * q) * side, 2.08 + 0.3 * q * (3.6 * q).sin()];
        (place, 0.03 * (1.0 - 0.75 * q))
    });
}

/// Returns the tail, whose origin is the end of its board.
pub fn tail(eye: &Eye, placed: Placed) -> Group {
    let mut shapes = Shapes::new(eye, placed);
    for k in 0..5 {
        let k = f64::from(k);
        shapes.ball([0.5 - 0.13 * k, 0.0, 1.36], 0.2 - 0.01 * k, "url(#skin)");
    }
    for (rank, colour) in [(0.0, "#c91a16"), (1.0, "#ff9a2e")] {
        for flame in -3..=3 {
            let flame = f64::from(flame);
            let long = (1.35 - 0.35 * rank) * (1.0 - 0.1 * flame.abs());
            shapes.tuft(colour, "#3a0405", |q| {
                let up = 0.95 - 0.12 * flame.abs() + 0.2 * rank;
                ([-0.05 - long * q, 0.1 * flame * (0.5 + 2.1 * q), 1.34 + up * q], 0.12 * (1.0 - q.powf(1.4)))
            });
        }
    }
    shapes.group("tail")
}
