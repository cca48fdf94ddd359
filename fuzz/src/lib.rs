//! The fuzz targets of `tests/fuzz`, for libFuzzer.

#[path = "../../tests/fuzz/targets/mod.rs"]
pub mod targets;

pub use libfuzzer_sys;

use fastrand::Rng;
use targets::Target;
// The program's macros name its module by its path from the root.
#[allow(unused_imports, reason = "the macros use it")]
use targets::command_line::program::commands;

/// Makes a program from a target: its function, and its own changes besides those of libFuzzer.
#[macro_export]
macro_rules! fuzz {
    ($target:ident) => {
        use $crate::libfuzzer_sys::{fuzz_mutator, fuzz_target};

        fuzz_target!(|data: &[u8]| {
            ($crate::targets::$target::TARGET.run)(data);
        });
        fuzz_mutator!(|data: &mut [u8], size: usize, most: usize, seed: u32| {
            $crate::mutated(&$crate::targets::$target::TARGET, data, size, most, seed)
        });
    };
}

/// Changes the first `size` bytes of `data`, which has room for `most` bytes: by the target's own changes in three of
/// four cases.
pub fn mutated(target: &Target, data: &mut [u8], size: usize, most: usize, seed: u32) -> usize {
    let mut random = Rng::with_seed(u64::from(seed));
    if random.u8(..4) == 0 {
        return libfuzzer_sys::fuzzer_mutate(data, size, most);
    }
    let made = (target.mutate)(&data[..size], &mut random);
    let length = made.len().min(most);
    data[..length].copy_from_slice(&made[..length]);
    length
}
