//! The benches of a dragon, independent of the scene file's syntax.

/// The benches of a dragon. The scene constructs it and has checked that every length is positive and that each board
/// is longer than twice its hole inset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Team {
    /// The number of benches, at least 1; one less than the number of handles.
    pub benches: usize,
    /// The length of the head's board, in metres.
    pub head_length: f64,
    /// The length of every other board, in metres, unless the tail has its own.
    pub body_length: f64,
    /// The width of every board, in metres, unless the head or the tail has its own.
    pub width: f64,
    /// The distance from the centre of a handle's hole to the nearest end of the board, in metres.
    pub hole_inset: f64,
    /// The sizes in which the head and the tail differ from the body.
    pub ends: Ends,
}

/// The sizes in which the head and the tail differ from the body, in metres. The tail is the last bench; a team of one
/// bench has none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ends {
    /// The width of the head's board.
    pub head_width: Option<f64>,
    /// The width of the tail's board.
    pub tail_width: Option<f64>,
    /// The length of the tail's board.
    pub tail_length: Option<f64>,
}

impl Ends {
    /// A head as wide as the body, and a tail like any other bench.
    pub const NONE: Self = Self { head_width: None, tail_width: None, tail_length: None };
}

impl Team {
    /// Returns the number of handles.
    pub fn handles(&self) -> usize {
        self.benches + 1
    }

    /// Returns the metres between the two handles of a bench (0 = head).
    #[inline]
    pub fn link(&self, bench: usize) -> f64 {
        self.board_length(bench) - 2.0 * self.hole_inset
    }

    /// Returns the length of the board of a bench, in metres.
    #[inline]
    pub fn board_length(&self, bench: usize) -> f64 {
        match self.ends.tail_length {
            _ if bench == 0 => self.head_length,
            Some(length) if bench + 1 == self.benches => length,
            _ => self.body_length,
        }
    }

    /// Returns the width of the board of a bench, in metres.
    #[inline]
    pub fn board_width(&self, bench: usize) -> f64 {
        let own = match bench {
            0 => self.ends.head_width,
            _ if bench + 1 == self.benches => self.ends.tail_width,
            _ => None,
        };
        own.unwrap_or(self.width)
    }

    /// Returns the tail, if there are benches between it and the head and it has a size of its own.
    pub fn own_tail(&self) -> Option<usize> {
        let differs = self.ends.tail_length.is_some() || self.ends.tail_width.is_some();
        (differs && self.benches > 2).then(|| self.benches - 1)
    }

    /// Returns the tail, if there are benches between it and the head and its link has a length of its own.
    pub fn own_tail_link(&self) -> Option<usize> {
        self.own_tail().filter(|tail| self.link(*tail) != self.link(1))
    }

    /// Returns a bench of each kind: the head, the bench behind it, and the last.
    pub fn kinds(&self) -> [usize; 3] {
        [0, 1, self.benches.max(2) - 1]
    }

    /// Returns the foremost benches of the team. The last of fewer benches is no tail.
    pub fn foremost(&self, benches: usize) -> Self {
        if benches >= self.benches {
            return *self;
        }
        let ends = Ends { head_width: self.ends.head_width, ..Ends::NONE };
        Self { benches, ends, ..*self }
    }

    /// Returns the length of the shortest link, in metres.
    pub fn shortest_link(&self) -> f64 {
        self.kinds().map(|bench| self.link(bench)).into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Returns the length of the longest link, in metres.
    pub fn longest_link(&self) -> f64 {
        self.kinds().map(|bench| self.link(bench)).into_iter().fold(0.0, f64::max)
    }

    /// Returns the width of the widest board, in metres.
    pub fn widest(&self) -> f64 {
        self.kinds().map(|bench| self.board_width(bench)).into_iter().fold(0.0, f64::max)
    }

    /// Returns the metres from the first handle to the last if the team is stretched.
    pub fn length(&self) -> f64 {
        let tail = self.own_tail().map_or(0.0, |tail| self.link(tail) - self.link(1));
        self.link(0) + self.link(1) * (self.benches - 1) as f64 + tail
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Factors of the body's sizes.
    #[derive(Debug, Clone, Copy, Default)]
    pub(crate) struct Factors {
        head_width: Option<f64>,
        tail_width: Option<f64>,
        tail_link: Option<f64>,
    }

    impl Factors {
        /// Returns the team with a head and a tail of these factors.
        pub(crate) fn ends_of(self, team: Team) -> Team {
            let Self { head_width, tail_width, tail_link } = self;
            let [head_width, tail_width] = [head_width, tail_width].map(|factor| Some(factor? * team.width));
            let tail_length = tail_link.map(|factor| 2.0 * team.hole_inset + factor * team.link(1));
            Team { ends: Ends { head_width, tail_width, tail_length }, ..team }
        }
    }

    /// Heads and tails that differ from the body in some of their sizes.
    pub(crate) fn any_ends() -> impl Strategy<Value = Factors> {
        let width = || prop::option::of(0.3..4.0f64);
        (width(), width(), prop::option::of(0.2..3.0f64)).prop_map(|(head_width, tail_width, tail_link)| Factors {
            head_width,
            tail_width,
            tail_link,
        })
    }
}
