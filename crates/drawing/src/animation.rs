//! A stretch of a motion as one animated SVG, for pages that show pictures but run no programs.
//!
//! Every board is a rectangle that SMIL moves and turns from sample to sample; a viewer without SMIL shows the last
//! sample. Boards move linearly between samples, so the error grows with the distance of the samples.

use svg::node::element::{Animate, AnimateTransform, Group, Rectangle};

use super::camera::{Camera, StageBox};
use super::marks::{Happened, Tense};
use super::palette::Palette;
use super::{Drawing, Surroundings, benches, marks, metres, rounded, sheet};
use bench_dragon_motion::model::board::Board;
use bench_dragon_motion::solve::Chain;

/// The time for which the last sample stays before the picture starts again, in seconds.
const HOLD: f64 = 4.0;

/// The number of colours of a board.
const COLOURS: usize = 16;

/// The greatest number of values in a countdown.
const MOST_NUMBERS: f64 = 200.0;

/// The times of an animation.
struct KeyTimes {
    /// The number of samples, and the number of further steps for which the last one stays.
    samples: usize,
    held: usize,
    /// The time between samples, in seconds.
    step: f64,
}

impl KeyTimes {
    fn steps(&self) -> usize {
        self.samples - 1 + self.held
    }

    fn seconds(&self) -> f64 {
        self.steps() as f64 * self.step
    }

    /// Returns the sample that is shown at a step.
    fn sample(&self, step: usize) -> usize {
        step.min(self.samples - 1)
    }

    /// Returns a time since the start as a fraction of the whole.
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

    /// Shows a hidden element from one second to another.
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
    /// Returns one SVG that shows chains at equal intervals in real time, at least two of them, and starts again.
    pub fn animated(&self, samples: &[(f64, Chain)]) -> String {
        let palette = self.look.theme.palette();
        let [(from, _), .., (until, last)] = samples else { return String::new() };
        let step = (until - from) / (samples.len() - 1) as f64;
        let key_times = KeyTimes { samples: samples.len(), held: (HOLD / step).ceil() as usize, step };
        let happened = marks::happened(self.timeline, *until);
        let now = happened.iter().rev().find(|past| past.tense == Tense::Present);
        let touching: Vec<usize> = now.into_iter().flat_map(Happened::benches).map(|bench| bench as usize).collect();
        let dragons = &self.dragons;
        let paths = dragons.all().iter().map(|of| self.path(of, palette));
        let mut stage = paths.fold(self.with_obstacles(self.stage(), palette), Group::add);
        let mut boards = Group::new().set("id", "benches");
        if self.motion.team().width * self.camera.scale > 4.0 {
            boards = boards.set("stroke", palette.ground).set("stroke-width", self.camera.metres(0.7));
        }
        let view = self.camera.view().padded(dragons.greatest_board());
        let ways: Vec<Vec<(usize, Board)>> =
            samples.iter().map(|(_, chain)| dragons.seen(chain, &StageBox::ALL)).collect();
        for (place, (bench, _)) in ways[0].iter().enumerate().rev() {
            let bench = *bench;
            let way: Vec<Board> = ways.iter().map(|boards| boards[place].1).collect();
            if !way.iter().any(|board| view.contains(board.centre)) {
                continue;
            }
            let colours = (0..=COLOURS).map(|colour| key_times.sample(colour * key_times.steps() / COLOURS));
            let colours: Vec<String> = match dragons.colour(bench) {
                Some(colour) => vec![colour.to_owned()],
                None => colours.map(|sample| self.fill(samples[sample].1.speed[bench], palette)).collect(),
            };
            let mut board = moving(&way, &colours, &key_times, &self.camera, bench);
            if dragons.is_head(bench) {
                let upright = lying(&way[0]);
                let sign = benches::head_sign(&upright, &self.camera, palette);
                board = board.adding(benches::outline(&upright, palette.ink, 1.6, &self.camera)).adding(sign);
            }
            if dragons.is_tail(bench) {
                board = board.adding(benches::tail_sign(&lying(&way[0]), &self.camera, palette));
            }
            if touching.contains(&bench) {
                let rim = benches::outline(&lying(&way[0]), palette.danger, 3.0, &self.camera);
                board = board.adding(rim.add(key_times.shown(until - from, key_times.seconds())));
            }
            boards = boards.add(board.finished());
        }
        stage = stage.add(boards);
        let mut document = self.document(*until, last, palette);
        let mut marks = Group::new().set("id", "marks");
        for past in happened.iter().filter(|past| past.tense == Tense::Present) {
            if let Some(place) = past.place(&self.camera) {
                let sign = past.sign(self.camera.sheet(place), palette);
                marks = marks.add(sign.add(key_times.shown(until - from, key_times.seconds())));
            }
        }
        document = document.add(Group::new().set("clip-path", "url(#frame)").add(stage).add(marks));
        if self.look.surroundings == Surroundings::Caption {
            document = document.add(self.countdown(*from, *until, now, &key_times, palette));
        }
        // From the end back to the start, the picture fades through the ground.
        let veil = Rectangle::new().set("width", super::WIDTH).set("height", rounded(self.height, 4));
        let dim = key_times.animate("opacity", &["1", "0", "0", "1"].map(str::to_owned));
        let times = ["0".to_owned(), key_times.part(0.8), key_times.part(key_times.seconds() - 0.8), "1".to_owned()];
        let veil = veil.set("fill", palette.ground).set("opacity", 0).add(dim.set("keyTimes", times.join(";")));
        self.finished(&document.add(veil))
    }

    /// Returns a countdown of seconds to the event that ends the stretch, and the event; without an event, the time.
    fn countdown(
        &self,
        from: f64,
        until: f64,
        now: Option<&Happened>,
        key_times: &KeyTimes,
        palette: &Palette,
    ) -> Group {
        let (x, y) = (28.0, 46.0);
        let mut group = Group::new().set("id", "countdown");
        let every = ((until - from) / MOST_NUMBERS).ceil().max(1.0);
        let heading = now.map_or("time".to_owned(), |now| now.timed.event.kind.name().replace('_', " "));
        let until_event = key_times.shown(0.0, until - from);
        let quiet = |content: &str| sheet::words(content, (x, y), 22, palette.quiet);
        let number = |content: &str| sheet::words(content, (x, y + 52.0), 54, palette.ink).set("font-weight", 700);
        let hidden = |text: svg::node::element::Text| text.set("visibility", "hidden");
        group = group.add(match now {
            Some(_) => hidden(quiet(&format!("{heading} in"))).add(until_event),
            None => quiet(&heading),
        });
        // Each number stays until the next. A countdown shows started seconds.
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
            group = group.add(hidden(shown).add(key_times.shown(begins.max(0.0), ends)));
        }
        let last =
            [key_times.shown(until - from, key_times.seconds()), key_times.shown(until - from, key_times.seconds())];
        let [one, other] = last;
        match now {
            None => group.add(number(&format!("{} s", rounded(until, 1))).add(one)),
            Some(now) => {
                let heading = sheet::words(&heading.to_uppercase(), (x, y + 6.0), 34, palette.danger);
                group
                    .add(heading.set("font-weight", 800).add(one))
                    .add(sheet::words(&self.concerned(now), (x, y + 40.0), 22, palette.danger).add(other))
            }
        }
    }
}

impl Drawing<'_> {
    /// Returns the benches of an event in words.
    fn concerned(&self, now: &Happened) -> String {
        if self.dragons.have_names() {
            let roster = &self.dragons.roster;
            let names =
                now.benches().map(|bench| roster.bench(bench).replace(" (the head)", "").replace(" (the tail)", ""));
            return names.collect::<Vec<_>>().join(" and ");
        }
        let benches: Vec<String> = now.benches().map(|bench| (bench + 1).to_string()).collect();
        match benches.len() {
            0 => String::new(),
            1 => format!("bench {}", benches[0]),
            _ => format!("benches {}", benches.join(" and ")),
        }
    }
}

/// Returns the board at the origin, along x.
fn lying(board: &Board) -> Board {
    Board {
        centre: bench_dragon_motion::model::Point::origin(),
        axis: bench_dragon_motion::model::Vector::x(),
        ..*board
    }
}

/// An animated board: rotating elements in a group that is translated.
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

fn moving(way: &[Board], colours: &[String], key_times: &KeyTimes, camera: &Camera, bench: usize) -> Moving {
    // A third of a unit of the sheet.
    let decimals = (3.0 * camera.scale).log10().ceil().max(0.0) as usize;
    let steps = || (0..=key_times.steps()).map(|step| way[key_times.sample(step)]);
    let centres: Vec<String> = steps()
        .map(|board| format!("{} {}", rounded(board.centre.x, decimals), rounded(board.centre.y, decimals)))
        .collect();
    let (mut turned, mut before) = (0.0, None);
    let angles: Vec<String> = steps()
        .map(|board| {
            let heading = board.axis.y.atan2(board.axis.x);
            // The shorter way from one heading to the next, so that no board makes a full turn.
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
        rectangle = rectangle.add(key_times.animate("fill", colours));
    }
    let last = angles.last().map_or("0", String::as_str).to_owned();
    let turning = Group::new().set("transform", format!("rotate({last})"));
    let turning = turning.add(key_times.transform("rotate", &angles)).add(rectangle);
    Moving { bench, turning, translate: key_times.transform("translate", &centres), centres }
}
