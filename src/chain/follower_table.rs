//! The cheapest solver: a table of where a chain of equal links stands, made once, and read off every frame.
//!
//! In: the time. Out: the chain, as exact as the safe solver's. A frame of the table does not depend on the ones before.
//! The table is as good as it was found to be when it was made; past that, in the last metres before a lock, the
//! whole-chain solver does the work, and [`FollowerTable::fallbacks`] counts how often. The show calls it through
//! [`Solver`].

mod columns;
mod heads;
mod kernel;
mod stencil;

use std::f64::consts::TAU;

use columns::Columns;
use heads::Heads;
use kernel::Moment;
use stencil::Stencil;

#[cfg(target_arch = "x86_64")]
use super::lanes::avx2::Avx2;
use super::lanes::{Lanes, Portable};
use super::whole_chain::WholeChain;
use super::{Chain, Instructions, Solver, Team, Velocities};
use crate::geometry::path::Fold;
use crate::geometry::spiral::Spiral;

/// A table of the follower map, interpolated.
///
/// Within the table the same times give the same bits on the same [`Instructions`], whichever frames were asked for
/// before.
#[derive(Debug, Clone)]
pub struct FollowerTable {
    pitch: f64,
    head_speed: f64,
    velocities: Velocities,
    stencil: Stencil,
    columns: Columns,
    heads: Heads,
    whole_chain: WholeChain,
    fallbacks: u64,
}

impl FollowerTable {
    /// A solver for `team` on `path`, the head moving at `head_speed` metres per second along the curve, with the
    /// fastest instructions this processor has.
    ///
    /// `None` where there is no such table: for a single bench, for a team or a way so long that the table would not fit,
    /// and where interpolation in it was found not to be exact even at the start.
    pub fn new(path: Spiral, team: Team, head_speed: f64, velocities: Velocities) -> Option<Self> {
        if team.benches < 2 || !heads::fits(&path, &team) {
            return None;
        }
        let stencil = Stencil::new();
        let columns = Columns::new(&path, &team)?;
        let heads = Heads::new(&path, &team, &columns, &stencil)?;
        let whole_chain = WholeChain::new(path, team, head_speed, velocities);
        let pitch = path.pitch();
        Some(Self { pitch, head_speed, velocities, stencil, columns, heads, whole_chain, fallbacks: 0 })
    }

    /// The same solver with other instructions, or `None` where this processor lacks them.
    pub fn with_instructions(self, instructions: Instructions) -> Option<Self> {
        let whole_chain = self.whole_chain.with_instructions(instructions)?;
        Some(Self { whole_chain, ..self })
    }

    /// The instructions it uses.
    pub fn instructions(&self) -> Instructions {
        self.whole_chain.instructions()
    }

    /// Bytes this solver holds.
    pub fn memory_bytes(&self) -> usize {
        let tables = self.columns.memory_bytes() + self.heads.memory_bytes();
        size_of::<Self>() - size_of::<WholeChain>() + tables + self.whole_chain.memory_bytes()
    }

    /// Simulated seconds up to which frames are read off the table.
    pub fn valid_until(&self) -> f64 {
        self.heads.valid() / self.head_speed
    }

    /// How many frames lay beyond the table.
    pub fn fallbacks(&self) -> u64 {
        self.fallbacks
    }

    /// The chain when the head has travelled so many metres, within the table.
    fn read_off(&self, travelled: f64, chain: &mut Chain) {
        match self.instructions() {
            // SAFETY: a solver is only made with instructions that this processor was found to have.
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => unsafe { self.read_off_with_avx512(travelled, chain) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => unsafe { self.read_off_with_avx2(travelled, chain) },
            _ => self.read_off_with::<Portable>(travelled, chain),
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
    fn read_off_with_avx512(&self, travelled: f64, chain: &mut Chain) {
        self.read_off_with::<Avx2>(travelled, chain);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn read_off_with_avx2(&self, travelled: f64, chain: &mut Chain) {
        self.read_off_with::<Avx2>(travelled, chain);
    }

    #[inline(always)]
    fn read_off_with<L: Lanes>(&self, travelled: f64, chain: &mut Chain) {
        let lead = self.heads.at(travelled, &self.stencil);
        let moment = Moment {
            knot: lead.knot,
            between: lead.between,
            pitch: self.pitch,
            knots_per_second: lead.knots_per_metre * self.head_speed,
            velocities: self.velocities,
        };
        kernel::write::<L>(&self.columns, &self.stencil, &moment, chain);
        let last = chain.handles() - 1;
        chain.heading[last] = chain.heading[last - 1];
        let (sine, cosine) = columns::sine_cosine(lead.fraction);
        let r = self.pitch * lead.turns;
        chain.x[0] = r * cosine;
        chain.y[0] = r * sine;
        let bearing = columns::fraction_of_turn(lead.fraction) + lead.tilt;
        let within = bearing - bearing.round_ties_even();
        chain.heading[0] = TAU * if within <= -0.5 { 0.5 } else { within };
        if self.velocities == Velocities::Computed {
            // The path's tangent, e_phi theta + e_r against the growing angle.
            let theta = TAU * lead.turns;
            let along = self.head_speed / (theta * theta + 1.0).sqrt();
            chain.speed[0] = self.head_speed;
            chain.vx[0] = along * (theta * sine - cosine);
            chain.vy[0] = -along * (theta * cosine + sine);
        }
    }
}

impl Solver for FollowerTable {
    fn name(&self) -> &'static str {
        "follower_table"
    }

    fn solve(&mut self, time: f64, chain: &mut Chain) -> Result<(), Fold> {
        let travelled = self.head_speed * time;
        if (0.0..=self.heads.valid()).contains(&travelled) {
            self.read_off(travelled, chain);
            return Ok(());
        }
        self.fallbacks += 1;
        self.whole_chain.solve(time, chain)
    }
}
