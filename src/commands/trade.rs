//! `trade`: what accuracy costs on this scene and machine, for every solver.

use std::path::{Path, PathBuf};

use bench_dragon::trade::{LAST_SECOND_MOMENTS, Measurement, SPREAD_MOMENTS, measure};
use plotters::prelude::*;

use super::{CommandError, Common, Output, progress_bar, search_timeline};

/// What `trade` takes.
#[derive(Debug, Clone, clap::Args)]
pub struct TradeArguments {
    /// Draw error against cost as an SVG
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
}

/// Measures every solver and prints a table or JSON lines.
pub fn trade(common: &Common, arguments: &TradeArguments) -> Result<(), CommandError> {
    let scene = common.load_scene()?;
    let timeline = search_timeline(&scene, common);
    let bar = progress_bar(1000, common).with_message("measuring");
    let measured = measure(&scene, &timeline, &mut |share| bar.set_position((1000.0 * share) as u64));
    bar.finish_and_clear();
    let measurements = measured.map_err(CommandError::Failed)?;
    if let Some(file) = &arguments.plot {
        draw(file, &scene.name, &measurements)?;
    }
    let mut output = Output::standard();
    if common.json {
        for measurement in &measurements {
            output.json(measurement)?;
        }
    } else {
        print(&mut output, &measurements)?;
    }
    output.finish()
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
         Errors: the largest over all handles at {SPREAD_MOMENTS} moments of the show and {LAST_SECOND_MOMENTS} of its \
         last second, against a reference of more than 30 digits."
    ))
}

/// The least error that is drawn: below it all is rounding.
const LEAST_ERROR: f64 = 1e-15;

fn draw(file: &Path, scene: &str, measurements: &[Measurement]) -> Result<(), CommandError> {
    let mut svg = String::new();
    plot(&mut svg, scene, measurements).map_err(|error| CommandError::Failed(format!("the plot: {error}")))?;
    let mut output = Output::file(file)?;
    output.line(&svg)?;
    output.finish()
}

fn plot(svg: &mut String, scene: &str, measurements: &[Measurement]) -> Result<(), Box<dyn std::error::Error>> {
    let error = |m: &Measurement| m.max_position_error.max(LEAST_ERROR);
    let area = SVGBackend::with_string(svg, (1020, 620)).into_drawing_area();
    area.fill(&WHITE)?;
    let cost = |m: &Measurement| m.frame_ns / 1e3;
    let (mut least, mut most) = (f64::INFINITY, 0f64);
    for measurement in measurements {
        (least, most) = (least.min(cost(measurement)), most.max(cost(measurement)));
    }
    let mut chart = ChartBuilder::on(&area)
        .caption(format!("Error against cost, scene {scene}"), ("sans-serif", 20))
        .margin(14)
        .x_label_area_size(44)
        .y_label_area_size(70)
        .build_cartesian_2d((0.5 * least..8.0 * most).log_scale(), (LEAST_ERROR..10.0).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("microseconds per frame (median)")
        .y_desc("largest position error, metres")
        .x_label_formatter(&|x| format!("{x}"))
        .y_label_formatter(&|y| format!("{y:.0e}"))
        .light_line_style(TRANSPARENT)
        .draw()?;
    let mut front: Vec<(f64, f64)> = measurements.iter().filter(|m| m.on_front).map(|m| (cost(m), error(m))).collect();
    front.sort_by(|a, b| a.0.total_cmp(&b.0));
    chart.draw_series(LineSeries::new(front, &BLUE))?;
    let places: Vec<(i32, i32)> = measurements.iter().map(|m| chart.backend_coord(&(cost(m), error(m)))).collect();
    // No label lies on a point either.
    let mut taken: Vec<Label> =
        places.iter().map(|(x, y)| Label { left: x - 6, right: x + 6, top: y - Label::HEIGHT / 2 }).collect();
    let mut labelled: Vec<(&Measurement, (i32, i32))> = measurements.iter().zip(places).collect();
    labelled.sort_by(|a, b| error(b.0).total_cmp(&error(a.0)));
    for (measurement, (x, y)) in labelled {
        let colour = if measurement.solver.starts_with("paper") { RED } else { BLUE };
        let at = (cost(measurement), error(measurement));
        let label = Label::near(&taken, (x, y), &measurement.solver);
        let middle = label.top + Label::HEIGHT / 2;
        if (middle - y).abs() > Label::HEIGHT {
            // A line from a label that had to go elsewhere to its point.
            let end = if label.left > x { label.left - 2 } else { label.right + 2 };
            let line = PathElement::new(vec![(0, 0), (end - x, middle - y)], colour.mix(0.4));
            chart.draw_series([EmptyElement::at(at) + line])?;
        }
        let style = if measurement.on_front { colour.filled() } else { colour.stroke_width(1) };
        chart.draw_series([Circle::new(at, 4, style)])?;
        let text = Text::new(measurement.solver.clone(), (label.left - x, label.top - y), ("sans-serif", 12));
        chart.draw_series([EmptyElement::at(at) + text])?;
        taken.push(label);
    }
    area.present()?;
    Ok(())
}

/// Where a label stands on the plot, pixels.
struct Label {
    left: i32,
    right: i32,
    top: i32,
}

impl Label {
    const HEIGHT: i32 = 13;
    /// What a letter takes, rounded up.
    const LETTER: i32 = 5;
    /// Where labels may stand.
    const LEFTMOST: i32 = 86;
    const RIGHTMOST: i32 = 1010;
    const TOPMOST: i32 = 45;
    const LOWEST: i32 = 540;

    /// A label beside a point, or as near to that as it lies on none of `others` and on the plot.
    fn near(others: &[Self], (x, y): (i32, i32), text: &str) -> Self {
        let width = Self::LETTER * text.len() as i32;
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
