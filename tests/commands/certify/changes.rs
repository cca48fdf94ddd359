//! Random changes to certificates. Shared by the test of tampering and the fuzz target.

use fastrand::Rng;
use serde_json::{Value, json};

/// Collects all numbers of a value that are not whole: coordinates, times, points.
fn numbers<'a>(value: &'a mut Value, found: &mut Vec<&'a mut Value>) {
    match value {
        Value::Number(number) if number.is_f64() => found.push(value),
        Value::Array(values) => values.iter_mut().for_each(|value| numbers(value, found)),
        Value::Object(fields) => fields.iter_mut().for_each(|(_, value)| numbers(value, found)),
        _ => {}
    }
}

/// Returns the number changed by a share of itself, from a tenth to one in 10^15.
fn moved(number: &Value, random: &mut Rng) -> Option<Value> {
    let number = number.as_f64()?;
    let share = 10f64.powi(-random.i32(1..16)) * random.f64();
    Some(json!(if random.bool() { number * (1.0 + share) } else { number * (1.0 - share) }))
}

/// Returns the index of the first result: the lines before prove it.
pub fn first_result(lines: &[Value]) -> usize {
    lines.iter().position(|line| line["type"] == "result").unwrap_or(lines.len())
}

/// Returns a list of spans or places of a line. A line about several dragons has one for each.
pub fn list<'a>(line: &'a mut Value, name: &str, random: &mut Rng) -> Option<&'a mut Vec<Value>> {
    let lists = line.get_mut(name)?.as_array_mut()?;
    // A place begins with a number, a span with a place.
    let depth = if name == "at" { 1 } else { 2 };
    let within = (0..depth).try_fold(lists.first()?, |item, _| item.get(0));
    if within.is_some_and(Value::is_array) { random.choice(lists)?.as_array_mut() } else { Some(lists) }
}

/// Changes a certificate in one place and returns a description of the change; `None` if nothing changed.
pub fn change(lines: &mut Vec<Value>, random: &mut Rng) -> Option<String> {
    let before = lines.clone();
    let index = random.usize(1..lines.len());
    let step = random.usize(1..first_result(lines).max(2));
    let what = match random.u8(..9) {
        0 => {
            // A step becomes longer or shorter, and the next one begins at its end.
            let to = lines[step].get_mut("to")?.get_mut(1)?;
            *to = moved(to, random)?;
            let end = to.clone();
            if let Some(from) =
                lines.get_mut(step + 1).and_then(|line| line.get_mut("from")).and_then(|from| from.get_mut(1))
            {
                *from = end;
            }
            format!("the end of line {}", step + 1)
        }
        1 => {
            let mut found = Vec::new();
            numbers(&mut lines[index], &mut found);
            let chosen = random.choice(found)?;
            *chosen = moved(chosen, random)?;
            format!("a number in line {}", index + 1)
        }
        2 => {
            // A span is moved.
            let spans = list(&mut lines[step], "spans", random)?;
            let span = random.choice(spans.iter_mut())?;
            let by = moved(&span[0][1], random)?.as_f64()? - span[0][1].as_f64()?;
            for end in 0..2 {
                span[end][1] = json!(span[end][1].as_f64()? + by);
            }
            format!("a span in line {}", step + 1)
        }
        3 => {
            let name = *random.choice(&["spans", "spans", "at", "last"])?;
            let places = list(&mut lines[step], name, random)?;
            if !places.is_empty() {
                places.remove(random.usize(..places.len()));
            }
            format!("one of {name} out of line {}", step + 1)
        }
        4 => {
            drop(lines.remove(index));
            format!("line {} left out", index + 1)
        }
        5 => {
            lines.insert(index, before[step].clone());
            format!("line {} again as {}", step + 1, index + 1)
        }
        6 => {
            lines.swap(index, step);
            format!("lines {} and {}", index + 1, step + 1)
        }
        7 => {
            let field = *random.choice(&["moving", "clear", "links", "status"])?;
            let value = lines[index].get_mut(field)?;
            *value = match field {
                "links" => json!(if *value == "all" { "front" } else { "all" }),
                "status" => json!(random.choice(["proved", "none", "undecided"])),
                _ => json!(!value.as_bool()?),
            };
            format!("{field} in line {}", index + 1)
        }
        _ => {
            // Changes a character of the scene.
            let mut text = lines[0]["scene"].as_str()?.to_owned().into_bytes();
            let digits: Vec<usize> = (0..text.len()).filter(|at| text[*at].is_ascii_digit()).collect();
            let at = *random.choice(&digits)?;
            text[at] = b'0' + random.u8(..10);
            lines[0]["scene"] = json!(String::from_utf8(text).ok()?);
            format!("character {at} of the scene")
        }
    };
    (*lines != before).then_some(what)
}
