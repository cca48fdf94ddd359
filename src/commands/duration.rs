//! Times on the command line, `90`, `90s`, `1:30` or `1h30m`: one notation for wall time and simulated time.

use bench_dragon::messages::sentence::Expected;

/// Parses a time to seconds. The range is left to the command.
///
/// # Errors
/// The text has another form.
pub fn seconds(text: &str) -> Result<f64, Expected> {
    let text = text.trim();
    let parsed = text.parse().ok().or_else(|| of_clock(text)).or_else(|| in_units(text));
    parsed.ok_or(Expected("seconds, or a time such as 90s, 1:30, 5m or 1h30m".into()))
}

/// Parses a wall time to seconds, above 0.
///
/// # Errors
/// The text has another form.
pub fn wall_seconds(text: &str) -> Result<f64, Expected> {
    let seconds = seconds(text).ok().filter(|seconds| *seconds > 0.0 && *seconds <= 1e9);
    seconds.ok_or(Expected("a time above 0 such as 60, 90s, 1:30, 5m or 1h30m".into()))
}

/// Parses `minutes:seconds` or `hours:minutes:seconds`.
fn of_clock(text: &str) -> Option<f64> {
    let (before, seconds) = text.rsplit_once(':')?;
    let (hours, minutes) = before.split_once(':').unwrap_or(("0", before));
    let whole = |digits: &str| digits.parse::<u32>().ok().map(f64::from);
    let sixtieths = |number: &f64| (0.0..60.0).contains(number);
    let minutes = whole(minutes).filter(|minutes| !before.contains(':') || sixtieths(minutes))?;
    Some(whole(hours)? * 3600.0 + minutes * 60.0 + seconds.parse().ok().filter(sixtieths)?)
}

/// Parses numbers with the units h, m and s, in this order.
fn in_units(text: &str) -> Option<f64> {
    let (mut rest, mut seconds) = (text, None);
    for (unit, factor) in [('h', 3600.0), ('m', 60.0), ('s', 1.0)] {
        if let Some((number, after)) = rest.split_once(unit) {
            let number = number.trim().parse::<f64>().ok().filter(|number| *number >= 0.0)?;
            seconds = Some(seconds.unwrap_or(0.0) + number * factor);
            rest = after;
        }
    }
    seconds.filter(|_| rest.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_in_every_notation() {
        for (text, expected) in [
            ("412.473837682115", 412.473837682115),
            (" 60 ", 60.0),
            ("-1", -1.0),
            ("90s", 90.0),
            ("0.5s", 0.5),
            ("5m", 300.0),
            ("1.5h", 5400.0),
            ("8h", 28_800.0),
            ("1h30m", 5400.0),
            ("1h 30m 5s", 5405.0),
            ("1:30", 90.0),
            ("90:00", 5400.0),
            ("0:07.5", 7.5),
            ("1:02:03", 3723.0),
        ] {
            assert_eq!(seconds(text), Ok(expected), "{text}");
        }
        for text in [
            "", "soon", "60fps", "1:60", "1:-30", "1:30:", ":30", "1:60:00", "1:2:3:4", "1h30", "1h-30m", "30m1h",
            "5ms", "h",
        ] {
            assert!(seconds(text).is_err(), "{text}: {:?}", seconds(text));
        }
        assert!(["0", "-5", "nan", "inf", "0:00"].into_iter().all(|text| wall_seconds(text).is_err()));
    }
}
