//! The model of the stage: curves, the path made of them, the board, the separation of two boards, root finding.
//!
//! Pure functions of numbers: no clock, no input or output, no team in motion, no scene file. Points and vectors are
//! nalgebra's, in metres, in the frame `stage` (x right, y up).

pub mod arc;
pub mod board;
pub mod curve;
pub mod curve_bounds;
pub mod description;
pub mod double_double;
pub mod elementary;
pub mod line;
pub mod path;
pub mod placed_spiral;
pub mod root;
pub mod segment;
pub mod separation;
pub mod shape;
pub mod spiral;
pub mod team;

/// A place on the stage, in metres.
pub type Point = nalgebra::Point2<f64>;
/// A displacement on the stage, metres, or a direction.
pub type Vector = nalgebra::Vector2<f64>;

#[cfg(test)]
mod tests {
    use std::path::Path;

    /// Returns the lines of product code of a folder that call an elementary function of the standard library.
    fn elementary_calls(folder: &Path) -> Vec<String> {
        let methods = "sin cos sin_cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp exp2 exp_m1 ln \
                       ln_1p log log2 log10 powf cbrt hypot";
        let calls: Vec<String> = methods.split_whitespace().map(|method| format!(".{method}(")).collect();
        let mut found = Vec::new();
        for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            // Tests may, and the reference calculates with numbers of its own.
            let is_exempt = ["tests.rs", "tests", "reference"].iter().any(|name| path.ends_with(name));
            if path.is_dir() && !is_exempt {
                found.extend(elementary_calls(&path));
            } else if !is_exempt {
                let text = std::fs::read_to_string(&path).unwrap();
                let code = text.split("#[cfg(test)]").next().unwrap_or_default();
                let lines = code.lines().filter(|line| calls.iter().any(|call| line.contains(call.as_str())));
                found.extend(lines.map(|line| format!("{}: {line}", path.display())));
            }
        }
        found
    }

    #[test]
    fn elementary_functions_have_the_same_bits_everywhere() {
        let crates = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        for name in ["motion", "show"] {
            let calls = elementary_calls(&crates.join(name).join("src"));
            assert!(calls.is_empty(), "{calls:#?}");
        }
    }
}
