//! The rules of a certificate of the least pitch: "The least pitch" and Lemma 8 of docs/proofs.md.

use super::boards::{Board, covers};
use super::chain::Chain;
use super::elementary;
use super::far;
use super::interval::{Interval, Vector};
use super::lines::ProvedPitch;
use super::path::{Place, Span};
use super::problem::{Checked, ensure, problem};
use super::scene::Scene;
use super::shown::At;
use super::steps::{Step, Steps};

/// Limit of pieces on which a distance is bounded for one lock. A certificate that the search has written needs some
/// hundred.
const MOST_PIECES: usize = 20_000;
/// A number above 3 pi / 2, in radians.
const THREE_QUARTERS: f64 = 4.712_388_980_384_7;

/// The consequences of the lines so far.
pub(super) struct Pitch {
    /// The radius that the head is to reach, in metres from the centre.
    radius: f64,
    /// The least pitch of the first interval, and the greatest of the last: with every pitch between, the head does not
    /// reach the radius.
    from: f64,
    blocked: f64,
    /// The required clearance of boards, in metres.
    clearance: f64,
    /// The pitch that is shown to be free.
    free: Option<Free>,
    /// Counts for the report.
    pub intervals: u64,
    pub links: u64,
}

/// A pitch with which Lemma 8 holds far out, and the steps from there.
struct Free {
    pitch: f64,
    /// The distance from the centre, in metres, from which on Lemma 8 holds.
    far: f64,
    scene: Scene,
    steps: Steps,
}

impl Pitch {
    /// Begins with the radius that is to be reached, the least pitch, and the clearance that boards must keep.
    ///
    /// # Errors
    /// A radius or pitch that is not positive, or a negative clearance.
    pub fn new(radius: f64, from: f64, clearance: f64) -> Checked<Self> {
        let is_positive = |number: f64| number.is_finite() && number > 0.0;
        ensure!(is_positive(radius) && is_positive(from), "the radius and the least pitch are not both positive");
        ensure!(clearance.is_finite() && clearance >= 0.0, "the clearance is {clearance:?} m, expected 0 or more");
        Ok(Self { radius, from, blocked: from, clearance, free: None, intervals: 0, links: 0 })
    }

    /// Returns the polar angle of the radius with all pitches from `from` to `to`.
    fn theta(&self, from: f64, to: f64) -> Interval {
        Interval::new(self.radius) / growth(from, to)
    }

    /// Checks that the interval from `from` to `to` follows the last one.
    fn next(&mut self, from: f64, to: f64) -> Checked {
        if self.free.is_some() || from != self.blocked || !(to > from && to.is_finite()) {
            return Err(problem!("the interval of pitches does not follow the one before"));
        }
        self.blocked = to;
        self.intervals += 1;
        Ok(())
    }

    /// Checks and adds an interval of pitches with which two boards overlap or are too near, the head at the angle
    /// `theta`. The first point is in both boards; with a second one, each is in one of them. Lengths are in units of a.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn add_overlap(
        &mut self,
        scene: &Scene,
        [from, to]: [f64; 2],
        theta: f64,
        [a, b]: [usize; 2],
        spans: &[Span],
        points: [[f64; 2]; 2],
    ) -> Checked {
        self.next(from, to)?;
        if b < 2 || a > b - 2 || b >= spans.len() {
            return Err(problem!("benches {a} and {b} share a handle, or are not both listed in order"));
        }
        ensure!(self.theta(from, to).is_at_most(&Interval::new(theta)), "the head may be inside the radius");
        let unit = growth(from, to);
        let [one, other] = points.map(|[x, y]| Vector::new(x, y));
        let clearance = Interval::new(self.clearance) / unit;
        if points[0] != points[1] && !one.minus(&other).norm().is_below(&clearance) {
            return Err(problem!("the two points may be as far apart as the clearance"));
        }
        let scene = scene.in_units(&unit);
        let head = Place(0, theta, 0.0);
        let chain = Chain::check(&scene, Span(head, head), spans)?;
        self.links += chain.products.len() as u64;
        for (bench, point) in [(a, one), (b, other)] {
            let (front, rear) = (&chain.capsules[bench], &chain.capsules[bench + 1]);
            let board = Board::new(front, rear, scene.team.size(bench));
            ensure!(covers(&board, &point), "the point may be outside bench {bench} (Lemma 5)");
        }
        Ok(())
    }

    /// Checks and adds an interval of pitches with which the head's link locks.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn add_lock(&mut self, scene: &Scene, from: f64, to: f64) -> Checked {
        self.next(from, to)?;
        let theta = self.theta(from, from).upper();
        let squared = (scene.team.link(0) / growth(to, to)).square();
        ensure!(Interval::new(1.0).is_below(&theta), "the radius is within the first radian");
        let mut pieces = vec![(0.0, THREE_QUARTERS)];
        for _ in 0..MOST_PIECES {
            let Some((first, last)) = pieces.pop() else { return Ok(()) };
            if is_nearer(&theta, (first, last), &squared) {
                continue;
            }
            let middle = first + (last - first) / 2.0;
            if middle <= first || middle >= last {
                break;
            }
            pieces.extend([(first, middle), (middle, last)]);
        }
        Err(problem!("the head's link may not lock"))
    }

    /// Checks Lemma 8 for a pitch and a radius `far`.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn add_far(&mut self, scene: &Scene, pitch: f64, far: f64) -> Checked {
        let is_positive = |number: f64| number.is_finite() && number > 0.0;
        if self.free.is_some() || !(is_positive(pitch) && is_positive(far)) {
            return Err(problem!("a second pitch, or a number that is not positive"));
        }
        let half = Interval::new(self.clearance) * Interval::new(0.5);
        ensure!(
            far::holds(&scene.team.grown(&half), pitch, &Interval::new(far)),
            "boards may touch or be too near further out than {far:?} m (Lemma 8)"
        );
        self.free = Some(Free { pitch, far, scene: scene.on_spiral(growth(pitch, pitch)), steps: Steps::far_out() });
        Ok(())
    }

    /// Checks and adds a step of the head on the spiral with the free pitch.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn add_step(&mut self, step: Step) -> Checked {
        let Some(free) = &mut self.free else { return Err(problem!("no pitch precedes it")) };
        let begin = step.head.0;
        let is_first = free.steps.end.is_none();
        free.steps.add(&free.scene, step)?;
        let radius = free.scene.path.spiral_radius(begin);
        if is_first && !radius.is_some_and(|radius| Interval::new(free.far).is_at_most(&radius)) {
            return Err(problem!("the first step begins where Lemma 8 does not hold"));
        }
        Ok(())
    }

    /// Returns the numbers of steps, links and pairs that were checked.
    pub fn counts(&self) -> (u64, u64, u64) {
        let of_steps =
            self.free.as_ref().map_or((0, 0, 0), |free| (free.steps.steps, free.steps.links, free.steps.pairs));
        (self.intervals + of_steps.0, self.links + of_steps.1, of_steps.2)
    }

    /// Checks the result.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn check(&self, outcome: &ProvedPitch) -> Checked {
        let ProvedPitch { radius, from, clearance, value_lo, value_hi } = *outcome;
        if radius != self.radius || from != self.from || clearance != self.clearance {
            return Err(problem!("the radius, the least pitch or the clearance is another"));
        }
        ensure!(
            value_lo.is_none_or(|value_lo| self.intervals > 0 && value_lo <= self.blocked),
            "value_lo does not follow"
        );
        let Some(value_hi) = value_hi else { return Ok(()) };
        let reached = self.free.as_ref().filter(|free| free.pitch == value_hi).is_some_and(|free| {
            let Steps { end, apart, .. } = &free.steps;
            let within = |metres: &Interval| metres.is_at_most(&Interval::new(radius));
            within(&Interval::new(free.far))
                || apart.all
                    && apart.least >= self.clearance
                    && end.map(At::Head) == apart.end
                    && end.and_then(|end| free.scene.path.spiral_radius(end)).is_some_and(|metres| within(&metres))
        });
        if reached { Ok(()) } else { Err(problem!("value_hi does not follow")) }
    }
}

/// Returns a = pitch / 2 pi of all pitches between two.
fn growth(from: f64, to: f64) -> Interval {
    Interval::new(from).hull(&Interval::new(to)) / elementary::turns(1.0)
}

/// Returns true if D(theta, theta + delta) is less than `squared` for all delta of a piece: Taylor's formula about its
/// middle.
fn is_nearer(theta: &Interval, (first, last): (f64, f64), squared: &Interval) -> bool {
    let middle = Interval::new(first + (last - first) / 2.0);
    let two = Interval::new(2.0);
    let (sine, cosine) = elementary::sin_cos(&middle);
    let rear = theta + middle;
    let both = theta * rear * two;
    let distance = theta.square() + rear.square() - both * cosine;
    let slope = (rear - theta * cosine) * two + both * sine;
    // D'' = 2 + 4 theta sin delta + 2 theta (theta + delta) cos delta.
    let most = two + theta * Interval::new(4.0) + theta * (theta + Interval::new(last)) * two;
    let half = (Interval::new(last) - middle).max(&(middle - Interval::new(first)));
    (distance + slope.abs() * half + most * half.square() * Interval::new(0.5)).is_below(squared)
}
