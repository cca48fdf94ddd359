//! Points by squares of the stage, so that points near a place are found without testing the others.
//!
//! A hash of the square leads to a list of points, which are linked through an array in descending order of their
//! numbers. Different squares can share a list.

/// The end of a list.
const NONE: u32 = u32::MAX;

/// Points by squares.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    squares_per_metre: f64,
    /// The last point of each list, and the point before each point.
    last: Vec<u32>,
    before: Vec<u32>,
    places: Vec<(f64, f64)>,
}

/// Lists from one row of squares to the next, modulo their number. With this constant, groups of points far from each
/// other rarely share lists, and the squares of a row have consecutive lists.
const ROW: u32 = 0x9E37_79B1;

impl Grid {
    /// Reserves the memory for points with numbers from 0 to `points - 1`.
    pub(super) fn new(points: usize) -> Self {
        let lists = (2 * points).next_power_of_two();
        Self {
            squares_per_metre: 1.0,
            last: vec![NONE; lists],
            before: vec![NONE; points],
            places: vec![(0.0, 0.0); points],
        }
    }

    /// Empties the grid and sets the side of a square, in metres.
    pub(super) fn clear(&mut self, side: f64) {
        self.squares_per_metre = side.recip();
        self.last.fill(NONE);
    }

    /// Adds a point; numbers must ascend.
    #[inline]
    pub(super) fn add(&mut self, point: usize, x: f64, y: f64) {
        let list = self.list(self.square(x), self.square(y));
        self.places[point] = (x, y);
        self.before[point] = std::mem::replace(&mut self.last[list], point as u32);
    }

    /// Calls `visit` for every point from number `from` on that is within `distance` metres of a place. If two squares
    /// share a list, it calls `visit` twice for some points.
    #[inline]
    pub(super) fn visit_near(&self, (x, y): (f64, f64), distance: f64, from: usize, mut visit: impl FnMut(usize)) {
        for row in self.square(y - distance)..=self.square(y + distance) {
            for column in self.square(x - distance)..=self.square(x + distance) {
                let mut next = self.last[self.list(column, row)];
                while next != NONE && next as usize >= from {
                    let point = next as usize;
                    let (dx, dy) = (self.places[point].0 - x, self.places[point].1 - y);
                    if dx * dx + dy * dy <= distance * distance {
                        visit(point);
                    }
                    next = self.before[point];
                }
            }
        }
    }

    #[inline]
    fn square(&self, coordinate: f64) -> i32 {
        let squares = coordinate * self.squares_per_metre;
        let whole = squares as i32;
        whole - i32::from(squares < f64::from(whole))
    }

    #[inline]
    fn list(&self, column: i32, row: i32) -> usize {
        let hash = (row as u32).wrapping_mul(ROW).wrapping_add(column as u32);
        hash as usize & (self.last.len() - 1)
    }
}
