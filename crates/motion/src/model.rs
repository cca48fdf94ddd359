//! The model of the stage: curves, the path made of them, the board, the separation of two boards, root finding.
//!
//! Pure functions of numbers: no clock, no input or output, no team in motion, no scene file. Every other room calls it.
//! Points and vectors are nalgebra's, in metres, frame `stage` (x right, y up).

pub mod arc;
pub mod board;
pub mod curve;
pub mod description;
pub mod double_double;
pub mod line;
pub mod path;
pub mod root;
pub mod segment;
pub mod separation;
pub mod spiral;
pub mod team;

/// A place on the stage, metres.
pub type Point = nalgebra::Point2<f64>;
/// A displacement on the stage, metres, or a direction.
pub type Vector = nalgebra::Vector2<f64>;

#[cfg(test)]
mod tests {
    use std::path::Path;

    /// Counts the lines of a folder's sources, but for those of one room, that name a kind of segment.
    fn kinds_named(folder: &Path, except: &Path) -> usize {
        let named = |entry: std::io::Result<std::fs::DirEntry>| {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true if path == except => 0,
                true => kinds_named(&path, except),
                false => std::fs::read_to_string(&path).unwrap().matches("Segment::").count(),
            }
        };
        std::fs::read_dir(folder).unwrap().map(named).sum()
    }

    #[test]
    fn only_the_model_distinguishes_kinds_of_curves() {
        let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        let model = sources.join("model");
        assert!(kinds_named(&model, Path::new("")) > 10);
        // The one below `src` is the string of this test itself.
        assert_eq!(kinds_named(&sources, &model), 1);
    }
}
