//! Plots over time as SVG text, for the report's page.

use plotters::prelude::*;

/// Pixels across and down.
const SIZE: (u32, u32) = (920, 270);
/// Colours that are distinguished by people who do not see red and green, too (Okabe and Ito).
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 159, 0),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(80, 80, 80),
];

/// A line of a plot.
pub struct Line {
    /// What it is.
    pub label: String,
    /// Seconds since the start, and values.
    pub points: Vec<(f64, f64)>,
}

/// How values are spread over the height.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Evenly, from 0.
    Linear,
    /// By powers of ten: for durations.
    Logarithmic,
}

/// A plot of some lines over time as HTML: what each colour means, and an `<svg>` element. `None` if there is nothing to
/// plot.
pub fn plot(unit: &str, scale: Scale, lines: &[Line]) -> Option<String> {
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
        chart.margin(8).x_label_area_size(36).y_label_area_size(74);
        match scale {
            // Zeros have no logarithm: they lie on the lower edge.
            Scale::Logarithmic => {
                let floor = if least.is_nan() { 0.1 } else { least * 0.7 };
                let down = (floor..(most * 1.4).max(floor * 10.0)).log_scale();
                draw(&mut chart.build_cartesian_2d(across, down).ok()?, unit, time, lines, (seconds, floor))?;
            }
            Scale::Linear => {
                let down = 0.0..if most > 0.0 { most * 1.1 } else { 1.0 };
                draw(&mut chart.build_cartesian_2d(across, down).ok()?, unit, time, lines, (seconds, 0.0))?;
            }
        }
        area.present().ok()?;
    }
    Some(legend(lines) + &svg)
}

/// What each colour means. Above the plot, where it hides no line.
fn legend(lines: &[Line]) -> String {
    let key = |(line, RGBColor(red, green, blue)): (&Line, &RGBColor)| {
        format!(
            "<span><b style=\"color:#{red:02x}{green:02x}{blue:02x}\">&mdash;</b> {}</span>\n",
            escaped(&line.label)
        )
    };
    format!("<p class=\"legend\">\n{}</p>\n", lines.iter().zip(COLOURS.iter().cycle()).map(key).collect::<String>())
}

/// Text as HTML takes it.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// The unit in which a span of time reads well: its seconds and its name.
fn unit_of_time(span: f64) -> (f64, &'static str) {
    match span {
        _ if span > 3.0 * 3600.0 => (3600.0, "hours"),
        _ if span > 180.0 => (60.0, "minutes"),
        _ => (1.0, "seconds"),
    }
}

fn draw<'a, Y>(
    chart: &mut ChartContext<'a, SVGBackend<'a>, Cartesian2d<plotters::coord::types::RangedCoordf64, Y>>,
    unit: &str,
    time: &str,
    lines: &[Line],
    (seconds, floor): (f64, f64),
) -> Option<()>
where
    Y: plotters::coord::ranged1d::Ranged<ValueType = f64> + plotters::coord::ranged1d::ValueFormatter<f64>,
{
    let mut mesh = chart.configure_mesh();
    mesh.x_desc(time).y_desc(unit).light_line_style(TRANSPARENT).y_label_formatter(&|value| short(*value));
    mesh.draw().ok()?;
    for (line, colour) in lines.iter().zip(COLOURS.iter().cycle()) {
        let points = line.points.iter().map(|(at, value)| (at / seconds, value.max(floor)));
        chart.draw_series(LineSeries::new(points, colour.stroke_width(1))).ok()?;
    }
    Some(())
}

/// A label of the axis without needless digits.
fn short(value: f64) -> String {
    if value >= 10.0 || value == 0.0 { format!("{value:.0}") } else { format!("{value:.2}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plots_are_svg_and_nothing_gives_none() {
        let line = |points| Line { label: "a & b".to_owned(), points };
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
