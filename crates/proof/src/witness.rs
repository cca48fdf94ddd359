//! Boards that touch, or that are no further apart than some metres: two of one dragon, one of each of two, or one and
//! an obstacle. Lemmas 5, 6, 9, 11 and 12 of docs/proofs.md.

use serde::Deserialize;

use super::boards::{Board, covers};
use super::first_order_board::FirstOrderBoard;
use super::ground::Obstacle;
use super::interval::{Interval, Vector};
use super::path::{Place, Span};
use super::problem::{Checked, Problem, ensure, problem};
use super::shown::At;

/// A board and another thing that it touches or is near.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Whom {
    /// Two boards of the dragon.
    Own([usize; 2]),
    /// A board of each of two dragons.
    Dragon([usize; 2]),
    /// A board and an obstacle.
    Obstacle { number: usize, bench: usize },
}

/// The fact that a witness shows of a board and another thing.
pub(super) enum Evidence {
    /// They have this point in common.
    Point(Vector),
    /// They are no further apart than these metres, by a place of each handle of each dragon.
    Most(Interval, Vec<Vec<Place>>),
}

/// A line that boards touch, or are no further apart than some metres. Each list has an entry for the dragon of the
/// section, or for the two.
#[derive(Deserialize)]
#[serde(try_from = "Written")]
pub(super) struct WitnessLine {
    pub whom: Whom,
    /// The time of the show in seconds, in a section of two.
    pub time: Option<f64>,
    heads: Vec<Span>,
    spans: Vec<Vec<Span>>,
    pub evidence: Evidence,
}

/// The line as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    #[serde(default)]
    obstacle: Option<usize>,
    benches: Vec<usize>,
    #[serde(default)]
    time: Option<f64>,
    heads: Vec<Span>,
    spans: Vec<Vec<Span>>,
    #[serde(default)]
    at: Vec<Vec<Place>>,
    #[serde(default)]
    point: Option<[f64; 2]>,
    #[serde(default)]
    most: Option<f64>,
}

impl TryFrom<Written> for WitnessLine {
    type Error = Problem;

    fn try_from(Written { obstacle, benches, time, heads, spans, at, point, most }: Written) -> Checked<Self> {
        let whom = match (obstacle, &benches[..], time) {
            (None, &[a, b], None) => Whom::Own([a, b]),
            (None, &[a, b], Some(_)) => Whom::Dragon([a, b]),
            (Some(number), &[bench], None) => Whom::Obstacle { number, bench },
            _ => return Err(problem!("expected two `benches`, or one and an `obstacle` of one dragon")),
        };
        let dragons = if time.is_some() { 2 } else { 1 };
        ensure!(heads.len() == dragons && spans.len() == dragons, "expected `heads` and `spans` of {dragons}");
        let evidence = match (point, most) {
            (Some([x, y]), None) if at.is_empty() => Evidence::Point(Vector::new(x, y)),
            (None, Some(most)) if at.len() == dragons => Evidence::Most(Interval::new(most), at),
            _ => return Err(problem!("expected either `point`, or `most` and the places `at` of {dragons}")),
        };
        Ok(Self { whom, time, heads, spans, evidence })
    }
}

impl WitnessLine {
    /// Returns the spans of the heads of the dragons of a section, and those of their handles.
    ///
    /// # Errors
    /// The line is about more or fewer.
    pub fn spans<const DRAGONS: usize>(&self) -> Checked<([Span; DRAGONS], [&[Span]; DRAGONS])> {
        ensure!(self.heads.len() == DRAGONS, "a witness with a time belongs to the section of two dragons, only");
        Ok((std::array::from_fn(|k| self.heads[k]), std::array::from_fn(|k| self.spans[k].as_slice())))
    }
}

impl Whom {
    /// Returns the number of the obstacle.
    pub fn obstacle(self) -> Option<usize> {
        if let Self::Obstacle { number, .. } = self { Some(number) } else { None }
    }

    /// Returns the benches of the boards.
    pub fn benches(self) -> [Option<usize>; 2] {
        match self {
            Self::Own(benches) | Self::Dragon(benches) => benches.map(Some),
            Self::Obstacle { bench, .. } => [Some(bench), None],
        }
    }

    /// Checks that the boards are listed and share no handle, and that there is such an obstacle. `spans` are those of
    /// each dragon.
    ///
    /// # Errors
    /// The condition that does not hold.
    pub fn check(self, obstacles: &[Obstacle], spans: &[&[Span]]) -> Checked {
        let is_listed = |k: usize, bench: usize| spans.get(k).is_some_and(|spans| bench < spans.len());
        match self {
            Self::Own([a, b]) => ensure!(
                a.abs_diff(b) >= 2 && is_listed(0, a) && is_listed(0, b),
                "benches {a} and {b} share a handle, or are not both listed"
            ),
            Self::Dragon([a, b]) => {
                ensure!(is_listed(0, a) && is_listed(1, b), "bench {a} or {b} of the two is not listed");
            }
            Self::Obstacle { number, bench } => {
                ensure!(number < obstacles.len(), "the scene has no obstacle {number}");
                ensure!(is_listed(0, bench), "bench {bench} is not listed");
            }
        }
        Ok(())
    }

    /// Checks that the two have a point in common. `board` returns a dragon's board.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn check_touch<'b>(
        self,
        board: impl Fn(usize, usize) -> Board<'b>,
        obstacles: &[Obstacle],
        point: &Vector,
    ) -> Checked {
        let boards = match self {
            Self::Own([a, b]) => [(0, a), (0, b)],
            Self::Dragon([a, b]) => [(0, a), (1, b)],
            Self::Obstacle { number, bench } => {
                ensure!(
                    obstacles[number].is_reached_by(&board(0, bench), point),
                    "bench {bench} may be clear of obstacle {number} (Lemma 9)"
                );
                return Ok(());
            }
        };
        for (k, bench) in boards {
            ensure!(covers(&board(k, bench), point), "the point may be outside bench {bench} (Lemma 5)");
        }
        Ok(())
    }

    /// Checks that the two are no further apart than some metres. `board` returns a dragon's board.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn check_near(
        self,
        board: impl Fn(usize, usize) -> FirstOrderBoard,
        obstacles: &[Obstacle],
        most: &Interval,
    ) -> Checked {
        let clearance = match self {
            Self::Own([a, b]) => {
                ensure!(a < b, "benches {a} and {b} are not in order");
                board(0, a).at_most(&board(0, b))
            }
            Self::Dragon([a, b]) => board(0, a).at_most(&board(1, b)),
            Self::Obstacle { number, bench } => obstacles[number].at_most(&board(0, bench)),
        };
        ensure!(clearance.is_at_most(most), "the boards may be further apart than it says (Lemmas 6 and 11)");
        Ok(())
    }
}

/// Benches with which an event has happened, or which are near each other or near an obstacle.
#[derive(Clone, Copy)]
pub(super) struct Witness {
    /// The bench of a link or at an obstacle, or the two.
    pub benches: [Option<usize>; 2],
    /// The clearance is no more than these metres.
    pub most: Interval,
    /// A moment at which this holds, or one before it. A place before the start means the start.
    pub at: At,
}

impl Witness {
    /// Returns the witness of an event: boards that overlap or have come to an obstacle, or a link.
    pub fn of_event(benches: [Option<usize>; 2], at: At) -> Self {
        Self { benches, most: Interval::new(0.0), at }
    }
}

/// The witnesses of a section.
#[derive(Default)]
pub(super) struct Witnesses {
    /// Boards that overlap or have come to an obstacle, at most one for each number.
    touched: Vec<(Option<usize>, Witness)>,
    /// Boards that are near each other or an obstacle, likewise.
    near: Vec<(Option<usize>, Witness)>,
}

impl Witnesses {
    /// Adds boards that touch, or that are no further apart than `most`.
    ///
    /// # Errors
    /// A witness of the same kind precedes.
    pub fn add(&mut self, whom: Whom, most: Option<Interval>, at: At) -> Checked {
        let witness = Witness { most: most.unwrap_or(Interval::new(0.0)), ..Witness::of_event(whom.benches(), at) };
        let earlier = if most.is_some() { &mut self.near } else { &mut self.touched };
        ensure!(
            earlier.iter().all(|(other, _)| *other != whom.obstacle()),
            "a second line about two boards, or about the same obstacle"
        );
        earlier.push((whom.obstacle(), witness));
        Ok(())
    }

    /// Returns the boards that touch, or the board at an obstacle.
    pub fn touched(&self, obstacle: Option<usize>) -> Option<Witness> {
        found(&self.touched, obstacle)
    }

    /// Returns the boards that are near, or the board near an obstacle.
    pub fn near(&self, obstacle: Option<usize>) -> Option<Witness> {
        found(&self.near, obstacle)
    }
}

fn found(witnesses: &[(Option<usize>, Witness)], obstacle: Option<usize>) -> Option<Witness> {
    witnesses.iter().find(|(other, _)| *other == obstacle).map(|(_, witness)| *witness)
}
