//! Linear timecode (SMPTE ST 12-1): timecode as sound. In: samples. Out: labels with the sample at which each ends.
//! Pure.
//!
//! A frame is 80 bits, least significant first, in biphase mark code: the signal changes at the beginning of each bit,
//! and once more in the middle of a 1. The last 16 bits are a pattern that also shows the direction.

pub mod channels;
pub mod generator;
pub mod wave;

use crate::timecode::{FrameRate, Label};

/// Bits of a frame.
const BITS: u32 = 80;
/// The last 16 bits of a frame, the first of them as the lowest bit; and read backward.
const SYNC: u128 = 0xbffc;
const SYNC_BACKWARD: u128 = 0x3ffd;
/// Bits per second of a rate between the slowest and the fastest, from which the measured length of a bit begins.
const MIDDLE_BIT_RATE: f64 = 2160.0;
/// The part of a bit that divides the intervals of a 1 from the interval of a 0.
const THRESHOLD: f64 = 0.75;
/// The part of the amplitude that a change must pass, so that noise about zero is no change.
const HYSTERESIS: f64 = 0.3;
/// The frames over which the length of a frame is averaged.
const MOST_AVERAGED: f64 = 32.0;
/// The rates, in frames per second, between 24 and 25, between 25 and 30, and between 29.97 and 30.
const ABOVE_24: f64 = 24.5;
const ABOVE_25: f64 = 27.5;
const ABOVE_2997: f64 = 29.985;

/// An event in the sound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event {
    /// A frame that ends with the given sample: there the next frame begins.
    Frame {
        /// The label of the frame that has ended.
        label: Label,
        /// The rate, by the length of the frames and the drop frame flag.
        rate: FrameRate,
        /// The sample at which the frame ends, counted from 0, with its fraction.
        end: f64,
    },
    /// A frame of timecode that runs backward.
    Backward,
    /// A frame whose label names no frame.
    Malformed,
}

/// A decoder of one channel.
#[derive(Debug, Clone)]
pub struct Decoder {
    sample_rate: f64,
    samples: u64,
    previous: f64,
    /// The greatest and the least of recent samples.
    greatest: f64,
    least: f64,
    is_high: bool,
    /// The sample of the latest change.
    changed: f64,
    /// Samples of a bit, as measured.
    bit: f64,
    /// True after the first half of a 1.
    half: bool,
    word: u128,
    /// The end of the latest frame, the mean length of frames in samples, and their number.
    latest_end: f64,
    frame_length: f64,
    averaged: f64,
}

impl Decoder {
    /// Creates a decoder for a number of samples per second.
    pub fn new(sample_rate: f64) -> Self {
        Self {
            sample_rate,
            samples: 0,
            previous: 0.0,
            greatest: 0.0,
            least: 0.0,
            is_high: false,
            changed: 0.0,
            bit: sample_rate / MIDDLE_BIT_RATE,
            half: false,
            word: 0,
            latest_end: f64::NEG_INFINITY,
            frame_length: 0.0,
            averaged: 0.0,
        }
    }

    /// Handles a sample; full scale is -1 to 1. Returns the event that the sample completes.
    pub fn push(&mut self, sample: f32) -> Option<Event> {
        let sample = f64::from(sample);
        let at = self.samples as f64;
        self.samples += 1;
        // The extremes decay within some bits, so that the level may change and the middle may drift.
        let decay = 1.0 / (8.0 * self.bit);
        let middle = 0.5 * (self.greatest + self.least);
        self.greatest = sample.max(self.greatest - decay * (self.greatest - middle));
        self.least = sample.min(self.least + decay * (middle - self.least));
        let threshold = HYSTERESIS * 0.5 * (self.greatest - self.least);
        let has_changed =
            if self.is_high { sample < middle - threshold } else { sample > middle + threshold } && threshold > 1e-4;
        let previous = std::mem::replace(&mut self.previous, sample);
        if !has_changed {
            return None;
        }
        self.is_high = !self.is_high;
        // The place of the change between two samples, by a straight line.
        let level = if self.is_high { middle + threshold } else { middle - threshold };
        let part = if sample == previous { 0.0 } else { ((level - previous) / (sample - previous)).clamp(0.0, 1.0) };
        let now = at - 1.0 + part;
        let interval = now - std::mem::replace(&mut self.changed, now);
        self.interval(interval / self.bit, now)
    }

    /// Handles the time between two changes, in bits.
    fn interval(&mut self, bits: f64, now: f64) -> Option<Event> {
        const ADAPTATION: f64 = 0.05;
        let is_half = bits < THRESHOLD;
        if !(0.25..1.6).contains(&bits) {
            // No timecode: a pause, or noise.
            (self.half, self.word, self.averaged) = (false, 0, 0.0);
            self.bit = self.sample_rate / MIDDLE_BIT_RATE;
            return None;
        }
        let measured = self.bit * if is_half { 2.0 * bits } else { bits };
        self.bit += ADAPTATION * (measured - self.bit);
        if is_half && !self.half {
            self.half = true;
            return None;
        }
        if !is_half && self.half {
            // A single half: the bits were read between their beginnings.
            (self.half, self.word) = (false, 0);
        }
        self.half = false;
        self.word = self.word >> 1 | u128::from(is_half) << (BITS - 1);
        match self.word >> 64 {
            SYNC => Some(self.frame(now)),
            SYNC_BACKWARD => Some(Event::Backward),
            _ => None,
        }
    }

    fn frame(&mut self, now: f64) -> Event {
        let length = now - std::mem::replace(&mut self.latest_end, now);
        // A frame after a gap has no known length.
        let is_next = (length / (f64::from(BITS) * self.bit) - 1.0).abs() < 0.1;
        self.averaged = if is_next { (self.averaged + 1.0).min(MOST_AVERAGED) } else { 0.0 };
        if is_next {
            self.frame_length += (length - self.frame_length) / self.averaged;
        }
        let length = if self.averaged > 0.0 { self.frame_length } else { f64::from(BITS) * self.bit };
        let field = |first: u32, bits: u32| (self.word >> first) as u8 & ((1 << bits) - 1);
        let digits = |first: u32, tens: u32, bits: u32| {
            let units = field(first, 4);
            (units < 10).then(|| 10 * field(tens, bits) + units)
        };
        let rate = match self.sample_rate / length {
            slow if slow < ABOVE_24 => FrameRate::Film24,
            slow if slow < ABOVE_25 => FrameRate::Ebu25,
            _ if field(10, 1) == 1 => FrameRate::Drop2997,
            slow if slow < ABOVE_2997 => FrameRate::NonDrop2997,
            _ => FrameRate::Smpte30,
        };
        let label = || {
            let (frames, seconds) = (digits(0, 8, 2)?, digits(16, 24, 3)?);
            let (minutes, hours) = (digits(32, 40, 3)?, digits(48, 56, 2)?);
            let label = Label { hours, minutes, seconds, frames };
            rate.frame(label).map(|_| label)
        };
        label().map_or(Event::Malformed, |label| Event::Frame { label, rate, end: now })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Encodes labels by the standard's table, bit after bit, as a square wave of amplitude `level`.
    fn sound(labels: &[Label], drop: bool, bits_per_second: f64, sample_rate: f64, level: f32) -> Vec<f32> {
        let mut changes = Vec::new();
        let mut time = 0.0;
        for label in labels {
            let mut word = [false; 80];
            let mut put =
                |at: usize, bits: usize, value: u8| (0..bits).for_each(|k| word[at + k] = value >> k & 1 == 1);
            for (units, tens, bits, value) in [
                (0, 8, 2, label.frames),
                (16, 24, 3, label.seconds),
                (32, 40, 3, label.minutes),
                (48, 56, 2, label.hours),
            ] {
                put(units, 4, value % 10);
                put(tens, bits, value / 10);
            }
            put(10, 1, u8::from(drop));
            word[66..78].fill(true);
            word[79] = true;
            for one in word {
                changes.push(time);
                if one {
                    changes.push(time + 0.5 / bits_per_second);
                }
                time += 1.0 / bits_per_second;
            }
        }
        changes.push(time);
        let count = ((time + 0.002) * sample_rate) as usize;
        let mut next = 0;
        let mut high = false;
        let level_at = |k: usize| {
            while changes.get(next).is_some_and(|change| *change * sample_rate <= k as f64) {
                next += 1;
                high = !high;
            }
            if high { level } else { -level }
        };
        (0..count).map(level_at).collect()
    }

    fn events(samples: &[f32], sample_rate: f64) -> Vec<Event> {
        let mut decoder = Decoder::new(sample_rate);
        samples.iter().filter_map(|sample| decoder.push(*sample)).collect()
    }

    #[test]
    fn every_rate_is_decoded_with_the_sample_at_which_its_frames_end() {
        // 23.976 is too near 24 to be told from it, and is given by the user.
        for rate in FrameRate::ALL.into_iter().filter(|rate| *rate != FrameRate::Film23976) {
            let fps = 1.0 / rate.seconds(1.0);
            let first = rate.frame("01:02:59:20".parse().unwrap()).unwrap();
            let labels: Vec<_> = (first..first + 60).map(|frame| rate.label(frame)).collect();
            for (sample_rate, level) in [(48_000.0, 0.5), (44_100.0, 0.02), (96_000.0, 1.0)] {
                let sound = sound(&labels, rate == FrameRate::Drop2997, 80.0 * fps, sample_rate, level);
                let found = events(&sound, sample_rate);
                assert!(found.len() >= 59, "{rate} at {sample_rate}: {}", found.len());
                for event in &found[found.len() - 50..] {
                    let Event::Frame { label, rate: of, end } = *event else { panic!("{event:?}") };
                    let frame = rate.frame(label).unwrap();
                    let expected = f64::from(frame + 1 - first) / fps * sample_rate;
                    assert_eq!(of, rate, "at {sample_rate}");
                    assert!((end - expected).abs() < 2.0, "{rate} at {sample_rate}: {end} for {expected}");
                }
            }
        }
    }

    #[test]
    fn backward_sound_and_noise_are_no_frames() {
        let labels: Vec<_> = (0..50).map(|frame| FrameRate::Ebu25.label(frame)).collect();
        let mut backward = sound(&labels, false, 2000.0, 48_000.0, 0.5);
        backward.reverse();
        let found = events(&backward, 48_000.0);
        assert!(found.len() > 45 && found.iter().all(|event| *event == Event::Backward), "{found:?}");
        let mut random = fastrand::Rng::with_seed(1);
        let noise: Vec<f32> = (0..480_000).map(|_| random.f32() - 0.5).collect();
        assert_eq!(events(&noise, 48_000.0), []);
        assert_eq!(events(&[0.0; 48_000], 48_000.0), []);
    }
}
