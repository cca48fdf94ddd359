//! The hand-outs of a design: the pages and the rows of `sheets`, of the text as it stands.
//!
//! In: a scene with its text. Out: a file with its name.

use std::ops::ControlFlow;

use serde::Serialize;

use crate::scene::DesignedScene;
use bench_dragon_motion::event::Progress;
use bench_dragon_proof::scene_hash;
use bench_dragon_sheets::page::{Wishes, html};
use bench_dragon_sheets::walk::Searched;
use bench_dragon_sheets::{Language, csv, followed, minutes_and_seconds};

/// The form of hand-outs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Pages to print.
    Pages(Language),
    /// The rows of all benches.
    Csv,
}

/// A file for the page to download.
#[derive(Debug, Serialize)]
pub struct HandOut {
    /// Its name.
    pub name: String,
    /// Its kind, as in HTTP.
    pub kind: &'static str,
    /// Its text.
    pub text: String,
}

/// The reason for missing hand-outs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum HandOutError {
    /// The motion is not exact.
    #[error("the scene names the solver \"paper\", whose head is too fast: hand-outs are for exact motion")]
    NotExact,
    /// The receiver of the progress has stopped a search.
    #[error("the making of the hand-outs was stopped")]
    Stopped,
}

/// Follows all benches and writes their hand-outs.
///
/// # Errors
/// [`HandOutError`]
pub fn hand_outs(designed: &DesignedScene, form: Form, progress: Progress<'_>) -> Result<HandOut, HandOutError> {
    let scene = &designed.scene;
    let ensemble = &scene.ensemble;
    if !ensemble.is_exact() {
        return Err(HandOutError::NotExact);
    }
    let timeline = ensemble.timeline(&mut |share| progress(0.2 * share));
    let obstacles = ensemble.obstacle_clearances(timeline.end(), &mut |share| progress(0.2 + 0.1 * share));
    let least = ensemble.least_clearances(&timeline, timeline.end(), &mut |share| progress(0.3 + 0.2 * share));
    go_on(progress(0.5))?;
    let searched = Searched { boards: least.of_show, obstacles: &obstacles };
    let benches: Vec<_> = ensemble.dragons().iter().map(|dragon| 0..dragon.motion.team().benches).collect();
    let walk = followed(scene, &timeline, &searched, &benches, &mut |share| progress(0.5 + 0.4 * share));
    go_on(progress(0.9))?;
    let name = |end: &str| {
        let letters = scene.name.chars();
        let name: String = letters.map(|letter| if letter.is_alphanumeric() { letter } else { '-' }).collect();
        format!("{name}{end}")
    };
    Ok(match form {
        Form::Pages(language) => {
            let (clock, hash) = (&minutes_and_seconds, &scene_hash(&designed.text));
            let text = html(&walk, &Wishes { language, benches: &benches, clock, hash });
            HandOut { name: name(".html"), kind: "text/html", text }
        }
        Form::Csv => {
            let progress = &mut |share| progress(0.9 + 0.1 * share);
            let text =
                csv(&walk, Language::English, &benches, &minutes_and_seconds, progress).ok_or(HandOutError::Stopped)?;
            HandOut { name: name(".csv"), kind: "text/csv", text }
        }
    })
}

/// Converts the answer of a progress's receiver.
fn go_on(answer: ControlFlow<()>) -> Result<(), HandOutError> {
    if answer.is_break() { Err(HandOutError::Stopped) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hand_outs_that_are_stopped_are_none() {
        let text = include_str!("../../../config/turnaround.toml").replace("benches = 223", "benches = 40");
        let stopped_at = |form: Form, most: f64| {
            let mut is_stopped = false;
            let mut progress = |share| {
                is_stopped |= share >= most;
                if is_stopped { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let scene = DesignedScene::read(&text, "scene").unwrap();
            hand_outs(&scene, form, &mut progress).map(|file| file.text)
        };
        for form in [Form::Csv, Form::Pages(Language::English)] {
            assert!(stopped_at(form, f64::INFINITY).is_ok());
            for most in [0.0, 0.1, 0.35, 0.5, 0.7, 0.9] {
                assert_eq!(stopped_at(form, most), Err(HandOutError::Stopped), "stopped at {most}");
            }
        }
    }
}
