//! The file a user writes, checked once and turned into the types of the model.
//!
//! In: TOML text, or what the command line overrides. Out: a [`Scene`], whose existence is the proof that every number
//! is in range and that the start is legal. Errors name the file, the line, the field and what was expected.

pub mod path;
pub mod ros2;

use std::path::Path as FilePath;

use serde::Deserialize;
use toml::Spanned;

use self::path::{RawPath, ScenePath};
use self::ros2::{RawRos2, Ros2Settings};
use crate::chain::follower_table::FollowerTable;
use crate::chain::newton::Newton;
use crate::chain::paper::{self, Paper, PaperRules};
use crate::chain::whole_chain::WholeChain;
use crate::chain::{Solver, Team, Velocities};
use crate::geometry::path::Path;

/// The paper's scene, as built into the program.
const PAPER: &str = include_str!("../config/paper.toml");
/// Subscribers that each iceoryx2 service admits at once where the scene does not say.
const DEFAULT_SUBSCRIBERS: usize = 8;

/// A closed range of accepted numbers and their unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Accepted {
    /// The least number accepted.
    pub least: f64,
    /// The greatest number accepted.
    pub greatest: f64,
    /// The unit, as in "metres".
    pub unit: &'static str,
}

impl Accepted {
    /// Pitch and lengths of boards.
    pub const LENGTH: Self = Self { least: 1e-3, greatest: 1e4, unit: "metres" };
    /// The turn on which the head starts.
    pub const START_TURN: Self = Self { least: 1e-9, greatest: 1e7, unit: "turns" };
    /// The first radius of a turnaround over the second.
    pub const ARC_RATIO: Self = Self { least: 1e-3, greatest: 1e3, unit: "metres per metre" };
    /// Metres of path before or after a turnaround.
    pub const ROUTE: Self = Self { least: 0.0, greatest: 1e9, unit: "metres" };
    /// A line or arc of a route.
    pub const LEG: Self = Self { least: 1e-3, greatest: 1e9, unit: "metres" };
    /// How far an arc of a route turns.
    pub const ARC_TURNS: Self = Self { least: 1e-6, greatest: 1e3, unit: "turns" };
    /// The direction in which a route begins.
    pub const HEADING: Self = Self { least: -1.0, greatest: 1.0, unit: "turns" };
    /// A coordinate on the stage.
    pub const PLACE: Self = Self { least: -1e9, greatest: 1e9, unit: "metres" };
    /// Speed of the head.
    pub const SPEED: Self = Self { least: 1e-9, greatest: 1e6, unit: "metres per second" };
    /// Frames per second.
    pub const RATE: Self = Self { least: 0.1, greatest: 20_000.0, unit: "frames per second" };
    /// Simulated seconds per second of wall time.
    pub const TIME_SCALE: Self = Self { least: 1e-6, greatest: 1e6, unit: "simulated seconds per second" };
    /// Position error asked for.
    pub const ACCURACY: Self = Self { least: 1e-18, greatest: 1e3, unit: "metres" };
    /// Times and clearances at which a warning is given.
    pub const WARNING: Self = Self { least: 0.0, greatest: 1e9, unit: "seconds or metres" };
    /// Seconds of the paper's time step and difference interval, radians of its tolerance.
    pub const PAPER_RULE: Self = Self { least: 1e-15, greatest: 1e3, unit: "seconds or radians" };
    /// The number of benches.
    pub const BENCHES: Self = Self { least: 1.0, greatest: 1e6, unit: "benches" };
    /// Frames a subscriber may fall behind.
    pub const QUEUE: Self = Self { least: 1.0, greatest: 1e6, unit: "frames" };
    /// Subscribers at once.
    pub const SUBSCRIBERS: Self = Self { least: 1.0, greatest: 256.0, unit: "subscribers" };
    /// Messages that a ROS 2 topic keeps.
    pub const DEPTH: Self = Self { least: 1.0, greatest: 1e3, unit: "messages" };

    /// The number itself where it is within the range.
    ///
    /// # Errors
    /// One sentence that names the field, the number and the range.
    pub fn check(self, field: &str, number: f64) -> Result<f64, String> {
        // A comparison with NaN is false, so that NaN is refused here too.
        if number >= self.least && number <= self.greatest {
            Ok(number)
        } else {
            let Self { least, greatest, unit } = self;
            let [least, greatest] = [least, greatest].map(short);
            Err(format!("{field} is {number}, expected a number from {least} to {greatest} {unit}"))
        }
    }
}

/// A number as people write it: 256, 20000, 1e6.
fn short(number: f64) -> String {
    let plain = number.to_string();
    if plain.len() <= 6 { plain } else { format!("{number:e}") }
}

/// Input that cannot be used, in one sentence that says where and what was expected.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct SceneError(String);

/// How the solver is chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// The cheapest solver that meets this position error, metres.
    Accuracy(f64),
    /// This solver, whatever its accuracy.
    Named(SolverName),
}

/// The solvers that a scene can name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SolverName {
    /// Exact motion, each follower bracketed.
    Newton,
    /// Exact motion, all handles at once from the frame before.
    WholeChain,
    /// Exact motion, every handle read off a table of where such chains stand.
    FollowerTable,
    /// The paper's rules.
    Paper,
}

/// What `run` does when two boards touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnContact {
    /// The show freezes at the contact.
    Stop,
    /// The show goes on.
    Continue,
}

/// What `run` does once the show has frozen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AtEnd {
    /// It publishes the frozen frame until it is ended.
    Hold,
    /// It begins again at the start.
    Loop,
}

/// When to warn of what lies ahead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlertRules {
    /// Simulated seconds before an event.
    pub approach_time: f64,
    /// Metres between two boards.
    pub approach_clearance: f64,
}

/// A scene: what is danced, how exactly, and how it is published.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// The scene's name; by default the stem of its file.
    pub name: String,
    /// The benches.
    pub team: Team,
    /// The curve the handles ride.
    pub path: ScenePath,
    /// Metres per second of the head along the curve.
    pub head_speed: f64,
    /// How the solver is chosen.
    pub method: Method,
    /// The paper's numbers, used by its solver only.
    pub paper_rules: PaperRules,
    /// What happens at a contact.
    pub on_contact: OnContact,
    /// What happens at the end.
    pub at_end: AtEnd,
    /// When to warn; `None` where the scene asks for no alerts.
    pub alerts: Option<AlertRules>,
    /// Frames per second.
    pub rate: f64,
    /// Whether velocities are computed.
    pub velocities: Velocities,
    /// Frames a subscriber may fall behind, where the scene says so.
    pub queue: Option<usize>,
    /// Subscribers that each iceoryx2 service admits at once.
    pub subscribers: usize,
    /// The ROS 2 topics; `None` where the scene asks for none.
    pub ros2: Option<Ros2Settings>,
}

impl Scene {
    /// The scene of the paper, which is built in.
    pub fn paper() -> Self {
        // A test parses the built-in text, and nothing can change it afterwards.
        Self::parse(PAPER, "paper.toml (built in)", "paper").expect("the built-in scene is valid")
    }

    /// Reads a scene from a file.
    ///
    /// # Errors
    /// One sentence for a file that cannot be read or used.
    pub fn load(file: &FilePath) -> Result<Self, SceneError> {
        let shown = file.display().to_string();
        let text = std::fs::read_to_string(file).map_err(|error| {
            let reason = match error.kind() {
                std::io::ErrorKind::NotFound => "there is no such file".to_owned(),
                std::io::ErrorKind::IsADirectory => "it is a folder".to_owned(),
                std::io::ErrorKind::InvalidData => "it is not UTF-8 text".to_owned(),
                _ => error.to_string(),
            };
            SceneError(format!("{shown}: {reason}, expected a scene file in TOML"))
        })?;
        let stem = file.file_stem().map_or("scene".into(), |stem| stem.to_string_lossy());
        Self::parse(&text, &shown, &stem)
    }

    /// Reads a scene from TOML text. `file` is how errors call it, `stem` its name where it gives none itself.
    ///
    /// # Errors
    /// One sentence that names the file, the line, the field and what was expected.
    pub fn parse(text: &str, file: &str, stem: &str) -> Result<Self, SceneError> {
        let source = Source { text, file };
        let deserializer = toml::Deserializer::parse(text).map_err(|error| source.refused(&error, ""))?;
        let raw: RawScene = serde_path_to_error::deserialize(deserializer)
            .map_err(|error| source.refused(error.inner(), &error.path().to_string()))?;
        raw.validated(&source, stem)
    }

    /// Simulated seconds after which the head has travelled so many metres along the path, by the motion this scene's
    /// solver follows.
    pub fn time_of(&self, travelled: f64) -> f64 {
        match (self.method, &self.path) {
            (Method::Named(SolverName::Paper), ScenePath::Spiral(spiral)) => {
                let theta = spiral.place_at(travelled).radians();
                paper::time_of_theta(spiral, self.head_speed, theta)
            }
            _ => travelled / self.head_speed,
        }
    }

    /// The solver this scene asks for, and in words why it is that one.
    pub fn solver(&self) -> (Box<dyn Solver>, String) {
        let Self { team, head_speed, velocities, .. } = *self;
        let spiral = match &self.path {
            ScenePath::Spiral(spiral) => *spiral,
            ScenePath::Pieces(path) => {
                let why = match self.method {
                    Method::Named(_) => "named by the scene",
                    Method::Accuracy(_) => "the one solver for paths of pieces, as exact as doubles allow",
                };
                let newton = Newton::new(path.clone(), team, head_speed, velocities);
                return (Box::new(newton), format!("newton: {why}"));
            }
        };
        let whole_chain = || -> (Box<dyn Solver>, String) {
            let solver = WholeChain::new(spiral, team, head_speed, velocities);
            let name = format!("whole_chain ({})", solver.instructions().name());
            (Box::new(solver), name)
        };
        let table = || -> Option<(Box<dyn Solver>, String)> {
            let solver = FollowerTable::new(spiral, team, head_speed, velocities)?;
            let valid = if solver.valid_until() * head_speed < spiral.length() {
                format!(" up to {:.1} s, then whole_chain", solver.valid_until())
            } else {
                String::new()
            };
            let name = format!("follower_table ({}){valid}", solver.instructions().name());
            Some((Box::new(solver), name))
        };
        match self.method {
            Method::Accuracy(accuracy) => {
                let (solver, name) = table().unwrap_or_else(whole_chain);
                (solver, format!("{name}: the cheapest that meets an accuracy of {accuracy:e} m"))
            }
            Method::Named(SolverName::FollowerTable) => match table() {
                Some((solver, name)) => (solver, format!("{name}: named by the scene")),
                None => {
                    let (solver, name) = whole_chain();
                    (
                        solver,
                        format!("{name}: the scene names follower_table, which has no table for this team and path"),
                    )
                }
            },
            Method::Named(SolverName::WholeChain) => {
                let (solver, name) = whole_chain();
                (solver, format!("{name}: named by the scene"))
            }
            Method::Named(SolverName::Newton) => {
                let newton = Newton::new(spiral, team, head_speed, velocities);
                (Box::new(newton), "newton: named by the scene".to_owned())
            }
            Method::Named(SolverName::Paper) => {
                let paper = Paper::new(spiral, team, head_speed, velocities, self.paper_rules);
                (Box::new(paper), "paper: named by the scene; its head is too fast by sqrt(1 + 1/theta^2)".to_owned())
            }
        }
    }
}

/// The text being read, for finding lines.
struct Source<'a> {
    text: &'a str,
    file: &'a str,
}

impl Source<'_> {
    fn line(&self, offset: usize) -> usize {
        self.text.as_bytes().iter().take(offset).filter(|byte| **byte == b'\n').count() + 1
    }

    /// What the TOML reader refused, in one sentence.
    fn refused(&self, error: &toml::de::Error, field: &str) -> SceneError {
        let place = error.span().map_or(String::new(), |span| format!(", line {}", self.line(span.start)));
        // What carries its place in the text is wrapped in a field that no user wrote.
        let field = field.replace(".$__serde_spanned_private_value", "");
        let field = if field.is_empty() || field == "." { String::new() } else { format!("{field}: ") };
        let message = error.message().trim().replace('\n', ", ");
        let message =
            message.replace("expected i64", "expected an integer").replace("expected f64", "expected a number");
        SceneError(format!("{}{place}: {field}{message}", self.file))
    }

    fn wrong<T>(&self, value: &Spanned<T>, sentence: &str) -> SceneError {
        self.wrong_at(value.span().start, sentence)
    }

    fn wrong_at(&self, offset: usize, sentence: &str) -> SceneError {
        SceneError(format!("{}, line {}: {sentence}", self.file, self.line(offset)))
    }

    fn check(&self, field: &str, value: &Spanned<f64>, accepted: Accepted) -> Result<f64, SceneError> {
        accepted.check(field, *value.get_ref()).map_err(|sentence| self.wrong(value, &sentence))
    }

    fn check_count(&self, field: &str, value: &Spanned<i64>, accepted: Accepted) -> Result<usize, SceneError> {
        let number = accepted.check(field, *value.get_ref() as f64).map_err(|sentence| self.wrong(value, &sentence))?;
        Ok(number as usize)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawScene {
    name: Option<Spanned<String>>,
    team: RawTeam,
    path: RawPath,
    motion: RawMotion,
    alerts: Option<RawAlerts>,
    #[serde(default)]
    publish: RawPublish,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTeam {
    benches: Spanned<i64>,
    head_length: Spanned<f64>,
    body_length: Spanned<f64>,
    width: Spanned<f64>,
    hole_inset: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMotion {
    head_speed: Spanned<f64>,
    accuracy: Option<Spanned<f64>>,
    solver: Option<Spanned<SolverName>>,
    paper: Option<Spanned<PaperRules>>,
    on_contact: Option<OnContact>,
    at_end: Option<AtEnd>,
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
    queue: Option<Spanned<i64>>,
    subscribers: Option<Spanned<i64>>,
    ros2: Option<RawRos2>,
}

impl RawScene {
    fn validated(self, source: &Source, stem: &str) -> Result<Scene, SceneError> {
        let team = self.team.validated(source)?;
        let path = self.path.validated(source, &team)?;
        let head_speed = source.check("motion.head_speed", &self.motion.head_speed, Accepted::SPEED)?;
        let (method, paper_rules) = self.motion.method(source)?;
        if let (
            Method::Named(SolverName::WholeChain | SolverName::FollowerTable | SolverName::Paper),
            ScenePath::Pieces(_),
            Some(given),
        ) = (method, &path, &self.motion.solver)
        {
            let sentence = "motion.solver rides spirals only, expected \"newton\" or no such field on this path";
            return Err(source.wrong(given, sentence));
        }
        let name = match &self.name {
            None => stem.to_owned(),
            Some(name) if name.get_ref().trim().is_empty() => {
                return Err(source.wrong(name, "name is empty, expected a name or no such field"));
            }
            Some(name) => name.get_ref().clone(),
        };
        let rate =
            self.publish.rate.as_ref().map_or(Ok(60.0), |rate| source.check("publish.rate", rate, Accepted::RATE))?;
        let queue =
            self.publish.queue.as_ref().map(|queue| source.check_count("publish.queue", queue, Accepted::QUEUE));
        let subscribers = self.publish.subscribers.as_ref().map_or(Ok(DEFAULT_SUBSCRIBERS), |subscribers| {
            source.check_count("publish.subscribers", subscribers, Accepted::SUBSCRIBERS)
        })?;
        let velocities = self.publish.velocities.unwrap_or(true);
        Ok(Scene {
            name,
            team,
            path,
            head_speed,
            method,
            paper_rules,
            on_contact: self.motion.on_contact.unwrap_or(OnContact::Stop),
            at_end: self.motion.at_end.unwrap_or(AtEnd::Hold),
            alerts: self.alerts.as_ref().map(|alerts| alerts.validated(source)).transpose()?,
            rate,
            velocities: if velocities { Velocities::Computed } else { Velocities::Omitted },
            queue: queue.transpose()?,
            subscribers,
            ros2: self.publish.ros2.as_ref().map(|ros2| ros2.validated(source)).transpose()?,
        })
    }
}

impl RawTeam {
    fn validated(&self, source: &Source) -> Result<Team, SceneError> {
        let length = |field, value| source.check(field, value, Accepted::LENGTH);
        let team = Team {
            benches: source.check_count("team.benches", &self.benches, Accepted::BENCHES)?,
            head_length: length("team.head_length", &self.head_length)?,
            body_length: length("team.body_length", &self.body_length)?,
            width: length("team.width", &self.width)?,
            hole_inset: length("team.hole_inset", &self.hole_inset)?,
        };
        for (field, board) in [("head_length", &self.head_length), ("body_length", &self.body_length)] {
            // Anything shorter has its two holes in one place, or crosswise.
            if *board.get_ref() - 2.0 * team.hole_inset < Accepted::LENGTH.least {
                let sentence = format!(
                    "team.{field} is {} and leaves no bench between its holes, expected more than twice \
                     team.hole_inset ({}) by at least {} metres",
                    board.get_ref(),
                    team.hole_inset,
                    Accepted::LENGTH.least
                );
                return Err(source.wrong(board, &sentence));
            }
        }
        Ok(team)
    }
}

impl RawMotion {
    fn method(&self, source: &Source) -> Result<(Method, PaperRules), SceneError> {
        let method = match (&self.accuracy, &self.solver) {
            (Some(accuracy), Some(_)) => {
                let sentence = "motion.accuracy and motion.solver are both given, expected one of them";
                return Err(source.wrong(accuracy, sentence));
            }
            (Some(accuracy), None) => {
                Method::Accuracy(source.check("motion.accuracy", accuracy, Accepted::ACCURACY)?)
            }
            (None, Some(solver)) => Method::Named(*solver.get_ref()),
            (None, None) => Method::Accuracy(1e-9),
        };
        let Some(paper) = &self.paper else { return Ok((method, PaperRules::default())) };
        if method != Method::Named(SolverName::Paper) {
            let sentence = "motion.paper is given but motion.solver is not \"paper\", expected both or neither";
            return Err(source.wrong(paper, sentence));
        }
        let rules = *paper.get_ref();
        for (field, number) in [
            ("motion.paper.time_step", rules.time_step),
            ("motion.paper.difference_interval", rules.difference_interval),
            ("motion.paper.bisection_tolerance", rules.bisection_tolerance),
        ] {
            Accepted::PAPER_RULE.check(field, number).map_err(|sentence| source.wrong(paper, &sentence))?;
        }
        Ok((method, rules))
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
