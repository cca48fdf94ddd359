//! `draw`: an SVG of the stage at a time: the path, every bench as its rectangle, the head, and where boards touch.

use std::f64::consts::TAU;
use std::path::PathBuf;

use bench_dragon::model::board::Board;
use bench_dragon::model::path::{OutlineKind, SegmentOutline};
use bench_dragon::model::spiral::Direction;
use bench_dragon::model::{Point, Vector};
use bench_dragon::motion::event::EventKind;
use bench_dragon::motion::timeline::{TimedEvent, Timeline};
use bench_dragon::scene::Scene;
use bench_dragon::show::solve_at_or_just_before;
use bench_dragon::solve::Chain;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use super::solve::{time_at, title};
use super::{CommandError, Common, Output, search_timeline};

/// Arguments of `draw`.
#[derive(Debug, clap::Args)]
pub struct DrawArguments {
    /// Simulated seconds, or contact, stall, lock
    #[arg(long, value_name = "TIME", default_value = "0", allow_negative_numbers = true)]
    at: String,
    /// Write to a file instead of standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Metres from the centre to the edge of the picture; by default all of the team
    #[arg(long, value_name = "METRES")]
    radius: Option<f64>,
}

type Stage<'a> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

const HEAD: RGBColor = RGBColor(192, 57, 43);
const BODY: RGBColor = RGBColor(212, 160, 60);
const TAIL: RGBColor = RGBColor(46, 110, 150);
const TOUCH: RGBColor = RGBColor(142, 36, 170);
const CURVE: RGBColor = RGBColor(170, 170, 170);

/// Draws the stage.
pub fn draw(common: &Common, arguments: &DrawArguments) -> Result<(), CommandError> {
    let scene = common.load_scene()?;
    if let Some(radius) = arguments.radius
        && !(radius.is_finite() && radius > 0.0)
    {
        return Err(CommandError::BadInput(format!("--radius is {radius}, expected a number of metres above 0")));
    }
    let timeline = search_timeline(&scene, common);
    let time = time_at(&arguments.at, &timeline)?;
    let mut chain = Chain::new(scene.team().handles());
    let mut solver = scene.motion.solver(scene.velocities).solver;
    solve_at_or_just_before(solver.as_mut(), time, &mut chain)
        .map_err(|none| CommandError::Failed(format!("at {time} s: {none}")))?;
    let picture = picture(&scene, &timeline, time, &chain, arguments.radius)
        .map_err(|error| CommandError::Failed(format!("the picture could not be drawn: {error}")))?;
    let mut output = match &arguments.output {
        Some(file) => Output::file(file)?,
        None => Output::standard(),
    };
    output.line(&picture)?;
    output.finish()
}

/// The SVG's text.
fn picture(
    scene: &Scene,
    timeline: &Timeline,
    time: f64,
    chain: &Chain,
    radius: Option<f64>,
) -> Result<String, Box<dyn std::error::Error>> {
    let team = chain.x.iter().zip(&chain.y).map(|(x, y)| x.hypot(*y));
    // The head's way from its start on, of which an inward spiral only comes nearer.
    let route = scene.motion.outline().into_iter().map(|segment| segment.start.coords.norm());
    let reach = team.chain(route.skip(1)).fold(0.0, f64::max);
    let radius = radius.unwrap_or(1.05 * reach + scene.team().head_length);
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (900, 918)).into_drawing_area();
        area.fill(&WHITE)?;
        let mut stage = ChartBuilder::on(&area)
            .caption(title(scene, time), ("sans-serif", 22))
            .margin(16)
            .x_label_area_size(36)
            .y_label_area_size(48)
            .build_cartesian_2d(-radius..radius, -radius..radius)?;
        stage.configure_mesh().x_desc("x, metres").y_desc("y, metres").light_line_style(WHITE).draw()?;
        draw_path(&mut stage, scene, radius)?;
        draw_benches(&mut stage, scene, timeline, time, chain, radius)?;
        stage
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.85))
            .border_style(CURVE)
            .draw()?;
        area.present()?;
    }
    Ok(text)
}

fn draw_path(stage: &mut Stage, scene: &Scene, radius: f64) -> Result<(), Box<dyn std::error::Error>> {
    let inside = |point: &(f64, f64)| point.0.abs() <= radius && point.1.abs() <= radius;
    for segment in scene.motion.outline() {
        let points: Vec<(f64, f64)> = outline(&segment, radius).into_iter().map(|point| (point.x, point.y)).collect();
        // One line for each stretch inside the picture: what lies outside must not be bridged.
        for stretch in points.split(|point| !inside(point)).filter(|stretch| stretch.len() > 1) {
            stage.draw_series(LineSeries::new(stretch.to_vec(), CURVE.stroke_width(1)))?;
        }
    }
    Ok(())
}

/// Points along a piece, near enough to each other for a picture of this radius. A spiral that comes in is drawn from
/// as far out as the picture goes: the team stands there.
fn outline(segment: &SegmentOutline, radius: f64) -> Vec<Point> {
    let spiral = |pitch: f64, from: f64, to: f64, sign: f64| -> Vec<Point> {
        let steps = ((to - from) * 12.0).ceil().clamp(1.0, 1e6);
        let thetas = (0..=steps as usize).map(|step| from + (to - from) * step as f64 / steps);
        let place = |theta: f64| Point::new(theta.cos(), theta.sin()) * (sign * pitch / TAU * theta);
        thetas.map(place).collect()
    };
    match segment.kind {
        OutlineKind::Spiral { direction: Direction::Inward, pitch, first, last } => {
            spiral(pitch, last, first.max((1.42 * radius / pitch * TAU).min(1e5)), 1.0)
        }
        OutlineKind::Spiral { direction: Direction::Outward, pitch, first, last } => {
            spiral(pitch, first, last.min(first.max(1e5)), -1.0)
        }
        OutlineKind::Line => {
            let direction = Vector::new(segment.heading.cos(), segment.heading.sin());
            // Short stretches, so that what leaves the picture is cut near its edge.
            let steps = (segment.length / (0.002 * radius)).ceil().clamp(1.0, 1e6);
            (0..=steps as usize)
                .map(|step| segment.start + direction * (segment.length * step as f64 / steps))
                .collect()
        }
        OutlineKind::Arc { curvature } => {
            let left = Vector::new(-segment.heading.sin(), segment.heading.cos());
            let centre = segment.start + left / curvature;
            let angle = curvature * segment.length;
            let steps = (angle.abs() * 24.0).ceil().clamp(1.0, 1e6);
            let turned = |step: usize| nalgebra::Rotation2::new(angle * step as f64 / steps) * (segment.start - centre);
            (0..=steps as usize).map(|step| centre + turned(step)).collect()
        }
    }
}

fn draw_benches(
    stage: &mut Stage,
    scene: &Scene,
    timeline: &Timeline,
    time: f64,
    chain: &Chain,
    radius: f64,
) -> Result<(), Box<dyn std::error::Error>> {
    let contact = timeline.find(EventKind::Contact).filter(|contact| contact.time <= time);
    let touching = |bench: usize| contact.is_some_and(|contact| is_of(contact, bench));
    let last = scene.team().benches - 1;
    let (touch, others): (Vec<_>, Vec<_>) = (0..=last).partition(|bench| touching(*bench));
    let (head, followers): (Vec<_>, Vec<_>) = others.into_iter().partition(|bench| *bench == 0);
    let (tail, body): (Vec<_>, Vec<_>) = followers.into_iter().partition(|bench| *bench == last);
    let kinds =
        [("body", BODY, body), ("tail", TAIL, tail), ("head", HEAD, head), ("the two that touch", TOUCH, touch)];
    for (name, colour, benches) in kinds.into_iter().filter(|(.., benches)| !benches.is_empty()) {
        for bench in benches {
            let corners = board(scene, chain, bench).corners().map(|corner| (corner.x, corner.y));
            if corners.iter().any(|(x, y)| x.abs() > radius || y.abs() > radius) {
                // The plot would bend what sticks out of it along its border.
                continue;
            }
            stage.draw_series([Polygon::new(corners.to_vec(), colour.mix(0.75))])?;
            let outline = corners.into_iter().chain([corners[0]]).collect::<Vec<_>>();
            stage.draw_series([PathElement::new(outline, colour.stroke_width(1))])?;
        }
        stage
            .draw_series(std::iter::empty::<Circle<(f64, f64), i32>>())?
            .label(name)
            .legend(move |(x, y)| Rectangle::new([(x, y - 5), (x + 14, y + 5)], colour.mix(0.75).filled()));
    }
    stage
        .draw_series([Circle::new((chain.x[0], chain.y[0]), 4, HEAD.filled())])?
        .label("front handle of the head")
        .legend(|(x, y)| Circle::new((x + 7, y), 4, HEAD.filled()));
    if let Some(place) = contact.and_then(|contact| contact.event.place) {
        stage
            .draw_series([Circle::new((place.x, place.y), 9, TOUCH.stroke_width(3))])?
            .label("where they touch")
            .legend(|(x, y)| Circle::new((x + 7, y), 6, TOUCH.stroke_width(2)));
    }
    Ok(())
}

fn is_of(contact: &TimedEvent, bench: usize) -> bool {
    [contact.event.bench_a, contact.event.bench_b].contains(&Some(bench as u32))
}

fn board(scene: &Scene, chain: &Chain, bench: usize) -> Board {
    let (sine, cosine) = chain.heading[bench].sin_cos();
    let front = Point::new(chain.x[bench], chain.y[bench]);
    let team = scene.team();
    Board::from_front(front, Vector::new(cosine, sine), team.link(bench), team.hole_inset, team.width)
}
