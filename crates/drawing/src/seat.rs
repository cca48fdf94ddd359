//! The look from a seat: the dragon as a spectator sees it, at night before a village, without script or filter.
//!
//! The look is that of the page's seat (`crates/outputs/src/view/seat.js`), with the same eye. Boards and places are
//! true; heights and people are ornament.

use svg::node::element::{
    Circle, Definitions, Ellipse, Group, Line, LinearGradient, Path, Polygon, RadialGradient, Rectangle, Stop, Text,
};

use super::camera::StageBox;
use super::eye::{Eye, Spot};
use super::figure::{self, Placed};
use super::light::Light;
use super::look::Seat;
use super::village::{self, used};
use super::{Drawing, FACE, WIDTH, rounded};
use bench_dragon_motion::model::Point;
use bench_dragon_motion::model::board::Board;
use bench_dragon_motion::solve::Chain;

/// The height of a sheet as a share of its width.
pub const SHAPE: f64 = 0.5625;
/// The height of the boards and their thickness, in metres.
const BOARD: f64 = 1.18;
const THICK: f64 = 0.06;
/// The lanterns of a board, as shares of half its length: the second of each is gold.
const ON_BODY: [f64; 3] = [-0.41, 0.0, 0.41];
const ON_HEAD: [f64; 3] = [-0.7, -0.44, -0.18];

/// The end of a dragon at which a bench is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    Head,
    Tail,
    None,
}

impl Drawing<'_> {
    /// Returns the SVG of a chain at a time, from a seat.
    pub(super) fn seat(&self, time: f64, chain: &Chain, seat: Seat) -> String {
        let dragons = &self.dragons;
        let mut stage = StageBox::EMPTY;
        chain.x.iter().zip(&chain.y).for_each(|(x, y)| stage.include(Point::new(*x, *y)));
        let eye = Eye::new(seat, &stage, self.height);
        let boards = dragons.seen(chain, &StageBox::ALL);
        let lights = dragons.lights();
        let mut things: Vec<(f64, Group)> = Vec::new();
        let (mut pools, mut bloom) = (lighting("pools"), lighting("bloom"));
        for (bench, board) in &boards {
            let Some(foot) = eye.spot(board.centre, 0.0).filter(|foot| Eye::is_seen(foot, 4.0)) else { continue };
            let (wide, flat) = (2.6 * foot.scale, eye.flat(foot.depth));
            let light = &lights[dragons.owner(*bench).0];
            pools = pools.add(
                used(&format!("pool{}", light.suffix))
                    .set("transform", placed(&foot, wide, wide * flat))
                    .set("opacity", if dragons.is_head(*bench) { 0.4 } else { 0.24 }),
            );
            let end = match (dragons.is_head(*bench), dragons.is_tail(*bench)) {
                (true, _) => End::Head,
                (false, true) => End::Tail,
                (false, false) => End::None,
            };
            let (thing, halos) = carried(&eye, *bench, end, board, light);
            bloom = bloom.add(halos);
            things.push((foot.depth, thing));
        }
        for handle in 0..chain.handles() {
            let (sine, cosine) = chain.heading[handle].sin_cos();
            // Beside the handle, on its right.
            let at = Point::new(chain.x[handle] + 0.2 * sine, chain.y[handle] - 0.2 * cosine);
            let Some(foot) = eye.spot(at, 0.0).filter(|foot| Eye::is_seen(foot, 1.0)) else { continue };
            let to_the_right = cosine * eye.right.0 + sine * eye.right.1;
            let mirrored = if to_the_right < 0.0 { -foot.scale } else { foot.scale };
            let person = used(if handle % 2 == 0 { "dancer" } else { "dancer-2" });
            let person = person.set("transform", placed(&foot, mirrored, foot.scale));
            things.push((foot.depth - 0.02, Group::new().add(person)));
        }
        things.sort_by(|one, other| other.0.total_cmp(&one.0));
        let dragon = things.into_iter().fold(Group::new().set("id", "dragon"), |group, (_, thing)| group.add(thing));
        let note =
            Text::new("Not to scale above the boards.").set("x", WIDTH - 8.0).set("y", rounded(self.height - 6.0, 2));
        let note = note.set("text-anchor", "end").set("font-size", 9).set("font-family", FACE).set("fill", "#8a8a8a");
        let picture = Group::new()
            .set("clip-path", "url(#frame)")
            .add(self.floor(&eye))
            .add(pools)
            .add(joints(&eye, self.height));
        let picture =
            picture.add(village::night(&eye)).add(dragon).add(bloom).add(village::front_row(self.height)).add(note);
        let document = self.document(time, chain, &super::palette::DARK).add(definitions(lights));
        self.finished(&document.add(picture))
    }

    fn floor(&self, eye: &Eye) -> Rectangle {
        let top = eye.foot().map_or(0.0, |foot| foot.y.clamp(0.0, self.height));
        let floor = Rectangle::new().set("y", rounded(top, 2)).set("width", WIDTH);
        floor.set("height", rounded(self.height - top, 2)).set("fill", "#0d0806")
    }
}

/// Returns an empty group of light.
fn lighting(name: &str) -> Group {
    Group::new().set("id", name).set("style", "mix-blend-mode:screen")
}

fn placed(at: &Spot, wide: f64, high: f64) -> String {
    format!("translate({} {})scale({} {})", rounded(at.x, 1), rounded(at.y, 1), rounded(wide, 2), rounded(high, 2))
}

/// Returns a bench with its lanterns and, at the ends, head or tail; and the lanterns' halos.
fn carried(eye: &Eye, bench: usize, end: End, board: &Board, light: &Light) -> (Group, Group) {
    let (axis, side) = (board.axis, board.axis.yx().component_mul(&nalgebra::Vector2::new(-1.0, 1.0)));
    let corner = |along: f64, across: f64, height: f64| eye.spot(board.centre + along * axis + across * side, height);
    let (long, wide) = (board.half_length, board.half_width);
    let near = if axis.x * eye.right.0 + axis.y * eye.right.1 > 0.0 { -wide } else { wide };
    let polygon = |corners: [Option<Spot>; 4], fill: &str| {
        let points: Option<Vec<String>> =
            corners.into_iter().map(|at| at.map(|at| format!("{},{}", rounded(at.x, 1), rounded(at.y, 1)))).collect();
        points.map(|points| Polygon::new().set("points", points.join(" ")).set("fill", fill.to_owned()))
    };
    let top = [(long, wide), (-long, wide), (-long, -wide), (long, -wide)].map(|(u, v)| corner(u, v, BOARD));
    let edge =
        [(long, BOARD), (-long, BOARD), (-long, BOARD - THICK), (long, BOARD - THICK)].map(|(u, z)| corner(u, near, z));
    let mut thing = Group::new().set("id", format!("bench-{bench}"));
    for shape in [polygon(top, &light.top), polygon(edge, &light.side)].into_iter().flatten() {
        thing = thing.add(shape);
    }
    let is_away = axis.y * eye.right.0 - axis.x * eye.right.1 > 0.0;
    let mut lamps = Group::new();
    let mut halos = Group::new();
    let places = if end == End::Head { ON_HEAD } else { ON_BODY };
    for step in 0..3 {
        let which = if is_away { 2 - step } else { step };
        let at = board.centre + places[which] * long * axis;
        let named = |gold: &str, own: &str| if which == 1 { gold.to_owned() } else { format!("{own}{}", light.suffix) };
        if let Some(foot) = eye.spot(at, BOARD) {
            lamps = lamps.add(used(&named("gold", "red")).set("transform", placed(&foot, foot.scale, foot.scale)));
        }
        if let Some(middle) = eye.spot(at, BOARD + 0.3) {
            let halo = used(&named("halo-gold", "halo-red"));
            halos = halos.add(halo.set("transform", placed(&middle, middle.scale, middle.scale)));
        }
    }
    let crown = match end {
        End::Head => Some(figure::head(eye, Placed { origin: board.centre + (long - 1.1) * axis, axis })),
        End::Tail => Some(figure::tail(eye, Placed { origin: board.centre - long * axis, axis })),
        End::None => None,
    };
    // The head is at the front of its board, the tail at the rear.
    thing = match crown {
        Some(crown) if is_away == (end == End::Head) => thing.add(crown).add(lamps),
        Some(crown) => thing.add(lamps).add(crown),
        None => thing.add(lamps),
    };
    if let Some(pearl) = (end == End::Head).then(|| eye.spot(board.centre + (long + 1.35) * axis, 2.35)).flatten() {
        thing = thing.add(used("pearl").set("transform", placed(&pearl, pearl.scale, pearl.scale)));
        halos = halos.add(used("halo-white").set("transform", placed(&pearl, pearl.scale, pearl.scale)));
    }
    (thing, halos)
}

/// Returns the joints of the paving: rows of 0.8 m, darker than the light between them.
fn joints(eye: &Eye, height: f64) -> Group {
    let mut group = Group::new().set("id", "joints").set("stroke", "#000000").set("stroke-opacity", 0.45);
    let on_floor = |right: f64, away: f64| {
        let (c, s) = eye.right;
        eye.spot(Point::new(eye.at.x + c * right - s * away, eye.at.y + s * right + c * away), 0.0)
    };
    for row in 1..40 {
        let Some(at) = on_floor(0.0, 0.8 * f64::from(row)).filter(|at| at.y < height) else { continue };
        let line = Line::new().set("x2", WIDTH).set("y1", rounded(at.y, 1)).set("y2", rounded(at.y, 1));
        group = group.add(line.set("stroke-width", rounded(0.022 * at.scale, 2)));
    }
    for column in -24..=24 {
        let x = 1.2 * f64::from(column);
        if let (Some(near), Some(far)) = (on_floor(x, 2.0), on_floor(x, 32.0)) {
            let line = Line::new().set("x1", rounded(near.x, 1)).set("y1", rounded(near.y, 1));
            group = group.add(line.set("x2", rounded(far.x, 1)).set("y2", rounded(far.y, 1)).set("stroke-width", 0.5));
        }
    }
    group
}

type Shade<'a> = (f64, &'a str, f64);

fn disc(name: &str, shades: &[Shade]) -> RadialGradient {
    shades.iter().fold(RadialGradient::new().set("id", name), |gradient, shade| gradient.add(stop(shade)))
}

fn upward(name: &str, shades: &[Shade]) -> LinearGradient {
    let gradient = LinearGradient::new().set("id", name).set("x1", 0).set("x2", 0).set("y1", 1).set("y2", 0);
    shades.iter().fold(gradient, |gradient, shade| gradient.add(stop(shade)))
}

fn stop((at, colour, opacity): &Shade) -> Stop {
    Stop::new().set("offset", *at).set("stop-color", *colour).set("stop-opacity", *opacity)
}

/// Returns the shapes that the picture uses many times: metres, upward is negative.
fn definitions(lights: &[Light]) -> Definitions {
    let ball = |name: &str, core: &str, middle: &str, rim: &str| {
        disc(name, &[(0.0, core, 1.0), (0.5, middle, 1.0), (1.0, rim, 1.0)]).set("cx", 0.42).set("cy", 0.36)
    };
    let halo = |name: &str, core: &str, skirt: &str, alpha: f64| {
        disc(name, &[(0.0, core, alpha), (0.2, skirt, 0.5 * alpha), (0.5, skirt, 0.16 * alpha), (1.0, skirt, 0.0)])
    };
    let round = |name: &str, radius: f64, fill: &str| {
        Circle::new().set("id", name).set("r", radius).set("fill", format!("url(#{fill})"))
    };
    let lamp = |name: &str, paper: &str, fill: &str, sign: Path| {
        let rim = Path::new()
            .set("d", "M-.1-.085h.2v-.03h-.2ZM-.1-.485h.2v-.03h-.2ZM-.035 0h.07v-.09h-.07Z")
            .set("fill", "#d99a34");
        let body = Path::new().set("d", paper).set("fill", format!("url(#{fill})"));
        Group::new().set("id", name).add(body).add(sign).add(rim)
    };
    let ribs = Path::new().set("d", "M-.05-.1Q-.11-.3-.05-.5M0-.1V-.5M.05-.1Q.11-.3.05-.5").set("fill", "none");
    let ribs = ribs.set("stroke", "#780600").set("stroke-opacity", 0.42).set("stroke-width", 0.008);
    let flower = Path::new()
        .set("d", "M0-.36L.017-.323.057-.318.028-.29.035-.25 0-.269-.035-.25-.028-.29-.057-.318-.017-.323Z")
        .set("fill", "#ce1a0e");
    let dancer = |name: &str, cloth: &str, scarf: &str| {
        let legs = Path::new().set("d", "M-.03-.84L-.2-.46-.3-.05M.03-.84L.2-.48.22-.05").set("fill", "none");
        let legs =
            legs.set("stroke", format!("url(#{cloth})")).set("stroke-width", 0.14).set("stroke-linecap", "round");
        let coat = Path::new()
            .set("d", "M-.17-.62L-.12-1.05-.17-1.36Q0-1.52.17-1.36L.12-1.05.18-.62Z")
            .set("fill", format!("url(#{cloth})"));
        let arm = Path::new().set("d", "M.1-1.34L.2-1.16.3-1.2M-.15-.98H.13").set("fill", "none");
        let arm = arm.set("stroke", scarf.to_owned()).set("stroke-width", 0.06).set("stroke-linecap", "round");
        let face =
            Ellipse::new().set("cx", 0.02).set("cy", -1.58).set("rx", 0.087).set("ry", 0.112).set("fill", "#7a3c20");
        let bound = Path::new()
            .set("d", "M-.08-1.61Q-.08-1.73.02-1.73T.12-1.61Q.02-1.66-.08-1.61Z")
            .set("fill", scarf.to_owned());
        Group::new().set("id", name).add(legs).add(coat).add(arm).add(face).add(bound)
    };
    let watcher = Path::new()
        .set("id", "watcher")
        .set("d", "M-.24 0C-.26-1.75.26-1.75.24 0ZM-.1-1.42a.1.13 0 1 1 .2 0a.1.13 0 1 1-.2 0Z");
    let common = Definitions::new()
        .add(halo("gold-light", "#ffd682", "#ff8c2c", 0.2))
        .add(halo("white-light", "#fffae8", "#ffce82", 0.95))
        .add(round("halo-gold", 0.55, "gold-light"))
        .add(round("halo-white", 1.3, "white-light"))
        .add(round("pearl", 0.17, "white"))
        .add(ball("skin", "#ffb066", "#ea4a1c", "#b3160f"))
        .add(ball("lit-gold", "#fffbe0", "#ffc040", "#b0620e"))
        .add(ball("white", "#ffffff", "#fff4cf", "#d8a050"))
        .add(disc(
            "paper-gold",
            &[(0.0, "#fffdf0", 1.0), (0.4, "#fff2c0", 1.0), (0.8, "#ffc650", 1.0), (1.0, "#c96d10", 1.0)],
        ))
        .add(upward(
            "sky",
            &[(0.0, "#1a0e12", 1.0), (0.1, "#120c16", 1.0), (0.4, "#060816", 1.0), (1.0, "#02030a", 1.0)],
        ))
        .add(upward(
            "wall",
            &[(0.0, "#7a3d1a", 1.0), (0.2, "#4e2714", 1.0), (0.5, "#2c1710", 1.0), (1.0, "#120b0e", 1.0)],
        ))
        .add(upward("cloth", &[(0.0, "#040203", 1.0), (0.4, "#4e100c", 1.0), (1.0, "#b0451f", 1.0)]))
        .add(upward("cloth-2", &[(0.0, "#040203", 1.0), (0.4, "#241c24", 1.0), (1.0, "#84503a", 1.0)]))
        .add(lamp("gold", "M-.105-.1L-.152-.31-.105-.5H.105L.152-.31.105-.1Z", "paper-gold", flower))
        .add(dancer("dancer", "cloth", "#b57a22"))
        .add(dancer("dancer-2", "cloth-2", "#b02a16"))
        .add(watcher);
    let barrel = "M-.085-.1C-.19-.17-.19-.43-.085-.5H.085C.19-.43.19-.17.085-.1Z";
    // The lanterns of the village are red.
    let village = lights[0].tint.is_some().then(Light::fire);
    lights.iter().chain(village.as_ref()).fold(common, |all, light| {
        let Light { suffix, halo_aside: [core, skirt], paper: [flame, lit, paper, rim], pool: [a, b, c, d], .. } =
            light;
        let named = |name: &str| format!("{name}{suffix}");
        let papers = [(0.0, flame.as_str(), 1.0), (0.3, lit, 1.0), (0.6, paper, 1.0), (1.0, rim, 1.0)];
        all.add(disc(&named("pool-light"), &[(0.0, a, 1.0), (0.25, b, 0.55), (0.6, c, 0.16), (1.0, d, 0.0)]))
            .add(round(&named("pool"), 1.0, &named("pool-light")))
            .add(halo(&named("red-light"), core, skirt, 0.22))
            .add(round(&named("halo-red"), 0.55, &named("red-light")))
            .add(disc(&named("paper-red"), &papers))
            .add(lamp(&named("red"), barrel, &named("paper-red"), ribs.clone()))
    })
}
