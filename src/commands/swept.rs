//! The ground that boards cover, for `draw --swept` and `check --swept`: options, the search, the file.

use std::ops::Range;
use std::path::Path;

use bench_dragon::drawing::swept::{Ring, SweptArea, SweptStretch, TOLERANCE};
use bench_dragon::messages::sentence::Expected;
use bench_dragon::motion::ensemble::Dragon;
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::show::scene::Scene;
use serde::Serialize;

use super::signals::{report, unstopped};
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
    pub benches: Option<&'a Benches>,
}

/// The benches of one dragon.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Benches {
    /// The name of the dragon, if one is given.
    dragon: Option<String>,
    /// The first and the last bench, counted from 1.
    range: (usize, usize),
}

/// Returns the benches that `text` names, as in `200-223` or `7`, with several dragons as in `gold:1-20`.
///
/// # Errors
/// The text has another form.
pub fn benches(text: &str) -> Result<Benches, Expected> {
    let (dragon, numbers) = text.split_once(':').map_or((None, text), |(name, rest)| (Some(name.trim()), rest));
    let (first, last) = numbers.split_once('-').unwrap_or((numbers, numbers));
    match (first.trim().parse(), last.trim().parse()) {
        (Ok(first), Ok(last)) if 1 <= first && first <= last => {
            Ok(Benches { dragon: dragon.map(str::to_owned), range: (first, last) })
        }
        _ => {
            Err(Expected("benches counted from 1, as in 200-223, or of one of several dragons, as in gold:1-20".into()))
        }
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
    /// The first and the last bench by the numbers of the show, counted from 0.
    benches: [usize; 2],
    /// The same for people.
    words: String,
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
        None => timeline.show_end(scene.stops_at_contact()).time,
    };
    if until < from {
        return Err(CommandError::BadInput(format!(
            "--until is {} s, expected a time from --from on, {} s",
            figure(until),
            figure(from)
        )));
    }
    let (stretches, benches, words) = selected(scene, [from, until], stretch.benches)?;
    let bar = progress_bar(1000, common).with_message("uniting the ground");
    let mut progress = |share| report(&bar, share);
    let area = SweptArea::new(&stretches, &mut progress);
    bar.finish_and_clear();
    unstopped()?;
    let area = area.map_err(|none| CommandError::Failed(format!("--until {}: {none}", figure(until))))?;
    Ok(Swept { area, from, until, benches, words })
}

/// Returns the boards of a stretch of time, the first and the last bench by the numbers of the show, and both in words.
fn selected<'s>(
    scene: &'s Scene,
    times: [f64; 2],
    benches: Option<&Benches>,
) -> Result<(Vec<SweptStretch<'s>>, [usize; 2], String), CommandError> {
    let ensemble = &scene.ensemble;
    let of = |dragon: &'s Dragon, benches: Range<usize>| SweptStretch {
        motion: &dragon.motion,
        travelled: times.map(|time| dragon.travelled_at(time)).into(),
        benches,
    };
    let Some((number, range)) = chosen(scene, benches)? else {
        let all = ensemble.dragons().iter().map(|dragon| of(dragon, 0..dragon.motion.team().benches)).collect();
        return Ok((all, [0, ensemble.handles() - 2], "all benches".to_owned()));
    };
    let (dragon, first) = (&ensemble.dragons()[number], ensemble.handles_of(number).start);
    let words = dragon.titled(&format!("benches {} to {}", range.start + 1, range.end));
    let ends = [first + range.start, first + range.end - 1];
    Ok((vec![of(dragon, range)], ends, words))
}

/// Returns the benches of each dragon that an option names, counted from 0; without the option all.
///
/// # Errors
/// Bad input: a dragon or a bench that the scene has not.
pub fn ranges(scene: &Scene, benches: Option<&Benches>) -> Result<Vec<Range<usize>>, CommandError> {
    let dragons = scene.ensemble.dragons().iter().enumerate();
    let chosen = chosen(scene, benches)?;
    let of = |(number, dragon): (usize, &Dragon)| match &chosen {
        Some((one, range)) if *one == number => range.clone(),
        Some(_) => 0..0,
        None => 0..dragon.motion.team().benches,
    };
    Ok(dragons.map(of).collect())
}

/// Returns the dragon that an option names and its benches, counted from 0; `None` for all benches of several dragons.
fn chosen(scene: &Scene, benches: Option<&Benches>) -> Result<Option<(usize, Range<usize>)>, CommandError> {
    let refused = |sentence: String| Err(CommandError::BadInput(sentence));
    let ensemble = &scene.ensemble;
    let name = benches.and_then(|benches| benches.dragon.as_deref()).unwrap_or_default();
    let named = ensemble.dragons().iter().position(|dragon| dragon.name == name);
    let Some(number) = named else {
        if benches.is_none() {
            return Ok(None);
        }
        if ensemble.only().is_some() {
            return refused("--benches names a dragon and the scene has one, expected benches as in 1-20".to_owned());
        }
        let names: Vec<&str> = ensemble.dragons().iter().map(|dragon| dragon.name.as_str()).collect();
        let names = names.join(", ");
        return refused(format!("--benches names no dragon of the scene, expected one of {names}, as in gold:1-20"));
    };
    Ok(Some((number, range(benches, ensemble.dragons()[number].motion.team().benches)?)))
}

/// Returns benches of a team counted from 0.
fn range(benches: Option<&Benches>, all: usize) -> Result<Range<usize>, CommandError> {
    let (first, last) = benches.map_or((1, all), |benches| benches.range);
    if last > all {
        let sentence = format!("--benches ends with bench {last}, expected benches from 1 to {all}");
        return Err(CommandError::BadInput(sentence));
    }
    Ok(first - 1..last)
}

/// The line of `check --swept --json`.
#[derive(Serialize)]
struct SweptLine {
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
    /// The first and the last bench by the numbers of the show, counted from 0.
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
        let Self { area, from, until, words, .. } = self;
        let rings = area.polygons().len();
        format!(
            "Ground covered from {} s to {} s by {words}: {:.3} m2, in {rings} polygon{}. Left out: rings narrower than \
             1 mm, and the ground of a real tail that whips by its momentum.",
            figure(*from),
            figure(*until),
            area.area(),
            if rings == 1 { "" } else { "s" }
        )
    }

    /// Returns the line of `check --swept --json`.
    pub fn line(&self) -> impl Serialize {
        SweptLine { check: "swept", area: self.area.area(), from: self.from, until: self.until }
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
                benches: self.benches,
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
