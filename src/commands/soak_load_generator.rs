//! `soak-load-generator` and `soak-client`: processes of `soak --conduct` that command its publisher.

use std::io::Write;
use std::sync::atomic::Ordering;
use std::time::Duration;

use bench_dragon::messages::control::Command;
use bench_dragon::motion::event::unreported;
use bench_dragon::show::scene::cue::{Cue, CueAction};
use bench_dragon::show::scene::{OnContact, Scene};
use bench_dragon::soak::conduct::ShowFacts;
use bench_dragon::soak::conduct::load_generator;

use super::parent::Parent;
use super::{CommandError, Common, stop_on_signals};

/// Longest wait for an answer of the publisher.
const TIMEOUT: Duration = Duration::from_secs(30);

/// Arguments of `soak-load-generator`.
#[derive(Debug, clap::Args)]
pub struct SoakLoadGeneratorArguments {
    /// The seed of its commands
    #[arg(long)]
    seed: u64,
    /// Frames per second of the publisher, if not the scene's
    #[arg(long)]
    rate: Option<f64>,
    #[command(flatten)]
    parent: Parent,
}

/// Arguments of `soak-client`.
#[derive(Debug, clap::Args)]
pub struct SoakClientArguments {
    #[command(flatten)]
    parent: Parent,
}

/// Conducts until a signal comes, and prints its counts once a second.
pub fn conduct(common: &Common, arguments: &SoakLoadGeneratorArguments) -> Result<(), CommandError> {
    arguments.parent.watch()?;
    let stop = stop_on_signals()?;
    let scene = common.load_scene()?;
    let rate = arguments.rate.unwrap_or(scene.rate);
    let mut output = std::io::stdout().lock();
    load_generator::conduct(common.name(), rate, arguments.seed, facts_of(&scene), &stop, &mut |conducted| -> Result<
        (),
        CommandError,
    > {
        serde_json::to_writer(&mut output, &conducted).map_err(std::io::Error::from)?;
        writeln!(output)?;
        Ok(output.flush()?)
    })
}

/// Returns the facts of a scene's show. Searches for its events.
fn facts_of(scene: &Scene) -> ShowFacts {
    let timeline = scene.ensemble.timeline(&mut unreported);
    let timeline = if scene.alerts.is_some() { timeline } else { timeline.end_only() };
    let stops = scene.alerts.is_some() && scene.on_contact == OnContact::Stop;
    let cue = |cue: &Cue| Some((cue.time(&scene.ensemble, &timeline)?, cue.then == CueAction::Pause));
    let mut cues = Vec::from_iter(scene.cues.iter().filter_map(cue));
    cues.sort_by(|a, b| a.0.total_cmp(&b.0));
    ShowFacts { end: timeline.show_end(stops).time, cues }
}

/// Requests the state of the show in a loop, so that it always awaits an answer, until it is killed.
pub fn client(common: &Common, arguments: &SoakClientArguments) -> Result<(), CommandError> {
    arguments.parent.watch()?;
    let stop = stop_on_signals()?;
    let Some(mut controller) = load_generator::connect(common.name(), &stop) else { return Ok(()) };
    while !stop.load(Ordering::Relaxed) {
        controller.send(Command::State, TIMEOUT)?;
    }
    Ok(())
}
