//! Selects the table for a requested accuracy: of those measured to meet it on this very path and team, the one that
//! reads the fewest bytes a handle.
//!
//! In: the motion and the requested accuracy. Out: a table with what was measured of it. The same request gives the
//! same table in every run: cost is counted in bytes, never timed. [`crate`] and `trade` call it.
//!
//! Every candidate starts from one table of T whose own polynomials are off by a sixteenth of the requested accuracy.
//! What a format loses of them is bounded over all phases while it is made; then frames are compared with the safe
//! solver's at moments over the whole way, junctions and the last metres of the table included. Half the requested
//! accuracy is left for what lies between these moments.

use std::time::{Duration, Instant};

use super::newton::Newton;
use super::table::{Allowed, EXACT_ACCURACY, FollowerTable, Instructions, Tolerance};
use super::{Chain, Solver, Velocities};
use crate::model::elementary::hypot;
use crate::model::path::Path;
use crate::model::team::Team;

/// Moments at which frames are compared, at most: spread over the way; at each junction; and towards the table's end.
const SPREAD_MOMENTS: usize = 200;
const JUNCTION_MOMENTS: usize = 60;
const LAST_MOMENTS: usize = 12;

/// Handles that the safe solver may solve for the comparison: some 0.1 s. Larger teams are compared at fewer moments.
const MOST_HANDLES: usize = 500_000;

/// Moments, at least.
const FEWEST_MOMENTS: usize = 4;

/// The coarsest accuracy that is used as requested, in links. Coarser ones would make the live clearance test dozens of
/// pairs a frame, which costs more than the frame itself can save.
const COARSEST: f64 = 1e-3;

/// Requested accuracies up to this, metres, get links to 1e-12 of their length.
pub const EXACT_LINKS: f64 = 1e-9;

/// Requested accuracies up to this, metres, get the most exact table: rounding along the chain is as much.
const FINEST: f64 = 2e-12;

/// What speeds may be off, relative to themselves, where links are exact: both ends of a link agree to so much.
const FINEST_SPEED: f64 = 1e-11;

/// Parts of the requested accuracy: for the polynomials of T, for the format, and what may be measured of both.
const SHARE_OF_ROWS: f64 = 1.0 / 16.0;
const SHARE_OF_FORMAT: f64 = 3.0 / 8.0;
const SHARE_MEASURED: f64 = 0.5;

/// Metres by which links may be off, besides rounding, at a requested accuracy: both ends may be off by as much.
pub fn link_tolerance(team: &Team, accuracy: f64) -> f64 {
    if accuracy > EXACT_LINKS { 2.0 * accuracy.min(COARSEST * team.shortest_link()) } else { 0.0 }
}

/// A table and what was measured of it.
pub struct Selection {
    /// The solver.
    pub table: FollowerTable,
    /// Metres: the requested accuracy, or a thousandth of the shortest link if that is less.
    pub accuracy: f64,
    /// Metres: the largest distance of a handle from the safe solver's.
    pub error: f64,
    /// Metres that the measured error may be: what the requested accuracy leaves, or what doubles allow where that is
    /// more.
    pub allowed: f64,
    /// Moments at which it was measured.
    pub moments: usize,
    /// How long it took to make, all that was tried included, and to measure.
    pub made_in: Duration,
}

impl Selection {
    /// Whether the measured error meets the requested accuracy.
    pub fn meets(&self) -> bool {
        self.error <= self.allowed
    }

    /// Whether rounding alone can exceed the requested accuracy where the error is the largest part of what is allowed.
    pub fn is_at_the_floor(&self) -> bool {
        self.allowed > self.accuracy
    }
}

/// The cheapest table for `accuracy` metres, or the most exact one where none is as exact; `None` where there is no
/// table for this team and path.
///
/// Positions are within max(accuracy, 8 eps (r + distance travelled)); headings within 2 accuracy / link; velocities
/// within 10 accuracy / link of a handle's speed, so that a tenth of a link's way further on they lead no farther
/// astray.
pub fn cheapest(path: &Path, team: Team, head_speed: f64, velocities: Velocities, accuracy: f64) -> Option<Selection> {
    cheapest_with(path, team, head_speed, velocities, accuracy, Instructions::fastest(team.handles()))
}

/// [`cheapest`] with other instructions; `None` too where this processor lacks them.
pub fn cheapest_with(
    path: &Path,
    team: Team,
    head_speed: f64,
    velocities: Velocities,
    accuracy: f64,
    instructions: Instructions,
) -> Option<Selection> {
    let began = Instant::now();
    let accuracy = accuracy.min(COARSEST * team.shortest_link());
    let make = |tolerance: Tolerance| {
        let table = FollowerTable::with_tolerance(path, team, head_speed, velocities, tolerance)?;
        table.with_instructions(instructions)
    };
    let tolerance = tolerance(&team, accuracy);
    let rows = make(tolerance)?;
    let measurement = ErrorMeasurement::new(path, team, head_speed, &rows);
    let select = |table: FollowerTable| {
        let (error, allowed) = measurement.error(&table, accuracy);
        let (moments, made_in) = (measurement.moments.len(), began.elapsed());
        Selection { table: table.promising(accuracy), accuracy, error, allowed, moments, made_in }
    };
    if accuracy > EXACT_LINKS {
        let link = team.shortest_link();
        let speed = match velocities {
            Velocities::Computed => 8.0 * accuracy / link,
            Velocities::Omitted => f64::INFINITY,
        };
        let allowed = Allowed { place: SHARE_OF_FORMAT * accuracy, heading: 1.5 * accuracy / link, speed };
        let packed = FollowerTable::formats().into_iter().filter_map(|format| rows.packed(format, allowed));
        if let Some(selection) = packed.map(select).find(Selection::meets) {
            return Some(selection);
        }
    }
    let selection = select(rows);
    let selection =
        if selection.meets() || tolerance == Tolerance::EXACT { selection } else { select(make(Tolerance::EXACT)?) };
    // One that is off by more than every table promises is no table.
    (selection.error <= selection.allowed.max(EXACT_ACCURACY)).then_some(selection)
}

/// How exact the rows of a table have to be for a requested accuracy.
fn tolerance(team: &Team, accuracy: f64) -> Tolerance {
    let exact = Tolerance::EXACT;
    if accuracy <= FINEST {
        return exact;
    }
    let place = (SHARE_OF_ROWS * accuracy).max(exact.place);
    let speed = 10.0 * SHARE_OF_ROWS * accuracy / team.shortest_link();
    if accuracy <= EXACT_LINKS {
        Tolerance { place, speed: speed.clamp(exact.speed, FINEST_SPEED), ..exact }
    } else {
        Tolerance { place, relative: f64::INFINITY, speed: speed.max(exact.speed) }
    }
}

/// Where the safe solver has the handles at some moments.
struct ErrorMeasurement {
    head_speed: f64,
    moments: Vec<Moment>,
}

struct Moment {
    time: f64,
    x: Vec<f64>,
    y: Vec<f64>,
}

impl ErrorMeasurement {
    fn new(path: &Path, team: Team, head_speed: f64, table: &FollowerTable) -> Self {
        let times = times(path, &team, head_speed, table.valid_until());
        let newton = Newton::new(path.clone(), team, head_speed, Velocities::Omitted);
        let solve = |times: &[f64]| -> Vec<Moment> {
            let mut chain = Chain::new(team.handles());
            let solved = times.iter().filter_map(|&time| {
                newton.solve_at(head_speed * time, &mut chain).ok()?;
                Some(Moment { time, x: chain.x.clone(), y: chain.y.clone() })
            });
            solved.collect()
        };
        let (first, second) = times.split_at(times.len() / 2);
        let moments = std::thread::scope(|scope| {
            let second = scope.spawn(|| solve(second));
            let mut moments = solve(first);
            moments.extend(second.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
            moments
        });
        Self { head_speed, moments }
    }

    /// The largest error, and what is allowed where it is largest as a part of that, metres.
    fn error(&self, table: &FollowerTable, accuracy: f64) -> (f64, f64) {
        let mut table = table.clone();
        let mut worst = (0.0, SHARE_MEASURED * accuracy);
        for Moment { time, x, y } in &self.moments {
            let mut chain = Chain::new(x.len());
            if table.solve(*time, &mut chain).is_err() {
                return (f64::INFINITY, worst.1);
            }
            for (handle, (x, y)) in x.iter().zip(y).enumerate() {
                let error = hypot(chain.x[handle] - x, chain.y[handle] - y);
                let floor = 8.0 * f64::EPSILON * (hypot(*x, *y) + self.head_speed * time);
                let allowed = (SHARE_MEASURED * accuracy).max(floor);
                if error.is_nan() || error * worst.1 > worst.0 * allowed {
                    worst = (error, allowed);
                }
            }
        }
        worst
    }
}

/// The times at which frames are compared, seconds, all within the table.
fn times(path: &Path, team: &Team, head_speed: f64, end: f64) -> Vec<f64> {
    let most = (MOST_HANDLES / team.handles()).max(FEWEST_MOMENTS);
    let spread = SPREAD_MOMENTS.min(most.div_ceil(2));
    let mut times: Vec<f64> = (0..spread).map(|k| end * k as f64 / spread as f64).collect();
    // Each a quarter of the way that was left before.
    let last = LAST_MOMENTS.min(most.div_ceil(2));
    times.extend((1..=last).map(|k| end * (1.0 - 0.25f64.powi(k as i32))));
    let (head, link) = (team.link(0), team.link(1));
    let crossings = path
        .junctions()
        .flat_map(|at| [-0.25 * link, 1e-3 * link, 0.5 * link, head, head + 0.4 * link].map(|by| at + by));
    let crossings: Vec<f64> =
        crossings.map(|metres| metres / head_speed).filter(|time| (0.0..end).contains(time)).collect();
    let wanted = JUNCTION_MOMENTS.min(most.div_ceil(4));
    let step = crossings.len().div_ceil(wanted).max(1);
    times.extend(crossings.into_iter().step_by(step));
    times.sort_by(f64::total_cmp);
    times
}
