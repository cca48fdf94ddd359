//! Changes of certificates that keep what bytes at random would never get right. These are lines of every kind, places
//! in order, and claims with numbers near the true ones.

use fastrand::Rng;
use serde_json::{Value, json};

use super::bytes::{changed, renumbered};
use super::certificate::lines_of;
use super::changes::{change, first_result, list};

/// Changes a certificate.
pub fn mutate(data: &[u8], random: &mut Rng) -> Vec<u8> {
    let text = String::from_utf8_lossy(data);
    let parsed: Result<Vec<Value>, _> = text.lines().map(serde_json::from_str).collect();
    // Lines that have lost their fields in an earlier change are not changed by name again.
    let is_whole = |lines: &Vec<Value>| lines.len() > 2 && lines[0]["scene"].is_string() && first_result(lines) > 1;
    let Some(mut lines) = parsed.ok().filter(is_whole) else { return changed(data, random) };
    match random.u8(..16) {
        0 => return changed(data, random),
        1 | 2 => return renumbered(&text, random).into_bytes(),
        3..6 => {
            // The data of an event, and the claims about it.
            let is_event = |line: &Value| !["step", "certificate"].contains(&line["type"].as_str().unwrap_or_default());
            let events: Vec<usize> = (0..lines.len()).filter(|at| is_event(&lines[*at])).collect();
            let Some(at) = random.choice(&events) else { return changed(data, random) };
            let mut texts: Vec<String> = lines.iter().map(Value::to_string).collect();
            texts[*at] = match random.u8(..3) {
                0 => {
                    let near = 1.0 + 10f64.powi(-random.i32(1..9)) * (2.0 * random.f64() - 1.0);
                    scaled(&lines[*at], near, random).to_string()
                }
                1 => texts[*at].replace("proved", "none").replace("undecided", "proved"),
                _ => renumbered(&texts[*at], random),
            };
            return (texts.join("\n") + "\n").into_bytes();
        }
        6..8 => {
            rearrange(&mut lines, random);
        }
        _ => {}
    }
    for _ in 0..1 + random.usize(..3) {
        if is_whole(&lines) {
            match random.u8(..3) {
                0 => rearrange(&mut lines, random),
                _ => drop(change(&mut lines, random)),
            }
        }
    }
    lines_of(&lines)
}

/// Changes a certificate so that it stays well formed, and often valid. A change is a step in two, wider spans, a
/// weaker claim, or a line of another kind with the places of a step.
fn rearrange(lines: &mut Vec<Value>, random: &mut Rng) {
    let results = first_result(lines);
    let at = random.usize(1..results);
    let last = lines.len() - 1;
    match random.u8(..6) {
        0 => split(lines, at, random),
        1 => widen(&mut lines[at], random),
        2 => {
            let conjured = conjured(&lines[at], random);
            lines.insert(random.usize(at..=results), conjured);
        }
        3 => {
            // A claim, weaker or stronger, of the result or of a step.
            let at = if random.bool() { last } else { at };
            let fields =
                ["lo", "hi", "value_lo", "value_hi", "ratio_lo", "ratio_hi", "time_until", "time_lo", "time_hi"];
            let others = ["apart", "most", "limit", "radius", "pitch", "theta"];
            for field in fields.iter().chain(&others) {
                if let Some(number) = lines[at][*field].as_f64().filter(|_| random.bool()) {
                    let by = 10f64.powi(-random.i32(..13)) * (2.0 * random.f64() - 1.0);
                    lines[at][*field] = json!(number + by);
                }
            }
        }
        4 => {
            // Whole numbers: benches, links, handles, obstacles.
            let field =
                *random.choice(&["bench_a", "bench_b", "bench", "link", "handle", "obstacle"]).unwrap_or(&"link");
            let at = if random.bool() { last } else { at };
            if let Some(number) = lines[at][field].as_u64() {
                lines[at][field] = json!(number.wrapping_add_signed(random.i64(-2..3)) % 1000);
            }
            let benches = lines[at].get_mut("benches").and_then(Value::as_array_mut);
            if let Some(bench) = benches.and_then(|benches| random.choice(benches)) {
                *bench = json!(random.u8(..5));
            }
        }
        _ => {
            // The question, the end of a stretch, the obstacles of a step, evidence of the other kind.
            let line = &mut lines[at];
            if let Some(free) = line.get_mut("free").and_then(Value::as_array_mut) {
                if random.bool() {
                    free.pop();
                } else {
                    free.push(json!(random.u8(..4)));
                }
            }
            if let Some(fields) = line.as_object_mut() {
                let (one, other) = if random.bool() { ("window", "beyond") } else { ("beyond", "window") };
                if let Some(evidence) = fields.remove(one) {
                    fields.insert(other.to_owned(), evidence);
                }
            }
            if lines[last]["until"].is_string() {
                lines[last]["until"] = json!(random.choice(["path_end", "contact", "time"]));
                lines[last]["time_until"] = if random.bool() { Value::Null } else { json!(random.f64()) };
            }
            if random.u8(..4) == 0 {
                lines[0]["about"] =
                    json!(random.choice(["events", "least_clearance", "greatest_speed", "least_pitch"]));
            }
        }
    }
}

/// Cuts a step in two at a place of the head.
fn split(lines: &mut Vec<Value>, at: usize, random: &mut Rng) {
    let line = &lines[at];
    let ends = (line["from"][1].as_f64(), line["to"][1].as_f64());
    let (Some(from), Some(to)) = ends else { return };
    let middle = from + (to - from) * random.f64();
    let mut second = line.clone();
    second["from"][1] = json!(middle);
    lines[at]["to"][0] = second["from"][0].clone();
    lines[at]["to"][1] = json!(middle);
    lines.insert(at + 1, second);
}

/// Moves the ends of the spans of a line outward, or inward, by a little.
fn widen(line: &mut Value, random: &mut Rng) {
    let by = 10f64.powi(-random.i32(1..16)) * if random.u8(..4) == 0 { -1.0 } else { 1.0 };
    for span in list(line, "spans", random).into_iter().flatten() {
        let (Some(lo), Some(hi)) = (span[0][1].as_f64(), span[1][1].as_f64()) else { continue };
        let sign = if hi < lo { -by } else { by };
        span[0][1] = json!(lo - sign);
        span[1][1] = json!(hi + sign);
    }
}

/// Returns a line of any kind with the places of another.
fn conjured(line: &Value, random: &mut Rng) -> Value {
    let [to, spans, at] = ["to", "spans", "at"].map(|field| line[field].clone());
    let from = if random.bool() { to.clone() } else { line["from"].clone() };
    let (number, length) = (random.u8(..4), 4.0 * random.f64());
    let benches = json!([number, number + 2]);
    let point = json!([to[1].as_f64().unwrap_or_default() - length, 0.1 * random.f64()]);
    match random.u8(..13) {
        0 => json!({"type": "path_end"}),
        1 => json!({"type": "witness", "benches": benches, "heads": [[from, to]], "spans": [spans], "point": point}),
        2 => json!({"type": "stall", "link": number, "from": from, "to": to, "spans": spans}),
        3 => json!({"type": "lock", "link": 0, "to": to, "spans": [], "last": [], "window": [from, to]}),
        4 => json!({"type": "lock", "link": 0, "to": to, "spans": [], "last": [], "beyond": [from, to]}),
        5 => {
            json!({"type": "witness", "benches": benches, "heads": [[from, to]], "spans": [spans], "at": [at],
            "most": length})
        }
        6 => json!({"type": "witness", "obstacle": number, "benches": [0], "heads": [[from, to]], "spans": [spans],
            "point": point}),
        7 => json!({"type": "speeds", "from": from, "to": to, "spans": spans, "at": at}),
        8 => json!({"type": "fast", "handle": number, "spans": spans, "at": at}),
        9 => json!({"type": "reach", "radius": length, "from": length}),
        10 => json!({"type": "far", "pitch": length, "radius": 30.0 * length}),
        11 => json!({"type": "head_locks", "from": length, "to": 1.1 * length}),
        _ => {
            json!({"type": "overlap", "from": length, "to": 1.001 * length, "theta": 30.0 * length, "benches": benches,
            "spans": spans, "point": point})
        }
    }
}

/// Returns a line with one of its numbers that is not whole multiplied by a factor.
fn scaled(line: &Value, factor: f64, random: &mut Rng) -> Value {
    fn count(value: &Value) -> usize {
        match value {
            Value::Array(values) => values.iter().map(count).sum(),
            Value::Object(fields) => fields.values().map(count).sum(),
            value => usize::from(value.is_f64()),
        }
    }
    fn scale(value: &mut Value, left: &mut usize, factor: f64) {
        match value {
            Value::Array(values) => values.iter_mut().for_each(|value| scale(value, left, factor)),
            Value::Object(fields) => fields.values_mut().for_each(|value| scale(value, left, factor)),
            value => {
                if let Some(number) = value.as_f64().filter(|_| value.is_f64()) {
                    if *left == 0 {
                        *value = json!(number * factor);
                    }
                    *left = left.wrapping_sub(1);
                }
            }
        }
    }
    let (mut line, mut left) = (line.clone(), random.usize(..count(line).max(1)));
    scale(&mut line, &mut left, factor);
    line
}
