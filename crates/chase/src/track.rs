//! A tracked performer: from places on the stage to a place on the path, and from there to a simulated time. Pure.
//!
//! A place is projected on the path near the latest place only, because the nearest point of the whole path would often
//! be on another turn of the coil, half a metre away.

use bench_dragon_motion::Motion;
use bench_dragon_motion::model::Point;

use crate::filter::{DelayLockedLoop, Noise, seconds_between};
use crate::steering::{Goal, Limits};

/// Half the length of path that is searched about the latest place, in metres.
const WINDOW: f64 = 3.0;
/// The distance of the points that are compared first, in metres.
const STEP: f64 = 0.25;
/// The steps along the tangent from the nearest of those points. Each step leaves the part of the error that is the
/// distance from the path divided by the radius of its curve.
const REFINEMENTS: usize = 8;
/// The greatest distance from the path, in metres.
pub const MOST_DISTANCE: f64 = 1.0;
/// Readings that lock.
const READINGS_TO_LOCK: u32 = 3;
/// The time without a reading that is shown as freewheeling, in seconds.
const QUIET: f64 = 0.3;
/// The greatest correction of the rate, in simulated seconds per second, and the error above which the show is sent to
/// its place, in seconds.
const TAKE_UP: f64 = 0.5;
const SEEK_ABOVE: f64 = 2.0;

/// A place on the path next to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// The length of path from the start, in metres.
    pub travelled: f64,
    /// The distance from the point to the path, in metres.
    pub distance: f64,
}

/// The state of a tracked performer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Following {
    /// No position has come.
    Silent,
    /// Too few positions have come.
    Locking,
    /// The performer is followed.
    Locked,
    /// No position comes; the performer continues at the latest speed.
    Freewheeling,
    /// No position comes, or only positions off the path.
    Lost,
}

/// The head's motion along the path of a show.
pub struct Track {
    motion: Motion,
    /// Simulated seconds of the show before the motion begins.
    delay: f64,
    freewheel: f64,
    estimate: Option<DelayLockedLoop>,
    readings: u32,
    fitting_ns: Option<u64>,
    distance: f64,
}

impl Track {
    /// Creates the track of a motion, whose head follows its path exactly and begins after `delay` simulated seconds of
    /// the show. `freewheel` is the time for which a performer that is not seen is followed, in seconds.
    pub fn new(motion: Motion, delay: f64, freewheel: f64) -> Self {
        Self { motion, delay, freewheel, estimate: None, readings: 0, fitting_ns: None, distance: f64::NAN }
    }

    /// Returns the limits of the corrections.
    pub fn limits(&self) -> Limits {
        Limits { take_up: TAKE_UP, seek_above: SEEK_ABOVE, seeks_back: false }
    }

    /// Returns the latest distance from the path, in metres; NaN before the first position.
    pub fn distance(&self) -> f64 {
        self.distance
    }

    /// Returns the place on the path that is nearest to a point of the stage, within `WINDOW` metres of a place.
    pub fn project(&self, point: Point, near: f64) -> Projection {
        let (path, placement) = (self.motion.bare_path(), self.motion.placement());
        let (first, last) = ((near - WINDOW).max(0.0), (near + WINDOW).min(path.length()));
        let offset = |travelled: f64| point - placement.point(path.point(path.param_at(travelled)));
        let count = ((last - first) / STEP).ceil().max(1.0);
        let places = (0..=count as u32).map(|k| first + (last - first) * f64::from(k) / count);
        let nearest = places.min_by(|a, b| offset(*a).norm().total_cmp(&offset(*b).norm()));
        let mut travelled = nearest.unwrap_or(first);
        for _ in 0..REFINEMENTS {
            let tangent = placement.vector(path.tangent(path.param_at(travelled)));
            let along = offset(travelled).dot(&tangent).clamp(-STEP, STEP);
            travelled = (travelled + along).clamp(first, last);
        }
        Projection { travelled, distance: offset(travelled).norm() }
    }

    /// Handles a position of the tracker on the stage, in metres. `show_time` is the simulated time of the show: the
    /// first search for a performer is near the head at that time.
    pub fn read(&mut self, point: Point, at_ns: u64, show_time: f64) {
        let head_speed = self.motion.head_speed();
        let near = self
            .estimate
            .as_ref()
            .map_or(head_speed * (show_time - self.delay).max(0.0), |estimate| estimate.position(at_ns));
        let Projection { travelled, distance } = self.project(point, near);
        self.distance = distance;
        if distance > MOST_DISTANCE {
            return;
        }
        self.fitting_ns = Some(at_ns);
        self.readings += 1;
        match &mut self.estimate {
            Some(estimate) => estimate.correct(at_ns, travelled),
            None => {
                let noise = Noise { spread: Noise::TRACKER.spread * head_speed, ..Noise::TRACKER };
                self.estimate = Some(DelayLockedLoop::new(at_ns, travelled, 0.5 * head_speed, noise));
            }
        }
    }

    /// Returns the state of the performer now.
    pub fn following(&mut self, now_ns: u64) -> Following {
        let quiet = self.fitting_ns.map(|at_ns| seconds_between(at_ns, now_ns));
        match quiet {
            None if self.distance.is_nan() => Following::Silent,
            None => Following::Lost,
            Some(quiet) if quiet > self.freewheel => {
                (self.estimate, self.readings) = (None, 0);
                Following::Lost
            }
            Some(_) if self.readings < READINGS_TO_LOCK => Following::Locking,
            Some(quiet) if quiet > QUIET => Following::Freewheeling,
            Some(_) => Following::Locked,
        }
    }

    /// Returns the goal of the show.
    pub fn goal(&mut self, now_ns: u64) -> Goal {
        match (self.following(now_ns), &self.estimate) {
            (Following::Locked | Following::Freewheeling, Some(estimate)) => {
                let head_speed = self.motion.head_speed();
                // The head moves forward only, and a place before the start is the start.
                let time = self.delay + (estimate.position(now_ns) / head_speed).max(0.0);
                Goal::Follow { time, rate: (estimate.rate() / head_speed).max(0.0) }
            }
            (Following::Lost, _) => Goal::Stand(None),
            _ => Goal::None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench_dragon_show::scene::Scene;

    fn track() -> Track {
        Track::new(Scene::paper().ensemble.only().unwrap().clone(), 0.0, 2.0)
    }

    #[test]
    fn a_point_beside_the_path_is_projected_on_its_own_turn() {
        let track = track();
        let path = track.motion.path();
        let mut random = fastrand::Rng::with_seed(3);
        for _ in 0..2000 {
            let travelled = 400.0 * random.f64();
            let param = path.param_at(travelled);
            let (point, tangent) = (path.point(param), path.tangent(param));
            // More than half the distance of two turns: the whole path's nearest point is another.
            let across = 0.4 * (2.0 * random.f64() - 1.0);
            let beside = point + across * bench_dragon_motion::model::Vector::new(-tangent.y, tangent.x);
            let near = travelled + 2.0 * (2.0 * random.f64() - 1.0);
            let found = track.project(beside, near);
            assert!((found.travelled - travelled).abs() < 1e-6, "{found:?} for {travelled}");
            assert!((found.distance - across.abs()).abs() < 1e-9);
        }
    }

    #[test]
    fn a_dragon_with_a_delay_is_behind_the_show() {
        let mut track = Track::new(Scene::paper().ensemble.only().unwrap().clone(), 30.0, 2.0);
        let path = track.motion.path().clone();
        for k in 0..10u64 {
            let place = 100.0 + 0.1 * k as f64;
            track.read(path.point(path.param_at(place)), 5_000_000_000 + 100_000_000 * k, 130.0);
        }
        let Goal::Follow { time, .. } = track.goal(5_900_000_000) else { panic!("not locked") };
        assert!((time - 130.9).abs() < 0.05, "{time}");
    }

    #[test]
    fn noise_of_15_cm_and_dropouts_leave_less_than_8_cm() {
        let mut track = track();
        let mut random = fastrand::Rng::with_seed(4);
        let mut errors = Vec::new();
        for k in 0..3600u64 {
            let at_ns = 5_000_000_000 + k * 16_666_667;
            let place = 100.0 + 0.8 * k as f64 / 60.0;
            let path = track.motion.path();
            let point = path.point(path.param_at(place));
            let mut normal = || 0.15 * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0);
            let point = Point::new(point.x + normal(), point.y + normal());
            if k % 600 > 30 {
                track.read(point, at_ns, 100.0);
            }
            let Goal::Follow { time, .. } = track.goal(at_ns) else { continue };
            if k > 210 {
                errors.push((time - place).abs());
            }
        }
        errors.sort_by(f64::total_cmp);
        let p99 = errors[errors.len() * 99 / 100];
        println!("p99 {p99:.3} m of {}", errors.len());
        assert!(errors.len() > 3000 && p99 < 0.08, "{p99}");
    }

    #[test]
    fn a_performer_off_the_path_or_unseen_is_lost() {
        let mut track = track();
        assert_eq!(track.following(0), Following::Silent);
        track.read(Point::new(30.0, 0.0), 1_000_000_000, 0.0);
        assert_eq!((track.following(1_000_000_000), track.goal(1_000_000_000)), (Following::Lost, Goal::Stand(None)));
        for k in 0..4 {
            track.read(Point::new(8.8, 0.1), 1_000_000_000 + k, 0.0);
        }
        assert_eq!(track.following(1_100_000_000), Following::Locked);
        assert_eq!(track.following(2_900_000_000), Following::Freewheeling);
        assert_eq!(track.following(3_100_000_000), Following::Lost);
    }
}
