//! The colour of a bench: its mean speed over one link passage, on a scale about the head's speed.
//!
//! The page has the same scale (`SpeedScale` of `crates/outputs/src/view/palette.js`), so a colour means the same speed
//! on the page, in a picture of `draw` and in the documents.

use bench_dragon_motion::Motion;
use bench_dragon_motion::solve::{Chain, Solver};

/// The widths of the scale on either side of the head's speed, as shares of that speed: the first that holds every
/// speed is used.
const WIDTHS: [f64; 4] = [1.0, 10.0, 100.0, 1000.0];
/// Differences from the head's speed that are far smaller than this share of the speed have no separate colour.
const FINEST: f64 = 0.001;
/// Samples of the mean over a link passage.
const SAMPLES: u32 = 16;

/// Replaces the speeds of a chain at `time` by their means over the last link passage, which begins at the earliest at
/// time 0. A link passage is the time in which the head travels the length of the last link. Behind a bend speeds pulse
/// with that period.
///
/// `earlier` is overwritten. Times without a solution do not count.
pub fn mean_speeds(motion: &Motion, solver: &mut dyn Solver, time: f64, chain: &mut Chain, earlier: &mut Chain) {
    let team = motion.team();
    let passage = (team.link(team.benches - 1) / motion.head_speed()).min(time);
    // The trapezoidal rule: both ends count half.
    let mut weights = 0.5;
    let mut sums: Vec<f64> = chain.speed.iter().map(|speed| 0.5 * speed).collect();
    for sample in 1..=SAMPLES {
        let before = time - passage * f64::from(sample) / f64::from(SAMPLES);
        if passage <= 0.0 || solver.solve(before.max(0.0), earlier).is_err() {
            continue;
        }
        let weight = if sample == SAMPLES { 0.5 } else { 1.0 };
        weights += weight;
        sums.iter_mut().zip(&earlier.speed).for_each(|(sum, speed)| *sum += weight * speed);
    }
    chain.speed.iter_mut().zip(sums).for_each(|(mean, sum)| *mean = sum / weights);
}

/// The range of speeds, in metres per second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Speeds {
    least: f64,
    greatest: f64,
}

impl Speeds {
    /// The range of no handle.
    pub const NONE: Self = Self { least: f64::INFINITY, greatest: f64::NEG_INFINITY };

    /// Extends the range to the handles of a chain.
    pub fn include(&mut self, chain: &Chain) {
        for speed in chain.speed.iter().filter(|speed| speed.is_finite()) {
            (self.least, self.greatest) = (self.least.min(*speed), self.greatest.max(*speed));
        }
    }

    /// Returns the colour scale, or `None` if no speed is known.
    pub fn scale(&self, head_speed: f64) -> Option<ColourScale> {
        if self.least > self.greatest {
            return None;
        }
        let most = (self.least / head_speed - 1.0).abs().max((self.greatest / head_speed - 1.0).abs());
        let width = WIDTHS.into_iter().find(|width| most <= *width).unwrap_or(WIDTHS[WIDTHS.len() - 1]);
        Some(ColourScale { head_speed, width })
    }
}

/// The assignment of colours to speeds: logarithmic in the difference from the head's speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColourScale {
    /// The head's speed in the middle of the scale, in metres per second.
    pub head_speed: f64,
    /// The greatest difference from the head's speed that has a colour, as a share of that speed.
    pub width: f64,
}

impl ColourScale {
    /// Returns the position of a speed on the scale, from 0 to 1.
    pub fn part(&self, speed: f64) -> f64 {
        let difference = speed / self.head_speed - 1.0;
        let part = (difference.abs() / FINEST).ln_1p() / (self.width / FINEST).ln_1p();
        0.5 + 0.5 * difference.signum() * part.min(1.0)
    }

    /// Returns the speeds at the slow and at the fast end, in metres per second.
    pub fn ends(&self) -> (f64, f64) {
        (self.head_speed * (1.0 - self.width).max(0.0), self.head_speed * (1.0 + self.width))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_widens_until_every_speed_has_a_colour() {
        let scale = |least, greatest| Speeds { least, greatest }.scale(2.0).unwrap();
        assert_eq!(scale(2.0, 2.0), ColourScale { head_speed: 2.0, width: 1.0 });
        assert_eq!(scale(0.0, 4.0).width, 1.0);
        assert_eq!(scale(1.0, 4.1).width, 10.0);
        assert_eq!(scale(1.0, 1e9).width, 1000.0);
        assert_eq!(Speeds::NONE.scale(2.0), None);
    }

    #[test]
    fn the_scale_is_logarithmic_about_the_head() {
        let scale = ColourScale { head_speed: 2.0, width: 1.0 };
        assert_eq!([0.0, 2.0, 4.0, 9.0].map(|speed| scale.part(speed)), [0.0, 0.5, 1.0, 1.0]);
        // ln(1 + 0.1 / 0.001) / ln(1 + 1 / 0.001) = 0.66797, by hand.
        assert!((scale.part(2.2) - 0.833_98).abs() < 1e-4 && (scale.part(1.8) - 0.166_02).abs() < 1e-4);
        assert_eq!(scale.ends(), (0.0, 4.0));
    }
}
