//! `check`: the model of a scene, its omissions, and its solver with the reason.

mod description;
mod parts;
mod required;

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use bench_dragon::messages::sentence::rounded;
use bench_dragon::messages::state::EventKind;
use bench_dragon::motion::ground::{BOUNDARY, Obstacle};
use bench_dragon::motion::timeline::{TimedObstacleClearance, Timeline};
use bench_dragon::show::requirements::{Bounds, Searched, verdicts};
use bench_dragon::show::results::{clearance_lines, event_sentence};
use bench_dragon::show::scene::{Scene, printable};
use bench_dragon::show::timed_cues;

use description::describe;
use parts::{Found, Parts};

use super::events::{bench_name, find_least_clearance, known, least_clearance, least_clearance_between};
use super::signals::{gave_up, report, stop_searches_on_signals, unstopped};
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
    /// Prove the least clearance of the whole route and that of each obstacle: enclose them within a nanometre, rounding
    /// included. With [require] the proof decides. It takes seconds to minutes; with --json, print the proof (and the line of --swept) alone
    #[arg(long)]
    prove: bool,
    /// Write the ground that boards cover, true to 1 mm, as GeoJSON in metres of the stage; a real tail that whips covers
    /// more
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

/// Validates the scene and prints what it does.
pub fn check(common: &Common, arguments: &CheckArguments) -> Result<(), CommandError> {
    let text = common.scene_text()?;
    let scene = text.parse()?;
    if arguments.prove {
        expect_exact_motion(&scene)?;
    }
    stop_searches_on_signals()?;
    let timeline = search_timeline(&scene, common);
    let mut output = Output::standard();
    if timeline.is_stopped() {
        if !common.json {
            ahead(&scene, &timeline, &mut output)?;
        }
        return output.finish().and(unstopped());
    }
    let covered = arguments.covered(&scene, &timeline, common)?;
    let certified = arguments.certificate.as_ref().map(|file| proved(&text.text, file, common)).transpose()?;
    if let (Some(covered), true) = (&covered, common.json) {
        output.json(&covered.line())?;
    }
    if common.json && covered.is_some() && !arguments.prove {
        return output.finish().and(unstopped());
    }
    if !common.json {
        describe(&scene, &warnings(&scene, &timeline), common, &mut output)?;
        ahead(&scene, &timeline, &mut output)?;
    }
    let found = find_least_clearance(&scene, &timeline, common);
    let beside = obstacle_clearances(&scene, &timeline, common);
    let least = Found { boards: found.of_show, obstacles: &beside };
    let prove = || Parts::enclosed(&scene, &text.text, timeline.end(), least, arguments.certify.as_deref(), common);
    let parts = arguments.prove.then(prove).transpose()?;
    let searched = Searched { timeline: &timeline, boards: found.of_show, obstacles: &beside, gave_up: gave_up() };
    let bounds = parts.as_ref().map(|parts| |obstacle: Option<&str>| parts.bounds(obstacle));
    let verdicts = verdicts(&scene, &searched, bounds.as_ref().map(|bounds| bounds as Bounds<'_>));
    if common.json {
        match &parts {
            Some(parts) => parts.print_lines(&mut output)?,
            None => {
                let lines = clearance_lines(&scene, &timeline, &found, &beside);
                lines.iter().try_for_each(|line| output.json(line))?;
            }
        }
        required::print_lines(&verdicts, &mut output)?;
        return output.finish().and(unstopped()).and(required::result(&verdicts));
    }
    output.line(&format!("  {}", least_clearance(&scene, found.of_show)))?;
    if let Some(between) = found.between.filter(|between| Some(*between) != found.of_show) {
        output.line(&format!("  {}", least_clearance_between(&scene, &between)))?;
    }
    parts.iter().try_for_each(|parts| parts.print_unnamed(None, &mut output))?;
    for least in &beside {
        output.line(&format!("  {}", obstacle_sentence(&scene, &timeline, least)))?;
        let name = &scene.ensemble.ground().obstacles()[least.obstacle].name;
        parts.iter().try_for_each(|parts| parts.print_unnamed(Some(name), &mut output))?;
    }
    parts.iter().try_for_each(|parts| parts.print_named(&mut output))?;
    required::print(&verdicts, &mut output)?;
    if let Some(covered) = covered {
        output.line(&format!("  {}", covered.sentence()))?;
    }
    if let Some(sentences) = certified {
        output.line("  Proved of this scene:")?;
        for sentence in sentences {
            output.line(&format!("    {sentence}."))?;
        }
    }
    output.finish().and(unstopped()).and(required::result(&verdicts))
}

/// Prints the events and the cues.
fn ahead(scene: &Scene, timeline: &Timeline, output: &mut Output) -> Result<(), CommandError> {
    output.line("  Ahead, in simulated time:")?;
    for timed in &known(timeline) {
        output.line(&format!("  {}", event_sentence(scene, timed)))?;
    }
    if timeline.is_stopped() {
        return Ok(());
    }
    for cue in cues(scene, timeline) {
        output.line(&format!("  {cue}"))?;
    }
    let stop = timeline.show_end(scene.stops_at_contact());
    if stop.time < timeline.end().time {
        let sentence = "where `motion.on_contact` stops it. The least clearances below are of the whole route";
        output.line(&format!("  The show stops at t = {} s, {sentence}.", figure(stop.time)))?;
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

/// Searches for the least clearance of each obstacle over the whole route.
fn obstacle_clearances(scene: &Scene, timeline: &Timeline, common: &Common) -> Vec<TimedObstacleClearance> {
    let bar = progress_bar(1000, common).with_message("searching for the least clearance of the obstacles");
    let mut progress = |share| report(&bar, share);
    let found = scene.ensemble.obstacle_clearances(timeline.end(), &mut progress);
    bar.finish_and_clear();
    found
}

/// Returns a sentence for people on the least clearance of an obstacle, and on its first touch.
fn obstacle_sentence(scene: &Scene, timeline: &Timeline, found: &TimedObstacleClearance) -> String {
    let TimedObstacleClearance { obstacle, least, time, searched_until } = *found;
    let Obstacle { name, keep_out, .. } = &scene.ensemble.ground().obstacles()[obstacle];
    let (at, bench) = (figure(time), bench_name(scene, least.bench));
    let up_to = searched_until
        .map_or(String::new(), |until| format!(" up to t = {} s, where the search {}", figure(until), gave_up()));
    let distance = least.value + keep_out;
    let beyond = match (*keep_out > 0.0, least.value < 0.0) {
        (false, _) => String::new(),
        (true, false) => format!(", {} m beyond the keep-out of {keep_out} m", figure(least.value)),
        (true, true) => format!(", {} m inside the keep-out of {keep_out} m", figure(-least.value)),
    };
    let number = Some((scene.ensemble.handles() + obstacle) as u32);
    let first = timeline.events().iter().find(|timed| timed.event.bench_b == number);
    let first = first.map_or(String::new(), |timed| format!(" First met at t = {} s.", figure(timed.time)));
    if least.value == f64::NEG_INFINITY {
        return format!(
            "No board fits inside the {}: at t = {at} s {bench} (counting from 1) is outside.",
            printable(name)
        );
    }
    let what = match distance < 0.0 {
        false => "The least distance from",
        true if name == BOUNDARY => "The greatest distance outside",
        true => "The greatest overlap with",
    };
    let distance = figure(distance.abs());
    format!(
        "{what} the {}{up_to} is {distance} m{beyond}, at t = {at} s, with {bench} (counting from 1).{first}",
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
