//! `plan`: answers for a choreographer, with where they are decided.

use bench_dragon::plan::{
    GreatestSpeed, LeastPitch, PitchEnclosure, PlanError, enclose_least_pitch, greatest_speed, least_pitch,
};
use bench_dragon::scene::Accepted;
use serde::Serialize;

use super::events::bench_name;
use super::{CommandError, Common, Output, expect_exact_motion, number, progress_bar, search_timeline};

/// Arguments of `plan`.
#[derive(Debug, clap::Args)]
pub struct PlanArguments {
    #[command(subcommand)]
    question: Question,
}

#[derive(Debug, clap::Subcommand)]
enum Question {
    /// The least pitch at which the scene's team comes in to a radius on a spiral without touching itself
    Pitch {
        /// Metres from the centre that the front handle of the head is to reach
        #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
        reach_radius: f64,
        /// Prove it: enclose it within a nanometre, rounding included; some seconds
        #[arg(long)]
        prove: bool,
    },
    /// The greatest constant speed of the head at which no handle of the show is ever faster than a limit
    Speed {
        /// Metres per second that no handle may exceed
        #[arg(long, value_name = "M/S", allow_negative_numbers = true)]
        max_handle_speed: f64,
    },
}

/// The line of `plan pitch --json`.
#[derive(Serialize)]
struct PitchLine {
    plan: &'static str,
    value: f64,
    bench_a: u32,
    bench_b: u32,
    head_radius: f64,
    #[serde(flatten)]
    enclosure: Option<PitchProof>,
}

/// What `--prove` adds to it.
#[derive(Serialize)]
struct PitchProof {
    value_lo: Option<f64>,
    value_hi: Option<f64>,
    status: &'static str,
}

/// The line of `plan speed --json`.
#[derive(Serialize)]
struct SpeedLine {
    plan: &'static str,
    status: &'static str,
    value: f64,
    value_lo: f64,
    value_hi: f64,
    time: f64,
    handle: u32,
    ratio: f64,
}

/// Answers the question.
pub fn plan(common: &Common, arguments: &PlanArguments) -> Result<(), CommandError> {
    match arguments.question {
        Question::Pitch { reach_radius, prove } => plan_pitch(common, reach_radius, prove),
        Question::Speed { max_handle_speed } => plan_speed(common, max_handle_speed),
    }
}

fn plan_pitch(common: &Common, radius: f64, prove: bool) -> Result<(), CommandError> {
    Accepted::LENGTH.check("--reach-radius", radius).map_err(CommandError::BadInput)?;
    let scene = common.load_scene()?;
    let bar = progress_bar(1000, common).with_message("searching for the pitch");
    let found = least_pitch(scene.team(), radius, &mut |share| bar.set_position((1000.0 * share) as u64));
    bar.finish_and_clear();
    let found = found?;
    let enclosure = prove.then(|| {
        let bar = progress_bar(1000, common).with_message("proving the pitch");
        let mut progress = |share| bar.set_position((1000.0 * share) as u64);
        let enclosure = enclose_least_pitch(scene.team(), radius, &found, &mut progress);
        bar.finish_and_clear();
        enclosure
    });
    let LeastPitch { value, bench_a, bench_b, head_radius } = found;
    let mut output = Output::standard();
    if common.json {
        let enclosure = enclosure.map(|enclosure| PitchProof {
            value_lo: enclosure.lo,
            value_hi: enclosure.hi,
            status: if enclosure.is_complete() { "proved" } else { "given_up" },
        });
        output.json(&PitchLine { plan: "pitch", value, bench_a, bench_b, head_radius, enclosure })?;
    } else {
        output.line(&format!("The least pitch with which the head reaches {radius} m is {value:.10} m per turn."))?;
        output.line(&format!(
            "At that pitch {} and {} (counting from 1) just touch, the head being {head_radius:.6} m from the centre.",
            bench_name(&scene, bench_a),
            bench_name(&scene, bench_b)
        ))?;
        if let Some(enclosure) = enclosure {
            output.line(&proof_sentence(&enclosure))?;
        }
    }
    output.finish()
}

/// Where the head begins whose way is proved.
const COMING: &str = "the head coming from three turns outside the radius, or outside a link's length";

/// What was proved of a pitch, for people.
fn proof_sentence(PitchEnclosure { lo, hi, from, .. }: &PitchEnclosure) -> String {
    let below =
        lo.map(|lo| format!("with every pitch from {from} m to {lo} m two boards overlap before, or a link locks"));
    let above = hi.map(|hi| format!("with {hi} m no two boards touch"));
    match (above, below) {
        (Some(above), Some(below)) => format!("Proved, {COMING}: {above}; {below}."),
        (None, Some(one)) | (Some(one), None) => format!("Proved, {COMING}: {one}. No more could be proved."),
        (None, None) => "Nothing of it could be proved.".to_owned(),
    }
}

fn plan_speed(common: &Common, limit: f64) -> Result<(), CommandError> {
    Accepted::SPEED.check("--max-handle-speed", limit).map_err(CommandError::BadInput)?;
    let scene = common.load_scene()?;
    expect_exact_motion(&scene)?;
    let timeline = search_timeline(&scene, common);
    let bar = progress_bar(1000, common).with_message("searching for the fastest handle");
    let found = greatest_speed(&scene, &timeline, limit, &mut |share| bar.set_position((1000.0 * share) as u64));
    bar.finish_and_clear();
    let GreatestSpeed { value_lo, value_hi, time, handle, ratio, proved, steps } = found?;
    let mut output = Output::standard();
    if common.json {
        let status = if proved { "proved" } else { "given_up" };
        let value = value_lo;
        output.json(&SpeedLine { plan: "speed", status, value, value_lo, value_hi, time, handle, ratio })?;
        return output.finish();
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
            "Not decided: the search was given up after {steps} steps of the head. What is proved: the greatest such \
             speed is from {value_lo} to {value_hi} m/s."
        )
    })?;
    output.finish()
}

impl From<PlanError> for CommandError {
    fn from(error: PlanError) -> Self {
        Self::BadInput(error.to_string())
    }
}
