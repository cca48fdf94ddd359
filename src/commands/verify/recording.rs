//! The report of `verify` on a recording.

use std::path::Path;

use bench_dragon::messages::hexadecimal;
use bench_dragon::proof::scene_hash;
use bench_dragon::recording::mcap::ReadError;
use bench_dragon::recording::mcap::reader::Recording;
use bench_dragon::recording::verify::{RecordingVerdict, compare};
use bench_dragon::show::scene::Scene;
use serde::Serialize;

use super::super::{CommandError, Common, Output, progress_bar};

/// The line of `--json`.
#[derive(Serialize)]
struct RecordingLine<'a> {
    scene_hash: String,
    #[serde(flatten)]
    verdict: &'a RecordingVerdict,
}

/// Computes the poses of a recording again from its scene. Exit code 0: every pose is within the accuracy of the scene.
/// 1: a difference. 2: a recording that cannot be read, or has no scene.
pub(super) fn verify(common: &Common, file: &Path) -> Result<(), CommandError> {
    let shown = file.display().to_string();
    let refused = |error: ReadError| CommandError::BadInput(format!("{shown}: {error}"));
    let mut recording = Recording::open(file).map_err(refused)?;
    let contents = recording.contents();
    let Some(text) = contents.scene_text.clone() else {
        return Err(CommandError::BadInput(format!(
            "{shown}: it has no scene (the attachment scene.toml), expected a recording of this version"
        )));
    };
    let name = contents.scene.clone().unwrap_or_else(|| "scene".to_owned());
    let scene = Scene::parse(&text, &format!("{shown}, scene.toml"), &name)?;
    let hash = scene_hash(&text);
    if hash != contents.stage.stage.scene_hash {
        return Err(CommandError::Failed(format!(
            "{shown}: its scene has BLAKE3 {} and its stage names {}: the scene is not that of the show",
            hexadecimal(&hash),
            hexadecimal(&contents.stage.stage.scene_hash)
        )));
    }
    let bar = progress_bar(recording.chunks() as u64, common).with_message("computing again");
    let verdict = compare(&mut recording, &scene, &mut |chunks| bar.set_position(chunks));
    bar.finish_and_clear();
    let verdict = verdict.map_err(refused)?;
    print(common, &verdict, hexadecimal(&hash))?;
    match &verdict.difference {
        None => Ok(()),
        Some(of) => Err(CommandError::Failed(format!(
            "{shown}: frame {} (tick {}, t = {} s) differs: {}",
            of.sequence, of.tick, of.sim_time, of.what
        ))),
    }
}

fn print(common: &Common, verdict: &RecordingVerdict, scene_hash: String) -> Result<(), CommandError> {
    let mut output = Output::standard();
    if common.json {
        output.json(&RecordingLine { scene_hash, verdict })?;
        return output.finish();
    }
    let RecordingVerdict { frames, max_difference, tolerance, difference, .. } = verdict;
    output.line(&format!("BLAKE3 of the scene's text: {scene_hash}"))?;
    if let (None, Some(metres), Some(tolerance)) = (difference, max_difference, tolerance) {
        output.line(&format!(
            "{frames} frames have the poses of the scene at their simulated times: up to {metres:.1e} m from newton's, where \
             {tolerance:.1e} m are allowed."
        ))?;
    }
    output.finish()
}
