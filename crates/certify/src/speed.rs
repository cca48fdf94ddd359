//! Enclosure of the greatest ratio of a handle's speed to the head's, by branch and bound over the head's travel. See
//! "Lemma 7" in `docs/proofs.md`.
//!
//! In: a scene's motion, and the end of the travel. Out: two numbers that enclose the greatest ratio. The proof does
//! not depend on a solver or on samples.

mod certificate;
mod step;

use std::cmp::Ordering;
use std::collections::BinaryHeap;

pub use self::certificate::certify_greatest_ratio;
use self::step::{Bounds, Speeds};
use super::grid::{GridPoint, place};
use super::interval::Interval;
use super::path::ExactPath;
use super::place::Place;
use super::step::Chain;
use bench_dragon_motion::Motion;
use bench_dragon_motion::event::Progress;

/// The distance that doubles can resolve, as a share of the path length in metres.
const LEAST: f64 = 1e-14;

/// The default limit of handles to enclose: half a minute to a minute.
pub const MOST_HANDLES: u64 = 8_000_000;

/// The greatest ratio of a handle's speed to the head's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GreatestRatio {
    /// Lower bound: the ratio of `handle` at `travelled`.
    pub lo: f64,
    /// The upper bound for all handles; infinite if the search was given up before it had a bound.
    pub hi: f64,
    /// The handle, counted from 0.
    pub handle: usize,
    /// The travel of the head at which the handle has at least the ratio `lo`, in metres.
    pub travelled: f64,
    /// Approximate ratio of the handle there, inside its enclosure.
    pub ratio: f64,
    /// True if `hi` is within the tolerance of `lo`.
    pub proved: bool,
    /// The number of steps of the head that were enclosed.
    pub steps: u64,
}

/// A part of the head's travel, in metres.
pub(crate) type Stretch = (f64, f64);

impl GreatestRatio {
    /// Returns a lower and an upper bound of a positive number divided by the ratio.
    pub fn divide(&self, number: f64) -> (f64, f64) {
        if self.hi == 1.0 {
            return (number, number);
        }
        let quotient = Interval::point(number).over(Interval { lo: self.lo, hi: self.hi });
        (quotient.lo.max(0.0), quotient.hi.min(number))
    }
}

/// A step of the head that may hold a greater ratio.
struct OpenStep {
    upper: f64,
    from: f64,
    to: f64,
}

impl PartialEq for OpenStep {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for OpenStep {}

impl PartialOrd for OpenStep {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for OpenStep {
    fn cmp(&self, other: &Self) -> Ordering {
        self.upper.total_cmp(&other.upper).then(other.from.total_cmp(&self.from))
    }
}

/// Encloses the greatest ratio of a handle's speed to the head's over the first `travelled` metres of the head, to a
/// share of `tolerance`. `progress` receives the share of the work that is done, from 0 to 1.
pub fn greatest_ratio(motion: &Motion, travelled: f64, tolerance: f64, progress: Progress<'_>) -> GreatestRatio {
    RatioSearch::new(motion, travelled, MOST_HANDLES).run(tolerance, None, progress)
}

struct RatioSearch<'a> {
    speeds: Speeds<'a>,
    end: f64,
    most_handles: u64,
    /// The distance that doubles can resolve, in metres.
    least: f64,
}

impl<'a> RatioSearch<'a> {
    fn new(motion: &'a Motion, travelled: f64, most_handles: u64) -> Self {
        let exact = ExactPath::new(motion.description());
        let speeds = Speeds { chain: Chain::new(motion.path(), exact, motion.team()) };
        Self { speeds, end: travelled, most_handles, least: LEAST * (1.0 + motion.path().length()) }
    }

    /// Encloses the greatest ratio. `steps` receives the steps that show the upper bound, in any order.
    fn run(&self, tolerance: f64, mut steps: Option<&mut Vec<Stretch>>, progress: Progress<'_>) -> GreatestRatio {
        // The ratio of the head itself.
        let mut best =
            GreatestRatio { lo: 1.0, hi: 1.0, handle: 0, travelled: 0.0, ratio: 1.0, proved: false, steps: 0 };
        let exact = &self.speeds.chain.exact;
        let from = self.beyond(0.0, -1.0, |place| exact.travelled(place).hi <= 0.0);
        let to = self.beyond(self.end, 1.0, |place| exact.travelled(place).lo >= self.end);
        let Some((from, to)) = from.zip(to) else { return GreatestRatio { hi: f64::INFINITY, ..best } };
        let mut open = BinaryHeap::from([OpenStep { upper: f64::INFINITY, from, to }]);
        let (mut settled, mut handles) = (1.0f64, 0);
        let enough = |best: &GreatestRatio, upper: f64| upper <= best.lo * (1.0 + tolerance);
        let mut is_stopped = false;
        while let Some(OpenStep { upper, from, to }) = open.pop() {
            let middle = 0.5 * from + 0.5 * to;
            let done = enough(&best, upper);
            if done || is_stopped || handles > self.most_handles || to - from < self.least {
                if let Some(steps) = steps.take() {
                    steps.push((from, to));
                    steps.extend(open.drain().map(|step| (step.from, step.to)));
                }
                return GreatestRatio { hi: upper.max(settled), proved: done, ..best };
            }
            for (from, to) in [(from, middle), (middle, to)] {
                let bounds = self.bounds(from, to);
                best.steps += 1;
                handles += bounds.as_ref().map_or(1, |bounds| bounds.handles);
                let travelled = 0.5 * from + 0.5 * to;
                if let Some(Bounds { fastest, speed, .. }) = bounds
                    && speed.lo > best.lo
                    && (self.least..=self.end - self.least).contains(&travelled)
                {
                    best = GreatestRatio { lo: speed.lo, ratio: speed.middle(), handle: fastest, travelled, ..best };
                }
                let upper = bounds.map_or(f64::INFINITY, |bounds| bounds.upper);
                if enough(&best, upper) {
                    settled = settled.max(upper);
                    steps.iter_mut().for_each(|steps| steps.push((from, to)));
                } else {
                    open.push(OpenStep { upper, from, to });
                }
            }
            let wide = (open.peek().map_or(settled, |step| step.upper) / best.lo - 1.0).max(tolerance);
            is_stopped = progress((wide.ln() / tolerance.ln()).clamp(0.0, 1.0)).is_break();
        }
        GreatestRatio { hi: settled, proved: true, ..best }
    }

    /// Returns a travel a little to one side whose place is proved to be beyond.
    fn beyond(&self, travelled: f64, side: f64, is_beyond: impl Fn(Place) -> bool) -> Option<f64> {
        let mut others = (0..40).map(|power| travelled + side * self.least * 2f64.powi(power));
        others.find(|other| is_beyond(self.grid_point(*other).head))
    }

    fn bounds(&self, from: f64, to: f64) -> Option<Bounds> {
        let [mut from, mut middle, mut to] =
            [from, 0.5 * from + 0.5 * to, to].map(|travelled| self.grid_point(travelled));
        self.speeds.over(&mut from, &mut middle, &mut to)
    }

    fn grid_point(&self, travelled: f64) -> GridPoint {
        let Chain { path, exact, .. } = &self.speeds.chain;
        if travelled <= self.end {
            return GridPoint::new(path, exact, travelled);
        }
        GridPoint::at(exact.moved(place(path.param_at(self.end)), travelled - self.end, false), travelled)
    }
}
