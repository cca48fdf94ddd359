//! A stretch of a motion as one SVG that moves by itself, for pages that show pictures and run no programs.
//!
//! Every board is a rectangle that SMIL moves and turns from moment to moment; a viewer without SMIL sees the last one.
//! Between two moments boards move evenly, so that the picture is only as true as its moments are close.

use svg::node::element::{Animate, AnimateTransform, Group, Rectangle};

use super::camera::Camera;
use super::marks::{Happened, Tense};
use super::palette::Palette;
use super::{Drawing, Surroundings, benches, marks, metres, rounded, sheet};
use bench_dragon_motion::model::board::Board;
use bench_dragon_motion::solve::Chain;

/// Seconds for which the last moment stands before the picture begins again.
const HOLD: f64 = 4.0;

/// How many colours a board takes on.
const COLOURS: usize = 16;

/// The most numbers that a countdown shows.
const MOST_NUMBERS: f64 = 200.0;

/// The times of a moving picture.
struct Score {
    /// Moments that are different, and those after them in which the last one stands.
    moments: usize,
    held: usize,
    /// Seconds from one moment to the next.
    step: f64,
}

impl Score {
    fn steps(&self) -> usize {
        self.moments - 1 + self.held
    }

    fn seconds(&self) -> f64 {
        self.steps() as f64 * self.step
    }

    /// The moment that is shown at a step.
    fn moment(&self, step: usize) -> usize {
        step.min(self.moments - 1)
    }

    /// The part of the whole at which a time since the start comes.
    fn part(&self, seconds: f64) -> String {
        rounded((seconds / self.seconds()).clamp(0.0, 1.0), 5)
    }

    fn transform(&self, kind: &str, values: &[String]) -> AnimateTransform {
        let animation = AnimateTransform::new().set("attributeName", "transform").set("type", kind);
        animation.set("dur", self.duration()).set("repeatCount", "indefinite").set("values", values.join(";"))
    }

    fn animate(&self, attribute: &str, values: &[String]) -> Animate {
        let animation = Animate::new().set("attributeName", attribute).set("values", values.join(";"));
        animation.set("dur", self.duration()).set("repeatCount", "indefinite")
    }

    /// Shows what is otherwise hidden from one second to another.
    fn shown(&self, from: f64, to: f64) -> Animate {
        let values = ["hidden", "visible", "hidden"].map(str::to_owned);
        let times = ["0".to_owned(), self.part(from), self.part(to)];
        self.animate("visibility", &values).set("calcMode", "discrete").set("keyTimes", times.join(";"))
    }

    fn duration(&self) -> String {
        rounded(self.seconds(), 3) + "s"
    }
}

impl Drawing<'_> {
    /// One SVG that shows the chains of times that stand equally far apart, at least two of them, one after the other
    /// in real time, and begins again.
    pub fn animated(&self, moments: &[(f64, Chain)]) -> String {
        let palette = self.look.theme.palette();
        let [(from, _), .., (until, last)] = moments else { return String::new() };
        let step = (until - from) / (moments.len() - 1) as f64;
        let score = Score { moments: moments.len(), held: (HOLD / step).ceil() as usize, step };
        let happened = marks::happened(self.timeline, *until);
        let now = happened.iter().rev().find(|past| past.tense == Tense::Present);
        let touching: Vec<usize> = now.into_iter().flat_map(Happened::benches).map(|bench| bench as usize).collect();
        let team = self.motion.team();
        let mut stage = self.stage().add(self.path(palette));
        let mut boards = Group::new().set("id", "benches");
        if team.width * self.camera.scale > 4.0 {
            boards = boards.set("stroke", palette.ground).set("stroke-width", self.camera.metres(0.7));
        }
        let reach = team.longest_link() + 2.0 * team.hole_inset;
        let view = self.camera.view().padded(reach);
        for bench in (0..team.benches).rev() {
            let way: Vec<Board> = moments.iter().map(|(_, chain)| benches::board(team, chain, bench)).collect();
            if !way.iter().any(|board| view.contains(board.centre)) {
                continue;
            }
            let colours = (0..=COLOURS).map(|colour| score.moment(colour * score.steps() / COLOURS));
            let colours: Vec<String> =
                colours.map(|moment| self.fill(moments[moment].1.speed[bench], palette)).collect();
            let mut board = moving(&way, &colours, &score, &self.camera, bench);
            if bench == 0 {
                let upright = lying(&way[0]);
                let sign = benches::head_sign(&upright, &self.camera, palette);
                board = board.adding(benches::outline(&upright, palette.ink, 1.6, &self.camera)).adding(sign);
            }
            if bench > 0 && bench + 1 == team.benches {
                board = board.adding(benches::tail_sign(&lying(&way[0]), &self.camera, palette));
            }
            if touching.contains(&bench) {
                let rim = benches::outline(&lying(&way[0]), palette.danger, 3.0, &self.camera);
                board = board.adding(rim.add(score.shown(until - from, score.seconds())));
            }
            boards = boards.add(board.finished());
        }
        stage = stage.add(boards);
        let mut document = self.document(*until, last, palette);
        let mut marks = Group::new().set("id", "marks");
        for past in happened.iter().filter(|past| past.tense == Tense::Present) {
            if let Some(place) = past.place(&self.camera) {
                let sign = past.sign(self.camera.sheet(place), palette);
                marks = marks.add(sign.add(score.shown(until - from, score.seconds())));
            }
        }
        document = document.add(Group::new().set("clip-path", "url(#frame)").add(stage).add(marks));
        if self.look.surroundings == Surroundings::Caption {
            document = document.add(self.countdown(*from, *until, now, &score, palette));
        }
        // From the end to the beginning through the ground.
        let veil = Rectangle::new().set("width", super::WIDTH).set("height", rounded(self.height, 4));
        let dim = score.animate("opacity", &["1", "0", "0", "1"].map(str::to_owned));
        let times = ["0".to_owned(), score.part(0.8), score.part(score.seconds() - 0.8), "1".to_owned()];
        let veil = veil.set("fill", palette.ground).set("opacity", 0).add(dim.set("keyTimes", times.join(";")));
        self.finished(&document.add(veil))
    }

    /// The seconds up to the event with which the stretch ends, and the event; without one, the time.
    fn countdown(&self, from: f64, until: f64, now: Option<&Happened>, score: &Score, palette: &Palette) -> Group {
        let (x, y) = (28.0, 46.0);
        let mut group = Group::new().set("id", "countdown");
        let every = ((until - from) / MOST_NUMBERS).ceil().max(1.0);
        let heading = now.map_or("time".to_owned(), |now| now.timed.event.kind.name().replace('_', " "));
        let until_event = score.shown(0.0, until - from);
        let quiet = |content: &str| sheet::words(content, (x, y), 22, palette.quiet);
        let number = |content: &str| sheet::words(content, (x, y + 52.0), 54, palette.ink).set("font-weight", 700);
        let hidden = |text: svg::node::element::Text| text.set("visibility", "hidden");
        group = group.add(match now {
            Some(_) => hidden(quiet(&format!("{heading} in"))).add(until_event),
            None => quiet(&heading),
        });
        // Each number stands until the next: of a countdown the seconds that are begun.
        let numbers = ((until - from) / every).ceil() as u64;
        for k in 0..numbers {
            let (begins, ends, shown) = match now {
                Some(_) => {
                    let left = (numbers - k) as f64 * every;
                    (until - from - left, until - from - left + every, left)
                }
                None => (k as f64 * every, (k + 1) as f64 * every, from + k as f64 * every),
            };
            let shown = number(&format!("{} s", rounded(shown, 0)));
            group = group.add(hidden(shown).add(score.shown(begins.max(0.0), ends)));
        }
        let last = [score.shown(until - from, score.seconds()), score.shown(until - from, score.seconds())];
        let [one, other] = last;
        match now {
            None => group.add(number(&format!("{} s", rounded(until, 1))).add(one)),
            Some(now) => {
                let benches: Vec<String> = now.benches().map(|bench| (bench + 1).to_string()).collect();
                let kind = match benches.len() {
                    0 => String::new(),
                    1 => format!("bench {}", benches[0]),
                    _ => format!("benches {}", benches.join(" and ")),
                };
                let heading = sheet::words(&heading.to_uppercase(), (x, y + 6.0), 34, palette.danger);
                group
                    .add(heading.set("font-weight", 800).add(one))
                    .add(sheet::words(&kind, (x, y + 40.0), 22, palette.danger).add(other))
            }
        }
    }
}

/// The board at the origin along x.
fn lying(board: &Board) -> Board {
    Board {
        centre: bench_dragon_motion::model::Point::origin(),
        axis: bench_dragon_motion::model::Vector::x(),
        ..*board
    }
}

/// A board that moves: what turns is added to it, then it is put where it moves.
struct Moving {
    bench: usize,
    turning: Group,
    centres: Vec<String>,
    translate: AnimateTransform,
}

impl Moving {
    fn adding(self, element: impl Into<Box<dyn svg::Node>>) -> Self {
        Self { turning: self.turning.add(element), ..self }
    }

    fn finished(self) -> Group {
        let last = self.centres.last().map_or("", String::as_str);
        let group =
            Group::new().set("id", format!("bench-{}", self.bench)).set("transform", format!("translate({last})"));
        group.add(self.translate).add(self.turning)
    }
}

fn moving(way: &[Board], colours: &[String], score: &Score, camera: &Camera, bench: usize) -> Moving {
    // A third of a unit of the sheet.
    let decimals = (3.0 * camera.scale).log10().ceil().max(0.0) as usize;
    let steps = || (0..=score.steps()).map(|step| way[score.moment(step)]);
    let centres: Vec<String> = steps()
        .map(|board| format!("{} {}", rounded(board.centre.x, decimals), rounded(board.centre.y, decimals)))
        .collect();
    let (mut turned, mut before) = (0.0, None);
    let angles: Vec<String> = steps()
        .map(|board| {
            let heading = board.axis.y.atan2(board.axis.x);
            // The shorter way from one heading to the next, so that no board spins once round.
            turned += before.map_or(heading, |before: bench_dragon_motion::model::Vector| {
                before.perp(&board.axis).atan2(before.dot(&board.axis))
            });
            before = Some(board.axis);
            rounded(f64::to_degrees(turned), 1)
        })
        .collect();
    let board = way[0];
    let rectangle = Rectangle::new().set("x", metres(-board.half_length)).set("y", metres(-board.half_width));
    let rectangle =
        rectangle.set("width", metres(2.0 * board.half_length)).set("height", metres(2.0 * board.half_width));
    let mut rectangle = rectangle.set("fill", colours.last().map_or("none", String::as_str));
    if colours.iter().any(|colour| *colour != colours[0]) {
        rectangle = rectangle.add(score.animate("fill", colours));
    }
    let last = angles.last().map_or("0", String::as_str).to_owned();
    let turning = Group::new().set("transform", format!("rotate({last})"));
    let turning = turning.add(score.transform("rotate", &angles)).add(rectangle);
    Moving { bench, turning, translate: score.transform("translate", &centres), centres }
}
