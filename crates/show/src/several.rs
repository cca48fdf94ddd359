//! The frames of a scene with several dragons: one chain with all handles, and the nearest two
//! boards of all dragons.
//!
//! In: the scene and a time of the show. Out: the chain on the stage, with the handles of all dragons one after the
//! other, and its clearance.

use std::ops::Range;

use crate::dancer::{Closest, Dancer};
use crate::scene::Scene;
use bench_dragon_motion::Choice;
use bench_dragon_motion::clearance::{ClearanceMonitor, PairClearance};
use bench_dragon_motion::ensemble::{Dragon, Ensemble};
use bench_dragon_motion::linkage::NoFollower;
use bench_dragon_motion::solve::{Chain, ChainMut, Solver};

/// One of several dragons in play.
struct Member {
    dragon: Dragon,
    dancer: Dancer,
    handles: Range<usize>,
    /// The nearest of its boards, by the numbers of the show.
    closest: Closest,
}

/// All dragons of a show in play.
pub(crate) struct Several {
    members: Vec<Member>,
    between: Option<ClearanceMonitor>,
}

impl Several {
    pub(crate) fn new(scene: &Scene, ensemble: &Ensemble) -> Self {
        let choices: Vec<Choice> =
            ensemble.dragons().iter().map(|dragon| Dancer::choice(scene, &dragon.motion)).collect();
        let between = scene.alerts.map(|_| ensemble.between_monitor(&choices));
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
        let reasons: Vec<String> =
            self.members.iter().map(|of| format!("of {}: {}", of.dragon.name, of.dancer.reason)).collect();
        reasons.join("; ")
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
        let nearer = |one: Option<PairClearance>, other: Option<PairClearance>| match (one, other) {
            (Some(one), Some(other)) if other.value < one.value => Some(other),
            (one, other) => one.or(other),
        };
        let own = self.members.iter().map(|member| member.closest.boards).fold(None, nearer);
        let Self { members, between } = self;
        let limit = own.map_or(f64::INFINITY, |own| own.value);
        let between =
            between.as_mut().and_then(|monitor| monitor.nearest(&*chain, show_time, limit, &mut AllOf(members)).boards);
        let boards = nearer(own, between);
        let any = self.members.iter().map(|member| member.closest.any).fold(boards, nearer);
        Ok(Closest { boards, any })
    }
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
        let Closest { boards, any } = self.dancer.solve(state.0, state.1, &mut own)?;
        let numbered = |pair: PairClearance| {
            let PairClearance { bench_a, bench_b, .. } = pair;
            let bench_b = if bench_b < own_handles { bench_b + first } else { bench_b - own_handles + all_handles };
            PairClearance { bench_a: bench_a + first, bench_b, ..pair }
        };
        self.closest = Closest { boards: boards.map(numbered), any: any.map(numbered) };
        Ok(())
    }
}
