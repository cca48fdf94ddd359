//! The rows of all benches as CSV: `bench,t,x,y,heading,speed,what`.
//!
//! A time is rounded to a hundredth of a second, and the place is that of the rounded time: the middle of the bench, the
//! midpoint of its handles. Metres, radians, seconds.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::ops::Range;

use bench_dragon_messages::sentence::rounded;
use bench_dragon_motion::event::Progress;
use bench_dragon_motion::solve::Chain;
use bench_dragon_show::solve_at_or_just_before;

use crate::stop::Teller;
use crate::walk::{Walk, middle};
use crate::words::Language;

/// Returns the CSV of some benches of each dragon; `None` if `progress` stops it.
pub fn csv(
    walk: &Walk<'_>,
    language: Language,
    benches: &[Range<usize>],
    clock: &dyn Fn(f64) -> String,
    progress: Progress<'_>,
) -> Option<String> {
    let teller = Teller::new(walk, language);
    let mut at: BTreeMap<u64, Vec<(usize, usize, String)>> = BTreeMap::new();
    let mut add = |time: f64, of: (usize, usize), what: String| {
        at.entry((100.0 * time).round() as u64).or_default().push((of.0, of.1, what));
    };
    for (dragon, range) in benches.iter().enumerate() {
        for bench in range.clone() {
            let (of, found) = ((dragon, bench), &walk.dragons[dragon].benches[bench]);
            for (index, stretch) in found.stretches.iter().enumerate() {
                add(stretch.time, of, teller.feet(dragon, found, index));
            }
            for row in teller.calls() {
                add(row.time, of, row.what);
            }
            found.board.iter().for_each(|near| add(near.time, of, teller.near(near, clock)));
            found.obstacle.iter().for_each(|near| add(near.time, of, teller.near_obstacle(near, clock)));
            let marks = (1..=(walk.end / walk.mark).floor() as u64).map(|mark| mark as f64 * walk.mark);
            marks.for_each(|time| add(time, of, String::new()));
        }
    }
    let ensemble = walk.ensemble();
    let (mut solver, mut chain) = (walk.solver(progress)?, Chain::new(ensemble.handles()));
    let times = at.len() as f64;
    let mut lines: Vec<((usize, usize), String)> = Vec::new();
    for (index, (hundredths, rows)) in at.into_iter().enumerate() {
        if progress(index as f64 / times).is_break() {
            return None;
        }
        let time = (hundredths as f64 / 100.0).min(walk.end);
        if solve_at_or_just_before(solver.as_mut(), time, &mut chain).is_err() {
            continue;
        }
        for (dragon, bench, what) in rows {
            let number = ensemble.handles_of(dragon).start + bench;
            let name = &ensemble.dragons()[dragon].name;
            let bench_name = if name.is_empty() { format!("{}", bench + 1) } else { format!("{name}:{}", bench + 1) };
            let (place, heading, speed) = (middle(&chain, number), chain.heading[number], chain.speed[number]);
            let [x, y] = [place.x, place.y].map(|metres| rounded(metres, 3));
            let (heading, speed) = (rounded(heading, 4), rounded(speed, 3));
            let what = what.replace('"', "\"\"");
            let line = format!("{bench_name},{},{x},{y},{heading},{speed},\"{what}\"", rounded(time, 2));
            lines.push(((dragon, bench), line));
        }
    }
    lines.sort_by_key(|(of, _)| *of);
    let mut text = "bench,t,x,y,heading,speed,what\n".to_owned();
    for (_, line) in lines {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{line}");
    }
    Some(text)
}
