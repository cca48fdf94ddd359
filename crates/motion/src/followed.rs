//! The singular configurations of a motion and the branches of its followers: searched once, when they are first needed,
//! for all clones of the motion.

use std::sync::{Arc, OnceLock};

use super::Motion;
use super::contact::ConservativeAdvancement;
use super::event::{Budget, Progress, unreported};
use super::model::path::Path;
use super::singularities::Singularities;

/// Units of work after which the search for stall and lock gives up: about ten seconds.
const SINGULARITIES_BUDGET: u64 = 50_000_000;

/// The path with the branches of its followers, and the singular configurations: found when first needed, for all
/// clones of the motion.
#[derive(Debug, Clone, Default)]
pub(super) struct Followed(Arc<OnceLock<(Path, Singularities)>>);

impl PartialEq for Followed {
    /// They follow from the path and the team.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Motion {
    /// Returns the path, in its own coordinates, with the branches of this team's followers. An inward spiral has none.
    pub fn path(&self) -> &Path {
        self.search_branches(&mut unreported);
        self.searched_path()
    }

    /// Searches for the branches of this team's followers, if they are not known yet. Returns false if `progress` stops
    /// the search. [`Motion::path`] does the same, but cannot be stopped.
    pub fn search_branches(&self, progress: Progress<'_>) -> bool {
        let is_known = || self.path.as_spiral().is_some() || self.followed.0.get().is_some();
        if !is_known() {
            self.singularities(progress);
        }
        is_known()
    }

    /// Returns the same path without branches, and without a search for them.
    pub fn bare_path(&self) -> &Path {
        &self.path
    }

    /// Returns the same path, without branches before the search of [`Motion::singularities`] or if it was stopped.
    fn searched_path(&self) -> &Path {
        self.followed.0.get().map_or(&self.path, |followed| &followed.0)
    }

    /// Searches for stall, lock and the turns of the handles.
    pub fn singularities(&self, progress: Progress<'_>) -> Singularities {
        if let Some(known) = self.followed.0.get() {
            return known.1.clone();
        }
        let mut budget = Budget::new(SINGULARITIES_BUDGET, progress);
        let found = Singularities::search(&self.path, &self.team, &mut budget);
        if !budget.is_stopped() {
            let path = self.path.clone().with_branches(found.branches.clone());
            self.followed.0.get_or_init(|| (path, found.clone()));
        }
        found
    }

    /// Returns the search for contacts and clearances, from the result of [`Motion::singularities`].
    pub fn advancement<'a>(&'a self, found: &'a Singularities) -> ConservativeAdvancement<'a> {
        ConservativeAdvancement::new(self.searched_path(), &self.team, &found.head_turns, &found.body_turns)
            .with_tail_turns(&found.tail_turns)
    }
}
