//! The rows of a sheet: where benches come to, when, and what their feet do there.
//!
//! In: a walk. Out: rows in order of time, of one bench or of the first and the last of several.

use bench_dragon_messages::state::EventKind;
use bench_dragon_motion::model::Point;

use crate::piece::turns_between;
use crate::place::Landmarks;
use crate::walk::{BenchWalk, DragonWalk, Near, Side, Stretch, Walk};
use crate::words::Language;

/// The relative change of speed that a row tells.
const FASTER: f64 = 0.1;

/// A row.
#[derive(Debug, Clone)]
pub(crate) struct Row {
    /// The time of the first bench, and of the last one where it is another.
    pub time: f64,
    pub last: Option<f64>,
    /// The letter on the map.
    pub mark: Option<String>,
    pub what: String,
    pub place: String,
}

/// Makes the words of a walk.
pub(crate) struct Teller<'w, 'a> {
    pub walk: &'w Walk<'a>,
    pub landmarks: Landmarks<'a>,
    pub language: Language,
}

impl<'w, 'a> Teller<'w, 'a> {
    pub fn new(walk: &'w Walk<'a>, language: Language) -> Self {
        let pieces: Vec<_> = walk.dragons.iter().map(|dragon| dragon.pieces.clone()).collect();
        Self { walk, landmarks: Landmarks::of(walk.ensemble(), &pieces, language), language }
    }

    /// Returns a number of the show in words: a bench, counted from 1 within its dragon.
    pub fn bench(&self, number: usize) -> String {
        let ensemble = self.walk.ensemble();
        match ensemble.owner(number) {
            Some((dragon, bench)) => self.language.benches(&ensemble.dragons()[dragon].name, bench + 1, bench + 1),
            None => self.obstacle(number - ensemble.handles()),
        }
    }

    /// Returns an obstacle's name.
    pub fn obstacle(&self, number: usize) -> String {
        let obstacles = self.walk.ensemble().ground().obstacles();
        let boundary = self.language.of(["boundary", "边界"]);
        match obstacles.get(number) {
            Some(_) if number + 1 == obstacles.len() && self.walk.ensemble().ground().has_boundary() => {
                boundary.to_owned()
            }
            Some(obstacle) => obstacle.name.clone(),
            None => String::new(),
        }
    }

    /// Returns what the feet of a bench do on one of its stretches, with the seconds that it takes.
    pub fn feet(&self, dragon: usize, bench: &BenchWalk, at: usize) -> String {
        let Stretch { piece, time, .. } = bench.stretches[at];
        let next = bench.stretches.get(at + 1);
        let piece = &self.walk.dragons[dragon].pieces[piece];
        let (from, to) =
            (piece.begin.max(bench.start), next.map_or(bench.end, |_| piece.end).max(piece.begin.max(bench.start)));
        let motion = &self.walk.ensemble().dragons()[dragon].motion;
        let turns = if to > from { turns_between(motion, from, to) } else { 0.0 };
        let seconds = next.map_or(self.walk.end, |next| next.time) - time;
        self.language.feet(piece.feet, to - from, turns, Some(seconds))
    }

    /// Returns the stage point at which a stretch of a bench begins: that of its front handle.
    pub fn point(&self, dragon: usize, bench: &BenchWalk, at: usize) -> Point {
        let motion = &self.walk.ensemble().dragons()[dragon].motion;
        let begin = self.walk.dragons[dragon].pieces[bench.stretches[at].piece].begin.max(bench.start);
        motion.placement().point(motion.path().point(motion.path().param_at(begin)))
    }

    /// Returns the rows of several benches of a dragon, by the numbers of the first and the last one.
    pub fn rows(&self, number: usize, (first, last): (usize, usize)) -> Vec<Row> {
        let DragonWalk { benches, .. } = &self.walk.dragons[number];
        let (front, rear) = (&benches[first], &benches[last]);
        let mut rows = Vec::new();
        let mut told: Option<f64> = None;
        for (at, stretch) in front.stretches.iter().enumerate() {
            let place = self.landmarks.words(self.point(number, front, at));
            let mut what = vec![self.feet(number, front, at)];
            let (least, greatest) = stretch.speeds;
            let changes =
                told.is_none_or(|told| (least / told - 1.0).abs() >= FASTER || (greatest / told - 1.0).abs() >= FASTER);
            if changes && least.is_finite() {
                let is_steady = greatest - least < FASTER * greatest;
                what.push(self.language.speed(if is_steady { (least, least) } else { (least, greatest) }));
                told = Some(if is_steady { least } else { greatest });
            }
            let same = rear.stretches.iter().find(|other| other.piece == stretch.piece && other.time > 0.0);
            let place = if at == 0 { self.language.stand(&place) } else { place };
            rows.push(Row {
                time: stretch.time,
                last: same.map(|other| other.time).filter(|_| first != last && at > 0),
                mark: (at > 0).then(|| letter(stretch.piece)),
                what: self.language.join(&what),
                place,
            });
        }
        rows.extend(self.calls());
        rows.sort_by(|one, other| one.time.total_cmp(&other.time));
        rows
    }

    /// Returns the rows of what the whole show does: cues, holds, events.
    pub fn calls(&self) -> Vec<Row> {
        let row = |time, what, place| Row { time, last: None, mark: None, what, place };
        let cue = |cue: &bench_dragon_show::ReachedCue| {
            let call = self.language.of(if cue.pauses { ["HOLD until go", "停候口令"] } else { ["cue", "提示"] });
            row(cue.time, self.language.labelled(call, &cue.name), String::new())
        };
        let cues = self.walk.cues.iter().map(cue);
        let event = |event: &crate::walk::Happening| {
            let name = |number: Option<u32>| number.map_or(String::new(), |number| self.bench(number as usize));
            let (one, other) = (name(event.bench_a), name(event.bench_b));
            let other = if event.kind == EventKind::Obstacle {
                format!("{}{other}", self.language.of(["the ", ""]))
            } else {
                other
            };
            row(event.time, self.language.event(event.kind, &one, &other), String::new())
        };
        cues.chain(self.walk.events.iter().map(event)).collect()
    }

    /// Returns who comes nearest to a bench, when, and the span in which it is near.
    pub fn near(&self, near: &Near, clock: &dyn Fn(f64) -> String) -> String {
        let side = match near.side {
            Side::Left => ["left", "左"],
            Side::Right => ["right", "右"],
            Side::Ahead => ["ahead", "前"],
            Side::Behind => ["behind", "后"],
        };
        let [time, from, until] = [near.time, near.span.0, near.span.1].map(clock);
        let when = if from == until { time } else { self.language.within(&time, &from, &until) };
        let (who, side) = (self.bench(near.other), self.language.of(side).to_owned());
        let parts = [who, side, self.language.distance(near.distance), when];
        self.language.join(&parts)
    }

    /// Returns the obstacle that a bench comes nearest to.
    pub fn near_obstacle(&self, near: &Near, clock: &dyn Fn(f64) -> String) -> String {
        let parts = [self.obstacle(near.other), self.language.distance(near.distance), clock(near.time)];
        self.language.join(&parts)
    }
}

/// Returns the letter of a joint by the number of the piece that it begins: A to Z, then A1 and so on.
pub(crate) fn letter(piece: usize) -> String {
    let piece = piece.saturating_sub(1);
    // The remainder is below 26.
    let letter = char::from(b'A' + (piece % 26) as u8);
    if piece < 26 { letter.to_string() } else { format!("{letter}{}", piece / 26) }
}
