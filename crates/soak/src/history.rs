//! A soak test's figures over time, in bounded memory.

use serde::Serialize;

/// The number of stretches of time. When all are full, neighbours are merged and each stretch is twice as long.
const MOST_STRETCHES: usize = 1024;

/// Columns of figures, each row a stretch of time. Each column keeps the greatest value of a stretch: the worst for
/// percentiles, the latest for counts that only grow.
#[derive(Debug, Clone, Serialize)]
pub struct History {
    /// The length of a row, in seconds.
    seconds_per_row: u64,
    columns: Vec<String>,
    /// The time of the end of each row, in seconds since the start, and its figures; NaN (null in JSON) for unknown
    /// figures.
    rows: Vec<Row>,
    #[serde(skip)]
    seconds_in_last: u64,
}

/// A stretch of time.
#[derive(Debug, Clone, Serialize)]
struct Row {
    seconds: f64,
    values: Vec<f64>,
}

impl History {
    /// Creates an empty history with these columns.
    pub fn new(columns: Vec<String>) -> Self {
        Self { seconds_per_row: 1, columns, rows: Vec::with_capacity(MOST_STRETCHES), seconds_in_last: 0 }
    }

    /// Adds the figures of a second that ended `seconds` after the start, one for each column.
    pub fn push(&mut self, seconds: f64, values: Vec<f64>) {
        debug_assert_eq!(values.len(), self.columns.len());
        let row = Row { seconds, values };
        match self.rows.last_mut() {
            Some(last) if self.seconds_in_last < self.seconds_per_row => {
                last.merge(&row);
                self.seconds_in_last += 1;
            }
            _ => {
                if self.rows.len() == MOST_STRETCHES {
                    self.halve();
                }
                self.rows.push(row);
                self.seconds_in_last = 1;
            }
        }
    }

    fn halve(&mut self) {
        let merged = self.rows.chunks(2).map(|pair| {
            let mut first = pair[0].clone();
            pair[1..].iter().for_each(|second| first.merge(second));
            first
        });
        let merged: Vec<_> = merged.collect();
        self.rows.clear();
        self.rows.extend(merged);
        self.seconds_per_row *= 2;
    }

    /// Returns the length of a row, in seconds.
    pub fn seconds_per_row(&self) -> u64 {
        self.seconds_per_row
    }

    /// Returns the points of a column: seconds since the start, and the known value. Empty for an unknown column.
    pub fn column(&self, name: &str) -> Vec<(f64, f64)> {
        let Some(at) = self.columns.iter().position(|column| column == name) else { return Vec::new() };
        self.rows.iter().map(|row| (row.seconds, row.values[at])).filter(|point| !point.1.is_nan()).collect()
    }
}

impl Row {
    fn merge(&mut self, later: &Row) {
        self.seconds = later.seconds;
        for (mine, other) in self.values.iter_mut().zip(&later.values) {
            // The maximum of a number and NaN is the number.
            *mine = mine.max(*other);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_bounded_and_nothing_great_is_lost() {
        let mut history = History::new(vec!["count".to_owned(), "spike".to_owned()]);
        let seconds = 100_000;
        for second in 0..seconds {
            let spike = if second == 54_321 { 9.0 } else { f64::NAN };
            history.push(f64::from(second), vec![f64::from(second), spike]);
        }
        let counts = history.column("count");
        assert!((MOST_STRETCHES / 2..=MOST_STRETCHES).contains(&counts.len()), "{}", counts.len());
        assert_eq!(counts.last(), Some(&(99_999.0, 99_999.0)));
        assert!(counts.windows(2).all(|pair| pair[1].0 - pair[0].0 <= history.seconds_per_row() as f64));
        let spikes = history.column("spike");
        assert_eq!(spikes.len(), 1);
        assert_eq!(spikes[0].1, 9.0);
        assert!((spikes[0].0 - 54_321.0).abs() < history.seconds_per_row() as f64);
    }
}
