//! The cheapest solver: every frame is interpolated in a table of the places of a chain of equal links, which is made
//! once.
//!
//! In: the time. Out: the chain, as exact as the safe solver's, on any path that begins with a straight line or an
//! inward spiral. A frame does not depend on earlier frames. The table covers the travel for which it was measured to
//! be exact. Beyond it, in the last metres before a lock or a stall within the body, the safe solver is used, and
//! [`FollowerTable::fallbacks`] counts these frames.

mod band;
mod beginning;
mod head;
mod kernel;
mod last_row;
mod layout;
mod packed;
mod polynomial;
pub(crate) mod rows;
mod single_kernel;
mod tail;
#[cfg(test)]
mod tests;
mod track;

use std::sync::Arc;

use head::{HeadBuilder, HeadTable};
use kernel::{FrameInput, within_half_turn};
use packed::PackedRows;
pub(crate) use packed::{Allowed, Format};
use rows::Rows;
pub(crate) use rows::Tolerance;
use tail::OwnTail;
use track::Track;

use super::newton::Newton;
use super::{ChainMut, Solver, Velocities};
use crate::event::{Budget, Progress};
use crate::linkage::NoFollower;
use crate::model::path::Path;
use crate::model::team::{Ends, Team};

/// The instructions that a code path may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Instructions {
    /// 512-bit vectors with fused multiply-add.
    Avx512,
    /// 256-bit vectors with fused multiply-add.
    Avx2,
    /// The instructions of every processor of the architecture.
    Portable,
}

impl Instructions {
    /// Returns all code paths that this processor can run, the fastest first.
    pub fn available() -> Vec<Self> {
        [Self::Avx512, Self::Avx2, Self::Portable]
            .into_iter()
            .filter(|instructions| instructions.is_available())
            .collect()
    }

    /// Returns the fastest instructions for frames of `handles` handles. Large frames wait for memory, and 512-bit
    /// stores, which each cross a cache line, then take a tenth more time.
    pub(crate) fn fastest(handles: usize) -> Self {
        const LARGE: usize = 10_000;
        let fastest = |instructions: &Self| *instructions != Self::Avx512 || handles < LARGE;
        Self::available().into_iter().find(fastest).unwrap_or(Self::Portable)
    }

    /// Returns the instructions of this [`name`](Self::name).
    pub fn of_name(name: &str) -> Option<Self> {
        [Self::Avx512, Self::Avx2, Self::Portable].into_iter().find(|instructions| instructions.name() == name)
    }

    /// Returns the name for people and recordings.
    pub fn name(self) -> &'static str {
        match self {
            Self::Avx512 => "AVX-512",
            Self::Avx2 => "AVX2 and FMA",
            Self::Portable => "portable",
        }
    }

    /// Returns true if this processor has these instructions.
    #[cfg(target_arch = "x86_64")]
    pub fn is_available(self) -> bool {
        let avx2 = || is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
        match self {
            Self::Avx512 => {
                avx2()
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
            }
            Self::Avx2 => avx2(),
            Self::Portable => true,
        }
    }

    /// Returns true if this processor has these instructions.
    #[cfg(not(target_arch = "x86_64"))]
    pub fn is_available(self) -> bool {
        self == Self::Portable
    }
}

/// A table of the follower map.
///
/// Within the table the same times give the same bits on the same [`Instructions`], independent of earlier frames.
#[derive(Debug, Clone)]
pub struct FollowerTable {
    head_speed: f64,
    velocities: Velocities,
    instructions: Instructions,
    /// Shared, so that a clone costs little.
    rows: Arc<Rows>,
    /// The tail, if its link has a length of its own.
    tail: Option<OwnTail>,
    /// The packed rows, if frames are read from them.
    packed: Option<Arc<PackedRows>>,
    head: Arc<HeadTable>,
    /// The travel, in metres, up to which the table has all handles; below 0 if the tail has a link of its own.
    plain_until: f64,
    newton: Newton,
    fallbacks: u64,
    /// The greatest error of its frames, in metres.
    accuracy: f64,
    exact_bytes_per_handle: f64,
}

/// The greatest error of the frames of the most exact table, metres, on any path but the farthest.
const EXACT_ACCURACY: f64 = 1e-9;

impl FollowerTable {
    /// Makes a solver for `team` on `path`, the head moving at `head_speed` metres per second along the curve. The
    /// solver is as exact as doubles allow and uses the fastest instructions of this processor.
    ///
    /// Returns `None` for a single bench, and for a team so long that the table would exceed its limit. Returns `None`
    /// also if the table is not exact even at the start, and if `progress`, whose share stays 0, stops the making.
    pub fn new(
        path: &Path,
        team: Team,
        head_speed: f64,
        velocities: Velocities,
        progress: Progress<'_>,
    ) -> Option<Self> {
        let budget = &mut Budget::new(u64::MAX, progress);
        Self::with_tolerance(path, team, head_speed, velocities, Tolerance::EXACT, budget)
    }

    /// Does the same at the requested accuracy.
    pub(crate) fn with_tolerance(
        path: &Path,
        team: Team,
        head_speed: f64,
        velocities: Velocities,
        tolerance: Tolerance,
        budget: &mut Budget,
    ) -> Option<Self> {
        if team.benches < 2 {
            return None;
        }
        let track = Track::new(path);
        let tail = OwnTail::of(&team, &track);
        // In the table the tail is like any other bench.
        let chain = Team {
            ends: Ends { tail_length: tail.as_ref().map_or(team.ends.tail_length, |_| None), ..team.ends },
            ..team
        };
        let mut rows = band::rows(&track, &chain, tolerance, tail.is_some(), budget)?;
        let head = HeadBuilder::new(&track, &chain, &rows).build(budget)?;
        if tail.is_none() {
            rows.bands.iter_mut().for_each(|band| band.centres = Vec::new());
        }
        let newton = Newton::new(path.clone(), team, head_speed, velocities);
        let instructions = Instructions::fastest(team.handles());
        let exact_bytes_per_handle = rows.bytes_per_row(team.benches);
        let plain_until = if tail.is_none() { head.valid_until() } else { -1.0 };
        let (rows, head) = (Arc::new(rows), Arc::new(head));
        Some(Self {
            head_speed,
            velocities,
            instructions,
            rows,
            tail,
            packed: None,
            head,
            plain_until,
            newton,
            fallbacks: 0,
            accuracy: EXACT_ACCURACY,
            exact_bytes_per_handle,
        })
    }

    /// Returns the metres that the head has travelled where frames have kinks; `None` if the budget is spent.
    pub(crate) fn kinks(path: &Path, team: &Team, budget: &mut Budget) -> Option<Vec<f64>> {
        layout::crossings(&Track::new(path), team, budget)
    }

    /// Returns the same solver with other instructions, or `None` if this processor lacks them.
    pub fn with_instructions(self, instructions: Instructions) -> Option<Self> {
        instructions.is_available().then_some(Self { instructions, ..self })
    }

    /// Returns the same solver with its frames read from another format; `None` if that would lose more than is
    /// allowed, and if the budget is spent.
    pub(crate) fn packed(&self, format: Format, allowed: Allowed, budget: &mut Budget) -> Option<Self> {
        let packed = PackedRows::new(&self.rows, self.head.foremost_row(), format, allowed, budget)?;
        Some(Self { packed: Some(Arc::new(packed)), ..self.clone() })
    }

    /// Returns the packed formats of frames, the fewest bytes first.
    pub(crate) fn formats() -> [Format; 3] {
        PackedRows::FORMATS
    }

    /// Returns the same solver with the promise that the error of its frames is at most `accuracy` metres.
    pub(crate) fn promising(self, accuracy: f64) -> Self {
        Self { accuracy: accuracy.max(EXACT_ACCURACY), ..self }
    }

    /// Returns the greatest error of its frames, metres, besides the rounding of doubles.
    pub fn accuracy(&self) -> f64 {
        self.accuracy
    }

    /// Describes the format of its coefficients, for people.
    pub fn format(&self) -> String {
        self.packed.as_ref().map_or_else(|| "double precision, order 6".to_owned(), |packed| packed.format.to_string())
    }

    /// Returns the bytes of the table that a frame reads per handle, on average over the team at the start.
    pub fn bytes_per_handle(&self) -> f64 {
        match &self.packed {
            Some(packed) => packed.format.bytes_per_handle() as f64,
            None => self.exact_bytes_per_handle,
        }
    }

    /// Returns [`bytes_per_handle`](Self::bytes_per_handle) as a part of the bytes of the most exact table.
    pub fn relative_cost(&self) -> f64 {
        self.bytes_per_handle() / self.exact_bytes_per_handle
    }

    /// Returns the same solver without the data that its frames do not read.
    pub fn for_frames(&self) -> Self {
        let reads_rows = self.packed.is_none() || self.tail.is_some();
        let rows = if reads_rows { self.rows.clone() } else { Arc::new(Rows::empty()) };
        Self { rows, ..self.clone() }
    }

    /// Returns the instructions that it uses.
    pub fn instructions(&self) -> Instructions {
        self.instructions
    }

    /// Returns the bytes that its frames need.
    pub fn memory_bytes(&self) -> usize {
        let table = self.packed.as_ref().map_or_else(|| self.rows.memory_bytes(), |packed| packed.memory_bytes());
        size_of::<Self>() + table + self.head.memory_bytes()
    }

    /// Returns the simulated seconds up to which frames are interpolated in the table.
    pub fn valid_until(&self) -> f64 {
        let time = self.head.valid_until() / self.head_speed;
        // The travel of that time may be rounded up past the table.
        if self.head_speed * time > self.head.valid_until() { time.next_down() } else { time }
    }

    /// Returns the number of frames beyond the table.
    pub fn fallbacks(&self) -> u64 {
        self.fallbacks
    }

    /// Fills the chain for `travelled` metres of the head, within the table.
    fn interpolate(&self, travelled: f64, chain: &mut ChainMut) {
        debug_assert!(self.instructions.is_available(), "{}", self.instructions.name());
        match self.instructions {
            // SAFETY: a solver is only made with instructions that this processor has.
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => unsafe { self.interpolate_with_avx512(travelled, chain) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => unsafe { self.interpolate_with_avx2(travelled, chain) },
            _ => self.interpolate_with::<false>(travelled, chain),
        }
    }

    /// Does the same for a team whose tail has a link of its own. Returns `None` if there is no such tail, or it cannot
    /// be found from the table.
    #[cold]
    fn interpolate_with_tail(&self, travelled: f64, chain: &mut ChainMut) -> Option<()> {
        let tail = self.tail.as_ref().filter(|_| (0.0..=self.head.valid_until()).contains(&travelled))?;
        self.interpolate(travelled, chain);
        tail.write(&self.rows, self.head.at(travelled).alpha, self.velocities, chain)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
    fn interpolate_with_avx512(&self, travelled: f64, chain: &mut ChainMut) {
        self.interpolate_with::<true>(travelled, chain);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn interpolate_with_avx2(&self, travelled: f64, chain: &mut ChainMut) {
        self.interpolate_with::<true>(travelled, chain);
    }

    #[inline(always)]
    fn interpolate_with<const FUSED: bool>(&self, travelled: f64, chain: &mut ChainMut) {
        match self.velocities {
            Velocities::Computed => self.interpolate_wanted::<FUSED, true>(travelled, chain),
            Velocities::Omitted => self.interpolate_wanted::<FUSED, false>(travelled, chain),
        }
    }

    #[inline(always)]
    fn interpolate_wanted<const FUSED: bool, const VELOCITIES: bool>(&self, travelled: f64, chain: &mut ChainMut) {
        let sample = self.head.at(travelled);
        let input = FrameInput { alpha: sample.alpha, alpha_per_second: sample.alpha_per_metre * self.head_speed };
        match &self.packed {
            Some(packed) => single_kernel::write::<FUSED, VELOCITIES>(packed, &input, chain),
            None => kernel::write::<FUSED, VELOCITIES>(&self.rows, &input, chain),
        }
        let last = chain.handles() - 1;
        chain.heading[last] = chain.heading[last - 1];
        chain.x[0] = sample.x;
        chain.y[0] = sample.y;
        chain.heading[0] = within_half_turn(sample.heading);
        if VELOCITIES {
            chain.speed[0] = self.head_speed;
            chain.vx[0] = self.head_speed * sample.tangent[0];
            chain.vy[0] = self.head_speed * sample.tangent[1];
        }
    }
}

impl Solver for FollowerTable {
    fn name(&self) -> &'static str {
        "follower_table"
    }

    fn solve_in(&mut self, time: f64, chain: &mut ChainMut) -> Result<(), NoFollower> {
        let travelled = self.head_speed * time;
        if (0.0..=self.plain_until).contains(&travelled) {
            self.interpolate(travelled, chain);
            return Ok(());
        }
        if self.interpolate_with_tail(travelled, chain).is_some() {
            return Ok(());
        }
        self.fallbacks += 1;
        self.newton.solve_at_in(travelled, chain)
    }
}
