//! The dragons of a scene in play: one chain with all handles, and the nearest two boards of all dragons.
//!
//! In: the scene and a time of the show. Out: the chain on the stage, with the handles of all dragons one after the
//! other, and its clearance.

use std::ops::Range;

use crate::dancer::{Closest, Dancer};
use crate::scene::Scene;
use bench_dragon_motion::Choice;
use bench_dragon_motion::clearance::{ClearanceMonitor, PairClearance};
use bench_dragon_motion::ensemble::Dragon;
use bench_dragon_motion::linkage::NoFollower;
use bench_dragon_motion::solve::{Chain, ChainMut, Solver};

/// A dragon in play, at its place in the show.
struct Member {
    dragon: Dragon,
    dancer: Dancer,
    handles: Range<usize>,
    /// The nearest of its boards, by the numbers of the show.
    closest: Closest,
}

/// All dragons of a show in play.
pub(crate) struct Dancers {
    members: Vec<Member>,
    between: Option<ClearanceMonitor>,
}

impl Dancers {
    pub(crate) fn new(scene: &Scene) -> Self {
        let ensemble = &scene.ensemble;
        let choices: Vec<Choice> =
            ensemble.dragons().iter().map(|dragon| Dancer::choice(scene, &dragon.motion)).collect();
        let between = scene.alerts.and_then(|_| ensemble.between_monitor(&choices));
        let member = |((k, dragon), choice): ((usize, &Dragon), Choice)| Member {
            dancer: Dancer::new(scene, &dragon.motion, choice),
            handles: ensemble.handles_of(k),
            closest: Closest { boards: None, any: None },
            dragon: dragon.clone(),
        };
        let members: Vec<Member> = ensemble.dragons().iter().enumerate().zip(choices).map(member).collect();
        Self { members, between }
    }

    /// Returns the names of the solvers and the reasons for their choice.
    pub(crate) fn reason(&self) -> String {
        let reason = |Member { dragon, dancer, .. }: &Member| match dragon.name.as_str() {
            "" => dancer.reason.clone(),
            name => format!("of {name}: {}", dancer.reason),
        };
        self.members.iter().map(reason).collect::<Vec<_>>().join("; ")
    }

    /// Returns the greatest error of a clearance, in metres.
    pub(crate) fn clearance_error(&self) -> f64 {
        self.members.iter().map(|member| member.dancer.clearance_error).fold(0.0, f64::max)
    }

    /// Returns the longest link of any dragon, in metres.
    pub(crate) fn longest_link(&self) -> f64 {
        self.members.iter().map(|member| member.dragon.motion.team().longest_link()).fold(0.0, f64::max)
    }

    /// Returns the pairs of boards tested so far.
    pub(crate) fn pairs_tested(&self) -> u64 {
        let between = self.between.as_ref().map_or(0, |monitor| monitor.counters().pairs);
        self.members.iter().map(|member| member.dancer.pairs_tested()).sum::<u64>() + between
    }

    /// Fills `chain` with all dragons at a time of the show. `moves` is false while the show stands still.
    pub(crate) fn solve(&mut self, show_time: f64, moves: bool, chain: &mut Chain) -> Result<Closest, NoFollower> {
        let all_handles = chain.handles();
        let mut all = chain.all_mut();
        for member in &mut self.members {
            member.solve(show_time, moves, all_handles, &mut all)?;
        }
        let Self { members, between } = self;
        let own = nearest(members.iter().filter_map(|member| member.closest.boards.as_ref())).copied();
        let limit = own.map_or(f64::INFINITY, |own| own.value);
        let between =
            between.as_mut().and_then(|monitor| monitor.nearest(&*chain, show_time, limit, &mut AllOf(members)).boards);
        let boards = nearest(own.iter().chain(&between));
        let any = members.iter().filter_map(|member| member.closest.any.as_ref());
        let any = nearest(boards.into_iter().chain(any));
        Ok(Closest { boards: boards.copied(), any: any.copied() })
    }
}

/// Returns the nearest of some pairs, the first of equals.
fn nearest<'a>(pairs: impl Iterator<Item = &'a PairClearance>) -> Option<&'a PairClearance> {
    pairs.reduce(|nearest, pair| if pair.value < nearest.value { pair } else { nearest })
}

/// The positions of all dragons on the stage at a later time of the show.
struct AllOf<'a>(&'a mut [Member]);

impl Solver for AllOf<'_> {
    fn name(&self) -> &'static str {
        "all dragons"
    }

    fn solve_in(&mut self, show_time: f64, chain: &mut ChainMut) -> Result<(), NoFollower> {
        self.0.iter_mut().try_for_each(|Member { dragon, dancer, handles, .. }| {
            dancer.solve_ahead(dragon.own_time(show_time).0, &mut chain.range_mut(handles.clone()))
        })
    }
}

impl Member {
    /// Solves the dragon in its place of the chain of all. A dragon that stands is solved once.
    fn solve(
        &mut self,
        show_time: f64,
        moves: bool,
        all_handles: usize,
        chain: &mut ChainMut,
    ) -> Result<(), NoFollower> {
        let (own_time, dances) = self.dragon.own_time(show_time);
        let state = (own_time, dances && moves);
        if self.dancer.solved == Some(state) {
            return Ok(());
        }
        let (first, own_handles) = (self.handles.start, self.handles.len());
        let mut own = chain.range_mut(self.handles.clone());
        self.closest = self.dancer.solve(state.0, state.1, &mut own)?;
        for pair in [&mut self.closest.boards, &mut self.closest.any].into_iter().flatten() {
            pair.bench_a += first;
            pair.bench_b += if pair.bench_b < own_handles { first } else { all_handles - own_handles };
        }
        Ok(())
    }
}
