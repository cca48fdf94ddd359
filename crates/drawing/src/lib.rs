//! Pictures of the stage: a chain at one time as SVG text, or a stretch of a motion as one animated SVG.
//!
//! In: a motion, its events, chains at times, a [`Look`]. Out: text. Pure. The plots of `trade` and of the soak report
//! take their colours from [`palette`].
//!
//! The stage is drawn in metres, y upward, in a group whose transform maps it to the sheet, so that an editor shows
//! true coordinates. It is clipped at the viewport.

pub mod animation;
mod benches;
pub mod camera;
pub mod dragons;
mod eye;
mod figure;
pub mod ground;
mod labels;
mod lanterns;
mod light;
mod look;
mod marks;
pub mod palette;
mod route;
mod scale;
mod seat;
mod sheet;
pub mod swept;
mod village;

use svg::Document;
use svg::node::element::{ClipPath, Definitions, Description, Group, Path, Rectangle, Title};

use bench_dragon_messages::sentence::rounded;
use bench_dragon_motion::Motion;
use bench_dragon_motion::model::Point;
use bench_dragon_motion::solve::Chain;
use bench_dragon_motion::timeline::Timeline;
use camera::{Camera, StageBox, Viewport};
use dragons::{Dragons, Drawn};
use labels::Name;
pub use look::{Framing, Length, Look, Seat, Style, Surroundings, Theme};
use marks::{Happened, Tense};
use palette::Palette;
pub use scale::mean_speeds;
use scale::{ColourScale, Speeds};
use swept::SweptArea;

/// The width of a sheet in its own units, for any size in print or on a screen.
const WIDTH: f64 = 960.0;

/// The font of all text, the same as on the page.
const FACE: &str = "system-ui, sans-serif";

/// The content of a picture, or of a sequence of pictures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    boards: StageBox,
    speeds: Speeds,
    last: f64,
}

impl Extent {
    /// No content.
    pub const NONE: Self = Self { boards: StageBox::EMPTY, speeds: Speeds::NONE, last: 0.0 };

    /// Adds the chain at a time.
    pub fn include(&mut self, dragons: &Dragons, time: f64, chain: &Chain) {
        for (_, board) in dragons.seen(chain, &StageBox::ALL) {
            let corners = board.corners();
            corners.into_iter().for_each(|corner| self.boards.include(corner));
        }
        self.speeds.include(chain);
        self.last = self.last.max(time);
    }

    /// Adds the ground that boards cover.
    pub fn include_ground(&mut self, area: &SweptArea) {
        let corners = area.polygons().iter().flatten().flatten();
        corners.for_each(|corner| self.boards.include(Point::from(*corner)));
    }
}

/// One camera and one look for one picture or many.
pub struct Drawing<'a> {
    name: &'a str,
    dragons: Dragons<'a>,
    /// The motion of the first dragon.
    motion: &'a Motion,
    timeline: &'a Timeline,
    look: Look,
    height: f64,
    camera: Camera,
    scale: Option<ColourScale>,
    ground: Option<&'a SweptArea>,
}

impl<'a> Drawing<'a> {
    /// Creates the drawings of a scene called `name`. `extent` holds the content of all pictures.
    pub fn new(name: &'a str, dragons: Dragons<'a>, timeline: &'a Timeline, extent: &Extent, look: Look) -> Self {
        let motion = dragons.first();
        let shown = match look.framing {
            Framing::Everything => {
                let mut boards = extent.boards;
                ground::include(motion.ground(), &mut boards);
                let margin = match look.style {
                    Style::Plan => 0.04 * boards.width().max(boards.height()) + motion.team().widest(),
                    Style::Lanterns | Style::Seat(_) => lanterns::MARGIN,
                };
                boards.padded(margin)
            }
            Framing::Radius(radius) => StageBox::around(Point::origin(), 2.0 * radius, 2.0 * radius),
            // Without a height, it follows from the viewport.
            Framing::View(centre, across, high) => StageBox::around(centre, across, high.unwrap_or(f64::MIN_POSITIVE)),
        };
        // A straight team still gets space beside it, and a tall one is not higher than a page.
        let shape = match look.framing {
            _ if matches!(look.style, Style::Seat(_)) => seat::SHAPE,
            Framing::View(_, across, high) => (high.unwrap_or(across) / across).clamp(0.05, 4.0),
            _ => (shown.height() / shown.width()).clamp(0.3, 1.3),
        };
        let rows =
            1 + marks::happened(timeline, extent.last).iter().filter(|past| past.timed.event.place.is_some()).count();
        let (viewport, height) = match look.surroundings {
            Surroundings::Words => {
                let (above, below) = sheet::margins(rows);
                let height = look.sheet_height().unwrap_or(above + below + shape * sheet::viewport_width());
                let height = height.max(above + below + 50.0);
                (sheet::viewport(height, rows), height)
            }
            Surroundings::Caption | Surroundings::Nothing => {
                let height = look.sheet_height().unwrap_or(shape * WIDTH);
                (Viewport { left: 0.0, top: 0.0, width: WIDTH, height }, height)
            }
        };
        let camera = Camera::showing(&shown, viewport);
        let scale = extent.speeds.scale(motion.head_speed());
        Self { name, dragons, motion, timeline, look, height, camera, scale, ground: None }
    }

    /// Returns the same drawings above the ground that boards cover.
    pub fn on_ground(self, area: &'a SweptArea) -> Self {
        Self { ground: Some(area), ..self }
    }

    /// Returns the SVG of a chain at a time.
    pub fn svg(&self, time: f64, chain: &Chain) -> String {
        match self.look.style {
            Style::Plan => self.plan(time, chain),
            Style::Lanterns => self.lanterns(time, chain),
            Style::Seat(seat) => self.seat(time, chain, seat),
        }
    }

    fn plan(&self, time: f64, chain: &Chain) -> String {
        let palette = self.look.theme.palette();
        let happened = marks::happened(self.timeline, time);
        let boards = self.dragons.seen(chain, &self.camera.view());
        let overlaps = self.overlaps(chain);
        let (outlined, what) = outlined(&happened, &overlaps);
        let outlined: Vec<usize> =
            outlined.into_iter().filter(|bench| boards.iter().any(|(seen, _)| seen == bench)).collect();
        let mut stage = self.with_obstacles(self.stage(), palette);
        if let Some(area) = self.ground {
            stage = stage.add(covered(area, palette));
        }
        for of in self.dragons.all() {
            stage = stage.add(self.path(of, palette));
        }
        let fill = |bench: usize| match self.dragons.colour(bench) {
            Some(colour) => colour.to_owned(),
            None => self.fill(chain.speed[bench], palette),
        };
        stage = stage.add(benches::group(&boards, fill, &self.camera, palette));
        stage = stage.add(benches::handles(self.motion.team(), chain, &self.camera, palette));
        let mut marks = Group::new().set("id", "marks");
        let (mut events, mut places) = (Vec::new(), Vec::new());
        for past in &happened {
            if let Some(place) = past.place(&self.camera) {
                let place = self.camera.sheet(place);
                places.push(place);
                marks = marks.add(past.sign(place, palette));
                events.push((*past, past.sentence("here", &self.dragons.roster)));
            }
        }
        let (mut signs, mut names) = ((false, false), Vec::new());
        for (bench, board) in boards.iter().rev() {
            let is_head = self.dragons.is_head(*bench);
            if self.dragons.is_tail(*bench) {
                stage = stage.add(benches::tail_sign(board, &self.camera, palette));
                signs.1 = true;
            }
            if outlined.contains(bench) {
                stage = stage.add(benches::outline(board, palette.ground, 6.0, &self.camera));
                stage = stage.add(benches::outline(board, palette.danger, 3.0, &self.camera));
            } else if is_head {
                stage = stage.add(benches::outline(board, palette.ink, 2.0, &self.camera));
            }
            if is_head {
                stage = stage.add(benches::head_sign(board, &self.camera, palette));
                signs.0 = true;
            }
            if let Some(name) = self.dragons.label(*bench, &outlined) {
                let colour = if outlined.contains(bench) { palette.danger } else { palette.ink };
                let number = bench + 1;
                names.push(Name { words: name, number, board: *board, colour });
            }
        }
        // Names of outlined boards are placed first.
        names.sort_by_key(|name| !outlined.contains(&(name.number - 1)));
        let mut document = self.document(time, chain, palette);
        // The clip path is in sheet units, whatever the units of the group.
        document = document.add(Group::new().set("clip-path", "url(#frame)").add(stage).add(marks));
        if self.look.surroundings == Surroundings::Words {
            let by_speed = !self.dragons.have_names();
            let coloured = by_speed && boards.iter().any(|(bench, _)| chain.speed[*bench].is_finite());
            let contents = sheet::Contents {
                scale: self.scale.filter(|_| coloured),
                head: signs.0,
                tail: signs.1,
                outlined: (!outlined.is_empty()).then_some(what),
                ground: self.ground.map(|area| format!("ground covered: {} m\u{b2}", rounded(area.area(), 1))),
                events: &events,
            };
            let (below, colour) = self.subtitle(time, &happened, &overlaps, palette);
            if !self.motion.ground().is_empty() {
                document = document.add(ground::labels(self.motion.ground(), &self.camera, palette));
            }
            document = document
                .add(labels::labels(&names, &boards, &places, self.motion.team().hole_inset, &self.camera, palette))
                .add(sheet::axes(&self.camera, palette))
                .add(sheet::title(&self.title(time), &below, colour, palette))
                .add(sheet::legend(&contents, &self.camera, palette));
        }
        self.finished(&document)
    }

    /// Returns the text of a document, with the dark rules if requested.
    fn finished(&self, document: &Document) -> String {
        let svg = document.to_string();
        if self.look.theme == Theme::Auto { palette::with_dark_rules(&svg) } else { svg }
    }

    /// Returns an empty sheet with its ground, its clip path, and its text for screen readers.
    fn document(&self, time: f64, chain: &Chain, palette: &Palette) -> Document {
        let part = self.height / WIDTH;
        let ground = Rectangle::new().set("width", WIDTH).set("height", rounded(self.height, 4));
        let clip = ClipPath::new().set("id", "frame").add(sheet::outline(self.camera.viewport));
        Document::new()
            .set("viewBox", format!("0 0 {WIDTH} {}", rounded(self.height, 4)))
            .set("width", self.look.width.attribute(1.0))
            .set("height", self.look.width.attribute(part))
            .set("role", "img")
            .add(Title::new(text(&self.title(time))))
            .add(Description::new().add(svg::node::Text::new(text(&self.description(chain)))))
            .add(Definitions::new().add(clip))
            .add(ground.set("fill", palette.ground))
    }

    /// Returns the group of the stage, in metres.
    fn stage(&self) -> Group {
        Group::new().set("id", "stage").set("transform", self.camera.transform())
    }

    /// Returns the group of the stage with the obstacles.
    fn with_obstacles(&self, stage: Group, palette: &Palette) -> Group {
        let ground = self.motion.ground();
        if ground.is_empty() { stage } else { stage.add(ground::group(ground, &self.camera, palette)) }
    }

    fn path(&self, of: &Drawn, palette: &Palette) -> Path {
        let id = if of.name.is_empty() { "path".to_owned() } else { format!("path-{}", of.name) };
        let path = Path::new().set("id", id).set("d", route::data(of.motion, &self.camera)).set("fill", "none");
        // Finer where turns are close together.
        let pitches = of.motion.description().pitches();
        let turns = pitches.fold(f64::INFINITY, f64::min) * self.camera.scale;
        let width = self.camera.metres((0.07 * turns).clamp(0.5, 1.3));
        path.set("stroke", palette.faint).set("stroke-width", width).set("stroke-linejoin", "round")
    }

    fn fill(&self, speed: f64, palette: &Palette) -> String {
        match self.scale {
            Some(scale) if speed.is_finite() => palette.shade(scale.part(speed)),
            _ => palette.still.to_owned(),
        }
    }

    fn overlaps(&self, chain: &Chain) -> Vec<(usize, usize, f64)> {
        // A board that overlaps a visible board may be outside the picture.
        let near = self.dragons.seen(chain, &self.camera.view().padded(self.dragons.greatest_board()));
        benches::overlapping(&near, 1e-9 * self.motion.team().longest_link())
    }

    fn title(&self, time: f64) -> String {
        format!("{} at {} s", self.name, rounded(time, 3))
    }

    /// Returns the line below the title, and its colour.
    fn subtitle<'p>(
        &self,
        time: f64,
        happened: &[Happened],
        overlaps: &[(usize, usize, f64)],
        palette: &'p Palette,
    ) -> (String, &'p str) {
        let now = happened.iter().rev().find(|happened| happened.tense == Tense::Present);
        if let Some(now) = now {
            let place = now.timed.event.place.unwrap_or_default();
            let place = format!("at ({}, {}) m", rounded(place.x, 3), rounded(place.y, 3));
            return (now.sentence(&place, &self.dragons.roster), palette.danger);
        }
        if let Some(sentence) = marks::overlap_sentence(overlaps, &self.dragons.roster) {
            return (sentence, palette.danger);
        }
        let next = self.timeline.events().iter().find(|event| event.time > time);
        let next = next
            .map(|next| format!("{} in {} s", next.event.kind.name().replace('_', " "), rounded(next.time - time, 3)));
        (next.unwrap_or_default(), palette.quiet)
    }

    /// Returns the picture in words.
    fn description(&self, chain: &Chain) -> String {
        let mut words = String::new();
        for Drawn { name, first, motion } in self.dragons.all() {
            let (x, y) = (rounded(chain.x[*first], 3), rounded(chain.y[*first], 3));
            let called = if name.is_empty() { String::new() } else { format!(", {name},") };
            let space = if *first == 0 { "" } else { " " };
            words += &format!(
                "{space}A bench dragon{called} of {} benches seen from above; the front handle of its head is at ({x}, {y}) m.",
                motion.team().benches
            );
        }
        for timed in self.timeline.events() {
            let (kind, time) = (timed.event.kind.name().replace('_', " "), rounded(timed.time, 3));
            let roster = &self.dragons.roster;
            let benches = [timed.event.bench_a, timed.event.bench_b].into_iter().flatten();
            let benches: Vec<String> = benches
                .map(|bench| text(&roster.bench(bench)).replace(" (the head)", "").replace(" (the tail)", ""))
                .collect();
            let benches = if benches.is_empty() { String::new() } else { format!(", {}", benches.join(" and ")) };
            words += &format!(" Event: {kind} at {time} s{benches}.");
        }
        words + " Lengths are metres; benches count from 1 in words and from 0 in the names of elements."
    }
}

/// Returns the benches to outline and their state: touching at this time, or overlapping.
fn outlined(happened: &[Happened], overlaps: &[(usize, usize, f64)]) -> (Vec<usize>, &'static str) {
    let touching = happened.iter().filter(|past| past.tense == Tense::Present);
    let touching = touching.filter(|past| past.timed.event.bench_b.is_some()).flat_map(Happened::benches);
    let mut benches: Vec<usize> = touching.map(|bench| bench as usize).collect();
    let what = if overlaps.is_empty() { "boards that touch" } else { "boards that overlap" };
    benches.extend(overlaps.iter().flat_map(|(one, other, _)| [*one, *other]));
    benches.sort_unstable();
    benches.dedup();
    (benches, what)
}

/// The opacity of the ground that boards cover, so that keep-outs are seen through it.
const SWEPT: f64 = 0.3;

/// Returns the ground that boards cover.
fn covered(area: &SweptArea, palette: &Palette) -> Path {
    let mut data = String::new();
    for ring in area.polygons().iter().flatten() {
        let corners: Vec<String> = ring.iter().map(|[x, y]| format!("{} {}", metres(*x), metres(*y))).collect();
        data += &format!("M{}z", corners.join("L"));
    }
    Path::new()
        .set("id", "swept")
        .set("d", data)
        .set("fill-rule", "evenodd")
        .set("fill", palette.warning)
        .set("fill-opacity", SWEPT)
}

/// Returns metres as SVG data, to a tenth of a micrometre.
fn metres(value: f64) -> String {
    rounded(value, 7)
}

/// Returns text with the special characters of HTML escaped.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Returns text without the control characters that XML forbids.
fn text(content: &str) -> String {
    let allowed = |letter: &char| !letter.is_control() && !matches!(letter, '\u{fffe}' | '\u{ffff}');
    content.chars().filter(allowed).collect()
}
