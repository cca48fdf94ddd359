//! `trade`: the cost of accuracy on this scene and machine, for every solver.

use std::io::{IsTerminal, stderr};
use std::path::PathBuf;

use bench_dragon::drawing::palette::{LIGHT, SERIES, channels, with_dark_rules};
use bench_dragon::messages::sentence::Expected;
use bench_dragon::motion::ensemble::{Dragon, Ensemble};
use bench_dragon::show::scene::Scene;
use bench_dragon::trade::display::{self, Display, DisplayMeasurement, Precision, Reader};
use bench_dragon::trade::{
    LAST_SECOND_SAMPLES, Measurement, SPREAD_SAMPLES, Subject, TradeError, measure, publisher_frame_ns,
};
use plotters::coord::combinators::LogCoord;
use plotters::prelude::*;
use serde::Serialize;

use super::signals::{report, stop_searches_on_signals, unstopped};
use super::{CommandError, Common, Output, progress_bar, seconds, svg_file, warn_of_gap};

/// Arguments of `trade`.
#[derive(Debug, Clone, clap::Args)]
pub struct TradeArguments {
    /// Draw error against cost as an SVG
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
    /// With --json, print the errors at the moment of display too; every option below implies it
    #[arg(long, help_heading = "The display")]
    pub display: bool,
    /// Draw the error at the moment of display against bytes per second as an SVG
    #[arg(long, value_name = "FILE", help_heading = "The display")]
    pub display_plot: Option<PathBuf>,
    /// The rate of the display in pictures per second [default: 60]
    #[arg(long, value_name = "HZ", value_parser = display_rate, help_heading = "The display")]
    pub display_rate: Option<f64>,
    /// Delay of the display behind the stream [default: 0 for `hold`, else one publishing period]
    #[arg(long, value_name = "TIME", value_parser = delay, help_heading = "The display")]
    pub delay: Option<f64>,
}

impl TradeArguments {
    /// Returns true if JSON lines of the display are requested: by default only the solvers have lines.
    fn wants_display(&self) -> bool {
        self.display || self.display_plot.is_some() || self.display_rate.is_some() || self.delay.is_some()
    }
}

fn display_rate(text: &str) -> Result<f64, Expected> {
    let rate = text.parse().unwrap_or(f64::NAN);
    if rate > 0.0 && rate < f64::INFINITY { Ok(rate) } else { Err(Expected("a rate above 0, in hertz".into())) }
}

fn delay(text: &str) -> Result<f64, Expected> {
    let delay = seconds(text)?;
    if (0.0..f64::INFINITY).contains(&delay) { Ok(delay) } else { Err(Expected("at least 0, in seconds".into())) }
}

/// Measures every solver, and readers at every rate, and prints tables or JSON lines.
pub fn trade(common: &Common, arguments: &TradeArguments) -> Result<(), CommandError> {
    /// Share of the solvers in the progress of a dragon.
    const SOLVERS: f64 = 0.85;
    svg_file("--plot", arguments.plot.as_deref())?;
    svg_file("--display-plot", arguments.display_plot.as_deref())?;
    let scene = common.load_scene()?;
    let parts = parts(&scene);
    if parts.len() > 1 && (arguments.plot.is_some() || arguments.display_plot.is_some()) {
        let sentence = "--plot and --display-plot draw one dragon and the scene has several, expected neither of them";
        return Err(CommandError::BadInput(sentence.to_owned()));
    }
    // A file that cannot be written is reported before minutes of measuring.
    let [plot_file, display_file] =
        [&arguments.plot, &arguments.display_plot].map(|file| file.as_deref().map(Output::file).transpose());
    let (mut plot_file, mut display_file) = (plot_file?, display_file?);
    announce(&scene, common);
    if !scene.ensemble.ground().is_empty() {
        log::warn!("`trade` leaves out the obstacles of the scene: it measures handles and the boards' first contact");
    }
    if parts.len() > 1 {
        log::warn!("`trade` leaves out the clearance and the contacts between dragons: it measures each dragon alone");
    }
    stop_searches_on_signals()?;
    let bar = progress_bar(1000, common);
    let mut output = Output::standard();
    let share = 1.0 / parts.len() as f64;
    for (k, part) in parts.iter().enumerate() {
        let progress = |done: f64| report(&bar, share * (k as f64 + done));
        let Part { subject, .. } = part;
        let timeline = Ensemble::alone(subject.motion.clone()).timeline(&mut |_| progress(0.0));
        warn_of_gap(&timeline);
        unstopped()?;
        bar.set_message("measuring");
        let measured = measure(subject, &timeline, &mut |done| progress(SOLVERS * done));
        unstopped()?;
        let measurements = measured?;
        let displayed = if common.json && !arguments.wants_display() {
            Vec::new()
        } else {
            let frame_ns = publisher_frame_ns(subject, &timeline);
            let display = Display { rate: arguments.display_rate.unwrap_or(60.0), delay: arguments.delay, frame_ns };
            let mut progress = |done| progress(SOLVERS + (1.0 - SOLVERS) * done);
            let displayed = display::measure(subject, &timeline, display, &mut progress);
            unstopped()?;
            displayed?
        };
        if k + 1 == parts.len() {
            bar.finish_and_clear();
        }
        bar.suspend(|| part.print(&mut output, common.json, &measurements, &displayed))?;
        if let Some(file) = plot_file.take() {
            draw(file, |svg| plot(svg, &scene.name, &measurements))?;
        }
        if let Some(file) = display_file.take() {
            draw(file, |svg| display_plot(svg, &scene.name, &displayed))?;
        }
    }
    output.finish()
}

impl From<TradeError> for CommandError {
    fn from(error: TradeError) -> Self {
        Self::Failed(error.to_string())
    }
}

/// One dragon, measured alone.
struct Part {
    /// Its name, if it has one.
    dragon: Option<String>,
    /// The dragon itself. With a name, it is where its path has it: errors do not depend on the placement.
    subject: Subject,
}

/// A JSON line, with the name of the dragon if it has one.
#[derive(Serialize)]
struct TradeLine<'a, M: Serialize> {
    #[serde(skip_serializing_if = "Option::is_none")]
    dragon: Option<&'a str>,
    #[serde(flatten)]
    measurement: &'a M,
}

/// Returns the dragons of a scene.
fn parts(scene: &Scene) -> Vec<Part> {
    let part = |Dragon { name, delay: _, motion }: &Dragon| {
        let dragon = (!name.is_empty()).then(|| name.clone());
        let motion = if dragon.is_some() { motion.in_own_frame() } else { motion.clone() };
        let (velocities, rate, stops_at_contact) = (scene.velocities, scene.rate, scene.stops_at_contact());
        Part { dragon, subject: Subject { motion, velocities, rate, stops_at_contact } }
    };
    scene.ensemble.dragons().iter().map(part).collect()
}

impl Part {
    fn print(
        &self,
        output: &mut Output,
        json: bool,
        measurements: &[Measurement],
        displayed: &[DisplayMeasurement],
    ) -> Result<(), CommandError> {
        let dragon = self.dragon.as_deref();
        if json {
            measurements.iter().try_for_each(|measurement| output.json(&TradeLine { dragon, measurement }))?;
            return displayed.iter().try_for_each(|measurement| output.json(&TradeLine { dragon, measurement }));
        }
        if let Some(name) = dragon {
            let benches = self.subject.motion.team().benches;
            output.line(&format!("{name}, {benches} benches, measured alone in its own time:"))?;
        }
        print(output, measurements)?;
        print_display(output, &self.subject, displayed)?;
        if dragon.is_some() { output.line("") } else { Ok(()) }
    }
}

/// Prints a line if no bar shows progress.
fn announce(scene: &Scene, common: &Common) {
    if common.quiet || stderr().is_terminal() {
        return;
    }
    let benches = scene.ensemble.benches();
    let time = if benches > 1000 { "some minutes" } else { "about half a minute" };
    let each = if scene.ensemble.only().is_none() { " a dragon" } else { "" };
    eprintln!("measuring every solver on scene {} ({benches} benches), which takes {time}{each}", scene.name);
}

fn print(output: &mut Output, measurements: &[Measurement]) -> Result<(), CommandError> {
    let width = measurements.iter().map(|measurement| measurement.solver.len()).max().unwrap_or(6);
    output.line(&format!(
        "  {:width$} {:>9} {:>9} {:>10} {:>5} {:>9} {:>9} {:>9} {:>8} {:>9} {:>8}",
        "solver",
        "frame us",
        "p99 us",
        "position m",
        "meets",
        "speed rel",
        "contact s",
        "link m",
        "B/handle",
        "bytes",
        "made ms"
    ))?;
    let or_dash = |number: Option<f64>| number.map_or("-".to_owned(), |number| format!("{number:.1e}"));
    for m in measurements {
        output.line(&format!(
            "{} {:width$} {:>9.2} {:>9.2} {:>10.1e} {:>5} {:>9} {:>9} {:>9.1e} {:>8} {:>9} {:>8.1}",
            if m.on_front { "*" } else { " " },
            m.solver,
            m.frame_ns / 1e3,
            m.frame_ns_p99 / 1e3,
            m.max_position_error,
            m.meets.map_or("-", |meets| if meets { "yes" } else { "no" }),
            or_dash(m.max_speed_error),
            or_dash(m.contact_time_error),
            m.max_link_error,
            m.bytes_per_handle.map_or("-".to_owned(), |bytes| format!("{bytes:.0}")),
            m.memory_bytes,
            1e3 * m.make_s
        ))?;
    }
    for line in measurements.iter().flat_map(|measurement| &measurement.collision) {
        let cost = match (line.frame_ns, line.search_s) {
            (Some(nanoseconds), _) => format!("{:.2} us a frame", nanoseconds / 1e3),
            (None, seconds) => format!("contact in {:.3} s", seconds.unwrap_or(f64::NAN)),
        };
        let error = line.contact_time_error.map_or(String::new(), |seconds| format!(", {seconds:.1e} s off"));
        output.line(&format!("  collisions, {:25} {cost}{error}", line.method))?;
    }
    let noise = measurements.first().map_or(f64::NAN, |first| first.noise);
    output.line(&format!(
        "* no other is both faster and more exact, where errors below {noise:.1e} m are rounding and count as equal. \
         Errors: the largest over all handles at {SPREAD_SAMPLES} moments of the motion and {LAST_SECOND_SAMPLES} of \
         its last second, against a reference of more than 30 digits."
    ))
}

/// One row for both precisions, which are neighbours.
fn print_display(output: &mut Output, subject: &Subject, displayed: &[DisplayMeasurement]) -> Result<(), CommandError> {
    output.line("")?;
    output.line(&format!(
        "  {:8} {:>7} {:>9}   {:>10} {:>11}   {:>10} {:>11}   {:>9}",
        "reader", "rate Hz", "delay s", "position m", "bytes/s", "single m", "bytes/s", "of a core"
    ))?;
    let star = |m: &DisplayMeasurement| if m.on_front { "*" } else { " " };
    for pair in displayed.chunks_exact(Precision::ALL.len()) {
        let (double, single) = (&pair[0], &pair[1]);
        output.line(&format!(
            "  {:8} {:>7} {:>9.4} {} {:>10.1e} {:>11.0} {} {:>10.1e} {:>11.0}   {:>8.4}%",
            double.reader.name(),
            double.rate_hz,
            double.delay_s,
            star(double),
            double.max_position_error,
            double.bytes_per_second,
            star(single),
            single.max_position_error,
            single.bytes_per_second,
            100.0 * double.cpu_share
        ))?;
    }
    let display_rate = displayed.first().map_or(f64::NAN, |first| first.display_rate_hz);
    output.line(&format!(
        "* no other has both fewer bytes and a smaller error. Errors: the largest over all {} handles at the moments of a \
         display at {display_rate} Hz that runs behind the stream by the delay, in the {} s up to the last whole second \
         before the show ends and at {} moments spread over it, against newton at the simulated time meant to be on display. Single: poses \
         rounded to 32 bits, as `precision = \"f32\"` publishes them. Of a core: computing the frames by the solver of the scene, \
         without transport.",
        subject.motion.team().handles(),
        display::WINDOW,
        display::SPREAD_SAMPLES
    ))
}

/// Pixels across and down: words stay legible on a phone, half as large.
const SIZE: (u32, u32) = (760, 720);

/// The least error drawn: smaller ones are rounding.
const LEAST_ERROR: f64 = 1e-15;

/// The error of a drawing.
type DrawingError = Box<dyn std::error::Error>;

fn draw(mut file: Output, plot: impl FnOnce(&mut String) -> Result<(), DrawingError>) -> Result<(), CommandError> {
    let mut svg = String::new();
    plot(&mut svg).map_err(|error| CommandError::Failed(format!("the plot: {error}")))?;
    file.line(&with_dark_rules(&svg))?;
    file.finish()
}

/// Returns a colour of the palette.
fn colour(hex: &str) -> RGBColor {
    let [red, green, blue] = channels(hex);
    RGBColor(red, green, blue)
}

/// Returns a text style in the page's font.
fn words(size: u32, colour: RGBColor) -> TextStyle<'static> {
    let style = TextStyle::from(("system-ui, sans-serif", size).into_font());
    TextStyle { color: colour.to_backend_color(), ..style }
}

fn plot(svg: &mut String, scene: &str, measurements: &[Measurement]) -> Result<(), DrawingError> {
    let point = |m: &Measurement| Point {
        at: (m.frame_ns / 1e3, m.max_position_error.max(LEAST_ERROR)),
        // The common beginning of all tables would only make the words smaller.
        text: m.solver.replace("follower_table", "table").replace(" precision", ""),
        colour: colour(if m.solver.starts_with("paper") { LIGHT.danger } else { LIGHT.slow }),
        on_front: m.on_front,
    };
    let points: Vec<Point> = measurements.iter().map(point).collect();
    let caption = format!("Error against cost, scene {scene}");
    let notes = [
        "Blue: exact motion. Red: the paper's rules. Table: follower_table.",
        "Filled, on the line: no other is both faster and more exact.",
    ];
    let axes = ["microseconds per frame (median)", "largest position error, metres"];
    scatter(svg, &caption, notes, axes, &[(front(&points), colour(LIGHT.slow))], points)
}

fn display_plot(svg: &mut String, scene: &str, displayed: &[DisplayMeasurement]) -> Result<(), DrawingError> {
    // Single precision makes no difference to readers whose error is far above its rounding.
    let series = [
        (Reader::Hold, Precision::Double, SERIES[2].0, "hold"),
        (Reader::Linear, Precision::Double, SERIES[1].0, "linear"),
        (Reader::Hermite, Precision::Double, SERIES[0].0, "Hermite"),
        (Reader::Hermite, Precision::Single, SERIES[3].0, "Hermite, single precision"),
    ];
    let (mut lines, mut points) = (Vec::new(), Vec::new());
    for (reader, precision, hex, name) in series {
        let colour = colour(hex);
        let of_series: Vec<_> = displayed.iter().filter(|m| (m.reader, m.precision) == (reader, precision)).collect();
        let line: Vec<Point> = of_series
            .into_iter()
            .enumerate()
            .map(|(index, m)| Point {
                at: (m.bytes_per_second / 1e3, m.max_position_error.max(LEAST_ERROR)),
                text: if index == 0 { format!("{name}, {} Hz", m.rate_hz) } else { format!("{} Hz", m.rate_hz) },
                colour,
                on_front: m.on_front,
            })
            .collect();
        lines.push((line.iter().map(|point| point.at).collect(), colour));
        points.extend(line);
    }
    lines.push((front(&points), colour(LIGHT.ink)));
    let caption = format!("Error at the moment of display, scene {scene}");
    let notes = [
        "Orange: hold. Yellow: linear. Blue: Hermite; green: from single precision.",
        "Filled: no other has both fewer bytes and a smaller error.",
    ];
    scatter(svg, &caption, notes, ["kilobytes per second", "largest position error, metres"], &lines, points)
}

/// A point of a plot, with its label.
struct Point {
    at: (f64, f64),
    text: String,
    colour: RGBColor,
    on_front: bool,
}

/// Returns the points of the front, by cost.
fn front(points: &[Point]) -> Vec<(f64, f64)> {
    let mut front: Vec<(f64, f64)> = points.iter().filter(|point| point.on_front).map(|point| point.at).collect();
    front.sort_by(|a, b| a.0.total_cmp(&b.0));
    front
}

/// Draws lines below labelled points, both axes logarithmic.
fn scatter(
    svg: &mut String,
    caption: &str,
    notes: [&str; 2],
    [x_desc, y_desc]: [&str; 2],
    lines: &[(Vec<(f64, f64)>, RGBColor)],
    points: Vec<Point>,
) -> Result<(), DrawingError> {
    let (ink, quiet) = (colour(LIGHT.ink), colour(LIGHT.quiet));
    let sheet = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    sheet.fill(&colour(LIGHT.ground))?;
    let mut area = sheet.margin(12, 0, 0, 0).titled(caption, words(30, ink))?;
    for note in notes {
        area = area.titled(note, words(20, quiet))?;
    }
    let (mut least, mut most) = (f64::INFINITY, 0f64);
    for Point { at: (cost, _), .. } in &points {
        (least, most) = (least.min(*cost), most.max(*cost));
    }
    let mut chart = ChartBuilder::on(&area)
        .margin(14)
        .x_label_area_size(58)
        .y_label_area_size(92)
        .build_cartesian_2d((0.5 * least..4.0 * most).log_scale(), (LEAST_ERROR..10.0).log_scale())?;
    chart
        .configure_mesh()
        .x_desc(x_desc)
        .y_desc(y_desc)
        .axis_desc_style(words(22, quiet))
        .label_style(words(20, quiet))
        .x_labels(5)
        .axis_style(quiet)
        .bold_line_style(colour(LIGHT.line))
        .x_label_formatter(&|x| if *x < 1e5 { format!("{x}") } else { format!("{x:.0e}") })
        .y_label_formatter(&|y| format!("{y:.0e}"))
        .light_line_style(TRANSPARENT)
        .draw()?;
    for (line, colour) in lines {
        chart.draw_series(LineSeries::new(line.iter().copied(), colour))?;
    }
    draw_points(&mut chart, points)?;
    sheet.present()?;
    Ok(())
}

/// A plot of two logarithmic axes.
type LogChart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<LogCoord<f64>, LogCoord<f64>>>;

/// Draws points, the least exact first, with labels that hide neither points nor each other.
fn draw_points(chart: &mut LogChart, points: Vec<Point>) -> Result<(), DrawingError> {
    let places: Vec<(i32, i32)> = points.iter().map(|point| chart.backend_coord(&point.at)).collect();
    // No label lies on a point either.
    let mut taken: Vec<Label> =
        places.iter().map(|(x, y)| Label { left: x - 6, right: x + 6, top: y - Label::HEIGHT / 2 }).collect();
    let mut labelled: Vec<(Point, (i32, i32))> = points.into_iter().zip(places).collect();
    labelled.sort_by(|a, b| b.0.at.1.total_cmp(&a.0.at.1));
    for (Point { at, text, colour, on_front }, (x, y)) in labelled {
        let label = Label::near(&taken, (x, y), &text);
        let middle = label.top + Label::HEIGHT / 2;
        if (middle - y).abs() >= Label::HEIGHT {
            // A line from a displaced label to its point.
            let end = if label.left > x { label.left - 2 } else { label.right + 2 };
            let line = PathElement::new(vec![(0, 0), (end - x, middle - y)], colour.mix(0.4));
            chart.draw_series([EmptyElement::at(at) + line])?;
        }
        let style = if on_front { colour.filled() } else { colour.stroke_width(2) };
        chart.draw_series([Circle::new(at, 5, style)])?;
        let text = Text::new(text, (label.left - x, label.top - y), words(20, self::colour(LIGHT.ink)));
        chart.draw_series([EmptyElement::at(at) + text])?;
        taken.push(label);
    }
    Ok(())
}

/// The place of a label on the plot, pixels.
struct Label {
    left: i32,
    right: i32,
    top: i32,
}

impl Label {
    const HEIGHT: i32 = 19;
    /// The width of a letter.
    const LETTER: i32 = 8;
    /// The area for labels.
    const LEFTMOST: i32 = 110;
    const RIGHTMOST: i32 = 748;
    const TOPMOST: i32 = 108;
    const LOWEST: i32 = 624;

    /// Places a label beside a point, or as near as possible on the plot without covering one of `others`.
    fn near(others: &[Self], (x, y): (i32, i32), text: &str) -> Self {
        // One letter more, since capitals and digits are wider than most.
        let width = Self::LETTER * (text.len() as i32 + 1);
        let overlaps = |label: &Self, other: &Self| {
            label.left < other.right && other.left < label.right && (label.top - other.top).abs() < Self::HEIGHT
        };
        let at = |left: i32, top: i32| Self { left, right: left + width, top };
        let free = |label: &Self| {
            label.left > Self::LEFTMOST
                && label.right < Self::RIGHTMOST
                && (Self::TOPMOST..Self::LOWEST).contains(&label.top)
                && !others.iter().any(|other| overlaps(label, other))
        };
        let level = y - Self::HEIGHT / 2;
        let right = |lines: i32| at(x + 8 + 6 * lines.abs().min(2), level + lines * Self::HEIGHT);
        let left = |lines: i32| at(x - 8 - 6 * lines.abs().min(2) - width, level + lines * Self::HEIGHT);
        let places = (0..30).flat_map(|lines| [right(lines), left(lines), right(-lines), left(-lines)]);
        places.into_iter().find(free).unwrap_or_else(|| right(0))
    }
}
