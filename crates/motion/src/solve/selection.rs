//! The selection of the table for a requested accuracy. Among the tables measured to meet the accuracy on this path
//! with this team, the selected table reads the fewest bytes per handle.
//!
//! In: the motion and the requested accuracy. Out: a table with its measured error. The same request gives the same
//! table in every run, because cost is counted in bytes, never timed.
//!
//! Every candidate starts from one table of T whose polynomials have an error of a sixteenth of the requested accuracy.
//! While a format is made, its loss is bounded over all phases. Then frames are compared with the safe solver's at test
//! points over the whole path, which include junctions, kinks and the last metres of the table: positions, and
//! velocities where they are computed. Half the requested accuracy is left for the error between the test points.

use std::time::{Duration, Instant};

use super::newton::Newton;
use super::table::{Allowed, FollowerTable, Instructions, Tolerance};
use super::{Chain, Solver, Velocities};
use crate::event::{Budget, Progress};
use crate::model::elementary::hypot;
use crate::model::path::Path;
use crate::model::team::Team;

/// The greatest numbers of test points: spread over the path, at each junction, where handles cross junctions, and
/// towards the table's end.
const SPREAD_TEST_POINTS: usize = 200;
const JUNCTION_TEST_POINTS: usize = 60;
const KINK_TEST_POINTS: usize = 300;
const LAST_TEST_POINTS: usize = 12;

/// Handles that the safe solver may solve for the comparison, about 0.1 s. Larger teams have fewer test points.
const MOST_HANDLES: usize = 500_000;

/// The least number of test points.
const FEWEST_TEST_POINTS: usize = 4;

/// The coarsest accuracy that is used as requested, in links. With a coarser one the live clearance would test dozens
/// of pairs per frame, which costs more than the frame saves.
const COARSEST: f64 = 1e-3;

/// Requested accuracies up to this, metres, get links to 1e-12 of their length.
pub const EXACT_LINKS: f64 = 1e-9;

/// Requested accuracies up to this, metres, get the most exact table: rounding along the chain is as large.
const FINEST: f64 = 2e-12;

/// The relative error of speeds if links are exact: both ends of a link agree to this.
const FINEST_SPEED: f64 = 1e-11;

/// Parts of the requested accuracy: for the polynomials of T, for the format, and for the measured sum of both.
const SHARE_OF_ROWS: f64 = 1.0 / 16.0;
const SHARE_OF_FORMAT: f64 = 3.0 / 8.0;
const SHARE_MEASURED: f64 = 0.5;

/// The promised error of a velocity, as a part of the handle's speed, for an error of one link in its position.
const SPEED_PER_LINK: f64 = 10.0;

/// Parts of the promised error of velocities: for the format, and for the measured sum with the polynomials' share. A
/// format loses up to its share at some phase, and [`SHARE_OF_ROWS`] is the polynomials'.
const SPEED_SHARE_OF_FORMAT: f64 = 0.8;
const SPEED_SHARE_MEASURED: f64 = 0.9;

/// Returns the metres by which links may be off, besides rounding, at a requested accuracy: twice the metres of a
/// handle.
pub fn link_tolerance(team: &Team, accuracy: f64) -> f64 {
    if accuracy > EXACT_LINKS { 2.0 * accuracy.min(COARSEST * team.shortest_link()) } else { 0.0 }
}

/// A table and its measured error.
pub struct Selection {
    /// The solver.
    pub table: FollowerTable,
    /// The requested accuracy, in metres, or a thousandth of the shortest link if that is less.
    pub accuracy: f64,
    /// The largest distance of a handle from the safe solver's, in metres.
    pub error: f64,
    /// The greatest measured error that is accepted, in metres: the share of the requested accuracy, or the rounding of
    /// doubles if that is more.
    pub allowed: f64,
    /// The greatest measured error of a velocity, as a part of the accepted error; 0 without velocities.
    pub speed_error: f64,
    /// The number of test points.
    pub test_points: usize,
    /// The time to make all candidates and to measure them.
    pub made_in: Duration,
}

impl Selection {
    /// Returns true if the measured errors meet the requested accuracy.
    pub fn meets(&self) -> bool {
        self.error <= self.allowed && self.speed_error <= 1.0
    }

    /// Returns true if rounding alone can exceed the requested accuracy at the handle with the largest relative error.
    pub fn is_at_the_floor(&self) -> bool {
        self.allowed > self.accuracy
    }
}

/// Returns the cheapest table for `accuracy` metres, or `None` if there is no table for this team and path, or none
/// that keeps the promise below. Returns `None` also if `progress`, whose share stays 0, stops the making.
///
/// Positions are within max(accuracy, 8 eps (r + distance travelled)), headings within 2 accuracy / link, and
/// velocities within 10 accuracy / link of a handle's speed. So extrapolation over a tenth of a link adds one accuracy.
pub fn cheapest(
    path: &Path,
    team: Team,
    head_speed: f64,
    velocities: Velocities,
    accuracy: f64,
    progress: Progress<'_>,
) -> Option<Selection> {
    let instructions = Instructions::fastest(team.handles());
    cheapest_with(path, team, head_speed, velocities, accuracy, instructions, progress)
}

/// Returns [`cheapest`] with other instructions; also `None` if this processor lacks them.
pub fn cheapest_with(
    path: &Path,
    team: Team,
    head_speed: f64,
    velocities: Velocities,
    accuracy: f64,
    instructions: Instructions,
    progress: Progress<'_>,
) -> Option<Selection> {
    let began = Instant::now();
    let budget = &mut Budget::new(u64::MAX, progress);
    let accuracy = accuracy.min(COARSEST * team.shortest_link());
    let make = |tolerance: Tolerance, budget: &mut Budget| {
        let table = FollowerTable::with_tolerance(path, team, head_speed, velocities, tolerance, budget)?;
        table.with_instructions(instructions)
    };
    let tolerance = tolerance(&team, accuracy);
    let rows = make(tolerance, budget)?;
    let measurement = ErrorMeasurement::new(path, team, head_speed, velocities, &rows, budget)?;
    let select = |table: FollowerTable, budget: &mut Budget| {
        let Measured { error, allowed, speed_error } = measurement.measure(&table, accuracy, budget)?;
        let (test_points, made_in) = (measurement.test_points.len(), began.elapsed());
        let table = table.promising(accuracy);
        Some(Selection { table, accuracy, error, allowed, speed_error, test_points, made_in })
    };
    if accuracy > EXACT_LINKS {
        let link = team.shortest_link();
        let speed = match velocities {
            Velocities::Computed => SPEED_SHARE_OF_FORMAT * SPEED_PER_LINK * accuracy / link,
            Velocities::Omitted => f64::INFINITY,
        };
        let allowed = Allowed { place: SHARE_OF_FORMAT * accuracy, heading: 1.5 * accuracy / link, speed };
        let packed = |format| select(rows.packed(format, allowed, budget)?, budget);
        if let Some(selection) = FollowerTable::formats().into_iter().filter_map(packed).find(Selection::meets) {
            return Some(selection);
        }
    }
    let mut selection = select(rows, budget)?;
    if !selection.meets() && tolerance != Tolerance::EXACT {
        selection = select(make(Tolerance::EXACT, budget)?, budget)?;
    }
    (selection.error <= selection.allowed.max(accuracy)).then_some(selection)
}

/// Returns the tolerance of a table's rows for a requested accuracy.
fn tolerance(team: &Team, accuracy: f64) -> Tolerance {
    let exact = Tolerance::EXACT;
    if accuracy <= FINEST {
        return exact;
    }
    let place = (SHARE_OF_ROWS * accuracy).max(exact.place);
    let speed = SPEED_PER_LINK * SHARE_OF_ROWS * accuracy / team.shortest_link();
    if accuracy <= EXACT_LINKS {
        Tolerance { place, speed: speed.clamp(exact.speed, FINEST_SPEED), ..exact }
    } else {
        Tolerance { place, relative: f64::INFINITY, speed: speed.max(exact.speed) }
    }
}

/// The safe solver's handles at the test points.
struct ErrorMeasurement {
    link: f64,
    head_speed: f64,
    velocities: Velocities,
    test_points: Vec<(f64, Chain)>,
}

/// The measured errors of a table: see [`Selection`].
struct Measured {
    error: f64,
    allowed: f64,
    speed_error: f64,
}

impl ErrorMeasurement {
    /// Returns `None` if the budget is spent.
    fn new(
        path: &Path,
        team: Team,
        head_speed: f64,
        velocities: Velocities,
        table: &FollowerTable,
        budget: &mut Budget,
    ) -> Option<Self> {
        let times = times(path, &team, head_speed, table.valid_until(), budget)?;
        let newton = Newton::new(path.clone(), team, head_speed, velocities);
        let solve = |times: &[f64], budget: &mut Budget| -> Option<Vec<(f64, Chain)>> {
            let mut test_points = Vec::with_capacity(times.len());
            for &time in times {
                budget.spend(team.handles() as u64).ok()?;
                let mut chain = Chain::new(team.handles());
                if newton.solve_at(head_speed * time, &mut chain).is_ok() {
                    test_points.push((time, chain));
                }
            }
            Some(test_points)
        };
        let (first, second) = times.split_at(times.len() / 2);
        let (first, second) = budget.both(|budget| solve(first, budget), |budget| solve(second, budget));
        let mut test_points = first?;
        test_points.extend(second?);
        Some(Self { link: team.shortest_link(), head_speed, velocities, test_points })
    }

    /// Returns the error and the allowed error, metres, of the handle with the largest ratio of the first to the
    /// second. Returns also the largest ratio for a velocity. Returns `None` if the budget is spent.
    fn measure(&self, table: &FollowerTable, accuracy: f64, budget: &mut Budget) -> Option<Measured> {
        let mut table = table.clone();
        let mut worst = Measured { error: 0.0, allowed: SHARE_MEASURED * accuracy, speed_error: 0.0 };
        for (time, safe) in &self.test_points {
            budget.spend(safe.handles() as u64).ok()?;
            let mut chain = Chain::new(safe.handles());
            if table.solve(*time, &mut chain).is_err() {
                return Some(Measured { error: f64::INFINITY, ..worst });
            }
            for handle in 0..safe.handles() {
                let (x, y) = (safe.x[handle], safe.y[handle]);
                let error = hypot(chain.x[handle] - x, chain.y[handle] - y);
                let floor = 8.0 * f64::EPSILON * (hypot(x, y) + self.head_speed * time);
                let allowed = (SHARE_MEASURED * accuracy).max(floor);
                if error.is_nan() || error * worst.allowed > worst.error * allowed {
                    (worst.error, worst.allowed) = (error, allowed);
                }
                if self.velocities == Velocities::Computed {
                    let accuracy = (SPEED_SHARE_MEASURED * accuracy).max(floor);
                    worst.speed_error = worst.speed_error.max(self.speed_error(&chain, safe, handle, accuracy));
                }
            }
        }
        Some(worst)
    }

    /// Returns the error of a handle's velocity, as a part of the error allowed where positions are within `accuracy`
    /// metres.
    fn speed_error(&self, chain: &Chain, safe: &Chain, handle: usize, accuracy: f64) -> f64 {
        let off = hypot(chain.vx[handle] - safe.vx[handle], chain.vy[handle] - safe.vy[handle]);
        let off = off.max((chain.speed[handle] - safe.speed[handle]).abs());
        let speed = safe.speed[handle].abs().max(self.head_speed);
        off * self.link / (SPEED_PER_LINK * accuracy * speed)
    }
}

/// Returns the times of the test points, seconds, all within the table; `None` if the budget is spent.
fn times(path: &Path, team: &Team, head_speed: f64, end: f64, budget: &mut Budget) -> Option<Vec<f64>> {
    let most = (MOST_HANDLES / team.handles()).max(FEWEST_TEST_POINTS);
    let spread = SPREAD_TEST_POINTS.min(most.div_ceil(2));
    let mut times: Vec<f64> = (0..spread).map(|k| end * k as f64 / spread as f64).collect();
    // Each leaves a quarter of the time that the one before left.
    let last = LAST_TEST_POINTS.min(most.div_ceil(2));
    times.extend((1..=last).map(|k| end * (1.0 - 0.25f64.powi(k as i32))));
    let (head, link) = (team.link(0), team.link(1));
    let crossings = path
        .junctions()
        .flat_map(|at| [-0.25 * link, 1e-3 * link, 0.5 * link, head, head + 0.4 * link].map(|by| at + by));
    let crossings: Vec<f64> =
        crossings.map(|metres| metres / head_speed).filter(|time| (0.0..end).contains(time)).collect();
    let wanted = JUNCTION_TEST_POINTS.min(most.div_ceil(4));
    let step = crossings.len().div_ceil(wanted).max(1);
    times.extend(crossings.into_iter().step_by(step));
    let kinks = FollowerTable::kinks(path, team, budget)?.into_iter().map(|metres| metres / head_speed);
    let kinks: Vec<f64> = kinks.filter(|time| (0.0..end).contains(time)).collect();
    let left = most.saturating_sub(times.len()).clamp(1, KINK_TEST_POINTS);
    let step = kinks.len().div_ceil(left).max(1);
    times.extend(kinks.into_iter().step_by(step));
    times.sort_by(f64::total_cmp);
    Some(times)
}
