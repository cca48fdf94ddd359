//! The names of benches for people: counted from 1, within the dragon with several.

use crate::layouts::{Stage, StageDragon, StageObstacle};
use crate::sentence::bench_name;

/// The dragons and obstacles of a show, as far as their names need them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Roster {
    /// The benches of each dragon and its name, which is empty if it is the only one.
    dragons: Vec<(String, u32)>,
    obstacles: Vec<String>,
}

impl Roster {
    /// Creates the roster of a show with one dragon and obstacles without names.
    pub fn team(benches: u32) -> Self {
        Self::new(vec![(String::new(), benches)], Vec::new())
    }

    /// Creates the roster of a show from its stage.
    pub fn of(stage: &Stage) -> Self {
        let dragon = |of: &StageDragon| (of.name.as_str().to_owned(), of.benches);
        let obstacle = |of: &StageObstacle| of.name.as_str().to_owned();
        Self::new(stage.dragons.iter().map(dragon).collect(), stage.obstacles.iter().map(obstacle).collect())
    }

    /// Creates the roster of dragons with their benches, in the order of their handles, and of obstacles.
    pub fn new(dragons: Vec<(String, u32)>, obstacles: Vec<String>) -> Self {
        Self { dragons, obstacles }
    }

    /// Returns the name of a bench, by its number; of a number that follows the handles, an obstacle's.
    ///
    /// # Examples
    ///
    /// ```
    /// use bench_dragon_messages::Roster;
    ///
    /// let two = Roster::new(vec![("gold".to_owned(), 20), ("jade".to_owned(), 12)], vec!["well".to_owned()]);
    /// assert_eq!(two.bench(8), "bench 9 of gold");
    /// // gold has the handles 0 to 20, jade 21 to 33.
    /// assert_eq!(two.bench(21), "bench 1 (the head) of jade");
    /// assert_eq!(two.bench(34), "the well");
    /// assert_eq!(Roster::team(223).bench(8), "bench 9");
    /// ```
    pub fn bench(&self, number: u32) -> String {
        if self.dragons.is_empty() {
            // The stage has not come.
            return format!("bench {}", u64::from(number) + 1);
        }
        let mut first = 0;
        for (name, benches) in &self.dragons {
            if number <= first + benches {
                let bench = bench_name(number - first, *benches);
                return if name.is_empty() { bench } else { format!("{bench} of {name}") };
            }
            first += benches + 1;
        }
        let obstacle = number - first;
        match self.obstacles.get(obstacle as usize) {
            Some(name) => format!("the {name}"),
            None => format!("obstacle {}", obstacle + 1),
        }
    }
}
