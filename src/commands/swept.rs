//! The ground that boards cover, for `draw --swept` and `check --swept`: options, the search, the file.

use std::ops::Range;
use std::path::Path;

use bench_dragon::drawing::swept::{Ring, SweptArea, TOLERANCE};
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::show::scene::Scene;
use serde::Serialize;

use super::solve::time_of;
use super::{CommandError, Common, Output, expect_exact_motion, figure, progress_bar};

/// The boards and the stretch of the show whose ground is requested.
#[derive(Debug, Clone, Copy)]
pub struct Stretch<'a> {
    /// The first time; 0 without one.
    pub from: Option<&'a str>,
    /// The last time; the end of the show without one.
    pub until: Option<&'a str>,
    /// Benches, counted from 1; all without them.
    pub benches: Option<Benches>,
}

/// The first and the last bench, counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Benches {
    first: usize,
    last: usize,
}

/// Returns the benches that `text` names, as in `200-223` or `7`.
///
/// # Errors
/// A sentence about text of another form.
pub fn benches(text: &str) -> Result<Benches, String> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    match (first.trim().parse(), last.trim().parse()) {
        (Ok(first), Ok(last)) if 1 <= first && first <= last => Ok(Benches { first, last }),
        _ => Err("expected benches counted from 1, as in 200-223".to_owned()),
    }
}

/// The ground that was covered, with its stretch.
#[derive(Debug)]
pub struct Swept {
    /// The ground.
    pub area: SweptArea,
    /// Simulated seconds of the first position.
    pub from: f64,
    /// Simulated seconds of the last position.
    pub until: f64,
    benches: Range<usize>,
}

/// Unites the ground that boards of a scene cover. Without a last time, the stretch ends with the show.
///
/// # Errors
/// Bad input: a time or a bench that the scene has not, or a solver whose head is too fast.
pub fn swept(scene: &Scene, timeline: &Timeline, stretch: Stretch<'_>, common: &Common) -> Result<Swept, CommandError> {
    expect_exact_motion(scene)?;
    let from = stretch.from.map_or(Ok(0.0), |from| time_of("--from", from, timeline))?;
    let until = match stretch.until {
        Some(until) => time_of("--until", until, timeline)?,
        None => timeline.freeze(scene.stops_at_contact()).time,
    };
    if until < from {
        return Err(CommandError::BadInput(format!(
            "--until is {} s, expected a time from --from on, {} s",
            figure(until),
            figure(from)
        )));
    }
    let all = scene.team().benches;
    let Benches { first, last } = stretch.benches.unwrap_or(Benches { first: 1, last: all });
    if last > all {
        return Err(CommandError::BadInput(format!(
            "--benches ends with bench {last}, expected benches from 1 to {all}"
        )));
    }
    let benches = first - 1..last;
    let travelled = [from, until].map(|time| scene.motion.travelled_at(time));
    let bar = progress_bar(1000, common).with_message("uniting the ground");
    let mut progress = |share| bar.set_position((1000.0 * share) as u64);
    let area = SweptArea::new(&scene.motion, travelled.into(), benches.clone(), &mut progress);
    bar.finish_and_clear();
    let area = area.map_err(|none| CommandError::Failed(format!("--until {}: {none}", figure(until))))?;
    Ok(Swept { area, from, until, benches })
}

/// The line of `check --swept --json`.
#[derive(Serialize)]
struct Line {
    check: &'static str,
    /// Square metres.
    area: f64,
    /// Simulated seconds.
    from: f64,
    /// Simulated seconds.
    until: f64,
}

/// A GeoJSON feature (RFC 7946) in metres of the stage in place of degrees.
#[derive(Serialize)]
struct Feature<'a> {
    r#type: &'static str,
    properties: Properties<'a>,
    geometry: MultiPolygon,
}

/// The ground in numbers.
#[derive(Serialize)]
struct Properties<'a> {
    scene: &'a str,
    /// Square metres.
    area: f64,
    /// Greatest distance of the rings from the true outline, metres.
    tolerance: f64,
    /// Simulated seconds.
    from: f64,
    /// Simulated seconds.
    until: f64,
    /// The first and the last bench, counted from 0.
    benches: [usize; 2],
}

#[derive(Serialize)]
struct MultiPolygon {
    r#type: &'static str,
    coordinates: Vec<Vec<Ring>>,
}

impl Swept {
    /// Returns a sentence on the ground.
    pub fn sentence(&self) -> String {
        let Self { area, from, until, benches } = self;
        let (first, last) = (benches.start + 1, benches.end);
        let rings = area.polygons().len();
        format!(
            "Ground covered from {} s to {} s by benches {first} to {last}: {:.3} m2, in {rings} polygon{}.",
            figure(*from),
            figure(*until),
            area.area(),
            if rings == 1 { "" } else { "s" }
        )
    }

    /// Returns the line of `check --swept --json`.
    pub fn line(&self) -> impl Serialize {
        Line { check: "swept", area: self.area.area(), from: self.from, until: self.until }
    }

    /// Writes the ground to a file as GeoJSON.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, scene: &Scene, file: &Path) -> Result<(), CommandError> {
        // Rings of GeoJSON end with their first corner.
        let closed = |ring: &Ring| ring.iter().chain(ring.first()).copied().collect();
        let polygons = self.area.polygons().iter();
        let feature = Feature {
            r#type: "Feature",
            properties: Properties {
                scene: &scene.name,
                area: self.area.area(),
                tolerance: TOLERANCE,
                from: self.from,
                until: self.until,
                benches: [self.benches.start, self.benches.end - 1],
            },
            geometry: MultiPolygon {
                r#type: "MultiPolygon",
                coordinates: polygons.map(|rings| rings.iter().map(closed).collect()).collect(),
            },
        };
        let mut output = Output::file(file)?;
        output.json(&feature)?;
        output.finish()
    }
}
