//! A scene of dragons with names: `[[dragons]]` in place of `[team]`, `[path]` and `[placement]`.
//!
//! In: the tables from serde. Out: an [`Ensemble`], or one sentence about the wrong field.

use serde::Deserialize;
use serde::de::IgnoredAny;
use toml::Spanned;

use super::cue::RawCue;
use super::path::RawPath;
use super::require::RawRequire;
use super::stage::RawStage;
use super::team::RawTeam;
use super::{
    Accepted, RawAlerts, RawEnds, RawMotion, RawPlacement, RawPublish, Scene, SceneError, SharedTables, SolverName,
    Source, motion_of,
};
use bench_dragon_motion::ensemble::{Dragon, Ensemble};
use bench_dragon_motion::ground::Ground;

/// The greatest number of dragons of a show.
pub const MOST_DRAGONS: usize = 16;
/// The greatest number of bytes of a dragon's name.
pub const MOST_DRAGON_NAME: usize = 32;

/// Distinguishes a scene with `[[dragons]]` from a scene with `[team]`.
#[derive(Deserialize)]
pub(super) struct Probe {
    pub dragons: Option<Spanned<IgnoredAny>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawEnsemble {
    name: Option<Spanned<String>>,
    dragons: Spanned<Vec<Spanned<RawDragon>>>,
    team: Option<Spanned<IgnoredAny>>,
    path: Option<Spanned<IgnoredAny>>,
    placement: Option<Spanned<IgnoredAny>>,
    stage: Option<RawStage>,
    #[serde(default)]
    motion: RawEnds,
    alerts: Option<RawAlerts>,
    require: Option<RawRequire>,
    #[serde(default)]
    cues: Vec<RawCue>,
    #[serde(default)]
    publish: RawPublish,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawDragon {
    name: Spanned<String>,
    delay: Option<Spanned<f64>>,
    team: RawTeam,
    path: RawPath,
    placement: Option<RawPlacement>,
    motion: RawMotion,
}

impl RawEnsemble {
    /// Checks the tables and returns the scene.
    pub(super) fn validated(self, source: &Source, stem: &str) -> Result<Scene, SceneError> {
        let tables = [("team", &self.team), ("path", &self.path), ("placement", &self.placement)];
        for (table, given) in tables {
            if let Some(given) = given {
                let sentence = format!(
                    "[{table}] stands beside [[dragons]], expected [{table}] for one dragon or [dragons.{table}] in \
                     each of several"
                );
                return Err(source.field_error(given, &sentence));
            }
        }
        let given = self.dragons.get_ref();
        if given.is_empty() {
            return Err(source.field_error(&self.dragons, "dragons is empty, expected 1 to 16 dragons"));
        }
        if let Some(beyond) = given.get(MOST_DRAGONS) {
            let sentence = format!("there are {} dragons, expected at most {MOST_DRAGONS}", given.len());
            return Err(source.field_error(&beyond.get_ref().name, &sentence));
        }
        let ground = self.stage.as_ref().map(|stage| stage.validated(source)).transpose()?.unwrap_or_default();
        let mut dragons: Vec<Dragon> = Vec::with_capacity(given.len());
        for raw in given {
            let dragon = raw.get_ref().validated(source, &ground)?;
            if dragons.iter().any(|other| other.name == dragon.name) {
                let sentence = format!("dragons.name \"{}\" is given twice, expected each name once", dragon.name);
                return Err(source.field_error(&raw.get_ref().name, &sentence));
            }
            dragons.push(dragon);
        }
        if let Some(travelled) = self.cues.iter().find_map(RawCue::travelled) {
            let sentence =
                "cues.travelled names no dragon, expected cues.at or cues.before in a show of several dragons";
            return Err(source.field_error(travelled, sentence));
        }
        let of_dragon = |raw: &Spanned<RawDragon>| {
            let RawDragon { name, team, .. } = raw.get_ref();
            let defaults = team.defaults();
            (!defaults.is_empty()).then(|| format!("{}: {}", name.get_ref(), defaults.join(", ")))
        };
        let team_defaults = given.iter().filter_map(of_dragon).collect();
        let Self { name, alerts, require, cues, publish, motion: ends, .. } = self;
        let shared = SharedTables { name, alerts, require, cues, publish, ends };
        Ok(Scene { team_defaults, ..shared.validated(source, stem, Ensemble::new(dragons))? })
    }
}

impl RawDragon {
    fn validated(&self, source: &Source, ground: &Ground) -> Result<Dragon, SceneError> {
        let name = self.name.get_ref();
        let is_legal = |letter: char| matches!(letter, 'a'..='z' | '0'..='9' | '_');
        if name.is_empty() || name.len() > MOST_DRAGON_NAME || !name.chars().all(is_legal) {
            let sentence =
                format!("dragons.name is {name:?}, expected 1 to {MOST_DRAGON_NAME} of the letters a-z, 0-9 and _");
            return Err(source.field_error(&self.name, &sentence));
        }
        let within = source.of_dragon(name);
        if let Some(field) = self.motion.ends().first_given() {
            let sentence = format!("motion.{field} belongs to the whole show, expected it in the table [motion]");
            return Err(within.field_error(&self.name, &sentence));
        }
        let paper = self.motion.solver.as_ref();
        if let Some(solver) = paper.filter(|solver| *solver.get_ref() == SolverName::Paper) {
            let sentence = "motion.solver is \"paper\", which a show of several dragons does not have, expected \
                            another solver or motion.accuracy";
            return Err(within.field_error(solver, sentence));
        }
        let delay = self.delay.as_ref().map_or(Ok(0.0), |delay| within.check("delay", delay, Accepted::CUE))?;
        let (motion, _) = motion_of(&within, &self.team, &self.path, &self.motion, self.placement.as_ref())?;
        Ok(Dragon { name: name.clone(), delay, motion: motion.on_ground(ground.clone()) })
    }
}
