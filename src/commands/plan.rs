//! `plan`: answers for a choreographer, with the place that decides them.

mod fit;
mod stage;
mod turn;

use std::path::{Path, PathBuf};

use bench_dragon::certify::CertificateLine;
use bench_dragon::certify::plan::{
    GreatestSpeed, LeastPitch, Overlap, PitchLine, PlanError, Planned, Spaced, SpeedLine, certify_greatest_speed,
    certify_least_pitch, greatest_speed, least_pitch,
};
use bench_dragon::certify::speed::MOST_HANDLES;
use bench_dragon::show::scene::{Accepted, Scene};

use self::stage::{on_stage, stage_sentence};
use super::certificate_file::CertificateFile;
use super::events::bench_name;
use super::scene_argument::scene_argument;
use super::signals::{are_searches_stopped, report, stop_searches_on_signals, unstopped};
use super::{CommandError, Common, Output, expect_exact_motion, number, progress_bar, search_timeline};

/// Arguments of `plan`.
#[derive(Debug, clap::Args)]
pub struct PlanArguments {
    #[command(subcommand)]
    question: Question,
}

#[derive(Debug, clap::Subcommand)]
enum Question {
    /// The least pitch at which the scene's team reaches a radius on a spiral without touching itself
    #[command(arg = scene_argument())]
    Pitch {
        /// The distance from the centre that the front handle of the head must reach, in metres
        #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
        reach_radius: f64,
        #[command(flatten)]
        spacing: Spacing,
        /// Write the certificate of the proof to this file, for `verify`
        #[arg(long, value_name = "FILE")]
        certify: Option<PathBuf>,
    },
    /// The greatest constant speed of the head at which no handle of the show exceeds a limit
    #[command(arg = scene_argument())]
    Speed {
        /// The speed that no handle may exceed, in metres per second
        #[arg(long, value_name = "M/S", allow_negative_numbers = true)]
        max_handle_speed: f64,
        /// Write the certificate of the proof to this file, for `verify`
        #[arg(long, value_name = "FILE")]
        certify: Option<PathBuf>,
    },
    /// The least turn radius with which the scene's team turns round without contact, stall or lock
    #[command(arg = scene_argument())]
    Turn {
        /// The radius of the first arc divided by that of the second; by default the best ratio that is found
        #[arg(long, value_name = "K", allow_negative_numbers = true)]
        arc_ratio: Option<f64>,
        #[command(flatten)]
        spacing: Spacing,
    },
    /// Numbers of the scene with which the show keeps what it must, with the greatest margin found
    #[command(arg = scene_argument())]
    Fit(fit::FitArguments),
}

/// The distance that boards must keep.
#[derive(Debug, clap::Args)]
pub struct Spacing {
    /// The clearance of any two boards that share no handle, in metres; by default the scene's `[require]`, or 0
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    clearance: Option<f64>,
}

impl Spacing {
    /// Returns the clearance that is required of a scene, in metres.
    fn required(&self, scene: &Scene) -> Result<f64, CommandError> {
        if let Some(metres) = self.clearance {
            Accepted::KEEP_OUT.check("--clearance", metres)?;
        }
        let of_scene = scene.require.and_then(|require| require.clearance);
        // No sentence has a sign of 0.
        Ok(self.clearance.or(of_scene).unwrap_or(0.0).abs())
    }
}

/// Returns the words for boards that are too near for a clearance.
pub fn are_too_near(clearance: f64) -> String {
    if clearance > 0.0 { format!("are nearer than {clearance} m") } else { "overlap".to_owned() }
}

/// Returns the words for boards that do not keep a clearance.
pub fn come_too_near(clearance: f64) -> String {
    if clearance > 0.0 { format!("come as near as {clearance} m") } else { "touch".to_owned() }
}

/// Returns the words for the end of a search that came to no end.
fn given_up() -> &'static str {
    if are_searches_stopped() { "was stopped" } else { "was given up" }
}

/// Plans the pitch, the speed, the turn or numbers of the scene.
pub fn plan(common: &Common, arguments: &PlanArguments) -> Result<(), CommandError> {
    stop_searches_on_signals()?;
    match &arguments.question {
        Question::Pitch { reach_radius, spacing, certify } => {
            plan_pitch(common, *reach_radius, spacing, certify.as_deref())
        }
        Question::Speed { max_handle_speed, certify } => plan_speed(common, *max_handle_speed, certify.as_deref()),
        Question::Turn { arc_ratio, spacing } => turn::plan_turn(common, *arc_ratio, spacing),
        Question::Fit(arguments) => fit::plan_fit(common, arguments),
    }
}

fn plan_pitch(common: &Common, radius: f64, spacing: &Spacing, file: Option<&Path>) -> Result<(), CommandError> {
    Accepted::LENGTH.check("--reach-radius", radius)?;
    let text = common.scene_text()?;
    let (scene, motion) = text.parse_only()?;
    warn_of_route(&scene, "its route", "the boards of its team on an inward spiral");
    let clearance = spacing.required(&scene)?;
    let asked = Spaced { team: motion.team(), clearance };
    let bar = progress_bar(1000, common).with_message("searching for the pitch");
    let mut progress = |share| report(&bar, share);
    let found = if let Some(file) = file {
        let mut certificate = CertificateFile::create(file)?;
        let mut write = |line: &CertificateLine| certificate.write(line);
        let found = certify_least_pitch(asked, radius, &text.text, &mut write, &mut progress)??;
        certificate.finish()?;
        found
    } else {
        least_pitch(asked, radius, &mut progress)?
    };
    let stage = on_stage(&motion, asked, Planned::Pitch { radius }, found.value_hi, &mut progress);
    bar.finish_and_clear();
    let mut output = Output::standard();
    if common.json {
        output.json(&PitchLine::new(&found, clearance, &stage, &motion, are_searches_stopped()))?;
        return output.finish().and(unstopped());
    }
    let LeastPitch { value_lo, value_hi, from, overlap, proved, intervals } = found;
    if let Some(value_hi) = value_hi {
        output.line(&format!(
            "With a pitch of {value_hi} m the head reaches {radius} m, and no two boards that share no handle {} before.",
            come_too_near(clearance)
        ))?;
    }
    if let Some(Overlap { bench_a, bench_b, head_radius }) = overlap {
        output.line(&format!(
            "With {value_lo} m {} and {} (counting from 1) {}, the head being {head_radius:.6} m from the centre.",
            bench_name(&scene, bench_a),
            bench_name(&scene, bench_b),
            are_too_near(clearance)
        ))?;
    }
    let blocked = format!(
        "with every pitch from {from} m to {value_lo} m two boards {}, or a link locks, before {radius} m",
        are_too_near(clearance)
    );
    let searched = format!("the search {} after {intervals} intervals of pitches", given_up());
    output.line(&match value_hi {
        Some(value_hi) if proved => format!(
            "Proved in {intervals} intervals of pitches: the least such pitch is from {value_lo} to {value_hi} m. Pitches below \
             {from} m are not looked at, and of those above {value_hi} m nothing is claimed."
        ),
        Some(value_hi) if intervals > 0 => format!(
            "Not decided to a nanometre: {searched}. What is proved: the least such pitch is from {value_lo} to {value_hi} m. \
             Pitches below {from} m are not looked at."
        ),
        Some(_) => "Not decided: it could not be proved that no smaller pitch will do.".to_owned(),
        None if intervals > 0 => format!("Not decided: {searched}. What is proved: {blocked}."),
        None => format!("Not decided: the search {}, and nothing is proved.", given_up()),
    })?;
    if let Some(sentence) = stage_sentence(&stage, &motion, "pitch", value_hi) {
        output.line(&sentence)?;
    }
    output.finish().and(unstopped())
}

fn plan_speed(common: &Common, limit: f64, file: Option<&Path>) -> Result<(), CommandError> {
    Accepted::SPEED.check("--max-handle-speed", limit)?;
    let text = common.scene_text()?;
    let (scene, _) = text.parse_only()?;
    expect_exact_motion(&scene)?;
    let timeline = search_timeline(&scene, common);
    unstopped()?;
    let bar = progress_bar(1000, common).with_message("searching for the fastest handle");
    let mut progress = |share| report(&bar, share);
    let found = if let Some(file) = file {
        let mut certificate = CertificateFile::create(file)?;
        let mut write = |line: &CertificateLine| certificate.write(line);
        let (text, most) = (&text.text, MOST_HANDLES);
        let found = certify_greatest_speed(&scene, &timeline, limit, text, most, &mut write, &mut progress)??;
        certificate.finish()?;
        found
    } else {
        greatest_speed(&scene, &timeline, limit, &mut progress)?
    };
    bar.finish_and_clear();
    let GreatestSpeed { value_lo, value_hi, time, handle, ratio, proved, steps } = found;
    let mut output = Output::standard();
    if common.json {
        output.json(&SpeedLine::new(&found, are_searches_stopped()))?;
        return output.finish().and(unstopped());
    }
    let limit = number(limit);
    output.line(&format!("No handle is faster than {limit} m/s while the head moves at {value_lo} m/s."))?;
    output.line(&format!(
        "The fastest found is handle {} (counting from 1) at {ratio:.10} times the head's speed, at t = {time:.6} s of the \
         scene as it is written.",
        handle + 1
    ))?;
    output.line(&if proved {
        format!("Proved in {steps} steps of the head: the greatest such speed is from {value_lo} to {value_hi} m/s.")
    } else {
        format!(
            "Not decided: the search {} after {steps} steps of the head. What is proved: the greatest such \
             speed is from {value_lo} to {value_hi} m/s.",
            given_up()
        )
    })?;
    output.finish().and(unstopped())
}

/// Warns of what a plan leaves out of a route. `Stage` is about obstacles.
fn warn_of_route(scene: &Scene, of_route: &str, about: &str) {
    let is_route = scene.ensemble.dragons().iter().any(|dragon| dragon.motion.description().pitch().is_none());
    if is_route {
        log::warn!("the plan leaves out {of_route}: it is about {about}");
    }
}

impl From<PlanError> for CommandError {
    fn from(error: PlanError) -> Self {
        Self::BadInput(error.to_string())
    }
}
