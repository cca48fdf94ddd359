//! The arithmetic on which the bits of a frame depend: the processor's instructions and the system's elementary
//! functions. The log names both, and `verify` compares them with those of its machine.

use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

use bench_dragon_motion::solve::table::Instructions;
use bench_dragon_show::scene::Scene;

/// Arguments at which the elementary functions are evaluated.
const ARGUMENTS: u32 = 4096;
/// Hexadecimal digits of the fingerprint.
const FINGERPRINT_DIGITS: usize = 16;

/// The arithmetic of a machine, as far as it affects a frame.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Arithmetic {
    /// The processor's architecture, for people: `x86_64`.
    pub architecture: String,
    /// The name of the instructions that read the tables ([`Instructions::name`]).
    pub instructions: String,
    /// The first 16 digits of a hash over results of the system's elementary functions. Their last digits differ
    /// between libraries.
    pub elementary_functions: String,
}

impl Arithmetic {
    /// Returns the arithmetic of a scene's show on this machine.
    pub fn of(scene: &Scene) -> Self {
        Self {
            architecture: std::env::consts::ARCH.to_owned(),
            instructions: scene.motion.instructions().name().to_owned(),
            elementary_functions: elementary_functions().to_owned(),
        }
    }

    /// Returns true if this machine computes the same bits.
    pub fn is_available(&self) -> bool {
        let instructions = Instructions::of_name(&self.instructions);
        self.architecture == std::env::consts::ARCH
            && instructions.is_some_and(Instructions::is_available)
            && self.elementary_functions == elementary_functions()
    }
}

/// Returns the fingerprint of the elementary functions that solvers and searches call. Computed once a process.
fn elementary_functions() -> &'static str {
    static FINGERPRINT: OnceLock<String> = OnceLock::new();
    FINGERPRINT.get_or_init(fingerprint)
}

fn fingerprint() -> String {
    let mut hasher = blake3::Hasher::new();
    for k in 1..=ARGUMENTS {
        // Spread over nine magnitudes, with digits in all places.
        let x = 1e-4 * 1.005f64.powi(k as i32);
        let unit = f64::from(k) / f64::from(ARGUMENTS + 1);
        let (sin, cos) = x.sin_cos();
        let results = [
            sin,
            cos,
            x.tan(),
            x.atan(),
            unit.asin(),
            unit.acos(),
            x.asinh(),
            x.ln(),
            x.powf(unit),
            unit.atan2(x),
            x.hypot(unit),
        ];
        for result in results {
            hasher.update(&result.to_le_bytes());
        }
    }
    hasher.finalize().to_hex()[..FINGERPRINT_DIGITS].to_owned()
}
