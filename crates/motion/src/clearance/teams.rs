//! The boards of a frame: which handles are whose, and which pairs of boards count.
//!
//! Benches and handles are numbered through all dragons, so the number of a dragon's last handle is no bench. A pair
//! (a, b) counts if b is at least [`Teams::first_partner`] of a.

use super::{circle_radius, corner_reach};
use crate::model::Point;
use crate::model::board::Board;
use crate::model::team::Team;
use crate::solve::Positions;

/// The pairs of boards of which the nearest is sought.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pairs {
    /// Boards that share no handle, of one dragon.
    Own,
    /// Boards of two dragons.
    Between,
}

/// The dragons of a frame.
#[derive(Debug, Clone)]
pub(super) struct Teams {
    pairs: Pairs,
    /// By dragon: the team, and the number of its first handle.
    parts: Vec<(Team, usize)>,
    /// The hole inset and the width of all boards, if they are alike, in metres.
    alike: Option<(f64, f64)>,
    /// The number of all handles.
    pub handles: usize,
    /// The radius of the circle about the largest board, the greatest displacement of a board's points per metre of
    /// displacement of its handles, and the longest link, in metres.
    pub radius: f64,
    pub reach: f64,
    pub longest_link: f64,
}

impl Teams {
    pub(super) fn new(teams: &[Team], pairs: Pairs) -> Self {
        let mut handles = 0;
        let mut part = |team: &Team| {
            handles += team.handles();
            (*team, handles - team.handles())
        };
        let parts: Vec<_> = teams.iter().map(&mut part).collect();
        let mut sizes =
            teams.iter().flat_map(|team| team.kinds().map(|bench| (team.hole_inset, team.board_width(bench))));
        let first = sizes.next();
        let alike = first.filter(|first| sizes.all(|size| size == *first));
        let most = |of: &dyn Fn(&Team) -> f64| teams.iter().map(of).fold(0.0, f64::max);
        Self {
            pairs,
            parts,
            alike,
            handles,
            radius: most(&|team| most_of(team, circle_radius)),
            reach: most(&|team| most_of(team, corner_reach)),
            longest_link: most(&Team::longest_link),
        }
    }

    fn part(&self, number: usize) -> usize {
        match &self.parts[..] {
            [_] => 0,
            parts => parts.partition_point(|(_, first)| *first <= number) - 1,
        }
    }

    /// Returns the hole inset and the width of the board of a bench, in metres.
    pub(super) fn inset_and_width(&self, bench: usize) -> (f64, f64) {
        self.alike.unwrap_or_else(|| {
            let (team, first) = &self.parts[self.part(bench)];
            (team.hole_inset, team.board_width(bench - first))
        })
    }

    /// Returns the numbers of all benches.
    pub(super) fn benches(&self) -> impl Iterator<Item = usize> {
        self.parts.iter().flat_map(|(team, first)| *first..first + team.benches)
    }

    /// Returns the first number behind a bench whose boards make pairs with it that count.
    pub(super) fn first_partner(&self, bench: usize) -> usize {
        match self.pairs {
            Pairs::Own => bench + 2,
            Pairs::Between => self.parts.get(self.part(bench) + 1).map_or(self.handles, |(_, first)| *first),
        }
    }

    /// Returns the benches that make pairs with a bench that count.
    pub(super) fn partners(&self, bench: usize) -> impl Iterator<Item = usize> {
        let first = self.first_partner(bench);
        self.benches().filter(move |other| *other >= first)
    }

    /// Returns a pair that counts.
    pub(super) fn some_pair(&self) -> Option<(usize, usize)> {
        Some((0, self.partners(0).next()?))
    }

    pub(super) fn board(&self, chain: Positions, number: usize) -> Board {
        let (hole_inset, width) = self.inset_and_width(number);
        let handle = |k: usize| Point::new(chain.x[k], chain.y[k]);
        Board::from_handles(handle(number), handle(number + 1), hole_inset, width)
    }
}

/// Returns the most that a quantity is for any bench of a team.
fn most_of(team: &Team, of_bench: fn(&Team, usize) -> f64) -> f64 {
    team.kinds().map(|bench| of_bench(team, bench)).into_iter().fold(0.0, f64::max)
}
