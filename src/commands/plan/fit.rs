//! `plan fit`: numbers of the scene with which the show keeps what it must.

use std::ops::ControlFlow;
use std::path::PathBuf;

use bench_dragon::fit::judge::{Part, What};
use bench_dragon::fit::line::FitLine;
use bench_dragon::fit::search::{FitError, Fitted, Vary, fit};
use bench_dragon::messages::sentence::Expected;
use bench_dragon::motion::ground::BOUNDARY;
use bench_dragon::show::scene::{Scene, SceneText, printable};

use super::super::events::bench_name;
use super::super::signals::{are_searches_stopped, report, unstopped};
use super::super::{CommandError, Common, Output, figure, progress_bar};
use super::Spacing;

/// Arguments of `plan fit`.
#[derive(Debug, clap::Args)]
pub struct FitArguments {
    /// A number of the scene that may change, and its range, as in path.pieces[2].pitch=1.5..2.0; by default a quarter of
    /// the number to either side, at least 0.5; may be repeated
    #[arg(long, value_name = "FIELD[=LO..HI]", required = true, value_parser = vary)]
    vary: Vec<Vary>,
    #[command(flatten)]
    spacing: Spacing,
    /// Write the scene with these numbers changed to this file, every other byte as it is
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// The seed of the search: the same seed gives the same answer
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    seed: u64,
}

/// The greatest number of fields that may change.
const MOST_FIELDS: usize = 8;

/// Returns a number that may change, from text such as `path.pitch=0.5..0.7`.
///
/// # Errors
/// The text has another form.
fn vary(text: &str) -> Result<Vary, Expected> {
    let (field, range) = text.split_once('=').map_or((text, None), |(field, range)| (field, Some(range)));
    let numbers = |range: &str| {
        let (least, greatest) = range.split_once("..")?;
        let range: (f64, f64) = (least.trim().parse().ok()?, greatest.trim().parse().ok()?);
        (range.0.is_finite() && range.1.is_finite() && range.0 < range.1).then_some(range)
    };
    let expected = "a field and perhaps its range, the lesser number first, as in path.pitch=0.5..0.7";
    let range = range.map(|range| numbers(range).ok_or(Expected(expected.into()))).transpose()?;
    Ok(Vary { field: field.trim().to_owned(), range })
}

/// Fits the numbers.
pub fn plan_fit(common: &Common, arguments: &FitArguments) -> Result<(), CommandError> {
    let text = common.scene_text()?;
    let scene = text.parse()?;
    let clearance = arguments.spacing.required(&scene)?;
    if arguments.vary.len() > MOST_FIELDS {
        let sentence = format!("--vary is given {} times, expected at most {MOST_FIELDS}", arguments.vary.len());
        return Err(CommandError::BadInput(sentence));
    }
    let bar = progress_bar(1000, common).with_message("searching for the numbers");
    let mut progress = |share: f64, margin: f64| -> ControlFlow<()> {
        if margin.is_finite() {
            bar.set_message(format!("margin {} m", figure((1e4 * margin).round() / 1e4)));
        }
        report(&bar, share)
    };
    let fitted = fit(&text, &arguments.vary, clearance, arguments.seed, &mut progress);
    bar.finish_and_clear();
    if matches!(fitted, Err(FitError::GaveUp)) {
        unstopped()?;
    }
    let fitted = fitted.map_err(|error| match error {
        FitError::GaveUp => CommandError::Failed(error.to_string()),
        _ => CommandError::BadInput(error.to_string()),
    })?;
    if let Some(file) = &arguments.output {
        let mut output = Output::file(file)?;
        output.text(&fitted.text)?;
        output.finish()?;
    }
    let mut output = Output::standard();
    if common.json {
        output.json(&FitLine::new(&fitted, clearance))?;
    } else {
        print(&text, &fitted, clearance, &mut output)?;
    }
    output.finish()?;
    if fitted.is_found() { Ok(()) } else { Err(CommandError::Failed(not_found(&fitted))) }
}

fn not_found(fitted: &Fitted) -> String {
    let short = figure(-fitted.judgement.margin());
    let stopped = if are_searches_stopped() { " before a signal stopped the search" } else { "" };
    match fitted.judgement.parts.iter().any(|part| part.what == What::PathEnd) {
        true => {
            format!("no numbers of these ranges were found{stopped} with which the head reaches the end of its path")
        }
        false => format!("no numbers of these ranges were found{stopped}: at best {short} m are missing"),
    }
}

fn print(text: &SceneText, fitted: &Fitted, clearance: f64, output: &mut Output) -> Result<(), CommandError> {
    // The text was parsed by the search.
    let scene = SceneText { text: fitted.text.clone(), ..text.clone() }.parse()?;
    for (name, value) in &fitted.fields {
        output.line(&format!("{name} = {value}"))?;
    }
    let margin = fitted.judgement.margin();
    let required = format!("{clearance} m between boards, and every keep-out");
    output.line(&match margin >= 0.0 {
        true => format!("The show keeps {required}, with {} m to spare.", figure(margin)),
        false => format!("The show does not keep {required}: {} m are missing.", figure(-margin)),
    })?;
    for part in fitted.limits() {
        output.line(&format!("Limited by {}.", limit(&scene, part, clearance)))?;
    }
    if let Some(rest) = fitted.without_boundary {
        let rest =
            if rest >= 0.0 { format!("{} m to spare", figure(rest)) } else { format!("{} m missing", figure(-rest)) };
        output.line(&format!(
            "The search has left out the boundary, because the team stands outside it at the start: without it there are \
             {rest}. Boards stay inside a boundary, so draw it round the street in which the team waits as well."
        ))?;
    }
    let (sampled, exact) = fitted.judged;
    let judged = format!("{sampled} scenes were judged at samples, {exact} of them exactly");
    let stopped = if are_searches_stopped() { "A signal stopped the search: " } else { "" };
    output.line(&format!("{stopped}{judged}. Found, not proved to be the greatest; `check --prove` proves the result."))
}

fn apart(distance: f64) -> String {
    if distance < 0.0 {
        format!("overlapping by {} m", figure(-distance))
    } else {
        format!("{} m apart", figure(distance))
    }
}

/// Returns a distance that limits the margin, in words.
fn limit(scene: &Scene, part: &Part, clearance: f64) -> String {
    let (bench, at) = (bench_name(scene, part.benches.0), figure((1e3 * part.time).round() / 1e3));
    match (part.what, part.benches.1) {
        (What::Boards, other) => {
            let other = other.map_or(String::new(), |other| format!(" and {}", bench_name(scene, other)));
            format!("{bench}{other} at {at} s, {} (benches count from 1)", apart(part.margin + clearance))
        }
        (What::Obstacle(number), _) => {
            let obstacle = &scene.ensemble.ground().obstacles()[number];
            let (name, distance) = (printable(&obstacle.name), part.margin + obstacle.keep_out);
            if name == BOUNDARY && distance < 0.0 {
                let outside = figure(-distance);
                return format!("{bench} at {at} s, outside the boundary by {outside} m (benches count from 1)");
            }
            format!("{bench} and the {name} at {at} s, {} (benches count from 1)", apart(distance))
        }
        (What::PathEnd, _) => format!("{bench} at {at} s, where it locks (benches count from 1)"),
    }
}
