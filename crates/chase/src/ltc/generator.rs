//! The sound of linear timecode as a function of the place in it, so that any speed and any jump is one formula. In: a
//! place in frames. Out: a sample. Pure.

use super::BITS;
use crate::timecode::{FrameRate, Label};

/// The time of a change of the signal, in seconds: SMPTE ST 12-1 has 40 µs, EBU Tech 3097 50 µs.
const RISE: f64 = 4e-5;
/// Half bits of a frame: the signal changes at their borders only.
const HALVES: usize = 2 * BITS as usize;

/// The signal of one frame at a time.
#[derive(Debug, Clone)]
pub struct Generator {
    rate: FrameRate,
    /// The label of the frame, and the signal in each of its half bits.
    label: Option<Label>,
    is_high: [bool; HALVES],
}

impl Generator {
    /// Creates a generator of frames of a rate.
    pub fn new(rate: FrameRate) -> Self {
        Self { rate, label: None, is_high: [false; HALVES] }
    }

    /// Returns the signal, from -1 to 1, at a part (0 to 1) of the frame of a label. `pace` is in frames per second.
    pub fn sample(&mut self, label: Label, part: f64, pace: f64) -> f64 {
        if self.label != Some(label) {
            self.label = Some(label);
            self.is_high = halves(word(label, self.rate));
        }
        let place = part.clamp(0.0, 1.0) * HALVES as f64;
        let half = (place as usize).min(HALVES - 1);
        let within = place - half as f64;
        // A bit begins with a change, so the signal before a frame, and after it, is the opposite.
        let level = |of: bool| if of { 1.0 } else { -1.0 };
        let now = level(self.is_high[half]);
        let before = half.checked_sub(1).map_or(!self.is_high[0], |before| self.is_high[before]);
        let after = self.is_high.get(half + 1).copied().unwrap_or(!self.is_high[HALVES - 1]);
        // The change is a straight line about the border of two half bits.
        let rise = (RISE * pace * HALVES as f64).min(1.0);
        let mix = |other: f64, distance: f64| now + (other - now) * (0.5 - distance / rise).max(0.0);
        if within < 0.5 { mix(level(before), within) } else { mix(level(after), 1.0 - within) }
    }
}

/// Returns the bits of a frame, the first as the lowest.
fn word(label: Label, rate: FrameRate) -> u128 {
    let Label { hours, minutes, seconds, frames } = label;
    let digits = |value: u8, units: u32, tens: u32| u128::from(value % 10) << units | u128::from(value / 10) << tens;
    let drop = u128::from(rate == FrameRate::Drop2997) << 10;
    let fields = digits(frames, 0, 8) | digits(seconds, 16, 24) | digits(minutes, 32, 40) | digits(hours, 48, 56);
    let word = fields | drop | super::SYNC << 64;
    // An even number of zeros: every frame begins with the same change.
    let parity = if rate == FrameRate::Ebu25 { 59 } else { 27 };
    word | u128::from(word.count_ones() % 2) << parity
}

/// Returns the signal in each half of each bit. A change begins each bit, another is in the middle of a 1.
fn halves(word: u128) -> [bool; HALVES] {
    let mut is_high = false;
    std::array::from_fn(|half| {
        is_high ^= half.is_multiple_of(2) || word >> (half / 2) & 1 == 1;
        is_high
    })
}

#[cfg(test)]
mod tests {
    use super::super::{Decoder, Event};
    use super::*;

    #[test]
    fn every_frame_begins_with_the_same_change() {
        for rate in FrameRate::ALL {
            for frame in (0..rate.frames_per_day()).step_by(997) {
                let halves = halves(word(rate.label(frame), rate));
                assert!(halves[0] && !halves[HALVES - 1], "{rate} {frame}");
            }
        }
    }

    /// The decoder of this crate; libltc judges the sound in the tests of processes.
    #[test]
    fn the_sound_of_every_rate_is_decoded() {
        for (rate, speed) in FrameRate::ALL.into_iter().flat_map(|rate| [(rate, 0.999), (rate, 1.0)]) {
            let (pace, first) = (speed * rate.per_second(), rate.frame("01:02:59:20".parse().unwrap()).unwrap());
            let (mut generator, mut decoder) = (Generator::new(rate), Decoder::new(48_000.0));
            let mut expected = None;
            let mut found = 0;
            for k in 0..96_000 {
                let place = f64::from(first) + f64::from(k) / 48_000.0 * pace;
                let sample = generator.sample(rate.label(place as u32), place.fract(), pace);
                assert!(sample.abs() <= 1.0);
                let Some(event) = decoder.push(0.5 * sample as f32) else { continue };
                let Event::Frame { label, end, .. } = event else { panic!("{rate}: {event:?}") };
                let frame = rate.frame(label).unwrap();
                assert_eq!(*expected.get_or_insert(frame), frame, "{rate}");
                expected = Some(frame + 1);
                let ideal = f64::from(frame + 1 - first) / pace * 48_000.0;
                assert!((end - ideal).abs() < 2.0, "{rate}: {end} for {ideal}");
                found += 1;
            }
            assert!(f64::from(found) > 1.9 * pace, "{rate}: {found}");
        }
    }
}
