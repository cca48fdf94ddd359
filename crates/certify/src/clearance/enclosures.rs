//! The hints that a search for the least clearances takes, and the enclosures that it returns.

use bench_dragon_motion::contact::LeastClearance;
use bench_dragon_motion::timeline::TimedObstacleClearance;

/// An enclosure of the least clearance of a show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClearanceEnclosure {
    /// The lower bound in metres, for all boards that share no handle, from the start up to `until`.
    pub lo: f64,
    /// The upper bound in metres: two boards are as near at one place of the show.
    pub hi: f64,
    /// The travel of the head at that place in metres, approximate.
    pub travelled: f64,
    /// The bench of the two that is nearer the head, counted from 0.
    pub bench_a: usize,
    /// The other bench.
    pub bench_b: usize,
    /// The travel in metres up to which `lo` is proved, if not up to the show's end.
    pub until: Option<f64>,
    /// The number of steps tried.
    pub steps: u64,
}

/// An enclosure of the least clearance of an obstacle over a show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObstacleEnclosure {
    /// The obstacle's number on the stage, the boundary last.
    pub obstacle: usize,
    /// The lower bound in metres, for all boards, from the start up to `until`.
    pub lo: f64,
    /// The upper bound in metres: the bench's clearance is no more at one place of the show.
    pub hi: f64,
    /// The travel of the head at that place in metres, approximate.
    pub travelled: f64,
    /// The bench, counted from 0.
    pub bench: usize,
    /// The travel in metres up to which `lo` is proved, if not up to the show's end.
    pub until: Option<f64>,
}

/// The least clearances that the ordinary search has found. They only suggest where to search.
#[derive(Debug, Clone, Copy)]
pub struct ClearanceHints<'h> {
    /// The least clearance of two boards; `None` to enclose only the clearances of the obstacles.
    pub boards: Option<&'h LeastClearance>,
    /// The least clearance of each obstacle.
    pub obstacles: &'h [TimedObstacleClearance],
}

/// The enclosures of a show.
#[derive(Debug, Clone, PartialEq)]
pub struct ClearanceEnclosures {
    /// The enclosure of two boards; `None` if not even the hint can be shown.
    pub boards: Option<ClearanceEnclosure>,
    /// The enclosure of each obstacle; `None` if nothing of it can be shown.
    pub obstacles: Vec<Option<ObstacleEnclosure>>,
}
