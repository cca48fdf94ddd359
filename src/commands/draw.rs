//! `draw`: the stage as SVG: of one time, of many times as numbered files, or as one animation.

use std::path::{Path, PathBuf};

use bench_dragon::drawing::dragons::Dragons;
use bench_dragon::drawing::swept::SweptArea;
use bench_dragon::drawing::{Drawing, Extent, Framing, Length, Look, Seat, Style, Surroundings, Theme, mean_speeds};
use bench_dragon::messages::sentence::Expected;
use bench_dragon::motion::model::Point;
use bench_dragon::motion::solve::{Chain, Solver, Velocities};
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::show::scene::{Accepted, RangeError, Scene};
use bench_dragon::show::solve_at_or_just_before;
use serde::Serialize;

use super::signals::{stop_searches_on_signals, unstopped};
use super::solve::time_of;
use super::swept::{Benches, Stretch, benches, swept};
use super::{
    CommandError, Common, Output, figure, make_solver, number, progress_bar, search_timeline, seconds, svg_file,
    warn_of_doubts,
};

/// Arguments of `draw`.
#[derive(Debug, clap::Args)]
pub struct DrawArguments {
    /// Simulated time (60, 1:30), or contact, obstacle, stall, lock, path_end
    #[arg(long, value_name = "TIME", default_value = "0", allow_negative_numbers = true, conflicts_with = "every")]
    at: String,
    /// Write to a file instead of standard output; with --every a pattern such as frames/%05d.svg
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    many: Many,
    #[command(flatten)]
    look: LookArguments,
}

/// More than one time.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Many times")]
struct Many {
    /// Simulated time between two pictures, which share one camera and one colour scale; with --until
    #[arg(long, value_name = "TIME", value_parser = seconds, requires = "until", allow_negative_numbers = true, group = "stretch")]
    every: Option<f64>,
    /// Draw the ground that the boards cover, with its area, under the boards of --at; a real tail that whips covers
    /// more
    #[arg(long, group = "stretch")]
    swept: bool,
    /// The first time: seconds, or an event
    #[arg(long, value_name = "TIME", default_value = "0", requires = "stretch", allow_negative_numbers = true)]
    from: String,
    /// The last time, inclusive: seconds, or an event; with --swept by default the end of the show
    #[arg(long, value_name = "TIME", requires = "stretch", allow_negative_numbers = true)]
    until: Option<String>,
    /// The benches whose ground is drawn, counted from 1, of several dragons as in gold:1-20; by default all
    #[arg(long, value_name = "FIRST-LAST", requires = "swept", value_parser = benches)]
    benches: Option<Benches>,
    /// Draw one SVG that moves in real time, instead of many pictures, with a moment about every --every seconds
    #[arg(long, requires = "every")]
    animated: bool,
}

/// The look of the picture.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "The picture")]
struct LookArguments {
    /// The distance from the centre of the stage to the edge of the picture, in metres; by default all boards are shown
    #[arg(long, value_name = "METRES", conflicts_with = "view", allow_negative_numbers = true)]
    radius: Option<f64>,
    /// The point in the middle of the picture, its width and its height, metres, as in 14,7.5,28,15; without the height
    /// it is as high as the sheet, and the sheet is a square
    #[arg(long, value_name = "X,Y,WIDTH,HEIGHT", value_parser = view, allow_hyphen_values = true)]
    view: Option<Framing>,
    /// plan; lanterns: the stage at night in the light of the dragon's lanterns; seat or seat=TURNS,DISTANCE,HEIGHT:
    /// the same from a place in the audience
    #[arg(long, value_name = "STYLE", default_value = "plan", value_parser = style, conflicts_with = "animated")]
    look: Style,
    /// light, dark, or auto: light, and dark if a browser prefers that
    #[arg(long, value_name = "THEME", default_value = "light", value_parser = theme)]
    theme: Theme,
    /// The width in print or on a screen, as in 210mm or 1920px; the whole drawing scales with it
    #[arg(long, value_name = "LENGTH", default_value = "960px", value_parser = length)]
    width: Length,
    /// The height; by default that of the content
    #[arg(long, value_name = "LENGTH", value_parser = length)]
    height: Option<Length>,
    /// Draw the stage alone, without axes, title and legend
    #[arg(long)]
    no_axes: bool,
}

/// A line of `draw --json`.
#[derive(Serialize)]
struct PictureLine<'a> {
    /// Simulated seconds; of an animation, its last moment.
    time: f64,
    /// The file written.
    file: Option<&'a Path>,
    /// The picture, if no file was named.
    svg: Option<&'a str>,
}

/// The greatest number of pictures of one command.
const MOST: f64 = 1e6;

/// The greatest number of moments of an animation: browsers show larger files badly.
const MOST_MOMENTS: f64 = 2000.0;

/// The least number of seconds between two moments of an animation. The last moment stays for seconds, and the SVG
/// repeats its values at each step of that time.
const LEAST_STEP: f64 = 1e-3;

/// The radius or the width of a picture.
const VIEW: Accepted = Accepted { least: 1e-9, greatest: 1e9, unit: "metres" };

/// Draws the stage.
pub fn draw(common: &Common, arguments: &DrawArguments) -> Result<(), CommandError> {
    svg_file("--output", arguments.output.as_deref())?;
    let scene = common.load_scene()?;
    warn_of_doubts(&scene);
    let look = arguments.look.look()?;
    stop_searches_on_signals()?;
    let timeline = search_timeline(&scene, common);
    unstopped()?;
    // Boards are coloured by speed, even if the scene publishes no speeds.
    let solver = make_solver(&scene, Velocities::Computed, common)?;
    let mut session = Session::new(&scene, &timeline, solver, arguments.output.as_deref(), common.json);
    let many = &arguments.many;
    match (many.every, &many.until) {
        (Some(every), Some(until)) => {
            let until = time_of("--until", until, &timeline)?;
            let from = time_of("--from", &many.from, &timeline)?;
            let steps = steps(every, from, until)?;
            if many.animated {
                if look.theme == Theme::Auto {
                    return Err(CommandError::BadInput(
                        "--theme auto is for pictures that stand, expected light or dark with --animated".to_owned(),
                    ));
                }
                session.draw_animated(look, (from, until), (until - from) / every)
            } else {
                let times: Vec<f64> = (0..=steps).map(|step| from + step as f64 * every).collect();
                session.draw_many(look, &times, common)
            }
        }
        _ => {
            let time = time_of("--at", &arguments.at, &timeline)?;
            let stretch =
                Stretch { from: Some(&many.from), until: many.until.as_deref(), benches: many.benches.as_ref() };
            let ground = many.swept.then(|| swept(&scene, &timeline, stretch, common)).transpose()?;
            session.draw_one(look, time, ground.as_ref().map(|ground| &ground.area))
        }
    }
}

/// Returns the number of steps of --every between two times.
fn steps(every: f64, from: f64, until: f64) -> Result<u64, CommandError> {
    if !(every.is_finite() && every > 0.0) {
        return Err(CommandError::BadInput(format!(
            "--every is {}, expected a number of seconds above 0",
            number(every)
        )));
    }
    if until < from {
        return Err(CommandError::BadInput(format!(
            "--until is before --from, expected a time from {} s on",
            number(from)
        )));
    }
    // A last picture that rounding puts past --until by less than a part in 10^9 of a step still counts.
    let steps = ((until - from) / every + 1e-9).floor();
    let pictures = steps + 1.0;
    if pictures > MOST {
        return Err(CommandError::BadInput(format!(
            "--every {} gives {pictures:e} pictures, expected at most {MOST:e}",
            number(every)
        )));
    }
    Ok(steps as u64)
}

/// A scene being drawn, and the destination of its pictures.
struct Session<'a> {
    scene: &'a Scene,
    timeline: &'a Timeline,
    solver: Box<dyn Solver>,
    chain: Chain,
    earlier: Chain,
    file: Option<&'a Path>,
    json: bool,
}

impl<'a> Session<'a> {
    fn new(
        scene: &'a Scene,
        timeline: &'a Timeline,
        solver: Box<dyn Solver>,
        file: Option<&'a Path>,
        json: bool,
    ) -> Self {
        let [chain, earlier] = [0, 1].map(|_| Chain::new(scene.ensemble.handles()));
        Self { scene, timeline, solver, chain, earlier, file, json }
    }

    fn solve(&mut self, time: f64) -> Result<(), CommandError> {
        unstopped()?;
        let solver = self.solver.as_mut();
        let time = solve_at_or_just_before(solver, time, &mut self.chain)
            .map_err(|none| CommandError::Failed(format!("at {} s: {none}", figure(time))))?;
        // Dragons with names are coloured by their names.
        if let Some(motion) = self.scene.ensemble.only() {
            mean_speeds(motion, solver, time, &mut self.chain, &mut self.earlier);
        }
        Ok(())
    }

    fn extent(&mut self, times: &[f64]) -> Result<Extent, CommandError> {
        let mut extent = Extent::NONE;
        let dragons = Dragons::of(&self.scene.ensemble);
        for time in times {
            self.solve(*time)?;
            extent.include(&dragons, *time, &self.chain);
        }
        Ok(extent)
    }

    fn drawing<'d>(&self, extent: &Extent, look: Look) -> Drawing<'d>
    where
        'a: 'd,
    {
        Drawing::new(&self.scene.name, Dragons::of(&self.scene.ensemble), self.timeline, extent, look)
    }

    fn draw_one(&mut self, look: Look, time: f64, swept: Option<&SweptArea>) -> Result<(), CommandError> {
        let mut extent = self.extent(&[time])?;
        swept.iter().for_each(|area| extent.include_ground(area));
        let drawing = self.drawing(&extent, look);
        let svg = swept.into_iter().fold(drawing, Drawing::on_ground).svg(time, &self.chain);
        self.write(time, &svg, self.file)
    }

    fn draw_many(&mut self, look: Look, times: &[f64], common: &Common) -> Result<(), CommandError> {
        let pattern = self.file.and_then(Pattern::of).ok_or_else(|| {
            CommandError::BadInput(
                "--every draws many files, expected -o with a pattern such as frames/%05d.svg".to_owned(),
            )
        })?;
        let extent = self.extent(times)?;
        let drawing = self.drawing(&extent, look);
        let bar = progress_bar(times.len() as u64, common).with_message("drawing");
        for (number, time) in times.iter().enumerate() {
            self.solve(*time)?;
            self.write(*time, &drawing.svg(*time, &self.chain), Some(&pattern.file(number)))?;
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(())
    }

    fn draw_animated(&mut self, look: Look, (from, until): (f64, f64), steps: f64) -> Result<(), CommandError> {
        // The steps are stretched a little, so that the last moment is --until itself.
        let steps = steps.round();
        if !(1.0..=MOST_MOMENTS).contains(&steps) {
            return Err(CommandError::BadInput(format!(
                "--animated from {} to {} s has {} moments after the first, expected 1 to {MOST_MOMENTS}: change --every",
                figure(from),
                figure(until),
                number(steps)
            )));
        }
        let step = (until - from) / steps;
        if step < LEAST_STEP {
            return Err(CommandError::BadInput(format!(
                "--animated from {} to {} s has steps of {step:e} s, expected at least {LEAST_STEP}: change --every",
                figure(from),
                figure(until)
            )));
        }
        let times: Vec<f64> =
            (0..=steps as u64).map(|step| until - (until - from) * (steps - step as f64) / steps).collect();
        let extent = self.extent(&times)?;
        let mut moments = Vec::with_capacity(times.len());
        for time in times {
            self.solve(time)?;
            moments.push((time, self.chain.clone()));
        }
        let surroundings = match look.surroundings {
            Surroundings::Words => Surroundings::Caption,
            other => other,
        };
        let svg = self.drawing(&extent, Look { surroundings, ..look }).animated(&moments);
        self.write(until, &svg, self.file)
    }

    /// Writes a picture to its destination, and with --json a line about it.
    fn write(&self, time: f64, svg: &str, file: Option<&Path>) -> Result<(), CommandError> {
        if let Some(file) = file {
            let mut output = Output::file(file)?;
            output.line(svg)?;
            output.finish()?;
        }
        let mut output = Output::standard();
        match (self.json, file) {
            (true, _) => output.json(&PictureLine { time, file, svg: file.is_none().then_some(svg) })?,
            (false, None) => output.line(svg)?,
            (false, Some(_)) => {}
        }
        output.finish()
    }
}

/// A file's name with a place for a number, as ffmpeg reads it: `%d`, or `%05d` for five digits.
struct Pattern {
    before: String,
    digits: usize,
    after: String,
}

impl Pattern {
    fn of(file: &Path) -> Option<Self> {
        let (before, rest) = file.to_str()?.split_once('%')?;
        let (digits, after) = rest.split_once('d')?;
        let digits = if digits.is_empty() { 0 } else { digits.strip_prefix('0')?.parse().ok().filter(|n| *n < 20)? };
        Some(Self { before: before.to_owned(), digits, after: after.to_owned() })
    }

    fn file(&self, number: usize) -> PathBuf {
        format!("{}{number:0digits$}{}", self.before, self.after, digits = self.digits).into()
    }
}

impl LookArguments {
    fn look(&self) -> Result<Look, CommandError> {
        let framing = match (self.radius, self.view) {
            (Some(radius), _) => Framing::Radius(VIEW.check("--radius", radius)?),
            (None, Some(view)) => view,
            (None, None) => Framing::Everything,
        };
        let is_bare = self.no_axes || self.look != Style::Plan;
        let surroundings = if is_bare { Surroundings::Nothing } else { Surroundings::Words };
        Ok(Look { style: self.look, theme: self.theme, framing, surroundings, width: self.width, height: self.height })
    }
}

fn style(text: &str) -> Result<Style, Expected> {
    match text {
        "plan" => Ok(Style::Plan),
        "lanterns" => Ok(Style::Lanterns),
        "seat" => seat("0"),
        _ => match text.strip_prefix("seat=") {
            Some(numbers) => seat(numbers),
            None => Err(Expected("plan, lanterns, seat or seat=TURNS,DISTANCE,HEIGHT".into())),
        },
    }
}

fn seat(text: &str) -> Result<Style, Expected> {
    let numbers: Vec<f64> = text.split(',').map(|number| number.trim().parse().unwrap_or(f64::NAN)).collect();
    let within = |at: usize, (least, most): (f64, f64)| numbers.get(at).is_none_or(|one| (least..=most).contains(one));
    if numbers.len() > 3 || !within(0, (-1e6, 1e6)) || !within(1, (2.0, 5000.0)) || !within(2, (0.3, 1000.0)) {
        let expected = "turns, a distance from 2 to 5000 m and a height from 0.3 to 1000 m, as in seat=0.25,19,4.4";
        return Err(Expected(expected.into()));
    }
    let height = numbers.get(2).copied().unwrap_or(4.4);
    Ok(Style::Seat(Seat { turns: numbers[0], distance: numbers.get(1).copied(), height }))
}

fn theme(text: &str) -> Result<Theme, Expected> {
    match text {
        "light" => Ok(Theme::Light),
        "dark" => Ok(Theme::Dark),
        "auto" => Ok(Theme::Auto),
        _ => Err(Expected("light, dark or auto".into())),
    }
}

/// A text that names no view.
#[derive(Debug, thiserror::Error)]
enum FramingError {
    #[error(transparent)]
    Form(#[from] Expected),
    #[error(transparent)]
    Range(#[from] RangeError),
    #[error("the width is {}, expected at least {} metres there", number(*.across), number(*.least))]
    Narrow { across: f64, least: f64 },
}

fn view(text: &str) -> Result<Framing, FramingError> {
    let numbers: Vec<f64> = text.split(',').map(|number| number.trim().parse().unwrap_or(f64::NAN)).collect();
    match numbers[..] {
        [x, y, across, ..] if numbers.len() <= 4 => {
            for coordinate in [x, y] {
                Accepted::PLACE.check("a coordinate", coordinate)?;
            }
            VIEW.check("the width", across)?;
            let high = numbers.get(3).map(|high| VIEW.check("the height", *high)).transpose()?;
            // Fewer digits would be left of the coordinates in the picture.
            let least = 1e-9 * x.abs().max(y.abs());
            if across < least {
                return Err(FramingError::Narrow { across, least });
            }
            Ok(Framing::View(Point::new(x, y), across, high))
        }
        _ => Err(Expected("a point, a width and perhaps a height in metres, as in 1.5,2,4".into()).into()),
    }
}

fn length(text: &str) -> Result<Length, Expected> {
    let parse = |digits: &str| digits.trim().parse::<f64>().ok().filter(|length| (1.0..=1e5).contains(length));
    let found = match text.strip_suffix("mm") {
        Some(digits) => parse(digits).map(Length::Millimetres),
        None => parse(text.strip_suffix("px").unwrap_or(text)).map(Length::Pixels),
    };
    found.ok_or(Expected("a length from 1 to 100000 such as 210mm, 1920px or 1920".into()))
}
