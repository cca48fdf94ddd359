//! Plots over time as SVG text, for the report's page.

use plotters::prelude::*;

use bench_dragon_drawing::escaped;
use bench_dragon_drawing::palette::{LIGHT, SERIES, channels};

/// Width and height in pixels: words are still readable at half the size, on a phone.
const SIZE: (u32, u32) = (760, 300);

/// The font of the page.
fn words(size: u32, colour: RGBColor) -> TextStyle<'static> {
    let style = TextStyle::from(("system-ui, sans-serif", size).into_font());
    TextStyle { color: colour.to_backend_color(), ..style }
}
fn colour(hex: &str) -> RGBColor {
    let [red, green, blue] = channels(hex);
    RGBColor(red, green, blue)
}

/// A line of a plot.
pub struct PlotLine {
    /// Its name.
    pub label: String,
    /// The times, in seconds since the start, and the values.
    pub points: Vec<(f64, f64)>,
}

/// The vertical scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Linear, from 0.
    Linear,
    /// Logarithmic, for durations.
    Logarithmic,
}

/// Returns a plot of lines over time as HTML: a legend, and an `<svg>` element. Returns `None` if there is nothing to
/// plot.
pub fn plot(unit: &str, scale: Scale, lines: &[PlotLine]) -> Option<String> {
    let points = || lines.iter().flat_map(|line| &line.points);
    let last = points().map(|point| point.0).fold(f64::NAN, f64::max);
    let most = points().map(|point| point.1).fold(f64::NAN, f64::max);
    let least = points().map(|point| point.1).filter(|value| *value > 0.0).fold(f64::NAN, f64::min);
    if last.is_nan() {
        return None;
    }
    let (seconds, time) = unit_of_time(last);
    let across = 0.0..last / seconds;
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        let mut chart = ChartBuilder::on(&area);
        chart.margin(8).margin_right(28).x_label_area_size(46).y_label_area_size(84);
        match scale {
            // Zero has no logarithm: it lies on the lower edge.
            Scale::Logarithmic => {
                let floor = if least.is_nan() { 0.1 } else { least * 0.7 };
                let down = (floor..(most * 1.4).max(floor * 10.0)).log_scale();
                draw(&mut chart.build_cartesian_2d(across, down).ok()?, unit, time, seconds, lines, floor)?;
            }
            Scale::Linear => {
                let down = 0.0..if most > 0.0 { most * 1.1 } else { 1.0 };
                draw(&mut chart.build_cartesian_2d(across, down).ok()?, unit, time, seconds, lines, 0.0)?;
            }
        }
        area.present().ok()?;
    }
    Some(legend(lines) + &svg)
}

/// Returns the legend, which stands above the plot, where it hides no line.
fn legend(lines: &[PlotLine]) -> String {
    // An `<svg>` element too, so that the dark rules of the plots apply to it.
    let key = |(line, (colour, _)): (&PlotLine, &(&str, &str))| {
        format!(
            "<span><svg width=\"18\" height=\"10\"><rect y=\"3\" width=\"18\" height=\"4\" fill=\"{colour}\"/></svg> {}</span>\n",
            escaped(&line.label)
        )
    };
    format!("<p class=\"legend\">\n{}</p>\n", lines.iter().zip(SERIES.iter().cycle()).map(key).collect::<String>())
}

/// Returns a suitable unit for a span of time: its seconds and its name.
fn unit_of_time(span: f64) -> (f64, &'static str) {
    match span {
        _ if span > 3.0 * 3600.0 => (3600.0, "hours"),
        _ if span > 180.0 => (60.0, "minutes"),
        _ => (1.0, "seconds"),
    }
}

/// Draws axes and lines. `time` is the name of the unit of time, which has `seconds`. Values below `floor` are drawn
/// on it.
fn draw<'a, Y>(
    chart: &mut ChartContext<'a, SVGBackend<'a>, Cartesian2d<plotters::coord::types::RangedCoordf64, Y>>,
    unit: &str,
    time: &str,
    seconds: f64,
    lines: &[PlotLine],
    floor: f64,
) -> Option<()>
where
    Y: plotters::coord::ranged1d::Ranged<ValueType = f64> + plotters::coord::ranged1d::ValueFormatter<f64>,
{
    let mut mesh = chart.configure_mesh();
    let (quiet, line) = (colour(LIGHT.quiet), colour(LIGHT.line));
    mesh.axis_desc_style(words(20, quiet)).label_style(words(18, quiet));
    mesh.axis_style(quiet).bold_line_style(line).x_labels(6).y_labels(6);
    mesh.x_desc(time).y_desc(unit).light_line_style(TRANSPARENT).y_label_formatter(&|value| short(*value));
    mesh.draw().ok()?;
    for (line, (hex, _)) in lines.iter().zip(SERIES.iter().cycle()) {
        let points = line.points.iter().map(|(at, value)| (at / seconds, value.max(floor)));
        chart.draw_series(LineSeries::new(points, colour(hex).stroke_width(2))).ok()?;
    }
    Some(())
}

/// Returns a label of the axis without unnecessary digits.
fn short(value: f64) -> String {
    if value >= 10.0 || value == 0.0 { format!("{value:.0}") } else { format!("{value:.2}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plots_are_svg_and_nothing_gives_none() {
        let line = |points| PlotLine { label: "a & b".to_owned(), points };
        for scale in [Scale::Linear, Scale::Logarithmic] {
            assert_eq!(plot("us", scale, &[line(Vec::new())]), None);
            let html = plot("us", scale, &[line(vec![(0.0, 0.0), (1.0, 0.0)])]).unwrap();
            assert!(
                html.contains("<svg") && html.trim_end().ends_with("</svg>") && html.contains("a &amp; b"),
                "{html}"
            );
        }
    }
}
