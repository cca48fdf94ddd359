//! What the bits of a frame depend on besides the program: the processor's instructions and the system's elementary
//! functions. The log names both, and `verify` compares them with its own.

use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

use bench_dragon_motion::solve::table::Instructions;
use bench_dragon_show::scene::Scene;

/// Arguments at which the elementary functions are evaluated.
const ARGUMENTS: u32 = 4096;
/// Hexadecimal digits of the fingerprint.
const FINGERPRINT_DIGITS: usize = 16;

/// The arithmetic of a machine, as far as it can show in a frame.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Arithmetic {
    /// The processor's architecture, for people: `x86_64`.
    pub architecture: String,
    /// The instructions that tables are read with, by [`Instructions::name`].
    pub instructions: String,
    /// The first 16 digits of a hash over what the system's elementary functions return: their last digits differ from
    /// one library to another.
    pub elementary_functions: String,
}

impl Arithmetic {
    /// What a show of this scene is computed with here.
    pub fn of(scene: &Scene) -> Self {
        Self {
            architecture: std::env::consts::ARCH.to_owned(),
            instructions: scene.motion.instructions().name().to_owned(),
            elementary_functions: elementary_functions().to_owned(),
        }
    }

    /// Whether this machine can compute the same bits.
    pub fn is_available(&self) -> bool {
        let instructions = Instructions::of_name(&self.instructions);
        self.architecture == std::env::consts::ARCH
            && instructions.is_some_and(Instructions::is_available)
            && self.elementary_functions == elementary_functions()
    }
}

/// A fingerprint of the elementary functions that solvers and searches call. They are the same as long as a process lives.
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
