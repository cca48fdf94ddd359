//! The tables of this folder, computed with 50 digits: one reader for every test that compares with them.

/// One handle at one time.
pub struct Row {
    /// Seconds of the table's own clock.
    pub time: f64,
    pub handle: usize,
    pub x: f64,
    pub y: f64,
    pub speed: f64,
}

/// Returns the rows of a CSV file whose first two columns are time and handle, and whose last three are x, y and speed.
pub fn table(text: &str) -> Vec<Row> {
    let row = |line: &str| {
        let fields: Vec<f64> = line.split(',').map(|field| field.parse().unwrap()).collect();
        let [time, handle, .., x, y, speed] = fields[..] else { panic!("{line}") };
        Row { time, handle: handle as usize, x, y, speed }
    };
    text.lines().skip(1).map(row).collect()
}
