//! The least clearance over all pairs of boards that share no handle.
//!
//! The show asks for it once a frame, if the scene has alerts.

use crate::chain::{Chain, Team};
use crate::geometry::rectangle::Board;
use crate::geometry::separation::clearance_board_board;
use crate::geometry::{Point, Vector};

/// The clearance of one pair of boards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairClearance {
    /// Metres, with the sign convention of [`crate::geometry::separation`].
    pub value: f64,
    /// The bench nearer the head.
    pub bench_a: usize,
    /// The other bench.
    pub bench_b: usize,
    /// The nearest point of the first board.
    pub point_a: Point,
    /// The nearest point of the second board.
    pub point_b: Point,
}

/// Finds the least clearance of each frame, allocating nothing.
#[derive(Debug, Clone)]
pub struct ClearanceMonitor {
    team: Team,
    boards: Vec<Board>,
    latest: Option<PairClearance>,
}

impl ClearanceMonitor {
    /// A monitor for a team on a spiral of `pitch` metres per turn.
    pub fn new(team: Team, _pitch: f64) -> Self {
        Self { team, boards: Vec::with_capacity(team.benches), latest: None }
    }

    /// The clearance of the latest frame.
    pub fn latest(&self) -> Option<PairClearance> {
        self.latest
    }

    /// The least clearance of a chain, or `None` under three benches.
    pub fn least_clearance(&mut self, chain: &Chain) -> Option<PairClearance> {
        let Self { team, boards, latest } = self;
        boards.clear();
        boards.extend((0..team.benches).map(|bench| {
            let (sine, cosine) = chain.heading[bench].sin_cos();
            let front = Point::new(chain.x[bench], chain.y[bench]);
            Board::from_front(front, Vector::new(cosine, sine), team.link(bench), team.hole_inset, team.width)
        }));
        *latest = None;
        let mut least = f64::INFINITY;
        for (a, one) in boards.iter().enumerate() {
            for (b, other) in boards.iter().enumerate().skip(a + 2) {
                if one.least_distance(other) < least {
                    let clearance = clearance_board_board(one, other);
                    if clearance.value < least {
                        least = clearance.value;
                        let (point_a, point_b) = (clearance.point_a, clearance.point_b);
                        *latest =
                            Some(PairClearance { value: clearance.value, bench_a: a, bench_b: b, point_a, point_b });
                    }
                }
            }
        }
        *latest
    }
}
