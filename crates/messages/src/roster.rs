//! The names of benches of a scene for people, before there is a stage message: counted from 1 within the dragon.

use crate::sentence::bench_name;

/// The dragons and obstacles of a show, as far as their names need them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Roster {
    /// The benches of each dragon and its name, which is empty if it is the only one.
    dragons: Vec<(String, u32)>,
    obstacles: Vec<String>,
}

impl Roster {
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
    /// ```
    pub fn bench(&self, number: u32) -> String {
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
