//! The limits of a soak test, and their notation.

use bench_dragon_messages::sentence::Expected;

/// The limits of a soak test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Frames that a steady subscriber may miss.
    pub missed: u64,
    /// The share of periods that may be skipped, 0 to 1.
    pub skipped_share: f64,
    /// Wake-up lateness: 99.9th percentile, ns.
    pub lateness_p999_ns: u64,
    /// Growth of the resident memory of the publisher, and of the ROS 2 process, after the first minute, in bytes.
    pub resident_growth_bytes: u64,
}

/// Parses a share: `0.01%`, `0.0001`.
///
/// # Errors
/// The expected notation, if the text is no share from 0 to 1.
pub fn share(text: &str) -> Result<f64, Expected> {
    let (digits, unit) = text.trim().strip_suffix('%').map_or((text.trim(), 1.0), |digits| (digits, 0.01));
    let share = digits.trim().parse::<f64>().map_or(f64::NAN, |number| number * unit);
    if (0.0..=1.0).contains(&share) { Ok(share) } else { Err(Expected("a share such as 0.01% or 0.0001".into())) }
}

/// Parses a short time: `500ns`, `200us`, `1.5ms`, `1s`. Returns nanoseconds.
///
/// # Errors
/// The expected notation, if the text is no such time.
pub fn nanoseconds(text: &str) -> Result<u64, Expected> {
    // Seconds come last: every other unit ends with the same letter.
    let units = [("ns", 1.0), ("us", 1e3), ("ms", 1e6), ("s", 1e9)];
    quantity(text, &units).ok_or(Expected("a time with its unit such as 200us or 1ms".into()))
}

/// Parses a size: `800B`, `500kB`, `1MB`, `2GB`. Returns bytes.
///
/// # Errors
/// The expected notation, if the text is no such size.
pub fn bytes(text: &str) -> Result<u64, Expected> {
    let units = [("kB", 1e3), ("MB", 1e6), ("GB", 1e9), ("B", 1.0)];
    quantity(text, &units).ok_or(Expected("a size with its unit such as 500kB or 1MB".into()))
}

/// Parses a number of at most 10^18 in one of these units.
fn quantity(text: &str, units: &[(&str, f64)]) -> Option<u64> {
    let (digits, unit) = units.iter().find_map(|(name, unit)| Some((text.trim().strip_suffix(name)?, unit)))?;
    let value = digits.trim().parse::<f64>().ok()? * unit;
    (0.0..=1e18).contains(&value).then_some(value as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read_as_people_write_them() {
        assert_eq!(
            (nanoseconds("200us"), nanoseconds("1.5ms"), nanoseconds("2 s")),
            (Ok(200_000), Ok(1_500_000), Ok(2_000_000_000))
        );
        assert_eq!((bytes("1MB"), bytes("500kB"), bytes("0B")), (Ok(1_000_000), Ok(500_000), Ok(0)));
        assert_eq!((share("0.01%"), share("0.5")), (Ok(0.0001), Ok(0.5)));
        for wrong in ["", "200", "us", "-1us", "nan%", "101%", "1XB"] {
            assert!(nanoseconds(wrong).is_err() && bytes(wrong).is_err(), "{wrong}");
        }
        for wrong in ["", "-1", "nan%", "101%", "x"] {
            assert!(share(wrong).is_err(), "{wrong}");
        }
    }
}
