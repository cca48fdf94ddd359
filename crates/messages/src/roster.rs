//! The names of benches and obstacles for people: benches count from 1 within their dragon.
//!
//! Before there is a stage message, a scene's [`Roster`] has the names; a subscriber has those of the [`Stage`].

use crate::layouts::{NO_BENCH, Stage};

/// The dragons and obstacles of a show, as far as their names need them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Roster {
    /// The benches of each dragon and its name, which is empty if the dragon is the only one.
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
        let dragons = self.dragons.iter().map(|(name, benches)| (name.as_str(), *benches));
        name(number, dragons, |obstacle| self.obstacles.get(obstacle).map(String::as_str))
    }
}

/// Returns the name of a bench or an obstacle of a show by its number, for people.
///
/// # Examples
///
/// ```
/// use bench_dragon_messages::sentence::name_in;
/// use bench_dragon_messages::{List, SceneName, Stage, StageDragon, StageObstacle};
///
/// let gold = StageDragon { benches: 4, name: SceneName::new("gold"), ..StageDragon::default() };
/// let jade = StageDragon { first_handle: 5, benches: 3, name: SceneName::new("jade"), ..StageDragon::default() };
/// let well = StageObstacle { name: SceneName::new("well"), ..StageObstacle::default() };
/// let stage = Stage { dragons: List::of([gold, jade]), obstacles: List::of([well]), ..Stage::default() };
/// assert_eq!(name_in(&stage, 1), "bench 2 of gold");
/// assert_eq!(name_in(&stage, 5), "bench 1 (the head) of jade");
/// // Nine handles come before the obstacles.
/// assert_eq!(name_in(&stage, 9), "the well");
/// ```
pub fn name_in(stage: &Stage, number: u32) -> String {
    // Before the stage has come, only the head is known by its number.
    if stage.dragons.is_empty() {
        return own_name(u64::from(number), u64::MAX);
    }
    let dragons = stage.dragons.iter().map(|dragon| (dragon.name.as_str(), dragon.benches));
    name(number, dragons, |obstacle| stage.obstacles.get(obstacle).map(|named| named.name.as_str()))
}

/// Returns the number of an obstacle, from 0, of a number that follows the handles of a stage's dragons.
pub fn obstacle_number(stage: &Stage, number: u32) -> Option<usize> {
    let handles = stage.dragons.iter().map(|dragon| u64::from(dragon.benches) + 1).sum();
    let obstacle = u64::from(number).checked_sub(handles).filter(|_| number != NO_BENCH && handles > 0)?;
    usize::try_from(obstacle).ok()
}

/// Returns the name of a number, given each dragon's name and benches in the order of their handles.
fn name<'a>(
    number: u32,
    dragons: impl Iterator<Item = (&'a str, u32)>,
    obstacle: impl FnOnce(usize) -> Option<&'a str>,
) -> String {
    // The numbers of a damaged stage may be too large for 32 bits together.
    let mut own = u64::from(number);
    for (name, benches) in dragons {
        if own <= u64::from(benches) {
            let bench = own_name(own, u64::from(benches));
            return if name.is_empty() { bench } else { format!("{bench} of {name}") };
        }
        own -= u64::from(benches) + 1;
    }
    match usize::try_from(own).ok().and_then(obstacle) {
        Some(name) => format!("the {name}"),
        None => format!("obstacle {}", own + 1),
    }
}

/// Returns the name of a bench within its dragon.
fn own_name(bench: u64, benches: u64) -> String {
    match bench + 1 {
        1 => "bench 1 (the head)".to_owned(),
        number if number == benches => format!("bench {number} (the tail)"),
        number => format!("bench {number}"),
    }
}
