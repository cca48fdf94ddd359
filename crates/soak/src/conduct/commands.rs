//! The random commands of a conducted soak test: the same seed gives the same list.

use std::time::Duration;

use bench_dragon_messages::control::Command;

/// The greatest time between two commands; the average is half of it.
const LONGEST_GAP: Duration = Duration::from_millis(200);
/// The longest step, as a share of a second.
const LONGEST_STEP: f64 = 0.3;

/// An endless list of commands, each with the wait before it.
#[derive(Debug, Clone)]
pub struct RandomCommands {
    chance: fastrand::Rng,
    rate: f64,
    end: f64,
}

impl RandomCommands {
    /// Creates the list of a seed, for a show of `rate` frames per second that ends at `end` simulated seconds.
    pub fn new(seed: u64, rate: f64, end: f64) -> Self {
        Self { chance: fastrand::Rng::with_seed(seed), rate, end }
    }

    /// Returns a time of the show: one in six just before its end, one in six out of range.
    fn time(&mut self) -> f64 {
        match self.chance.u32(0..12) {
            0 => -1.0,
            1 => [self.end * 1.001 + 1.0, f64::NAN, f64::MAX][self.chance.usize(0..3)],
            2 => self.end,
            3 => (self.end - self.chance.f64()).max(0.0),
            _ => self.end * self.chance.f64(),
        }
    }

    /// Returns a rate: mostly near 1, sometimes the least or the greatest rate, one in six out of range.
    fn play_rate(&mut self) -> f64 {
        match self.chance.u32(0..24) {
            0..4 => [0.0, -1.0, 1e-7, 1.1e6, f64::NAN, f64::INFINITY][self.chance.usize(0..6)],
            4 => 1e-6,
            5 => 1e6,
            6..10 => 1.0,
            _ => 10f64.powf(self.chance.f64() * 2.0 - 1.0),
        }
    }

    fn periods(&mut self) -> u64 {
        self.chance.u64(1..=(self.rate * LONGEST_STEP).ceil() as u64)
    }
}

impl Iterator for RandomCommands {
    type Item = (Duration, Command);

    fn next(&mut self) -> Option<Self::Item> {
        let gap = LONGEST_GAP.mul_f64(self.chance.f64());
        let command = match self.chance.u32(0..100) {
            0..8 => Command::State,
            8..18 => Command::Pause,
            18..38 => Command::Resume,
            38..50 => Command::Rate(self.play_rate()),
            50..63 => Command::Seek(self.time()),
            63..73 => Command::Step(self.periods()),
            73..78 => Command::Restart,
            78..81 => Command::Hold,
            81..95 => Command::Release,
            _ => Command::Go,
        };
        Some((gap, command))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench_dragon_messages::control::RATES;

    #[test]
    fn a_seed_gives_the_same_list_again_and_another_seed_another() {
        // As text: some values are NaN.
        let list = |seed| format!("{:?}", RandomCommands::new(seed, 1000.0, 400.0).take(1000).collect::<Vec<_>>());
        assert_eq!(list(7), list(7));
        assert_ne!(list(7), list(8));
    }

    #[test]
    fn ten_a_second_of_every_kind() {
        let list: Vec<_> = RandomCommands::new(1, 1000.0, 400.0).take(1000).collect();
        let seconds: f64 = list.iter().map(|(gap, _)| gap.as_secs_f64()).sum();
        assert!((90.0..110.0).contains(&seconds), "{seconds}");
        let mut counts = [0; 10];
        list.iter().for_each(|(_, command)| counts[command.number_and_value().0 as usize] += 1);
        assert!(counts.iter().all(|count| *count >= 10), "{counts:?}");
        let wrong = |command: &Command| match *command {
            Command::Rate(rate) => !RATES.contains(&rate),
            Command::Seek(time) => !(0.0..=400.0).contains(&time),
            _ => false,
        };
        assert!(list.iter().filter(|(_, command)| wrong(command)).count() > 20);
    }
}
