//! The nearest moment beyond an event at which a proof of the event is found.

/// The share of the distance from an event to which the nearest place beyond it is found at which the event is shown.
const BESIDE: f64 = 0.1;

/// Returns the least distance found, from `around` to `most`, at which `shown` returns a result, with the result. The
/// distance is doubled until there is one, and then halved between.
pub(super) fn nearest_shown<T>(around: f64, most: f64, mut shown: impl FnMut(f64) -> Option<T>) -> Option<(f64, T)> {
    let (mut not_shown, mut far) = (0.0, around);
    let mut found = loop {
        if let Some(found) = shown(far) {
            break found;
        }
        not_shown = far;
        far *= 2.0;
        if far > most {
            return None;
        }
    };
    while not_shown > 0.0 && far - not_shown > BESIDE * far {
        let middle = 0.5 * (not_shown + far);
        match shown(middle) {
            Some(nearer) => (found, far) = (nearer, middle),
            None => not_shown = middle,
        }
    }
    Some((far, found))
}
