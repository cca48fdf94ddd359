//! The cheapest solver: a table of where a chain of equal links stands, made once, and read off every frame.
//!
//! In: the time. Out: the chain, as exact as the safe solver's, on any path that begins with a straight line or an
//! inward spiral. A frame of the table does not depend on the ones before. The table is as good as it was found to be
//! when it was made; past that, in the last metres before a lock or a stall within the body, the safe solver does the
//! work, and [`FollowerTable::fallbacks`] counts how often. The show calls it through [`Solver`].

mod band;
mod beginning;
mod head;
mod kernel;
mod layout;
mod polynomial;
pub(crate) mod rows;
mod track;

use std::sync::Arc;

use head::{HeadBuilder, HeadTable};
use kernel::{Moment, within_half_turn};
pub use rows::Order;
use rows::{Alpha, Rows};
use track::Track;

use super::newton::Newton;
use super::{Chain, Solver, Velocities};
use crate::linkage::NoFollower;
use crate::model::path::Path;
use crate::model::team::Team;

/// The instructions that a code path may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Instructions {
    /// 512-bit vectors with fused multiply-add.
    Avx512,
    /// 256-bit vectors with fused multiply-add.
    Avx2,
    /// What every processor of the architecture has.
    Portable,
}

impl Instructions {
    /// All code paths that this processor can run, the fastest first.
    pub fn available() -> Vec<Self> {
        [Self::Avx512, Self::Avx2, Self::Portable]
            .into_iter()
            .filter(|instructions| instructions.is_available())
            .collect()
    }

    /// The name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Avx512 => "AVX-512",
            Self::Avx2 => "AVX2 and FMA",
            Self::Portable => "portable",
        }
    }

    #[cfg(target_arch = "x86_64")]
    fn is_available(self) -> bool {
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

    #[cfg(not(target_arch = "x86_64"))]
    fn is_available(self) -> bool {
        self == Self::Portable
    }
}

/// A table of the follower map.
///
/// Within the table the same times give the same bits on the same [`Instructions`], whichever frames were asked for
/// before.
#[derive(Debug, Clone)]
pub struct FollowerTable {
    head_speed: f64,
    velocities: Velocities,
    instructions: Instructions,
    /// Shared, so that a clone costs little.
    rows: Arc<Rows>,
    head: Arc<HeadTable>,
    newton: Newton,
    fallbacks: u64,
}

impl FollowerTable {
    /// A solver for `team` on `path`, the head moving at `head_speed` metres per second along the curve, as exact as
    /// doubles allow, with the fastest instructions this processor has.
    ///
    /// `None` where there is no such table: for a single bench, for a team so long that the table would not fit, and
    /// where it was found not to be exact even at the start.
    pub fn new(path: &Path, team: Team, head_speed: f64, velocities: Velocities) -> Option<Self> {
        Self::with_order(path, team, head_speed, velocities, Order::EXACT)
    }

    /// The same with polynomials of another length and exactness.
    pub fn with_order(path: &Path, team: Team, head_speed: f64, velocities: Velocities, order: Order) -> Option<Self> {
        if team.benches < 2 || !matches!((order.coefficients, order.heading_coefficients), (6, 5) | (4, 3)) {
            return None;
        }
        let track = Track::new(path);
        let mut rows = band::rows(&track, &team, order)?;
        let head = HeadBuilder::new(&track, &team, &rows).build()?;
        rows.bands.iter_mut().for_each(|band| band.centres = Vec::new());
        let newton = Newton::new(path.clone(), team, head_speed, velocities);
        let instructions = Instructions::available()[0];
        let (rows, head) = (Arc::new(rows), Arc::new(head));
        Some(Self { head_speed, velocities, instructions, rows, head, newton, fallbacks: 0 })
    }

    /// The same solver with other instructions, or `None` where this processor lacks them.
    pub fn with_instructions(self, instructions: Instructions) -> Option<Self> {
        instructions.is_available().then_some(Self { instructions, ..self })
    }

    /// The instructions it uses.
    pub fn instructions(&self) -> Instructions {
        self.instructions
    }

    /// Bytes this solver holds.
    pub fn memory_bytes(&self) -> usize {
        size_of::<Self>() + self.rows.memory_bytes() + self.head.memory_bytes()
    }

    /// Simulated seconds up to which frames are read off the table.
    pub fn valid_until(&self) -> f64 {
        let time = self.head.valid_until() / self.head_speed;
        // The travel of that time may be rounded up past the table.
        if self.head_speed * time > self.head.valid_until() { time.next_down() } else { time }
    }

    /// How many frames lay beyond the table.
    pub fn fallbacks(&self) -> u64 {
        self.fallbacks
    }

    /// Where the handles behind the head can stand: for the clearance.
    pub(crate) fn rows(&self) -> &Rows {
        &self.rows
    }

    /// Where the second handle stands when the head has travelled so many metres, and the derivative by these metres;
    /// `None` beyond the table.
    pub(crate) fn second_handle(&self, travelled: f64) -> Option<(Alpha, f64)> {
        let sample = (0.0..=self.head.valid_until()).contains(&travelled).then(|| self.head.at(travelled))?;
        Some((sample.alpha, sample.alpha_per_metre))
    }

    /// The chain when the head has travelled so many metres, within the table.
    fn read_off(&self, travelled: f64, chain: &mut Chain) {
        match self.instructions {
            // SAFETY: a solver is only made with instructions that this processor was found to have.
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => unsafe { self.read_off_with_avx512(travelled, chain) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => unsafe { self.read_off_with_avx2(travelled, chain) },
            _ => self.read_off_with::<false>(travelled, chain),
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
    fn read_off_with_avx512(&self, travelled: f64, chain: &mut Chain) {
        self.read_off_with::<true>(travelled, chain);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn read_off_with_avx2(&self, travelled: f64, chain: &mut Chain) {
        self.read_off_with::<true>(travelled, chain);
    }

    #[inline(always)]
    fn read_off_with<const FUSED: bool>(&self, travelled: f64, chain: &mut Chain) {
        match self.velocities {
            Velocities::Computed => self.read_off_wanted::<FUSED, true>(travelled, chain),
            Velocities::Omitted => self.read_off_wanted::<FUSED, false>(travelled, chain),
        }
    }

    #[inline(always)]
    fn read_off_wanted<const FUSED: bool, const VELOCITIES: bool>(&self, travelled: f64, chain: &mut Chain) {
        let sample = self.head.at(travelled);
        let moment = Moment { alpha: sample.alpha, alpha_per_second: sample.alpha_per_metre * self.head_speed };
        kernel::write::<FUSED, VELOCITIES>(&self.rows, &moment, chain);
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

    fn solve(&mut self, time: f64, chain: &mut Chain) -> Result<(), NoFollower> {
        let travelled = self.head_speed * time;
        if (0.0..=self.head.valid_until()).contains(&travelled) {
            self.read_off(travelled, chain);
            return Ok(());
        }
        self.fallbacks += 1;
        self.newton.solve_at(travelled, chain)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Point;
    use crate::model::curve::Side;

    const TEAM: Team = Team { benches: 60, head_length: 3.41, body_length: 2.2, width: 0.3, hole_inset: 0.275 };

    fn paths() -> [Path; 3] {
        let route = Path::route(Point::new(-30.0, -10.0), 0.0).line(40.0).arc(Side::Left, 6.0, 0.25).line(12.0);
        let route = route.arc(Side::Right, 5.0, 0.5).line(10.0).arc(Side::Left, 5.0, 0.5).line(120.0);
        let turnaround = Path::turnaround(1.7, 4.5, 2.0, 100.0, 100.0).unwrap();
        [Path::spiral(0.55, 16.0), turnaround, route.build().unwrap()]
    }

    /// The largest differences of place, metres, of heading and of speed, relative to the head's or its own.
    fn differences(one: &Chain, other: &Chain) -> [f64; 3] {
        let mut most = [0.0; 3];
        for i in 0..one.handles() {
            let turn = (one.heading[i] - other.heading[i]).abs();
            let rates =
                (one.vx[i] - other.vx[i]).hypot(one.vy[i] - other.vy[i]).max((one.speed[i] - other.speed[i]).abs());
            let place = (one.x[i] - other.x[i]).hypot(one.y[i] - other.y[i]);
            let turn = turn.min((turn - std::f64::consts::TAU).abs());
            for (most, now) in most.iter_mut().zip([place, turn, rates / other.speed[i].abs().max(1.0)]) {
                *most = now.max(*most);
            }
        }
        most
    }

    #[test]
    fn the_table_agrees_with_the_safe_solver_on_every_code_path_and_across_junctions() {
        for path in paths() {
            let newton = Newton::new(path.clone(), TEAM, 1.0, Velocities::Computed);
            let table = FollowerTable::new(&path, TEAM, 1.0, Velocities::Computed).unwrap();
            let end = table.valid_until();
            assert!(end > 200.0, "{end}");
            let around = |junction: f64| [-1e-3, -1e-9, 0.0, 1e-9, 1e-3].map(|by| junction + by);
            let regular = (0..=200).map(|k| end * f64::from(k) / 200.0);
            let times: Vec<f64> = path.junctions().flat_map(around).chain(regular).collect();
            for instructions in Instructions::available() {
                let mut table = table.clone().with_instructions(instructions).unwrap();
                let (mut found, mut wanted) = (Chain::new(TEAM.handles()), Chain::new(TEAM.handles()));
                for time in times.iter().copied().filter(|time| (0.0..=end).contains(time)) {
                    table.solve(time, &mut found).unwrap();
                    newton.solve_at(time, &mut wanted).unwrap();
                    let [place, heading, speed] = differences(&found, &wanted);
                    // Both solvers may be off by what the travel's rounding does to the chain.
                    let allowed = 2.0 * 1e-13f64.max(8.0 * f64::EPSILON * time);
                    let name = instructions.name();
                    assert!(
                        place < allowed && heading < 1e-12 && speed < 2e-12,
                        "{name} {time}: {place:e} {heading:e} {speed:e}"
                    );
                }
                assert_eq!(table.fallbacks(), 0);
            }
        }
    }

    #[test]
    fn a_frame_does_not_depend_on_the_ones_before_and_past_the_table_the_safe_solver_works() {
        let path = &paths()[0];
        let mut table = FollowerTable::new(path, TEAM, 1.0, Velocities::Omitted).unwrap();
        let [mut first, mut again] = [Chain::new(TEAM.handles()), Chain::new(TEAM.handles())];
        table.solve(123.4, &mut first).unwrap();
        assert_eq!(table.solve(440.0, &mut again), Err(NoFollower));
        assert_eq!(table.fallbacks(), 1);
        table.solve(123.4, &mut again).unwrap();
        assert_eq!((first.x, first.y, first.heading), (again.x, again.y, again.heading));
    }

    #[test]
    fn a_coarser_order_is_as_exact_as_it_says() {
        let order = Order { coefficients: 4, heading_coefficients: 3, tolerance: 1e-7, speed_tolerance: 1e-5 };
        for path in paths() {
            let newton = Newton::new(path.clone(), TEAM, 1.0, Velocities::Computed);
            let mut table = FollowerTable::with_order(&path, TEAM, 1.0, Velocities::Computed, order).unwrap();
            let (mut found, mut wanted) = (Chain::new(TEAM.handles()), Chain::new(TEAM.handles()));
            for k in 0..=100 {
                let time = 2.0 * f64::from(k);
                table.solve(time, &mut found).unwrap();
                newton.solve_at(time, &mut wanted).unwrap();
                let [place, heading, speed] = differences(&found, &wanted);
                assert!(place < 4e-7 && heading < 4e-6 && speed < 2e-5, "{time}: {place:e} {heading:e} {speed:e}");
            }
        }
    }
}
