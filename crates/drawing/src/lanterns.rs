//! The lantern look: the stage at night in the light of the dragon's lanterns, without script and without filter.
//!
//! The look is that of the page's show (`crates/outputs/src/view/lanterns.js`). Light on the ground is a mask over
//! paving. Pools of light are white circles in the mask, which cover one another in the way that light adds up.
//! The boards are the true rectangles.

use svg::node::element::{
    Circle, Definitions, Ellipse, Group, Line, Mask, Path, Pattern, RadialGradient, Rectangle, Stop, Use,
};

use super::benches;
use super::camera::StageBox;
use super::dragons::Dragons;
use super::light::{Light, css};
use super::{Drawing, WIDTH, metres, rounded};
use bench_dragon_motion::model::Point;
use bench_dragon_motion::model::board::Board;
use bench_dragon_motion::solve::Chain;

/// The radius of a bench's pool of light, and of a lantern's halo, in metres.
const POOL: f64 = 3.2;
const HALO: f64 = 0.62;
/// The width of the light around the boards of a picture, in metres.
pub const MARGIN: f64 = 2.0;
/// The lanterns of a board, as shares of half its length: the second of each is gold.
const ON_BODY: [f64; 3] = [-0.41, 0.0, 0.41];
const ON_HEAD: [f64; 4] = [-0.7, -0.44, -0.18, 0.09];
/// The distance of the pearl ahead of the head's board, in metres.
const PEARL: f64 = 0.42;
/// The size of the head and of the tail.
const CROWN: f64 = 1.3;

/// Half of the head seen from above, from its snout at the origin, going right: mane, horn, ear, skull, eye, brow.
const HEAD: [(&str, &str); 8] = [
    ("M-.62 0L-.8 .3Q-1.1 .34-1.42 .46Q-1.28 .3-1.2 .26Q-1.4 .24-1.62 .2Q-1.4 .1-1.3 .06L-1.66 0Z", "#7c0d12"),
    ("M-.62 0L-.78 .2Q-1 .24-1.28 .3Q-1.15 .2-1.08 .16L-1.4 .1Q-1.2 .05-1.42 0Z", "#f0601a"),
    ("M-.62 0L-.76 .12L-1.08 .16L-.96 .08L-1.16 0Z", "#ffb43a"),
    ("M-.62 .11Q-.9 .3-1.28 .37L-1.28 .43Q-1.1 .4-.98 .36L-1.0 .5L-1.06 .5L-1.04 .34Q-.8 .34-.62 .17Z", "#e8b44a"),
    ("M-.48 .22L-.8 .52Q-.74 .34-.62 .18Z", "#138a66"),
    (
        "M0 0C0 .1-.05 .15-.13 .155C-.2 .16-.24 .11-.3 .13C-.36 .16-.38 .27-.52 .27C-.68 .27-.78 .2-.86 .1V0Z",
        "url(#skull)",
    ),
    ("M-.47 .16A.075 .052 17 1 1-.33 .18A.075 .052 17 1 1-.47 .16Z", "#ffe27a"),
    ("M-.27 .09Q-.45 .13-.66 .21Q-.45 .2-.27 .15Z", "#17a57e"),
];
const TAIL: [(&str, &str); 3] = [
    ("M.1 0Q0 .1-.4 .6Q-.3 .35-.4 .3Q-.7 .4-.85 .4Q-.6 .22-.6 .15Q-.9 .1-1.15 0Z", "#7c0d12"),
    ("M.1 0Q0 .08-.3 .42Q-.24 .26-.3 .2Q-.5 .26-.62 .27Q-.45 .15-.45 .1Q-.65 .06-.85 0Z", "#f0701a"),
    ("M.1 0Q0 .05-.16 .22Q-.14 .12-.3 .12Q-.26 .06-.46 0Z", "#ffcf5a"),
];

impl Drawing<'_> {
    /// Returns the SVG of a chain at a time, in the light of its lanterns.
    pub(super) fn lanterns(&self, time: f64, chain: &Chain) -> String {
        let dragons = &self.dragons;
        let longest = dragons.all().iter().map(|of| of.motion.team().head_length).fold(0.0, f64::max);
        let view = self.camera.view().padded(POOL + 0.5 * longest);
        let boards = dragons.seen(chain, &view);
        let mut document = self.document(time, chain, &super::palette::DARK).add(definitions(dragons.lights()));
        let black = Rectangle::new().set("width", WIDTH).set("height", rounded(self.height, 4)).set("fill", "#000000");
        document = document.add(black);
        let all_benches = dragons.all().iter().map(|of| of.motion.team().benches).sum();
        let is_head = |bench: usize| dragons.is_head(bench);
        let stage = self.stage().add(ground(&boards, dragons, &view, exposure(all_benches, chain)));
        let mut stage = self.with_obstacles(stage, &super::palette::DARK);
        let mut wood = Group::new().set("id", "benches");
        let lights = dragons.lights();
        let light_of = |bench: usize| &lights[dragons.owner(bench).0];
        for (bench, board) in boards.iter().rev() {
            let outer = benches::polygon(board).set("id", format!("bench-{bench}"));
            let outer = outer.set("fill", light_of(*bench).edge.as_str());
            let inner = Board { half_length: board.half_length - 0.02, half_width: 0.87 * board.half_width, ..*board };
            wood = wood.add(outer).add(benches::polygon(&inner).set("fill", "#1c0605"));
        }
        let (mut people, mut halos, mut lamps) =
            (Group::new().set("id", "dancers"), Group::new().set("id", "halos"), Group::new().set("id", "lanterns"));
        halos = halos.set("style", "mix-blend-mode:screen");
        for (bench, board) in &boards {
            let turned = |at: Point| {
                let degrees = board.axis.y.atan2(board.axis.x).to_degrees();
                format!("translate({} {})rotate({})", rounded(at.x, 3), rounded(at.y, 3), rounded(degrees, 1))
            };
            let front = Point::new(chain.x[*bench], chain.y[*bench]);
            people =
                people.add(used(if bench % 2 == 0 { "dancer" } else { "dancer-2" }).set("transform", turned(front)));
            let places: &[f64] = if is_head(*bench) { &ON_HEAD } else { &ON_BODY };
            for (number, share) in places.iter().enumerate() {
                let at = board.centre + share * board.half_length * board.axis;
                let suffix = &light_of(*bench).suffix;
                let (halo, lamp) = match number {
                    1 => ("halo-gold".to_owned(), "gold".to_owned()),
                    _ => (format!("halo-red{suffix}"), format!("red{suffix}")),
                };
                halos = halos.add(used(&halo).set("x", metres(at.x)).set("y", metres(at.y)));
                lamps = lamps.add(used(&lamp).set("transform", turned(at)));
            }
        }
        stage = stage.add(wood).add(people).add(halos).add(lamps);
        for (bench, board) in boards.iter().rev() {
            if is_head(*bench) || dragons.is_tail(*bench) {
                stage = stage.add(crown(board, is_head(*bench)).set("id", dragons.end_id(*bench)));
            }
        }
        self.finished(&document.add(Group::new().set("clip-path", "url(#frame)").add(stage)))
    }
}

/// Returns the opacity of pools of light: a coil has many lanterns to a square metre, a procession few.
fn exposure(benches: usize, chain: &Chain) -> f64 {
    let mut around = StageBox::EMPTY;
    chain.x.iter().zip(&chain.y).for_each(|(x, y)| around.include(Point::new(*x, *y)));
    let density = benches as f64 / (0.785 * (around.width() + 1.0) * (around.height() + 1.0));
    (0.34 / density).clamp(0.3, 0.8)
}

fn used(name: &str) -> Use {
    Use::new().set("href", format!("#{name}"))
}

/// Returns the paving in the light of the pools: the light of each of several dragons on top of those before it.
fn ground(boards: &[(usize, Board)], dragons: &Dragons, view: &StageBox, exposure: f64) -> Group {
    let lights = dragons.lights();
    let mut group = Group::new().set("id", "ground");
    for (number, light) in lights.iter().enumerate() {
        let own = boards.iter().filter(|(bench, _)| dragons.owner(*bench).0 == number);
        group = lit(group, own, dragons, view, exposure, light);
    }
    group
}

/// Adds the pools of light of a dragon, as a mask, and the paving in their light.
fn lit<'a>(
    ground: Group,
    boards: impl Iterator<Item = &'a (usize, Board)>,
    dragons: &Dragons,
    view: &StageBox,
    exposure: f64,
    light: &Light,
) -> Group {
    let Light { suffix, tint, .. } = light;
    let mut mask = Mask::new().set("id", format!("light{suffix}")).set("maskUnits", "userSpaceOnUse");
    for (attribute, value) in
        [("x", view.least.x), ("y", view.least.y), ("width", view.width()), ("height", view.height())]
    {
        mask = mask.set(attribute, metres(value));
    }
    for (bench, board) in boards {
        let head = if dragons.is_head(*bench) { 1.3 } else { 1.0 };
        let pool = used("pool").set("x", metres(board.centre.x)).set("y", metres(board.centre.y));
        mask = mask.add(pool.set("opacity", rounded((exposure * head).min(1.0), 3)));
    }
    let mut paving = Rectangle::new().set("x", metres(view.least.x)).set("y", metres(view.least.y));
    paving = paving.set("width", metres(view.width())).set("height", metres(view.height()));
    paving = paving.set("fill", format!("url(#paving{suffix})")).set("mask", format!("url(#light{suffix})"));
    if tint.is_some() {
        // The lights of several dragons add up.
        paving = paving.set("style", "mix-blend-mode:screen");
    }
    ground.add(mask).add(paving)
}

/// Returns the head with its pearl, or the tail.
fn crown(board: &Board, head: bool) -> Group {
    let end = board.centre + if head { 1.0 } else { -1.0 } * board.half_length * board.axis;
    let degrees = rounded(board.axis.y.atan2(board.axis.x).to_degrees(), 2);
    let place = format!("translate({} {})rotate({degrees})scale({CROWN})", metres(end.x), metres(end.y));
    let mut group = Group::new().set("transform", place);
    let shapes: &[(&str, &str)] = if head { &HEAD } else { &TAIL };
    for (data, colour) in shapes {
        let half = Path::new().set("d", *data).set("fill", *colour);
        let other = half.clone().set("transform", "scale(1 -1)");
        group = group.add(half).add(other);
    }
    if !head {
        return group;
    }
    for side in [1, -1] {
        let whisker = Path::new().set("d", "M-.12 .14C.16 .34-.1 .6-.48 .62").set("fill", "none");
        let whisker = whisker.set("stroke", "#ffcf6a").set("stroke-width", 0.026).set("stroke-linecap", "round");
        group = group.add(whisker.set("transform", format!("scale(1 {side})")));
    }
    let pearl = |radius: f64, fill: &str| {
        Circle::new().set("cx", rounded(PEARL / CROWN, 3)).set("r", radius).set("fill", fill.to_owned())
    };
    group.add(pearl(0.6, "url(#white)").set("style", "mix-blend-mode:screen")).add(pearl(0.15, "url(#pearl)"))
}

/// Returns the paving in a light, as a pattern: without a tint warm light on grey stone.
fn paving(Light { suffix, tint, .. }: &Light) -> Pattern {
    let stone = |share: f64, warm: &str| match tint {
        Some(light) => css(light.map(|part| (f64::from(part) * share).round() as u8)),
        None => warm.to_owned(),
    };
    let tile = |pattern: Pattern| pattern.set("width", 2.4).set("height", 1.6);
    let joints = Rectangle::new().set("width", 2.4).set("height", 1.6).set("fill", stone(0.12, "#1f0f06"));
    let pattern = Pattern::new().set("id", format!("paving{suffix}")).set("patternUnits", "userSpaceOnUse");
    let slabs = [
        (0.0, 0.0, 1.2, 0.72, "#b8602c"),
        (1.2, 0.0, 1.2, 0.65, "#a65528"),
        (-0.6, 0.8, 1.2, 0.61, "#9c4f25"),
        (0.6, 0.8, 1.2, 0.75, "#c0662f"),
        (1.8, 0.8, 1.2, 0.61, "#9c4f25"),
    ];
    slabs.into_iter().fold(tile(pattern).add(joints), |pattern, (x, y, width, share, warm)| {
        let slab = Rectangle::new().set("x", rounded(x + 0.011, 3)).set("y", rounded(y + 0.011, 3)).set("rx", 0.03);
        let slab = slab.set("width", rounded(width - 0.022, 3)).set("height", 0.778);
        pattern.add(slab.set("fill", stone(share, warm)))
    })
}

fn shades(name: &str, stops: &[(f64, &str, f64)]) -> RadialGradient {
    stops.iter().fold(RadialGradient::new().set("id", name), |gradient, (at, colour, opacity)| {
        gradient.add(Stop::new().set("offset", *at).set("stop-color", *colour).set("stop-opacity", *opacity))
    })
}

/// Returns the paving, the lanterns, the dancers and the lights that the picture uses many times.
fn definitions(lights: &[Light]) -> Definitions {
    // (1 + (q / h)^2)^-1.5 of a near and a high lamp, as in sprites.js.
    let lamp = |q: f64, height: f64| (1.0 + (q / height).powi(2)).powf(-1.5);
    let light = |q: f64| 0.72 * lamp(q, 0.5) + 0.28 * lamp(q, 1.3);
    let stops: Vec<(f64, &str, f64)> = (0..=12)
        .map(|k| {
            let at = f64::from(k * k) / 144.0;
            let left = (light(at * POOL) - light(POOL)) / (1.0 - light(POOL));
            ((at * 1e4).round() / 1e4, "#ffffff", (left * 1e4).round() / 1e4)
        })
        .collect();
    let halo = |name: &str, core: &str, skirt: &str| {
        let stops = [
            (0.0, core, 0.62),
            (0.12, core, 0.43),
            (0.26, skirt, 0.26),
            (0.5, skirt, 0.1),
            (0.75, skirt, 0.03),
            (1.0, skirt, 0.0),
        ];
        shades(name, &stops)
    };
    let disc = |name: &str, radius: f64, fill: &str| {
        Circle::new().set("id", name).set("r", radius).set("fill", format!("url(#{fill})"))
    };
    let dancer = |name: &str, cloth: &str, scarf: &str| {
        let shoulders = Ellipse::new().set("rx", 0.12).set("ry", 0.23).set("fill", cloth);
        let head = Ellipse::new().set("rx", 0.106).set("ry", 0.093).set("fill", scarf);
        Group::new()
            .set("id", name)
            .set("stroke", "#000000")
            .set("stroke-opacity", 0.5)
            .set("stroke-width", 0.02)
            .add(shoulders)
            .add(head)
    };
    let pane =
        Rectangle::new().set("x", -0.115).set("y", -0.115).set("width", 0.23).set("height", 0.23).set("rx", 0.02);
    let rib = |turn: i32| {
        Line::new()
            .set("x1", 0.045)
            .set("x2", 0.135)
            .set("transform", format!("rotate({})", turn * 45))
            .set("stroke", "#3c0000")
            .set("stroke-opacity", 0.28)
            .set("stroke-width", 0.006)
    };
    let red = |suffix: &str| {
        let barrel = Circle::new().set("r", 0.135).set("fill", format!("url(#barrel{suffix})"));
        (0..8).map(rib).fold(Group::new().set("id", format!("red{suffix}")).add(barrel), Group::add)
    };
    let gold = pane.set("id", "gold").set("fill", "url(#box)").set("stroke", "#6b3205").set("stroke-width", 0.012);
    let common = Definitions::new()
        .add(shades("pool-light", &stops))
        .add(disc("pool", POOL, "pool-light"))
        .add(halo("gold-light", "#ffe296", "#ffa03c"))
        .add(halo("white", "#fffcf0", "#ffd696"))
        .add(disc("halo-gold", HALO, "gold-light"))
        .add(shades(
            "box",
            &[(0.0, "#fffdf0", 1.0), (0.16, "#fffbe0", 1.0), (0.5, "#ffcf52", 1.0), (1.0, "#e8860f", 1.0)],
        ))
        .add(shades("pearl", &[(0.0, "#fffef6", 1.0), (0.55, "#ffe9b0", 1.0), (1.0, "#ff9a3a", 1.0)]))
        .add(shades("skull", &[(0.0, "#fff0b0", 1.0), (0.4, "#ff8a24", 1.0), (1.0, "#8f0d14", 1.0)]))
        .add(dancer("dancer", "#7a1d14", "#c98a2a"))
        .add(dancer("dancer-2", "#3a2626", "#b52a18"))
        .add(gold);
    lights.iter().fold(common, |all, light| {
        let Light { suffix, halo: [core, skirt], barrel: [flame, lit, paper, rim], .. } = light;
        let papers = [(0.0, "#fffdf0", 1.0), (0.16, flame, 1.0), (0.42, lit, 1.0), (0.8, paper, 1.0), (1.0, rim, 1.0)];
        all.add(paving(light))
            .add(halo(&format!("red-light{suffix}"), core, skirt))
            .add(disc(&format!("halo-red{suffix}"), HALO, &format!("red-light{suffix}")))
            .add(shades(&format!("barrel{suffix}"), &papers))
            .add(red(suffix))
    })
}
