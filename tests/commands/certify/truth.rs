//! Certificates of scenes, and the ordinary search's results for the same scenes. Shared by the tests of certificates
//! and their fuzz target.

use std::sync::OnceLock;

use bench_dragon::certify::plan::{LeastPitch, greatest_speed, least_pitch};
use bench_dragon::certify::{self, CertificateLine};
use bench_dragon::messages::state::EventKind as Kind;
use bench_dragon::motion::Method;
use bench_dragon::motion::clearance::least_clearance_all_pairs;
use bench_dragon::motion::event::{Event, unreported};
use bench_dragon::motion::solve::{Chain, Velocities};
use bench_dragon::motion::timeline::Timeline;
use bench_dragon::proof::{EventKind, Proved, ProvedClearance, ProvedEvent, ProvedPitch, ProvedSpeed, Status, Until};
use bench_dragon::show::scene::Scene;
use serde_json::Value;

/// Greatest error of a time of the ordinary search, seconds.
const ERROR: f64 = 1e-9;

/// Greatest error of a clearance in metres, of a ratio of speeds, and of a pitch in metres, of the ordinary search.
const CLOSE: f64 = 1e-8;

/// Frames of a motion with which claims are compared.
const FRAMES: u32 = 16;

/// Returns the part of a scene's text that a certificate is about.
pub fn scene(text: &str) -> Option<Scene> {
    let mut table: toml::Table = text.parse().ok()?;
    table.retain(|key, _| ["team", "path", "motion", "stage", "placement"].contains(&key));
    let motion = table["motion"].as_table_mut()?;
    motion.retain(|key, _| key == "head_speed");
    motion.insert("on_contact".to_owned(), "continue".into());
    Scene::parse(&toml::to_string(&table).ok()?, "scene.toml", "scene").ok()
}

/// The results of the ordinary search for a scene.
pub struct Found {
    scene: Scene,
    timeline: Timeline,
    /// Frames of the whole motion, each with its time.
    frames: Vec<(f64, Chain)>,
    /// The least clearance of the motion, and the greatest ratio of a handle's speed to the head's, once needed.
    least: OnceLock<Option<f64>>,
    fastest: OnceLock<Option<f64>>,
    /// The least pitch with which the team reaches a radius.
    pitch: OnceLock<(f64, Option<LeastPitch>)>,
}

impl Found {
    /// Searches the scene of a certificate; `None` if it is refused.
    pub fn new(text: &str) -> Option<Self> {
        let scene = scene(text)?;
        let timeline = scene.ensemble.timeline(&mut unreported);
        let mut solver =
            scene.ensemble.only().unwrap().with_method(Method::Newton).ok()?.solver(Velocities::Computed).solver;
        let end = timeline.end().time;
        let times = (0..FRAMES).map(|frame| f64::from(frame) / f64::from(FRAMES) * end);
        let frames = times.filter_map(|time| {
            let mut chain = Chain::new(scene.ensemble.handles());
            solver.solve(time, &mut chain).ok()?;
            Some((time, chain))
        });
        let frames = frames.collect();
        let (least, fastest, pitch) = (OnceLock::new(), OnceLock::new(), OnceLock::new());
        Some(Self { scene, timeline, frames, least, fastest, pitch })
    }

    /// Returns a claim of a certificate that is false, in words.
    pub fn contradiction(&self, proved: &Proved) -> Option<String> {
        let false_result = proved.results.iter().find(|outcome| !self.has(outcome)).map(|it| format!("{it:?}"));
        let clearance = proved.least_clearance.as_ref().filter(|claim| !self.has_clearance(claim));
        let speed = proved.greatest_speed.as_ref().filter(|claim| !self.has_speed(claim));
        let pitch = proved.least_pitch.as_ref().filter(|claim| !self.has_pitch(claim));
        false_result
            .or_else(|| clearance.map(|claim| format!("{claim:?}")))
            .or_else(|| speed.map(|claim| format!("{claim:?}")))
            .or_else(|| pitch.map(|claim| format!("{claim:?}")))
    }

    /// Returns true if the claim about an event is true.
    pub fn has(&self, outcome: &ProvedEvent) -> bool {
        let kind = match outcome.event {
            EventKind::Contact => Kind::Contact,
            EventKind::Stall => Kind::Stall,
            EventKind::Lock => Kind::Lock,
            EventKind::PathEnd => Kind::PathEnd,
            EventKind::Obstacle => Kind::Obstacle,
        };
        let obstacle = outcome.obstacle.map(|number| self.scene.ensemble.obstacle_number(number));
        let mut events = self.timeline.events().iter().map(|timed| (timed.event, timed.time));
        let is_it = |event: &Event| event.kind == kind && (obstacle.is_none() || event.bench_b == obstacle);
        let found = events.find(|(event, _)| is_it(event)).map(|(_, time)| time);
        match (outcome.status, found, outcome.time_lo, outcome.time_hi) {
            (Status::None, None, ..) => true,
            (Status::Proved, Some(time), Some(lo), Some(hi)) => {
                let error = ERROR * time.max(1.0);
                lo <= time + error && time <= hi + error
            }
            (Status::Undecided, Some(time), Some(lo), _) => lo <= time + ERROR * time.max(1.0),
            (Status::Undecided, None, ..) => true,
            _ => false,
        }
    }

    /// Returns true if no frame is nearer than the lower bound, and some moment is as near as the upper bound.
    fn has_clearance(&self, claim: &ProvedClearance) -> bool {
        let contact = self.timeline.find(Kind::Contact).map(|contact| contact.time);
        let until = match claim.until {
            Until::PathEnd => Some(self.timeline.end().time),
            Until::Contact => contact,
            Until::Time => claim.time_until,
        };
        let Some(until) = until else { return false };
        let is_apart = |chain: &Chain, lo: f64| {
            least_clearance_all_pairs(chain, self.scene.ensemble.only().unwrap().team())
                .is_none_or(|pair| pair.value >= lo - CLOSE)
        };
        let least = || {
            let ensemble = &self.scene.ensemble;
            let found = ensemble.least_clearances(&self.timeline, self.timeline.end(), &mut unreported);
            Some(found.own?.least.value).filter(|_| self.timeline.searched_until().is_none())
        };
        let mut frames = self.frames.iter().filter(|(time, _)| *time <= until);
        claim.lo.is_none_or(|lo| frames.all(|(_, chain)| is_apart(chain, lo)))
            && claim.hi.is_none_or(|hi| self.least.get_or_init(least).is_none_or(|least| least <= hi + CLOSE))
    }

    /// Returns true if no handle is faster in a frame than the upper bound. Also, the lower bound must not be above the
    /// greatest ratio that the search finds.
    fn has_speed(&self, claim: &ProvedSpeed) -> bool {
        let ratio = |x: &f64, y: &f64| x.hypot(*y) / self.scene.ensemble.only().unwrap().head_speed();
        let is_slow =
            |chain: &Chain| chain.vx.iter().zip(&chain.vy).all(|(x, y)| ratio(x, y) <= claim.ratio_hi + CLOSE);
        let mut frames = self.frames.iter().filter(|(time, _)| *time <= claim.time_until);
        // A motion that ends with a lock has no greatest ratio.
        let fastest = || Some(1.0 / greatest_speed(&self.scene, &self.timeline, 1.0, &mut unreported).ok()?.value_lo);
        frames.all(|(_, chain)| is_slow(chain))
            && self.fastest.get_or_init(fastest).is_none_or(|most| claim.ratio_lo <= most * (1.0 + CLOSE))
    }

    /// Returns true if the claim agrees with the ordinary search for the least pitch.
    fn has_pitch(&self, claim: &ProvedPitch) -> bool {
        let find = || {
            (claim.radius, least_pitch(self.scene.ensemble.only().unwrap().team(), claim.radius, &mut unreported).ok())
        };
        let (radius, found) = *self.pitch.get_or_init(find);
        let found = if radius == claim.radius { found } else { find().1 };
        // Every pitch may reach the radius, or none.
        let Some(LeastPitch { value_lo, value_hi, from, .. }) = found else { return true };
        let is_free = |pitch: f64| pitch < from || pitch >= value_lo - CLOSE;
        claim.value_hi.is_none_or(is_free)
            && claim.value_lo.is_none_or(|lo| claim.from > value_lo || value_hi.is_none_or(|hi| lo <= hi + CLOSE))
    }
}

/// Returns the lines of a scene's certificate.
pub fn certificate(text: &str) -> Vec<Value> {
    let scene = Scene::parse(text, "scene.toml", "scene").unwrap();
    let timeline = scene.ensemble.timeline(&mut unreported);
    let mut lines = Vec::new();
    let mut write = |line: &CertificateLine| {
        lines.push(serde_json::to_value(line).unwrap());
        Ok::<(), std::io::Error>(())
    };
    certify::certify(&scene.ensemble, &timeline, text, certify::MOST_STEPS, &mut write, &mut unreported).unwrap();
    lines
}
