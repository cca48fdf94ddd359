//! The benches of a dragon, independent of the scene file's syntax.

/// The benches of a dragon. The scene constructs it and has checked that every length is positive and that each board
/// is longer than twice its hole inset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Team {
    /// The number of benches, at least 1; one less than the number of handles.
    pub benches: usize,
    /// The length of the head's board, in metres.
    pub head_length: f64,
    /// The length of every other board, in metres.
    pub body_length: f64,
    /// The width of every board, in metres.
    pub width: f64,
    /// The distance from the centre of a handle's hole to the nearest end of the board, in metres.
    pub hole_inset: f64,
}

impl Team {
    /// Returns the number of handles.
    pub fn handles(&self) -> usize {
        self.benches + 1
    }

    /// Returns the metres between the two handles of a bench (0 = head).
    pub fn link(&self, bench: usize) -> f64 {
        let board = if bench == 0 { self.head_length } else { self.body_length };
        board - 2.0 * self.hole_inset
    }

    /// Returns the length of the shorter kind of link, in metres.
    pub fn shortest_link(&self) -> f64 {
        self.link(0).min(self.link(1))
    }

    /// Returns the length of the longer kind of link, in metres.
    pub fn longest_link(&self) -> f64 {
        self.link(0).max(self.link(1))
    }

    /// Returns the metres from the first handle to the last if the team is stretched.
    pub fn length(&self) -> f64 {
        self.link(0) + self.link(1) * (self.benches - 1) as f64
    }
}
