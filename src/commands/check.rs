//! `check`: the model of a scene, its omissions, and its solver with the reason.

mod description;
mod several;

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use bench_dragon::certify::{
    CertificateLine, CertifyError, ClearanceEnclosure, ClearanceEnclosures, ClearanceHints, MOST_CLEARANCE_STEPS,
    ObstacleEnclosure, certify_least_clearance, enclose_least_clearance,
};
use bench_dragon::messages::sentence::rounded;
use bench_dragon::messages::state::EventKind;
use bench_dragon::motion::ground::Obstacle;
use bench_dragon::motion::timeline::{TimedClearance, TimedEvent, TimedObstacleClearance, Timeline};
use bench_dragon::show::scene::{Scene, printable};
use bench_dragon::show::timed_cues;
use serde::Serialize;

use description::describe;

use super::certificate_file::CertificateFile;
use super::events::{bench_name, find_least_clearance, least_clearance, least_clearance_between, sentence};
use super::swept::{Benches, Stretch, Swept, benches, swept};
use super::verify::certificate::proved_of;
use super::{CommandError, Common, Output, expect_exact_motion, figure, progress_bar, search_timeline};

/// Arguments of `check`.
#[derive(Debug, clap::Args)]
pub struct CheckArguments {
    /// A certificate of `events`, `check`, `plan speed` or `plan pitch` with `--certify`, for this scene: check the
    /// certificate and print its results; with --json, print no results
    #[arg(long, value_name = "FILE")]
    certificate: Option<PathBuf>,
    /// Prove the least clearance of the show and that of each obstacle: enclose them within a nanometre, rounding
    /// included. The proof takes seconds to minutes; with --json, print the proof (and the line of --swept) alone
    #[arg(long)]
    prove: bool,
    /// Write the ground that boards cover, true to 1 mm, as GeoJSON in metres of the stage
    #[arg(long, value_name = "FILE")]
    swept: Option<PathBuf>,
    /// The first time of --swept: seconds, or an event; by default 0
    #[arg(long, value_name = "TIME", requires = "swept", allow_negative_numbers = true)]
    from: Option<String>,
    /// The last time of --swept: seconds, or an event; by default the end of the show
    #[arg(long, value_name = "TIME", requires = "swept", allow_negative_numbers = true)]
    until: Option<String>,
    /// The benches of --swept, counted from 1, of several dragons as in gold:1-20; by default all
    #[arg(long, value_name = "FIRST-LAST", requires = "swept", value_parser = benches)]
    benches: Option<Benches>,
    /// Write the certificate of the proof to this file, for `verify`
    #[arg(long, value_name = "FILE", requires = "prove")]
    certify: Option<PathBuf>,
}

/// The proved bounds of a least clearance, in every line of `check --prove --json`.
#[derive(Serialize)]
struct ProvedBounds {
    #[serde(rename = "least_clearance_lo")]
    lo: Option<f64>,
    #[serde(rename = "least_clearance_hi")]
    hi: Option<f64>,
    #[serde(rename = "least_clearance_status")]
    status: &'static str,
    /// Simulated seconds up to which the bounds are proved, unless to the end of the show.
    proved_until: Option<f64>,
    time: Option<f64>,
}

impl ProvedBounds {
    /// Creates the fields of a proof up to a time, or to the end of the show. The upper bound is met at `time`.
    fn new(lo: Option<f64>, hi: Option<f64>, until: Option<f64>, time: Option<f64>) -> Self {
        let status = match (lo.is_some() && hi.is_some(), until.is_none()) {
            (true, true) => "proved",
            (true, false) => "given_up",
            (false, _) => "searched",
        };
        Self { lo, hi, status, proved_until: until.map(rounded_down), time }
    }

    /// Creates the fields of an enclosure, if there is one. The fields are its bounds, the metres of travel up to which
    /// these hold, and the metres where the upper bound is met.
    fn of(found: Option<([f64; 2], Option<f64>, f64)>, time_at: impl Fn(f64) -> f64) -> Self {
        let Some(([lo, hi], until, travelled)) = found else { return Self::new(None, None, None, None) };
        Self::new(Some(lo), Some(hi), until.map(&time_at), Some(time_at(travelled)))
    }
}

/// Returns a proved time rounded down, so that it is not after the exact one.
fn rounded_down(time: f64) -> f64 {
    time.next_down().max(0.0)
}

/// The line of `check --prove --json`.
#[derive(Serialize)]
struct ClearanceLine {
    least_clearance: Option<f64>,
    #[serde(flatten)]
    proved: ProvedBounds,
    bench_a: Option<usize>,
    bench_b: Option<usize>,
}

/// A line of `check --prove --json` for an obstacle.
#[derive(Serialize)]
struct ProvedObstacleLine<'a> {
    obstacle: &'a str,
    least_clearance: f64,
    #[serde(flatten)]
    proved: ProvedBounds,
    bench: Option<usize>,
}

/// Validates the scene and prints what it does.
pub fn check(common: &Common, arguments: &CheckArguments) -> Result<(), CommandError> {
    let text = common.scene_text()?;
    let scene = text.parse_any()?;
    if arguments.prove {
        expect_exact_motion(&scene)?;
    }
    let timeline = search_timeline(&scene, common);
    let mut output = Output::standard();
    let covered = arguments.covered(&scene, &timeline, common)?;
    let certified = arguments.certificate.as_ref().map(|file| proved(&text.text, file, common)).transpose()?;
    if let (Some(covered), true) = (&covered, common.json) {
        output.json(&covered.line())?;
    }
    if let (Some(ensemble), true, true) = (&scene.ensemble, arguments.prove, common.json) {
        let show_end = timeline.show_end(scene.stops_at_contact());
        let file = arguments.certify.as_deref();
        for part in several::enclosed((&scene, ensemble, &text.text), show_end, file, common)? {
            output.json(&part)?;
        }
        return output.finish();
    }
    if arguments.prove && common.json {
        return print_proof(&scene, &text.text, &timeline, arguments, common, output);
    }
    if common.json {
        return if covered.is_some() { output.finish() } else { print_lines(&scene, &timeline, common, output) };
    }
    describe(&scene, &warnings(&scene, &timeline), &mut output)?;
    ahead(&scene, &timeline, &mut output)?;
    let (found, show_end) = find_least_clearance(&scene, &timeline, common);
    output.line(&format!("  {}", least_clearance(&scene, found.of_show())))?;
    if let Some(between) = found.between.filter(|between| Some(*between) != found.of_show()) {
        output.line(&format!("  {}", least_clearance_between(&scene, &between)))?;
    }
    let found = found.of_show();
    let beside = obstacle_clearances(&scene, show_end, common);
    let enclosures = match arguments.prove && scene.ensemble.is_none() {
        true => {
            let hints = (found, beside.as_slice(), show_end);
            Some(enclosed(&scene, &text.text, hints, arguments.certify.as_deref(), common)?)
        }
        false => None,
    };
    if let Some(ClearanceEnclosures { boards, .. }) = &enclosures {
        output.line(&format!("  {}", proof_sentence(&scene, *boards)))?;
    }
    for least in &beside {
        output.line(&format!("  {}", obstacle_sentence(&scene, &timeline, least)))?;
        if let Some(ClearanceEnclosures { obstacles, .. }) = &enclosures {
            output.line(&format!("  {}", obstacle_proof(&scene, enclosure_of(obstacles, least))))?;
        }
    }
    if let (Some(ensemble), true) = (&scene.ensemble, arguments.prove) {
        let parts = several::enclosed((&scene, ensemble, &text.text), show_end, arguments.certify.as_deref(), common)?;
        several::print(&parts, &mut output)?;
    }
    if let Some(covered) = covered {
        output.line(&format!("  {}", covered.sentence()))?;
    }
    if let Some(sentences) = certified {
        output.line("  Proved of this scene:")?;
        for sentence in sentences {
            output.line(&format!("    {sentence}."))?;
        }
    }
    output.finish()
}

/// Proves the least clearances and prints them as JSON lines.
fn print_proof(
    scene: &Scene,
    text: &str,
    timeline: &Timeline,
    arguments: &CheckArguments,
    common: &Common,
    mut output: Output,
) -> Result<(), CommandError> {
    let (found, show_end) = find_least_clearance(scene, timeline, common);
    let found = found.of_show();
    let beside = obstacle_clearances(scene, show_end, common);
    let hints = (found, beside.as_slice(), show_end);
    let ClearanceEnclosures { boards, obstacles } = enclosed(scene, text, hints, arguments.certify.as_deref(), common)?;
    output.json(&clearance_line(scene, found, boards))?;
    for found in &beside {
        output.json(&obstacle_line(scene, found, enclosure_of(&obstacles, found)))?;
    }
    output.finish()
}

/// Prints the events and the cues.
fn ahead(scene: &Scene, timeline: &Timeline, output: &mut Output) -> Result<(), CommandError> {
    output.line("  Ahead, in simulated time:")?;
    for timed in &timeline.all() {
        output.line(&format!("  {}", sentence(scene, timed)))?;
    }
    for cue in cues(scene, timeline) {
        output.line(&format!("  {cue}"))?;
    }
    Ok(())
}

/// Returns the warnings about a scene: its doubtful numbers, and boards that overlap or are at an obstacle at the start.
fn warnings(scene: &Scene, timeline: &Timeline) -> Vec<String> {
    let begins_with = |kind| timeline.find(kind).is_some_and(|timed| timed.time == 0.0);
    let overlap = "boards overlap at the start: widen the pitch or narrow the boards";
    let obstacle = "a board is within the keep-out of an obstacle at the start";
    let starts = [(EventKind::Contact, overlap), (EventKind::Obstacle, obstacle)];
    let starts = starts.into_iter().filter(|(kind, _)| begins_with(*kind)).map(|(_, warning)| warning.to_owned());
    scene.doubts.iter().cloned().chain(starts).collect()
}

/// A line of `check --json`: the least clearance of two boards.
#[derive(Serialize)]
struct LeastClearanceLine {
    check: &'static str,
    clearance: Option<f64>,
    time: Option<f64>,
    bench_a: Option<u32>,
    bench_b: Option<u32>,
}

/// A line of `check --json`: the least clearance of an obstacle.
#[derive(Serialize)]
struct ObstacleLine<'a> {
    check: &'static str,
    obstacle: &'a str,
    clearance: f64,
    time: f64,
    bench: u32,
}

/// Prints the least clearances of the show as JSON lines.
fn print_lines(scene: &Scene, timeline: &Timeline, common: &Common, mut output: Output) -> Result<(), CommandError> {
    let (found, show_end) = find_least_clearance(scene, timeline, common);
    let line = |check, found: Option<TimedClearance>| LeastClearanceLine {
        check,
        clearance: found.map(|found| found.least.value),
        time: found.map(|found| found.time),
        bench_a: found.map(|found| found.least.bench_a),
        bench_b: found.map(|found| found.least.bench_b),
    };
    output.json(&line("clearance", found.of_show()))?;
    if scene.ensemble.is_some() {
        output.json(&line("clearance_between_dragons", found.between))?;
    }
    for TimedObstacleClearance { obstacle, least, time, .. } in obstacle_clearances(scene, show_end, common) {
        let obstacle = &scene.ground().obstacles()[obstacle].name;
        let (check, clearance, bench) = ("obstacle", least.value, least.bench);
        output.json(&ObstacleLine { check, obstacle, clearance, time, bench })?;
    }
    output.finish()
}

/// Searches for the least clearance of each obstacle over the whole show.
fn obstacle_clearances(scene: &Scene, show_end: &TimedEvent, common: &Common) -> Vec<TimedObstacleClearance> {
    let bar = progress_bar(1000, common).with_message("searching for the least clearance of the obstacles");
    let mut progress = |share: f64| bar.set_position((1000.0 * share) as u64);
    let found = match &scene.ensemble {
        Some(ensemble) => ensemble.obstacle_clearances(show_end, &mut progress),
        None => scene.motion.obstacle_clearances(show_end, &mut progress),
    };
    bar.finish_and_clear();
    found
}

/// Returns a sentence for people on the least clearance of an obstacle, and on its first touch.
fn obstacle_sentence(scene: &Scene, timeline: &Timeline, found: &TimedObstacleClearance) -> String {
    let TimedObstacleClearance { obstacle, least, time, searched_until } = *found;
    let Obstacle { name, keep_out, .. } = &scene.ground().obstacles()[obstacle];
    let (value, at, bench) = (figure(least.value), figure(time), bench_name(scene, least.bench));
    let up_to = searched_until
        .map_or(String::new(), |until| format!(" up to t = {} s, where the search gave up", figure(until)));
    let beyond = if *keep_out > 0.0 { format!(" beyond its keep-out of {keep_out} m") } else { String::new() };
    let number = Some((scene.handles() + obstacle) as u32);
    let first = timeline.events().iter().find(|timed| timed.event.bench_b == number);
    let first = first.map_or(String::new(), |timed| format!(" First met at t = {} s.", figure(timed.time)));
    format!(
        "The least clearance of the {}{beyond}{up_to} is {value} m, at t = {at} s, with {bench} (counting from 1).{first}",
        printable(name)
    )
}

impl CheckArguments {
    /// Writes the file of --swept and returns its content.
    fn covered(&self, scene: &Scene, timeline: &Timeline, common: &Common) -> Result<Option<Swept>, CommandError> {
        let Some(file) = &self.swept else { return Ok(None) };
        let stretch =
            Stretch { from: self.from.as_deref(), until: self.until.as_deref(), benches: self.benches.as_ref() };
        let ground = swept(scene, timeline, stretch, common)?;
        ground.write(scene, file)?;
        Ok(Some(ground))
    }
}

/// Encloses the least clearances between two numbers each, if they can be proved. Writes the certificate to `file`.
fn enclosed(
    scene: &Scene,
    text: &str,
    (found, obstacles, show_end): (Option<TimedClearance>, &[TimedObstacleClearance], &TimedEvent),
    file: Option<&Path>,
    common: &Common,
) -> Result<ClearanceEnclosures, CommandError> {
    expect_exact_motion(scene)?;
    let certificate = file.map(CertificateFile::create).transpose()?;
    if found.is_none() && obstacles.is_empty() {
        let sentence = "no certificate is written: the search found no least clearance";
        let nothing = ClearanceEnclosures { boards: None, obstacles: Vec::new() };
        return if file.is_some() { Err(CommandError::Failed(sentence.to_owned())) } else { Ok(nothing) };
    }
    let least = found.map(|found| found.least);
    let hints = ClearanceHints { boards: least.as_ref(), obstacles };
    let bar = progress_bar(1000, common).with_message("proving the least clearance");
    let mut progress = |share| bar.set_position((1000.0 * share) as u64);
    let most_steps = MOST_CLEARANCE_STEPS;
    let Some(mut certificate) = certificate else {
        let enclosures = enclose_least_clearance(&scene.motion, show_end, hints, most_steps, &mut progress);
        bar.finish_and_clear();
        return Ok(enclosures);
    };
    let mut write = |line: &CertificateLine| certificate.write(line);
    let motion = &scene.motion;
    let enclosures = certify_least_clearance(motion, show_end, hints, text, most_steps, &mut write, &mut progress);
    bar.finish_and_clear();
    let enclosures = enclosures.map_err(|CertifyError::Write(error)| error)?;
    certificate.finish()?;
    Ok(enclosures)
}

/// Returns the enclosure of the obstacle of a found clearance.
fn enclosure_of(enclosures: &[Option<ObstacleEnclosure>], found: &TimedObstacleClearance) -> Option<ObstacleEnclosure> {
    enclosures.get(found.obstacle).copied().flatten()
}

/// Returns a sentence for people on the proof of the least clearance of an obstacle.
fn obstacle_proof(scene: &Scene, enclosure: Option<ObstacleEnclosure>) -> String {
    let Some(ObstacleEnclosure { lo, hi, until, travelled, .. }) = enclosure else {
        return "Nothing of it could be proved.".to_owned();
    };
    match until {
        None => format!("Proved: it is between {lo} m and {hi} m."),
        Some(until) => {
            let [until, at] = [until, travelled].map(|travelled| scene.motion.time_at(travelled));
            format!(
                "Proved: up to t = {} s it is not less than {lo} m; at t = {at} s it is at most {hi} m. Not decided \
                 beyond.",
                rounded_down(until)
            )
        }
    }
}

fn obstacle_line<'a>(
    scene: &'a Scene,
    found: &TimedObstacleClearance,
    enclosure: Option<ObstacleEnclosure>,
) -> ProvedObstacleLine<'a> {
    let proved = enclosure.map(|found| ([found.lo, found.hi], found.until, found.travelled));
    ProvedObstacleLine {
        obstacle: &scene.ground().obstacles()[found.obstacle].name,
        least_clearance: found.least.value,
        proved: ProvedBounds::of(proved, |travelled| scene.motion.time_at(travelled)),
        bench: enclosure.map(|enclosure| enclosure.bench),
    }
}

/// Returns a sentence for people on the proof of the least clearance.
fn proof_sentence(scene: &Scene, enclosure: Option<ClearanceEnclosure>) -> String {
    let Some(ClearanceEnclosure { lo, hi, until, travelled, .. }) = enclosure else {
        return "Nothing of it could be proved.".to_owned();
    };
    let time_at = |travelled| scene.motion.time_at(travelled);
    proved_sentence((lo, hi), until.map(time_at).map(rounded_down), time_at(travelled))
}

/// Returns a sentence for people on a least clearance that is proved up to a time, rounded down, or to the end of the
/// show.
fn proved_sentence((lo, hi): (f64, f64), until: Option<f64>, at: f64) -> String {
    match until {
        None if lo == hi => format!("Proved: it is {lo} m."),
        None => format!("Proved: it is between {lo} m and {hi} m."),
        Some(until) => format!(
            "Proved: up to t = {until} s no two boards are nearer than {lo} m; at t = {at} s two are no further apart \
             than {hi} m. Not decided beyond."
        ),
    }
}

fn clearance_line(
    scene: &Scene,
    found: Option<TimedClearance>,
    enclosure: Option<ClearanceEnclosure>,
) -> ClearanceLine {
    let proved = enclosure.map(|found| ([found.lo, found.hi], found.until, found.travelled));
    ClearanceLine {
        least_clearance: found.map(|found| found.least.value),
        proved: ProvedBounds::of(proved, |travelled| scene.motion.time_at(travelled)),
        bench_a: enclosure.map(|enclosure| enclosure.bench_a),
        bench_b: enclosure.map(|enclosure| enclosure.bench_b),
    }
}

/// Returns the proved results of a certificate for the scene with this text.
fn proved(scene: &str, file: &Path, common: &Common) -> Result<Vec<String>, CommandError> {
    let shown = file.display().to_string();
    let opened = File::open(file)
        .map_err(|error| CommandError::BadInput(format!("{shown}: {error}, expected a certificate to read")))?;
    let bar = progress_bar(opened.metadata().map_or(0, |data| data.len()), common).with_message("checking");
    let proved = proved_of(scene, &shown, BufReader::new(opened), &mut |bytes| bar.set_position(bytes));
    bar.finish_and_clear();
    proved
}

/// Returns a sentence on each cue, in the order of their times; those that the show does not reach stand last.
fn cues(scene: &Scene, timeline: &Timeline) -> Vec<String> {
    let (cues, missing) = timed_cues(scene, timeline);
    let end = timeline.show_end(scene.stops_at_contact()).time;
    let told = cues.into_iter().map(|cue| {
        let action = match (cue.time > end, cue.pauses) {
            (true, _) => ", after the end of the show",
            (false, true) => "; the show waits there for `go`",
            (false, false) => "",
        };
        format!("Cue {}, \"{}\", at {} s{action}.", cue.number, cue.name, rounded(cue.time, 3))
    });
    let missing = missing.into_iter().map(|name| {
        format!("Cue \"{name}\" has no time: its event does not happen, or the time would be before the start.")
    });
    told.chain(missing).collect()
}
