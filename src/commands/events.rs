//! `events`: the events of a scene in order, and its least clearance; with a proof on request.

use std::path::{Path, PathBuf};

use bench_dragon::certify::{self, CertifiedEvent, CertifyError, MOST_STEPS, Status};
use bench_dragon::messages::state::EventKind;
use bench_dragon::motion::ensemble::LeastClearances;
use bench_dragon::motion::event::Event;
use bench_dragon::motion::timeline::{TimedClearance, TimedEvent, Timeline};
pub use bench_dragon::show::results::bench_name;
use bench_dragon::show::results::{EventLine, event_sentence, obstacle_label};
use bench_dragon::show::scene::{Scene, printable};
use serde::Serialize;

use super::certificate_file::CertificateFile;
use super::signals::{gave_up, report, stop_searches_on_signals, unstopped};
use super::{CommandError, Common, Output, expect_exact_motion, figure, progress_bar, search_timeline, warn_of_doubts};

/// Arguments of `events`.
#[derive(Debug, clap::Args)]
pub struct EventsArguments {
    /// Prove the events and write the certificate to this file, for `verify`
    #[arg(long, value_name = "FILE")]
    certify: Option<PathBuf>,
}

/// The times between which an event is proved; both null if undecided.
#[derive(Serialize)]
struct Enclosure {
    time_lo: Option<f64>,
    time_hi: Option<f64>,
}

/// One line of `events --json`.
#[derive(Serialize)]
struct Line {
    #[serde(flatten)]
    event: EventLine,
    #[serde(flatten)]
    enclosure: Option<Enclosure>,
}

/// Prints the events of the scene.
pub fn events(common: &Common, arguments: &EventsArguments) -> Result<(), CommandError> {
    let text = common.scene_text()?;
    let scene = text.parse()?;
    warn_of_doubts(&scene);
    stop_searches_on_signals()?;
    let timeline = search_timeline(&scene, common);
    let proved = match &arguments.certify {
        Some(file) if !timeline.is_stopped() => Some(certified(&scene, &timeline, &text.text, file, common)?),
        _ => None,
    };
    let outcome_of = |kind: EventKind, obstacle: Option<usize>, dragons: &[usize]| {
        let outcomes = proved.as_ref()?.iter();
        let is_it = |outcome: &&CertifiedEvent| {
            (outcome.event, outcome.obstacle, outcome.dragons.as_slice()) == (kind, obstacle, dragons)
        };
        outcomes.into_iter().find(is_it)
    };
    let proof = |kind, obstacle| Some(&outcome_of(kind, obstacle, &[])?.status);
    let number = |event: &Event| {
        let named = scene.ensemble.obstacle_of(event)?;
        scene.ensemble.ground().obstacles().iter().position(|obstacle| obstacle.name == named.name)
    };
    let outcome = |event: &Event| outcome_of(event.kind, number(event), &dragons_of(&scene, event));
    let status = |event: &Event| Some(&outcome(event)?.status);
    let mut output = Output::standard();
    for timed in &known(&timeline) {
        if common.json {
            let enclosure = status(&timed.event).map(enclosure);
            output.json(&Line { event: EventLine::new(&scene, timed), enclosure })?;
        } else {
            output.line(&event_sentence(&scene, timed))?;
            if let Some(status) = status(&timed.event) {
                output.line(&proof_sentence(timed.event.kind, status))?;
            }
        }
    }
    if !common.json {
        let until = match timeline.searched_until() {
            Some(time) => format!("up to t = {} s, where the search {}", figure(time), gave_up()),
            None => "before the motion ends".to_owned(),
        };
        let obstacle = (!scene.ensemble.ground().is_empty()).then_some(EventKind::Obstacle);
        for kind in [EventKind::Contact].into_iter().chain(obstacle).chain([EventKind::Stall]) {
            if timeline.find(kind).is_none() {
                match kind {
                    EventKind::Obstacle => output.line(&format!("No board meets an obstacle {until}."))?,
                    _ => output.line(&format!("There is no {} {until}.", kind.name()))?,
                }
                if let Some(status) = proof(kind, None) {
                    output.line(&proof_sentence(kind, status))?;
                }
            }
        }
        if scene.ensemble.only().is_none() {
            let all = timeline.all();
            let told: Vec<_> = all.iter().filter_map(|timed| outcome(&timed.event)).collect();
            for other in proved.iter().flatten().filter(|other| !told.contains(other)) {
                output.line(&format!("Of {}:", subject(&scene, other)))?;
                output.line(&proof_sentence(other.event, &other.status))?;
            }
        }
        for (number, obstacle) in scene.ensemble.ground().obstacles().iter().enumerate() {
            if let Some(status @ (Status::None { .. } | Status::Undecided { .. })) =
                proof(EventKind::Obstacle, Some(number))
            {
                output.line(&format!("Of the {}:", printable(&obstacle.name)))?;
                output.line(&proof_sentence(EventKind::Obstacle, status))?;
            }
        }
        if !timeline.is_stopped() {
            output.line(&least_clearance(&scene, find_least_clearance(&scene, &timeline, common).of_show))?;
        }
    }
    output.finish().and(unstopped())
}

/// Returns the events in order of time; of a search that was stopped, those up to where it came.
pub fn known(timeline: &Timeline) -> Vec<TimedEvent> {
    let until = timeline.searched_until().filter(|_| timeline.is_stopped());
    timeline.all().into_iter().filter(|timed| until.is_none_or(|until| timed.time <= until)).collect()
}

/// Returns the dragons with names that an event is about, in their order.
fn dragons_of(scene: &Scene, event: &Event) -> Vec<usize> {
    let numbers = event.bench_a.into_iter().chain(event.bench_b).filter(|_| scene.ensemble.only().is_none());
    let mut dragons: Vec<usize> = numbers.filter_map(|number| Some(scene.ensemble.owner(number as usize)?.0)).collect();
    dragons.sort_unstable();
    dragons.dedup();
    dragons
}

/// Returns the subject of a result about dragons with names: the kind of event, and the names.
fn subject(scene: &Scene, outcome: &CertifiedEvent) -> String {
    let dragons = scene.ensemble.dragons();
    let names: Vec<&str> =
        outcome.dragons.iter().filter_map(|dragon| Some(dragons.get(*dragon)?.name.as_str())).collect();
    let obstacle = outcome.obstacle.and_then(|number| scene.ensemble.ground().obstacles().get(number));
    let at = obstacle.map_or(String::new(), |obstacle| format!(" and {}", obstacle_label(obstacle)));
    format!("{}{at}, {}", names.join(" and "), outcome.event.name().replace('_', " "))
}

/// Writes the certificate of a scene's events, and returns what it proves.
fn certified(
    scene: &Scene,
    timeline: &Timeline,
    text: &str,
    file: &Path,
    common: &Common,
) -> Result<Vec<CertifiedEvent>, CommandError> {
    expect_exact_motion(scene)?;
    let mut certificate = CertificateFile::create(file)?;
    let bar = progress_bar(1000, common).with_message("proving");
    let mut write = |line: &certify::CertificateLine| certificate.write(line);
    let mut progress = |share| report(&bar, share);
    let (ensemble, most_steps) = (&scene.ensemble, MOST_STEPS);
    let outcomes = certify::certify(ensemble, timeline, text, most_steps, &mut write, &mut progress);
    bar.finish_and_clear();
    let outcomes = outcomes.map_err(|CertifyError::Write(error)| error)?;
    certificate.finish()?;
    Ok(outcomes)
}

fn enclosure(status: &Status) -> Enclosure {
    match *status {
        Status::Proved { time_lo, time_hi, .. } => Enclosure { time_lo: Some(time_lo), time_hi: Some(time_hi) },
        Status::None { .. } | Status::Undecided { .. } => Enclosure { time_lo: None, time_hi: None },
    }
}

/// Returns a sentence for people on the proof of an event.
fn proof_sentence(kind: EventKind, status: &Status) -> String {
    let name = kind.name().replace('_', " ");
    match status {
        Status::Proved { time_lo, time_hi, because, .. } => {
            let wide =
                because.as_ref().map(|because| format!(" They are {:.1e} s apart: {because}.", time_hi - time_lo));
            let wide = wide.unwrap_or_default();
            format!("           Proved: the first {name} is between t = {time_lo} s and {time_hi} s.{wide}")
        }
        Status::None { time_lo: None } => "           Proved.".to_owned(),
        Status::None { time_lo: Some(time_lo) } => {
            format!("           Proved up to t = {time_lo} s; the lock that ends the motion is later.")
        }
        Status::Undecided { time_lo, because } => {
            format!("           Proved up to t = {time_lo} s that there is no {name}; not decided beyond: {because}.")
        }
    }
}

/// Returns the least clearances of the whole route: up to the lock or the path end with which the motion ends, even if
/// the show stops earlier.
pub fn find_least_clearance(scene: &Scene, timeline: &Timeline, common: &Common) -> LeastClearances {
    let bar = progress_bar(1000, common).with_message("searching for the least clearance");
    let mut progress = |share| report(&bar, share);
    let found = scene.ensemble.least_clearances(timeline, timeline.end(), &mut progress);
    bar.finish_and_clear();
    found
}

/// Returns a sentence for people on the least clearance of the whole route.
pub fn least_clearance(scene: &Scene, found: Option<TimedClearance>) -> String {
    let Some(TimedClearance { least, time, searched_until }) = found else {
        return "The least clearance of the whole route is not computed: there are no two benches that could meet, or the search gave up or was stopped.".to_owned();
    };
    let (first, second) = (bench_name(scene, least.bench_a), bench_name(scene, least.bench_b));
    let (value, time) = (figure(least.value), figure(time));
    let of = searched_until.map_or("of the whole route".to_owned(), |until| {
        format!("up to t = {} s, where the search {},", figure(until), gave_up())
    });
    format!("The least clearance {of} is {value} m, at t = {time} s, between {first} and {second} (counting from 1).")
}

/// Returns a sentence for people on the least clearance of boards of two dragons.
pub fn least_clearance_between(scene: &Scene, found: &TimedClearance) -> String {
    let sentence = least_clearance(scene, Some(*found));
    sentence.replacen(" of the whole route", "", 1).replacen(
        "The least clearance",
        "The least clearance between dragons",
        1,
    )
}
