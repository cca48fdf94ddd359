//! The arithmetic on which the bits of a frame depend: the processor's instructions and the crate of the elementary
//! functions. The log names both, so that `verify` can compare them with those of its machine.

use serde::{Deserialize, Serialize};

use bench_dragon_motion::solve::table::Instructions;
use bench_dragon_show::scene::Scene;

/// The crate that computes sines and their like, compiled in (`bench_dragon_motion::model::elementary`). Earlier
/// programs called the C library, and logged a hash of its results.
const ELEMENTARY_FUNCTIONS: &str = "libm 0.2.16";

/// The arithmetic of a machine, as far as it affects a frame.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Arithmetic {
    /// The processor's architecture: `x86_64`. Another architecture counts as another arithmetic.
    pub architecture: String,
    /// The name of the instructions that read the tables ([`Instructions::name`]); with several dragons the name for
    /// each, separated by commas.
    pub instructions: String,
    /// The crate of the elementary functions and its version.
    pub elementary_functions: String,
}

impl Arithmetic {
    /// Returns the arithmetic of a scene's show on this machine.
    pub fn of(scene: &Scene) -> Self {
        let names = scene.ensemble.dragons().iter().map(|dragon| dragon.motion.instructions().name());
        Self {
            architecture: std::env::consts::ARCH.to_owned(),
            instructions: names.collect::<Vec<_>>().join(","),
            elementary_functions: ELEMENTARY_FUNCTIONS.to_owned(),
        }
    }

    /// Returns true if this machine computes the same bits.
    pub fn is_available(&self) -> bool {
        self.architecture == std::env::consts::ARCH
            && self.sets().is_some()
            && self.elementary_functions == ELEMENTARY_FUNCTIONS
    }

    /// Returns the instructions of each dragon, or `None` if this processor lacks some.
    pub fn sets(&self) -> Option<Vec<Instructions>> {
        let set = |name| Instructions::of_name(name).filter(|set| set.is_available());
        self.instructions.split(',').map(set).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_crate_named_is_the_one_compiled_in() {
        let (name, version) = ELEMENTARY_FUNCTIONS.split_once(' ').unwrap();
        let lock = include_str!("../../../../Cargo.lock");
        assert!(lock.contains(&format!("name = \"{name}\"\nversion = \"{version}\"\n")));
    }
}
