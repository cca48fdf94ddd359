//! The names of benches in a picture. A line leads from each to its own board, so that no name can be read as the name
//! of another board.
//!
//! The rule is that of the page (`crates/outputs/src/view/label_layout.js`) without its exception for a name beside its
//! board. Lengths are sheet units, y downward.

use std::f64::consts::TAU;

use svg::node::element::{Circle, Group, Line, Rectangle};

use super::camera::{Camera, Viewport};
use super::palette::Palette;
use super::{rounded, sheet};
use bench_dragon_motion::model::board::Board;
use bench_dragon_motion::model::{Point, Vector};

/// The side of the squares of the map of boards.
const SQUARE: f64 = 4.0;
/// Directions around a place, and distances from the place, that are tried.
const DIRECTIONS: u32 = 32;
const DISTANCES: [f64; 9] = [16.0, 28.0, 44.0, 66.0, 94.0, 130.0, 175.0, 230.0, 300.0];
/// The cost of a box that covers nothing but boards, in units of a line's length.
const COVERING: f64 = 90.0;
/// The radius that names leave free around the mark of an event.
const MARK: f64 = 24.0;
/// The size of letters, and half the height of a name's box.
const SIZE: f64 = 16.0;
const TALL: f64 = 12.0;
/// The share of a board's part between its neighbours on which lines end.
const FREE: f64 = 0.9;

/// A name to place.
#[derive(Debug, Clone)]
pub struct Name<'a> {
    /// The words.
    pub words: String,
    /// The number of the bench, which stands on the board if there is no room for the words.
    pub number: usize,
    /// The bench's board.
    pub board: Board,
    /// Its colour.
    pub colour: &'a str,
}

/// A board on the sheet.
#[derive(Debug, Clone, Copy)]
struct SheetBoard {
    centre: Point,
    axis: Vector,
    half_length: f64,
    half_width: f64,
}

impl SheetBoard {
    fn new(board: &Board, camera: &Camera) -> Self {
        let (x, y) = camera.sheet(board.centre);
        Self {
            centre: Point::new(x, y),
            axis: Vector::new(board.axis.x, -board.axis.y),
            half_length: board.half_length * camera.scale,
            half_width: board.half_width * camera.scale,
        }
    }

    fn distance(&self, point: Point) -> f64 {
        let away = point - self.centre;
        let (along, across) = (away.dot(&self.axis).abs(), away.perp(&self.axis).abs());
        (along - self.half_length).max(0.0).hypot((across - self.half_width).max(0.0))
    }

    /// Returns the line from one end to the other.
    fn spine(&self) -> Segment {
        Segment { from: self.centre - self.half_length * self.axis, to: self.centre + self.half_length * self.axis }
    }
}

/// A box of words.
#[derive(Debug, Clone, Copy)]
struct WordBox {
    centre: Point,
    half: f64,
    tall: f64,
}

impl WordBox {
    fn meets(&self, point: Point, gap: f64) -> bool {
        let away = point - self.centre;
        away.x.abs() < self.half + gap && away.y.abs() < self.tall + gap
    }

    fn overlaps(&self, other: &Self, gap: f64) -> bool {
        let away = other.centre - self.centre;
        away.x.abs() <= self.half + other.half + gap && away.y.abs() <= self.tall + other.tall + gap
    }

    /// Returns the line from the box's edge to a point outside the box.
    fn line_to(&self, end: Point) -> Segment {
        let way = end - self.centre;
        let out = (self.half / way.x.abs().max(1e-9)).min(self.tall / way.y.abs().max(1e-9)).min(1.0);
        Segment { from: self.centre + out * way, to: end }
    }
}

/// A straight line.
#[derive(Debug, Clone, Copy)]
struct Segment {
    from: Point,
    to: Point,
}

impl Segment {
    fn length(&self) -> f64 {
        (self.to - self.from).norm()
    }

    /// Returns true if a predicate holds at one of some points along the line.
    fn some(&self, points: u32, holds: impl Fn(Point) -> bool) -> bool {
        (0..=points).any(|k| holds(self.from + f64::from(k) / f64::from(points) * (self.to - self.from)))
    }

    fn crosses(&self, other: &Self) -> bool {
        let side = |line: &Self, point: Point| (line.to - line.from).perp(&(point - line.from));
        side(self, other.from) * side(self, other.to) < 0.0 && side(other, self.from) * side(other, self.to) < 0.0
    }
}

/// The squares of the sheet that boards cover.
struct BoardMap {
    columns: usize,
    covered: Vec<bool>,
}

impl BoardMap {
    fn new(boards: &[SheetBoard], viewport: &Viewport) -> Self {
        let cells = |length: f64| (length / SQUARE).ceil().max(0.0) as usize + 1;
        let (columns, rows) = (cells(viewport.right()), cells(viewport.bottom()));
        let mut covered = vec![false; columns * rows];
        for board in boards {
            let reach = board.half_length + board.half_width;
            let range = |middle: f64, count: usize| {
                let cell = |place: f64| (place / SQUARE).clamp(0.0, (count - 1) as f64) as usize;
                cell(middle - reach)..=cell(middle + reach)
            };
            for row in range(board.centre.y, rows) {
                for column in range(board.centre.x, columns) {
                    let place = Point::new(column as f64 * SQUARE, row as f64 * SQUARE);
                    covered[row * columns + column] |= board.distance(place) == 0.0;
                }
            }
        }
        Self { columns, covered }
    }

    /// Returns the share of a box that boards cover.
    fn share(&self, words: &WordBox) -> f64 {
        let (mut covered, mut all) = (0, 0);
        let steps = |half: f64| (-half / SQUARE).round() as i64..=(half / SQUARE).round() as i64;
        for down in steps(words.tall) {
            for right in steps(words.half) {
                let place = words.centre + SQUARE * Vector::new(right as f64, down as f64);
                let (column, row) = ((place.x / SQUARE).round() as usize, (place.y / SQUARE).round() as usize);
                all += 1;
                covered += usize::from(self.covered.get(row * self.columns + column) == Some(&true));
            }
        }
        covered as f64 / f64::from(all.max(1))
    }
}

/// Returns the names with their lines, the most important first in `names`. `boards` are all boards of the picture,
/// `marks` the places of events, `hole_inset` is the team's, in metres.
pub fn labels(
    names: &[Name],
    boards: &[(usize, Board)],
    marks: &[(f64, f64)],
    hole_inset: f64,
    camera: &Camera,
    palette: &Palette,
) -> Group {
    let all: Vec<SheetBoard> = boards.iter().map(|(_, board)| SheetBoard::new(board, camera)).collect();
    let map = BoardMap::new(&all, &camera.viewport);
    let marks: Vec<Point> = marks.iter().map(|(x, y)| Point::new(*x, *y)).collect();
    let own: Vec<SheetBoard> = names.iter().map(|name| SheetBoard::new(&name.board, camera)).collect();
    let mut group = Group::new().set("id", "labels");
    let (mut boxes, mut lines): (Vec<WordBox>, Vec<Segment>) = (Vec::new(), Vec::new());
    for (index, name) in names.iter().enumerate() {
        let board = &own[index];
        let free = FREE * (board.half_length - 2.0 * hole_inset * camera.scale).max(0.0);
        // Bold letters are a tenth wider.
        let half = 0.55 * sheet::width_of(&name.words, SIZE) + 6.0;
        let mut best: Option<(f64, WordBox, Segment)> = None;
        for end in [0.0, free, -free].map(|along| board.centre + along * board.axis) {
            for turn in 0..DIRECTIONS {
                let (sine, cosine) = (TAU * f64::from(turn) / f64::from(DIRECTIONS)).sin_cos();
                for far in DISTANCES {
                    let away = Vector::new(cosine * (far + half * cosine.abs()), sine * (far + TALL * sine.abs()));
                    let words = WordBox { centre: end + away, half, tall: TALL };
                    let line = words.line_to(end);
                    let shorter = best.as_ref().is_none_or(|(cost, ..)| line.length() < *cost);
                    let others = own.iter().enumerate().filter(|(other, _)| *other != index).map(|(_, other)| other);
                    let fits = shorter
                        && is_within(&words, &camera.viewport)
                        && !boxes
                            .iter()
                            .any(|other| words.overlaps(other, 3.0) || line.some(24, |at| other.meets(at, 2.0)))
                        && !lines.iter().any(|other| line.crosses(other) || other.some(24, |at| words.meets(at, 2.0)))
                        && !own.iter().any(|other| other.spine().some(24, |at| words.meets(at, other.half_width)))
                        && !others.into_iter().any(|other| line.some(40, |at| other.distance(at) < 1.5))
                        && !marks.iter().any(|mark| words.meets(*mark, MARK));
                    if fits {
                        let cost = line.length() + COVERING * map.share(&words);
                        if best.as_ref().is_none_or(|(least, ..)| cost < *least) {
                            best = Some((cost, words, line));
                        }
                    }
                }
            }
        }
        group = match best {
            Some((_, words, line)) => {
                boxes.push(words);
                lines.push(line);
                group.add(label(name, &words, &line, palette))
            }
            // A number on the board itself cannot be read as the number of another board.
            None => group.add(badge(name, board.centre, palette)),
        };
    }
    group
}

fn is_within(words: &WordBox, viewport: &Viewport) -> bool {
    let WordBox { centre, half, tall } = words;
    centre.x - half > viewport.left + 2.0
        && centre.x + half < viewport.right() - 2.0
        && centre.y - tall > viewport.top + 2.0
        && centre.y + tall < viewport.bottom() - 2.0
}

/// Returns a name on its plate, and the line to its board with a dot at the end.
fn label(name: &Name, words: &WordBox, line: &Segment, palette: &Palette) -> Group {
    let mut group = Group::new().set("class", format!("bench-{}", name.number - 1));
    for (colour, width, radius) in [(palette.ground, 4.5, 5.0), (name.colour, 1.8, 3.5)] {
        let [x1, y1, x2, y2] = [line.from.x, line.from.y, line.to.x, line.to.y].map(|place| rounded(place, 2));
        let leader = Line::new().set("x1", x1).set("y1", y1).set("x2", x2.clone()).set("y2", y2.clone());
        group = group
            .add(leader.set("stroke", colour).set("stroke-width", width).set("stroke-linecap", "round"))
            .add(Circle::new().set("cx", x2).set("cy", y2).set("r", radius).set("fill", colour));
    }
    let WordBox { centre, half, tall } = words;
    let plate = Rectangle::new().set("x", rounded(centre.x - half, 2)).set("y", rounded(centre.y - tall, 2));
    let plate = plate.set("width", rounded(2.0 * half, 2)).set("height", rounded(2.0 * tall, 2)).set("rx", 4);
    let plate = plate.set("fill", palette.ground).set("fill-opacity", 0.9);
    let place = (centre.x, centre.y + 5.5);
    group.add(plate.set("stroke", name.colour).set("stroke-width", 1.2)).add(
        sheet::words(&name.words, place, SIZE as u32, name.colour).set("text-anchor", "middle").set("font-weight", 600),
    )
}

/// Returns a bench's number on its board.
fn badge(name: &Name, at: Point, palette: &Palette) -> Group {
    let number = |colour| {
        sheet::words(&name.number.to_string(), (at.x, at.y + 5.0), 14, colour)
            .set("text-anchor", "middle")
            .set("font-weight", 600)
    };
    let rim = number(palette.ground).set("stroke", palette.ground).set("stroke-width", 4);
    Group::new().set("class", format!("bench-{}", name.number - 1)).add(rim).add(number(name.colour))
}
