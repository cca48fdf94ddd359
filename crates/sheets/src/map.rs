//! The map of a sheet: the stage once for all pages, and on each page the trail of its benches with times.
//!
//! Lengths are sheet units; the map is 600 of them wide, 132 mm. All is black on white.

use std::fmt::Write;

use bench_dragon_drawing::camera::{Camera, StageBox, Viewport};
use bench_dragon_drawing::palette::Palette;
use bench_dragon_drawing::{escaped, ground};
use bench_dragon_messages::sentence::rounded;
use bench_dragon_motion::model::shape::ShapeKind;
use bench_dragon_motion::model::{Point, Vector};

use crate::piece::Feet;
use crate::stop::letter;
use crate::walk::{DragonWalk, Walk};

/// The width of a map.
pub(crate) const WIDTH: f64 = 600.0;
/// The least height of a map.
const LEAST_HEIGHT: f64 = 150.0;
/// The metres of a street that are shown: from the end of the first line, and from the beginning of the last one.
const STREET: f64 = 12.0;
/// The metres around the ways within which obstacles are shown.
const AROUND: f64 = 15.0;
/// The places of a piece that make its line and the frame.
const PLACES: usize = 2000;
/// The size of letters.
const SIZE: f64 = 15.0;

/// Black on white.
const PRINT: Palette = Palette {
    ground: "#ffffff",
    ink: "#000000",
    quiet: "#000000",
    faint: "#000000",
    line: "#dddddd",
    danger: "#000000",
    warning: "#000000",
    still: "#777777",
    slow: "#000000",
    middle: "#000000",
    fast: "#000000",
};

/// The map of a show.
pub(crate) struct Map {
    camera: Camera,
    /// The ways of the dragons, as far as the map shows them.
    ways: Vec<Vec<Point>>,
    /// The boxes of the words of the stage.
    taken: Taken,
    /// The names of the obstacles.
    names: String,
}

impl Map {
    /// Creates a map that is at most `most` units high.
    pub fn of(walk: &Walk<'_>, most: f64) -> Self {
        let mut shown = StageBox::EMPTY;
        let ways: Vec<Vec<Point>> =
            walk.dragons.iter().enumerate().map(|(k, dragon)| places(walk, k, dragon)).collect();
        ways.iter().flatten().for_each(|place| shown.include(*place));
        let near = shown.padded(AROUND);
        for obstacle in walk.ensemble().ground().obstacles() {
            let beyond = Vector::repeat(obstacle.shape.radius());
            let points = obstacle.shape.points().iter().filter(|point| near.contains(**point));
            for point in points.filter(|_| obstacle.shape.kind() != ShapeKind::Boundary) {
                shown.include(point - beyond);
                shown.include(point + beyond);
            }
        }
        let shown = shown.padded(1.0 + 0.02 * shown.width().max(shown.height()));
        let height = (WIDTH * shown.height() / shown.width()).min(most).max(LEAST_HEIGHT);
        let camera = Camera::showing(&shown, Viewport { left: 0.0, top: 0.0, width: WIDTH, height });
        // The scale and the arrow to the north.
        let mut taken = Taken(vec![[WIDTH - 70.0, height - 20.0, 65.0, 18.0], [WIDTH - 18.0, 20.0, 14.0, 20.0]]);
        let obstacles = walk.ensemble().ground().obstacles().iter();
        let named = obstacles.filter(|obstacle| obstacle.shape.kind() != ShapeKind::Boundary);
        let placed = named.map(|obstacle| (&obstacle.name, ground::middle(&obstacle.shape)));
        let seen = placed.filter(|(_, place)| camera.view().contains(*place));
        let names = seen.map(|(name, place)| taken.word(name, camera.sheet(place), &camera, Word::Name)).collect();
        Self { camera, ways, taken, names }
    }

    /// Returns the height.
    pub fn height(&self) -> f64 {
        self.camera.viewport.height
    }

    /// Returns the stage with its ways, north and scale: an SVG that is not shown itself.
    pub fn stage(&self, walk: &Walk<'_>) -> String {
        let (camera, ground) = (&self.camera, walk.ensemble().ground());
        let mut ways = String::new();
        for way in &self.ways {
            let data = line(way.iter().map(|place| camera.sheet(*place)));
            let _ = write!(
                ways,
                "<path d=\"{data}\" fill=\"none\" stroke=\"#000\" stroke-width=\"0.8\" stroke-dasharray=\"5\"/>"
            );
        }
        let (obstacles, names) = (ground::group(ground, camera, &PRINT), &self.names);
        let (right, bottom) = (WIDTH - 14.0, self.height() - 8.0);
        let metres = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0].into_iter();
        let metres = metres.take_while(|metres| metres * camera.scale < 110.0).last().unwrap_or(1.0);
        let left = right - metres * camera.scale;
        format!(
            "<svg width=\"0\" height=\"0\" style=\"position:absolute\"><defs><clipPath id=\"frame\"><rect \
             width=\"{WIDTH}\" height=\"{height}\"/></clipPath><g id=\"stage\" clip-path=\"url(#frame)\"><g \
             transform=\"{transform}\">{obstacles}</g>{ways}<g font-size=\"{SIZE}\">{names}</g><path \
             d=\"M{left} {bottom}H{right}m0 -5v10M{left} {bottom}m0 -5v10\" stroke=\"#000\" stroke-width=\"1.5\"/><g \
             font-size=\"{SIZE}\">{scale}{north}</g><path \
             d=\"M{x} 24l-5 13h10z\"/></g></defs></svg>\n",
            height = rounded(self.height(), 2),
            transform = camera.transform(),
            scale = words(&format!("{metres} m"), (0.5 * (left + right), bottom - 8.0)),
            north = words("N", (right - 4.0, 20.0)),
            x = right - 4.0,
        )
    }

    /// Returns the map with the trail of a bench of a dragon, the letters of its joints, and a time at each mark.
    pub fn with_trail(&self, walk: &Walk<'_>, number: usize, bench: usize, clock: &dyn Fn(f64) -> String) -> String {
        let DragonWalk { benches, pieces } = &walk.dragons[number];
        let (bench, camera) = (&benches[bench], &self.camera);
        let motion = &walk.ensemble().dragons()[number].motion;
        let (mut taken, mut letters, mut signs) = (self.taken.clone(), String::new(), String::new());
        for stretch in bench.stretches.iter().skip(1) {
            let joint = motion.path().point(motion.path().param_at(pieces[stretch.piece].begin));
            let joint = motion.placement().point(joint);
            if camera.view().contains(joint) {
                letters += &taken.word(&letter(stretch.piece), camera.sheet(joint), camera, Word::Letter);
            }
        }
        let mut before: Option<(f64, f64)> = None;
        for (time, place) in &bench.trail {
            let (x, y) = camera.sheet(*place);
            let marks = time / walk.mark;
            if (marks - marks.round()).abs() < 1e-9 && camera.view().contains(*place) {
                signs += &before.map_or(String::new(), |(u, v)| arrow((x, y), (x - u, y - v)));
                signs += &taken.word(&clock(*time), (x, y), camera, Word::Time);
            }
            before = Some((x, y));
        }
        let data = line(bench.trail.iter().map(|(_, place)| camera.sheet(*place)));
        format!(
            "<svg class=\"map\" viewBox=\"0 0 {WIDTH} {height}\" role=\"img\"><use href=\"#stage\"/><g \
             clip-path=\"url(#frame)\"><path d=\"{data}\" fill=\"none\" stroke=\"#000\" stroke-width=\"2.4\" \
             stroke-linejoin=\"round\"/></g><g font-size=\"{SIZE}\">{signs}{letters}</g></svg>",
            height = rounded(self.height(), 2)
        )
    }
}

/// Returns the data of a line through places on the sheet, without places nearer than two units to the one before.
fn line(places: impl Iterator<Item = (f64, f64)>) -> String {
    let mut data = String::new();
    let mut before: Option<(f64, f64)> = None;
    for (x, y) in places {
        if before.is_none_or(|(u, v)| (x - u).hypot(y - v) > 2.0) {
            // Writing to a String cannot fail.
            let _ = write!(data, "{}{} {}", if data.is_empty() { "M" } else { "L" }, rounded(x, 1), rounded(y, 1));
            before = Some((x, y));
        }
    }
    data
}

/// Returns places on the way of a dragon that the map has to show.
fn places(walk: &Walk<'_>, number: usize, dragon: &DragonWalk) -> Vec<Point> {
    let motion = &walk.ensemble().dragons()[number].motion;
    let on_stage = |travelled| motion.placement().point(motion.path().point(motion.path().param_at(travelled)));
    let last = dragon.pieces.len() - 1;
    let mut places = Vec::new();
    for (k, piece) in dragon.pieces.iter().enumerate() {
        let is_street = piece.feet == Feet::Straight && last > 0;
        let from = match (k, is_street) {
            (0, true) => piece.end - STREET,
            (0, false) if piece.feet != Feet::Straight => -motion.team().length(),
            _ => piece.begin.max(0.0),
        };
        let to = if k == last && is_street { piece.end.min(from + STREET) } else { piece.end };
        places.extend((0..=PLACES).map(|at| on_stage(from + (to - from) * at as f64 / PLACES as f64)));
    }
    places
}

/// Returns text in the middle of a place.
fn words(content: &str, (x, y): (f64, f64)) -> String {
    format!("<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>", rounded(x, 1), rounded(y, 1), escaped(content))
}

/// Returns a mark at a place that points in a direction.
fn arrow((x, y): (f64, f64), (along, down): (f64, f64)) -> String {
    let turn = rounded(down.atan2(along).to_degrees(), 1);
    format!(
        "<path transform=\"translate({} {}) rotate({turn})\" d=\"M6 0L-4 4.5V-4.5z\"/>",
        rounded(x, 1),
        rounded(y, 1)
    )
}

/// The kinds of words on a map.
#[derive(Clone, Copy, PartialEq)]
enum Word {
    Name,
    Letter,
    Time,
}

/// The boxes of words that are placed: centre and half of width and height.
#[derive(Clone)]
struct Taken(Vec<[f64; 4]>);

/// The directions and the distances in which a place for words is sought.
const DIRECTIONS: usize = 16;
const DISTANCES: [f64; 6] = [15.0, 22.0, 30.0, 42.0, 58.0, 78.0];

impl Taken {
    /// Returns words near a place, where no other words stand, with a line to the place.
    fn word(&mut self, content: &str, (x, y): (f64, f64), camera: &Camera, kind: Word) -> String {
        let half = [0.5 * 0.58 * SIZE * content.chars().count() as f64 + 2.0, 0.5 * SIZE];
        let own = (kind == Word::Name).then_some((x, y));
        let around = DISTANCES.iter().flat_map(|away| {
            (0..DIRECTIONS).map(move |k| {
                let (sine, cosine) = (std::f64::consts::TAU * k as f64 / DIRECTIONS as f64).sin_cos();
                (x + (away + half[0] - SIZE * 0.5).max(*away) * cosine, y - away * sine)
            })
        });
        let is_free = |(u, v): &(f64, f64)| {
            let inside =
                (half[0]..=WIDTH - half[0]).contains(u) && (half[1]..=camera.viewport.height - half[1]).contains(v);
            inside
                && self
                    .0
                    .iter()
                    .all(|[s, t, wide, high]| (u - s).abs() > wide + half[0] || (v - t).abs() > high + half[1])
        };
        // Without a free place, the mark alone stands there.
        let Some((u, v)) = own.into_iter().chain(around).find(is_free) else { return String::new() };
        self.0.push([u, v, half[0], half[1]]);
        let place = words(content, (u, v + 0.36 * SIZE));
        let [x, y, u, v] = [x, y, u, v].map(|units| rounded(units, 1));
        let line = format!("<path d=\"M{x} {y}L{u} {v}\" stroke=\"#000\" stroke-width=\"0.7\"/>");
        let rim = place.replacen("<text", "<text class=\"rim\"", 1);
        match kind {
            Word::Letter => {
                let ring = format!("<circle cx=\"{u}\" cy=\"{v}\" r=\"9.5\" fill=\"#fff\" stroke=\"#000\"/>");
                format!("{line}{ring}<g class=\"letter\">{place}</g>")
            }
            Word::Time => format!("{line}{rim}{place}"),
            Word::Name => format!("{rim}<g class=\"letter\">{place}</g>"),
        }
    }
}
