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
pub mod ros2;
pub(crate) mod stage;
mod team;
mod text;

use std::cell::RefCell;
use std::path::Path as FilePath;
use std::rc::Rc;

use serde::Deserialize;
use toml::Spanned;

pub use self::accepted::Accepted;
use self::cue::{Cue, RawCue};
pub use self::dragons::{MOST_DRAGON_NAME, MOST_DRAGONS};
use self::dragons::{Probe, RawSeveral};
use self::path::RawPath;
use self::precision::Precision;
pub use self::precision::SinglePrecision;
use self::ros2::RawRos2;
use self::stage::RawStage;
use self::team::RawTeam;
pub use self::text::{SceneText, printable};
use bench_dragon_messages::Roster;
use bench_dragon_motion::ensemble::Ensemble;
use bench_dragon_motion::event::Event;
use bench_dragon_motion::ground::{Ground, Obstacle};
use bench_dragon_motion::model::Vector;
use bench_dragon_motion::model::description::PathDescription;
use bench_dragon_motion::model::team::Team;
use bench_dragon_motion::placement::Placement;
use bench_dragon_motion::solve::paper::PaperRules;
use bench_dragon_motion::solve::{Solver, Velocities};
use bench_dragon_motion::timeline::Timeline;
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
#[error("{}", printable(.0))]
pub struct SceneError(String);

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

/// A scene: its motion, its accuracy, and how it is published.
///
/// # Examples
///
/// ```
/// use bench_dragon_show::scene::{Scene, SceneText};
///
/// let twenty = SceneText::paper().text.replace("benches = 223", "benches = 20");
/// let scene = Scene::parse(&twenty, "twenty.toml", "twenty")?;
/// assert_eq!(scene.team().handles(), 21);
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
    /// The team on its path, with the accuracy. With several dragons, the motion of the first alone: only code that
    /// looks at `ensemble` first may use this field.
    pub motion: Motion,
    /// The dragons of a scene with `[[dragons]]`; `None` for a scene with `[team]`.
    pub ensemble: Option<Ensemble>,
    /// The sizes of benches that the text leaves to their defaults, as in `width = 0.3`; of several dragons each with
    /// its dragon's name before it.
    pub team_defaults: Vec<String>,
    /// Sentences on numbers that are accepted and hardly meant, such as millimetres; each names its file and line.
    pub doubts: Vec<String>,
    /// The placement of the path's coordinates on the stage, if the scene states one. The motion's own placement
    /// contains this one.
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

    /// Reads a scene of one dragon from TOML text. `file` is the file's name in errors, `stem` the scene's name if the
    /// text gives none.
    ///
    /// # Errors
    /// One sentence that names the file, the line, the field and the expected value. A scene of several dragons is
    /// refused.
    pub fn parse(text: &str, file: &str, stem: &str) -> Result<Self, SceneError> {
        let source = Source::new(text, file);
        match several(text) {
            Some(dragons) => Err(source.field_error(
                &dragons,
                "the scene has several dragons, which this command does not take, expected one dragon in [team] and \
                 [path]",
            )),
            None => source.scene::<RawScene>(|raw| raw.validated(&source, stem)),
        }
    }

    /// Reads a scene of one dragon or of several, as [`Scene::parse`].
    ///
    /// # Errors
    /// One sentence that names the file, the line, the field and the expected value.
    pub fn parse_any(text: &str, file: &str, stem: &str) -> Result<Self, SceneError> {
        let source = Source::new(text, file);
        match several(text) {
            Some(_) => source.scene::<RawSeveral>(|raw| raw.validated(&source, stem)),
            None => source.scene::<RawScene>(|raw| raw.validated(&source, stem)),
        }
    }

    /// Returns the team of a scene of one dragon.
    pub fn team(&self) -> &Team {
        self.motion.team()
    }

    /// Returns the number of benches of all dragons.
    pub fn benches(&self) -> usize {
        self.ensemble.as_ref().map_or(self.motion.team().benches, Ensemble::benches)
    }

    /// Returns the number of handles of a frame: the handles of all dragons.
    pub fn handles(&self) -> usize {
        self.ensemble.as_ref().map_or(self.motion.team().handles(), Ensemble::handles)
    }

    /// Returns the greatest error of a link in a frame besides rounding, metres, as [`Motion::link_tolerance`].
    pub fn link_tolerance(&self) -> f64 {
        self.ensemble.as_ref().map_or_else(|| self.motion.link_tolerance(), Ensemble::link_tolerance)
    }

    /// Returns the obstacles, in stage coordinates.
    pub fn ground(&self) -> &Ground {
        self.ensemble.as_ref().map_or(self.motion.ground(), Ensemble::ground)
    }

    /// Returns the obstacle that an event reaches; `None` for other kinds.
    pub fn obstacle_of(&self, event: &Event) -> Option<&Obstacle> {
        self.ensemble.as_ref().map_or_else(|| self.motion.obstacle_of(event), |all| all.obstacle_of(event))
    }

    /// Returns the names of the benches and obstacles, for people.
    pub fn roster(&self) -> Roster {
        self.ensemble.as_ref().map_or_else(|| self.motion.roster(), Ensemble::roster)
    }

    /// Returns a bench's name for people, counted from 1 within its dragon.
    pub fn bench_name(&self, bench: u32) -> String {
        self.roster().bench(bench)
    }

    /// Returns all events of the scene, as [`Motion::timeline`].
    pub fn timeline(&self, progress: &mut dyn FnMut(f64)) -> Timeline {
        match &self.ensemble {
            Some(ensemble) => ensemble.timeline(progress),
            None => self.motion.timeline(progress),
        }
    }

    /// Returns the events of the scene without those that cost a search.
    pub fn timeline_without_contact(&self) -> Timeline {
        match &self.ensemble {
            Some(ensemble) => ensemble.timeline_without_contact(),
            None => self.motion.timeline_without_contact(),
        }
    }

    /// Returns the scene's solver; its chains are placed on the stage and hold all dragons.
    pub fn solver(&self) -> Box<dyn Solver> {
        match &self.ensemble {
            Some(ensemble) => Box::new(ensemble.solver(self.velocities)),
            None => self.motion.solver(self.velocities).solver,
        }
    }

    /// Returns true if a show of this scene stops at a contact. Without alerts no contact is computed.
    pub fn stops_at_contact(&self) -> bool {
        self.alerts.is_some() && self.on_contact == OnContact::Stop
    }
}

/// Returns the place of `[[dragons]]` in a text, if it has several dragons. A text that is not TOML has none, so its
/// errors are those of a scene of one dragon.
fn several(text: &str) -> Option<Spanned<serde::de::IgnoredAny>> {
    // Most scenes have one dragon, and are read once.
    text.contains("dragons").then(|| toml::from_str::<Probe>(text).ok()?.dragons).flatten()
}

/// The text being read, for line numbers.
#[derive(Clone)]
struct Source<'a> {
    text: &'a str,
    file: &'a str,
    /// The dragon whose tables are checked, if there are several.
    dragon: Option<&'a str>,
    /// The sentences of [`Scene::doubts`].
    doubts: Rc<RefCell<Vec<String>>>,
}

impl<'a> Source<'a> {
    fn new(text: &'a str, file: &'a str) -> Self {
        Self { text, file, dragon: None, doubts: Rc::default() }
    }

    /// Reads and checks a scene. An error that follows doubts may come from the first of them.
    fn scene<T: for<'de> Deserialize<'de>>(
        &self,
        validated: impl FnOnce(T) -> Result<Scene, SceneError>,
    ) -> Result<Scene, SceneError> {
        let result = validated(self.read()?);
        let doubts = self.doubts.take();
        match (result, doubts.first()) {
            (Ok(scene), _) => Ok(Scene { doubts, ..scene }),
            (Err(SceneError(sentence)), Some(doubt)) => Err(SceneError(format!("{sentence} ({doubt})"))),
            (Err(error), None) => Err(error),
        }
    }

    /// Notes that a number is accepted, and hardly meant.
    fn doubt<T>(&self, value: &Spanned<T>, sentence: &str) {
        let SceneError(sentence) = self.field_error(value, sentence);
        self.doubts.borrow_mut().push(sentence);
    }

    fn read<T: for<'de> Deserialize<'de>>(&self) -> Result<T, SceneError> {
        let deserializer = toml::Deserializer::parse(self.text).map_err(|error| self.toml_error(&error, ""))?;
        serde_path_to_error::deserialize(deserializer)
            .map_err(|error| self.toml_error(error.inner(), &error.path().to_string()))
    }

    fn line(&self, offset: usize) -> usize {
        self.text.as_bytes().iter().take(offset).filter(|byte| **byte == b'\n').count() + 1
    }

    /// Converts an error of the TOML reader into one sentence.
    fn toml_error(&self, error: &toml::de::Error, field: &str) -> SceneError {
        let place = error.span().map_or(String::new(), |span| format!(", line {}", self.line(span.start)));
        // `Spanned` values are wrapped in a field that no user wrote.
        let field = field.replace(".$__serde_spanned_private_value", "");
        let line = error.span().map(|span| self.line(span.start));
        let line = line.and_then(|line| self.text.lines().nth(line - 1)).unwrap_or_default();
        if let Some(sentence) = mend::sentence(error.message(), &field, line) {
            return SceneError(format!("{}{place}: {sentence}", self.file));
        }
        let field = if field.is_empty() || field == "." { String::new() } else { format!("{field}: ") };
        let message = error.message().trim().replace('\n', ", ");
        let message =
            message.replace("expected i64", "expected an integer").replace("expected f64", "expected a number");
        SceneError(format!("{}{place}: {field}{message}", self.file))
    }

    fn field_error<T>(&self, value: &Spanned<T>, sentence: &str) -> SceneError {
        self.field_error_at(value.span().start, sentence)
    }

    fn field_error_at(&self, offset: usize, sentence: &str) -> SceneError {
        let whose = self.dragon.map_or(String::new(), |dragon| format!("dragon \"{dragon}\": "));
        SceneError(format!("{}, line {}: {whose}{sentence}", self.file, self.line(offset)))
    }

    /// Returns a name without control characters, since it is printed unchanged.
    fn printable(&self, field: &str, value: &Spanned<String>) -> Result<String, SceneError> {
        let name = value.get_ref();
        if name.chars().any(char::is_control) {
            let sentence = format!("{field} has a control character in it, expected text of one line");
            return Err(self.field_error(value, &sentence));
        }
        Ok(name.clone())
    }

    fn check(&self, field: &str, value: &Spanned<f64>, accepted: Accepted) -> Result<f64, SceneError> {
        accepted.check(field, *value.get_ref()).map_err(|sentence| self.field_error(value, &sentence))
    }

    /// Returns a place of the stage; by default the origin.
    fn place(&self, field: &str, value: Option<&Spanned<[f64; 2]>>) -> Result<Vector, SceneError> {
        let Some(given) = value else { return Ok(Vector::zeros()) };
        for number in given.get_ref() {
            let checked = Accepted::PLACE.check(field, *number);
            checked.map_err(|sentence| self.field_error(given, &sentence))?;
        }
        Ok(Vector::from(*given.get_ref()))
    }

    fn check_count(&self, field: &str, value: &Spanned<i64>, accepted: Accepted) -> Result<usize, SceneError> {
        let number =
            accepted.check(field, *value.get_ref() as f64).map_err(|sentence| self.field_error(value, &sentence))?;
        Ok(number as usize)
    }
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

/// The fields of `[motion]` that a show has once, also with several dragons.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawEnds {
    on_contact: Option<OnContact>,
    at_end: Option<AtEnd>,
    end_hold: Option<Spanned<f64>>,
}

/// The tables that a scene has once, also with several dragons.
struct SharedTables {
    name: Option<Spanned<String>>,
    alerts: Option<RawAlerts>,
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
        let Self { name, team, path, placement, stage, motion, alerts, cues, publish } = self;
        let (checked, placement) = motion_of(source, &team, &path, &motion, placement.as_ref())?;
        let checked = match &stage {
            Some(stage) => checked.on_ground(stage.validated(source)?),
            None => checked,
        };
        let shared = SharedTables { name, alerts, cues, publish, ends: motion.ends() };
        Ok(Scene { team_defaults: team.defaults(), ..shared.validated(source, stem, checked, placement)? })
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
    /// Checks the tables. Returns the scene of a motion.
    fn validated(
        &self,
        source: &Source,
        stem: &str,
        motion: Motion,
        placement: Option<Placement>,
    ) -> Result<Scene, SceneError> {
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
            motion,
            ensemble: None,
            team_defaults: Vec::new(),
            doubts: Vec::new(),
            placement,
            on_contact: on_contact.unwrap_or(OnContact::Stop),
            at_end: at_end.unwrap_or(AtEnd::Hold),
            end_hold: end_hold
                .as_ref()
                .map_or(Ok(DEFAULT_END_HOLD), |seconds| source.check("motion.end_hold", seconds, Accepted::END_HOLD))?,
            cues: self.cues.iter().map(|cue| cue.validated(source, self.alerts.is_some())).collect::<Result<_, _>>()?,
            alerts: self.alerts.as_ref().map(|alerts| alerts.validated(source)).transpose()?,
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
