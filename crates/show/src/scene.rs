//! The scene file, checked once and converted to the types of the model.
//!
//! In: TOML text. Out: a [`Scene`], whose numbers are all in range and whose start is legal. Errors name the file, the
//! line, the field and the expected value.

pub mod accepted;
pub mod cue;
mod dragons;
mod mend;
pub mod path;
mod piece;
pub mod precision;
mod reading;
mod require;
pub mod ros2;
mod source;
pub(crate) mod stage;
mod team;
mod text;
pub mod values;

use std::path::Path as FilePath;

use serde::Deserialize;
use toml::Spanned;

pub use self::accepted::{Accepted, RangeError};
use self::cue::{Cue, RawCue};
pub use self::dragons::{MOST_DRAGON_NAME, MOST_DRAGONS};
use self::dragons::{Probe, RawEnsemble};
use self::path::RawPath;
pub use self::piece::ARC_RATIO;
use self::precision::Precision;
pub use self::precision::SinglePrecision;
use self::require::RawRequire;
pub use self::require::Requirements;
use self::ros2::RawRos2;
pub use self::source::CheckedNumber;
use self::source::Source;
pub use self::stage::MOST_OBSTACLES;
use self::stage::RawStage;
use self::team::RawTeam;
pub use self::text::{SceneText, printable};
use bench_dragon_motion::ensemble::Ensemble;
use bench_dragon_motion::model::description::PathDescription;
use bench_dragon_motion::placement::Placement;
use bench_dragon_motion::solve::Velocities;
use bench_dragon_motion::solve::paper::PaperRules;
use bench_dragon_motion::{Method, Motion, MotionError};
use bench_dragon_ros2_messages::settings::Ros2Settings;

/// The paper's scene, built into the program.
const PAPER: &str = include_str!("../../../config/paper.toml");
/// The default limit of subscribers of each iceoryx2 service.
const DEFAULT_SUBSCRIBERS: usize = 8;
/// The default wall time for which a looping show stands at its end, in seconds.
const DEFAULT_END_HOLD: f64 = 5.0;

/// Invalid input, in one sentence that names the place and the expected value.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", printable(sentence))]
pub struct SceneError {
    sentence: String,
    at: Option<usize>,
}

impl SceneError {
    /// Returns the byte of the text at which the fault stands; `None` for a file that cannot be read.
    pub fn at(&self) -> Option<usize> {
        self.at
    }
}

/// The solvers that a scene can name.
#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum SolverName {
    /// Exact motion: each follower is bracketed.
    Newton,
    /// Exact motion: every handle is interpolated in a table of followers.
    FollowerTable,
    /// The paper's rules.
    Paper,
}

/// The reaction of `run` to a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnContact {
    /// The show ends at the contact.
    Stop,
    /// The show continues.
    Continue,
}

/// The behaviour of `run` at the end of the show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AtEnd {
    /// `run` publishes the last frame until it is stopped.
    Hold,
    /// `run` starts the show again.
    Loop,
}

/// The limits for warnings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlertRules {
    /// Simulated seconds before an event.
    pub approach_time: f64,
    /// The distance between two boards, in metres.
    pub approach_clearance: f64,
}

/// A scene: its dragons, and how they are published.
///
/// # Examples
///
/// ```
/// use bench_dragon_show::scene::{Scene, SceneText};
///
/// let twenty = SceneText::paper().text.replace("benches = 223", "benches = 20");
/// let scene = Scene::parse(&twenty, "twenty.toml", "twenty")?;
/// assert_eq!(scene.ensemble.handles(), 21);
/// // An error names file, line and field.
/// let wrong = twenty.replace("pitch = 0.55", "pitch = 0");
/// let error = Scene::parse(&wrong, "wrong.toml", "wrong").unwrap_err().to_string();
/// assert!(error.starts_with("wrong.toml, line ") && error.contains("path.pitch is 0, expected"), "{error}");
/// # Ok::<(), bench_dragon_show::scene::SceneError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// The scene's name; by default the stem of its file.
    pub name: String,
    /// The dragons: the one of `[team]`, or those of `[[dragons]]`.
    pub ensemble: Ensemble,
    /// The sizes of benches that the text leaves to their defaults, as in `width = 0.3`; of dragons with names each
    /// with the name before it.
    pub team_defaults: Vec<String>,
    /// Sentences on numbers that are accepted and hardly meant, such as millimetres; each names its file and line.
    pub doubts: Vec<String>,
    /// The placement that `[placement]` states for the dragon of `[team]`, or none; the motion's own placement contains
    /// it. `None` for `[[dragons]]`.
    pub placement: Option<Placement>,
    /// The reaction to a contact.
    pub on_contact: OnContact,
    /// The behaviour at the end of the show.
    pub at_end: AtEnd,
    /// The wall time for which a looping show stands at its end, in seconds.
    pub end_hold: f64,
    /// The cues, in the order of the file.
    pub cues: Vec<Cue>,
    /// The limits for warnings; `None` for a scene without alerts.
    pub alerts: Option<AlertRules>,
    /// The clearances that the show must keep; `None` without any.
    pub require: Option<Requirements>,
    /// The rate, in frames per second.
    pub rate: f64,
    /// The velocities: computed or not.
    pub velocities: Velocities,
    /// The service of poses in single precision beside the service of whole frames; `None` without one.
    pub single_precision: Option<SinglePrecision>,
    /// Frames that a subscriber may fall behind, if the scene states it.
    pub queue: Option<usize>,
    /// Limit of subscribers of each iceoryx2 service.
    pub subscribers: usize,
    /// The ROS 2 topics; `None` without them.
    pub ros2: Option<Ros2Settings>,
}

impl Scene {
    /// Returns the built-in scene of the paper.
    pub fn paper() -> Self {
        // A test parses the built-in text, which is constant.
        SceneText::paper().parse().expect("the built-in scene is valid")
    }

    /// Reads a scene from a file.
    ///
    /// # Errors
    /// One sentence for a file that cannot be read or is invalid.
    pub fn load(file: &FilePath) -> Result<Self, SceneError> {
        SceneText::load(file)?.parse()
    }

    /// Reads a scene from TOML text. `file` is the file's name in errors, `stem` the scene's name if the text gives none.
    ///
    /// # Errors
    /// One sentence that names the file, the line, the field and the expected value.
    pub fn parse(text: &str, file: &str, stem: &str) -> Result<Self, SceneError> {
        parse(&Source::new(text, file), stem)
    }

    /// Reads a scene from TOML text, and the numbers of the text with their accepted ranges, in the order in which they
    /// are checked.
    ///
    /// # Errors
    /// As [`parse`](Self::parse).
    pub fn parse_with_numbers(text: &str, file: &str, stem: &str) -> Result<(Self, Vec<CheckedNumber>), SceneError> {
        let source = Source::new(text, file);
        let scene = parse(&source, stem)?;
        Ok((scene, source.numbers.take()))
    }

    /// Returns true if a show of this scene stops at a contact. Without alerts no contact is computed.
    pub fn stops_at_contact(&self) -> bool {
        self.alerts.is_some() && self.on_contact == OnContact::Stop
    }
}

fn parse(source: &Source, stem: &str) -> Result<Scene, SceneError> {
    match dragons_in(source.text) {
        Some(_) => source.scene::<RawEnsemble>(|raw| raw.validated(source, stem)),
        None => source.scene::<RawScene>(|raw| raw.validated(source, stem)),
    }
}

/// Returns the place of `[[dragons]]` in a text, if it has that table. A text that is not TOML has none, so its errors
/// are those of a scene with `[team]`.
fn dragons_in(text: &str) -> Option<Spanned<serde::de::IgnoredAny>> {
    // Most scenes have `[team]`, and are read once.
    text.contains("dragons").then(|| toml::from_str::<Probe>(text).ok()?.dragons).flatten()
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawScene {
    name: Option<Spanned<String>>,
    team: RawTeam,
    path: RawPath,
    placement: Option<RawPlacement>,
    stage: Option<RawStage>,
    motion: RawMotion,
    alerts: Option<RawAlerts>,
    require: Option<RawRequire>,
    #[serde(default)]
    cues: Vec<RawCue>,
    #[serde(default)]
    publish: RawPublish,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPlacement {
    origin: Option<Spanned<[f64; 2]>>,
    rotation_turns: Option<Spanned<f64>>,
    #[serde(default)]
    mirror: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMotion {
    head_speed: Spanned<f64>,
    accuracy: Option<Spanned<f64>>,
    solver: Option<Spanned<SolverName>>,
    paper: Option<Spanned<RawPaper>>,
    on_contact: Option<OnContact>,
    at_end: Option<AtEnd>,
    end_hold: Option<Spanned<f64>>,
}

/// The fields of `[motion]` that a show has once, also with `[[dragons]]`.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawEnds {
    on_contact: Option<OnContact>,
    at_end: Option<AtEnd>,
    end_hold: Option<Spanned<f64>>,
}

/// The tables that a scene has once, also with `[[dragons]]`.
struct SharedTables {
    name: Option<Spanned<String>>,
    alerts: Option<RawAlerts>,
    require: Option<RawRequire>,
    cues: Vec<RawCue>,
    publish: RawPublish,
    ends: RawEnds,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPaper {
    time_step: Option<Spanned<f64>>,
    difference_interval: Option<Spanned<f64>>,
    bisection_tolerance: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawAlerts {
    approach_time: Option<Spanned<f64>>,
    approach_clearance: Option<Spanned<f64>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPublish {
    rate: Option<Spanned<f64>>,
    velocities: Option<bool>,
    #[serde(default)]
    precision: Precision,
    every: Option<Spanned<i64>>,
    queue: Option<Spanned<i64>>,
    subscribers: Option<Spanned<i64>>,
    ros2: Option<RawRos2>,
}

impl RawScene {
    fn validated(self, source: &Source, stem: &str) -> Result<Scene, SceneError> {
        let Self { name, team, path, placement, stage, motion, alerts, require, cues, publish } = self;
        let (checked, placement) = motion_of(source, &team, &path, &motion, placement.as_ref())?;
        let checked = match &stage {
            Some(stage) => checked.on_ground(stage.validated(source)?),
            None => checked,
        };
        let shared = SharedTables { name, alerts, require, cues, publish, ends: motion.ends() };
        let scene = shared.validated(source, stem, Ensemble::alone(checked))?;
        let placement = Some(placement.unwrap_or(Placement::IDENTITY));
        Ok(Scene { team_defaults: team.defaults(), placement, ..scene })
    }
}

/// Checks the tables of a dragon. Returns its motion, and the placement that the scene states.
fn motion_of(
    source: &Source,
    team: &RawTeam,
    path: &RawPath,
    motion: &RawMotion,
    placement: Option<&RawPlacement>,
) -> Result<(Motion, Option<Placement>), SceneError> {
    let team = team.validated(source)?;
    let description = path.validated(source, &team)?;
    let head_speed = source.check("motion.head_speed", &motion.head_speed, Accepted::SPEED)?;
    let method = motion.method(source)?;
    if let (Method::Paper(rules), PathDescription::Spiral { pitch, start_turn }) = (method, &description)
        && path::is_folded_after(*pitch, *start_turn, head_speed * rules.time_step, &team)
    {
        return Err(motion.first_step_error(source, rules.time_step));
    }
    let checked =
        Motion::new(description, team, head_speed, method).map_err(|error| match (&error, &motion.solver) {
            (MotionError::PaperElsewhere, Some(given)) => source.field_error(
                given,
                "motion.solver is \"paper\", which follows spirals only, expected another solver or no such field",
            ),
            _ => path.error(source, &error.to_string()),
        })?;
    let placement = placement.map(|placement| placement.validated(source)).transpose()?;
    let start = path.start(source)?;
    Ok((checked.placed(placement.unwrap_or(Placement::IDENTITY).after_moving_by(start)), placement))
}

impl SharedTables {
    /// Checks the tables. Returns the scene of an ensemble.
    fn validated(&self, source: &Source, stem: &str, ensemble: Ensemble) -> Result<Scene, SceneError> {
        let name = match &self.name {
            None => stem.to_owned(),
            Some(name) if name.get_ref().trim().is_empty() => {
                return Err(source.field_error(name, "name is empty, expected a name or no such field"));
            }
            Some(name) => source.printable("name", name)?,
        };
        let rate =
            self.publish.rate.as_ref().map_or(Ok(60.0), |rate| source.check("publish.rate", rate, Accepted::RATE))?;
        let queue =
            self.publish.queue.as_ref().map(|queue| source.check_count("publish.queue", queue, Accepted::QUEUE));
        let subscribers = self.publish.subscribers.as_ref().map_or(Ok(DEFAULT_SUBSCRIBERS), |subscribers| {
            source.check_count("publish.subscribers", subscribers, Accepted::SUBSCRIBERS)
        })?;
        let velocities = self.publish.velocities.unwrap_or(true);
        let RawEnds { on_contact, at_end, end_hold } = &self.ends;
        Ok(Scene {
            name,
            ensemble,
            team_defaults: Vec::new(),
            doubts: Vec::new(),
            placement: None,
            on_contact: on_contact.unwrap_or(OnContact::Stop),
            at_end: at_end.unwrap_or(AtEnd::Hold),
            end_hold: end_hold
                .as_ref()
                .map_or(Ok(DEFAULT_END_HOLD), |seconds| source.check("motion.end_hold", seconds, Accepted::END_HOLD))?,
            cues: self.cues.iter().map(|cue| cue.validated(source, self.alerts.is_some())).collect::<Result<_, _>>()?,
            alerts: self.alerts.as_ref().map(|alerts| alerts.validated(source)).transpose()?,
            require: self.require.as_ref().map(|require| require.validated(source)).transpose()?,
            rate,
            velocities: if velocities { Velocities::Computed } else { Velocities::Omitted },
            single_precision: self.publish.precision.single(self.publish.every.as_ref(), source)?,
            queue: queue.transpose()?,
            subscribers,
            ros2: self.publish.ros2.as_ref().map(|ros2| ros2.validated(source)).transpose()?,
        })
    }
}

impl RawPlacement {
    fn validated(&self, source: &Source) -> Result<Placement, SceneError> {
        let origin = source.place("placement.origin", self.origin.as_ref())?;
        let turns = self.rotation_turns.as_ref();
        let turns =
            turns.map_or(Ok(0.0), |turns| source.check("placement.rotation_turns", turns, Accepted::ROTATION))?;
        Ok(Placement::new(origin, turns, self.mirror))
    }
}

impl RawEnds {
    /// Returns the name of the first field that is given.
    fn first_given(&self) -> Option<&'static str> {
        let fields = [
            ("on_contact", self.on_contact.is_some()),
            ("at_end", self.at_end.is_some()),
            ("end_hold", self.end_hold.is_some()),
        ];
        fields.into_iter().find_map(|(field, given)| given.then_some(field))
    }
}

impl RawMotion {
    /// Returns the fields that a show has once.
    fn ends(&self) -> RawEnds {
        RawEnds { on_contact: self.on_contact, at_end: self.at_end, end_hold: self.end_hold.clone() }
    }

    /// Returns the error of a first step that is too long. The paper's rules are one step ahead of the time: the first
    /// frame is at the end of the first step.
    fn first_step_error(&self, source: &Source, time_step: f64) -> SceneError {
        let sentence = format!(
            "motion.paper.time_step is {time_step}, after which the head is so near the centre that a bench is folded \
             back on itself, expected a shorter one"
        );
        let given = self.paper.as_ref().and_then(|paper| paper.get_ref().time_step.as_ref());
        source.field_error(given.unwrap_or(&self.head_speed), &sentence)
    }

    fn method(&self, source: &Source) -> Result<Method, SceneError> {
        let solver = self.solver.as_ref().map(|solver| *solver.get_ref());
        if let (Some(paper), true) = (&self.paper, solver != Some(SolverName::Paper)) {
            let sentence = "motion.paper is given but motion.solver is not \"paper\", expected both or neither";
            return Err(source.field_error(paper, sentence));
        }
        match (&self.accuracy, solver) {
            (Some(accuracy), Some(_)) => {
                let sentence = "motion.accuracy and motion.solver are both given, expected one of them";
                Err(source.field_error(accuracy, sentence))
            }
            (Some(accuracy), None) => {
                Ok(Method::Accuracy(source.check("motion.accuracy", accuracy, Accepted::ACCURACY)?))
            }
            (None, None) => Ok(Method::Accuracy(1e-9)),
            (None, Some(SolverName::Newton)) => Ok(Method::Newton),
            (None, Some(SolverName::FollowerTable)) => Ok(Method::FollowerTable),
            (None, Some(SolverName::Paper)) => Ok(Method::Paper(self.paper_rules(source)?)),
        }
    }

    fn paper_rules(&self, source: &Source) -> Result<PaperRules, SceneError> {
        let usual = PaperRules::default();
        let Some(paper) = &self.paper else { return Ok(usual) };
        let RawPaper { time_step, difference_interval, bisection_tolerance } = paper.get_ref();
        let number = |field: &str, value: &Option<Spanned<f64>>, usual| {
            let field = format!("motion.paper.{field}");
            value.as_ref().map_or(Ok(usual), |value| source.check(&field, value, Accepted::PAPER_RULE))
        };
        Ok(PaperRules {
            time_step: number("time_step", time_step, usual.time_step)?,
            difference_interval: number("difference_interval", difference_interval, usual.difference_interval)?,
            bisection_tolerance: number("bisection_tolerance", bisection_tolerance, usual.bisection_tolerance)?,
        })
    }
}

impl RawAlerts {
    fn validated(&self, source: &Source) -> Result<AlertRules, SceneError> {
        let number = |field, value: &Option<Spanned<f64>>, default| {
            value.as_ref().map_or(Ok(default), |value| source.check(field, value, Accepted::WARNING))
        };
        Ok(AlertRules {
            approach_time: number("alerts.approach_time", &self.approach_time, 10.0)?,
            approach_clearance: number("alerts.approach_clearance", &self.approach_clearance, 0.05)?,
        })
    }
}
