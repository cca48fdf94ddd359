//! A chain as text: rows of a CSV table, or a line of JSON.

use bench_dragon_messages::sentence::number;
use bench_dragon_motion::solve::Chain;
use serde::Serialize;

/// The first row of the CSV table, with its line feed.
pub const CSV_HEADER: &str = "t,handle,x,y,heading,vx,vy,speed\n";

/// The chain at a time, as JSON.
#[derive(Serialize)]
struct TimeLine {
    t: f64,
    /// x, y, heading, vx, vy, speed; NaN becomes null.
    handles: Vec<[f64; 6]>,
}

/// Appends a row for each handle at `time`, in simulated seconds; NaN becomes an empty field.
pub fn csv_rows(time: f64, chain: &Chain, text: &mut String) {
    let time = number(time);
    for handle in 0..chain.handles() {
        text.extend([&time, ",", &handle.to_string()]);
        for value in numbers(chain, handle) {
            text.push(',');
            if !value.is_nan() {
                text.push_str(&number(value));
            }
        }
        text.push('\n');
    }
}

/// Appends a line of JSON with all handles at `time`, in simulated seconds.
pub fn json_line(time: f64, chain: &Chain, text: &mut String) {
    let line = TimeLine { t: time, handles: (0..chain.handles()).map(|handle| numbers(chain, handle)).collect() };
    // Numbers and names of fields only: nothing that JSON does not have.
    text.push_str(&serde_json::to_string(&line).unwrap_or_default());
    text.push('\n');
}

fn numbers(chain: &Chain, handle: usize) -> [f64; 6] {
    let Chain { x, y, heading, speed, vx, vy } = chain;
    [x, y, heading, vx, vy, speed].map(|column| column[handle])
}
