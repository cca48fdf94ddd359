//! The channel that has linear timecode, among all channels of a sound. In: blocks of samples. Out: the events of that
//! channel. Pure.

use std::ops::Range;

use super::wave::Format;
use super::{Decoder, Event};

/// The most channels that are searched.
const MOST_CHANNELS: usize = 64;
/// The time without a frame after which another channel is followed, in seconds.
const PATIENCE: f64 = 1.0;

/// A decoder of each channel, one of which is followed.
#[derive(Debug, Clone)]
pub struct Channels {
    format: Format,
    /// The channels that are decoded, counted from 0.
    searched: Range<usize>,
    decoders: Vec<Decoder>,
    followed: Option<usize>,
    /// The samples since the latest frame of the channel that is followed.
    quiet: u32,
}

impl Channels {
    /// Creates decoders of all channels, or of one, counted from 1. Returns `None` if the sound has no such channel.
    pub fn new(format: Format, channel: Option<usize>) -> Option<Self> {
        let searched = match channel {
            Some(channel) => channel.checked_sub(1).filter(|index| *index < format.channels())?..channel,
            None => 0..format.channels().min(MOST_CHANNELS),
        };
        let decoders = vec![Decoder::new(f64::from(format.sample_rate)); searched.len()];
        Some(Self { format, searched, decoders, followed: None, quiet: 0 })
    }

    /// Returns the channel that is followed, counted from 1.
    pub fn followed(&self) -> Option<usize> {
        self.followed.map(|index| index + 1)
    }

    /// Handles the samples of one time. Returns the event that they complete in the channel that is followed: the first
    /// one that has a frame, until it has none for a second and another channel has.
    pub fn push(&mut self, block: &[u8]) -> Option<Event> {
        self.quiet = self.quiet.saturating_add(1);
        let is_lost = f64::from(self.quiet) > PATIENCE * f64::from(self.format.sample_rate);
        let mut result = None;
        for (channel, decoder) in self.searched.clone().zip(&mut self.decoders) {
            let Some(event) = decoder.push(self.format.sample(block, channel)) else { continue };
            let is_frame = matches!(event, Event::Frame { .. });
            if is_frame && (self.followed.is_none() || is_lost) {
                self.followed = Some(channel);
            }
            let is_only = self.searched.len() == 1 || self.followed.is_none() && event == Event::Backward;
            if self.followed == Some(channel) || is_only && result.is_none() {
                self.quiet = if is_frame { 0 } else { self.quiet };
                result = Some(event);
            }
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::super::generator::Generator;
    use super::super::wave;
    use super::*;
    use crate::timecode::FrameRate;

    const RATE: FrameRate = FrameRate::Ebu25;

    /// Returns the labels that are decoded, with the channel, of sound with timecode in one channel at a time.
    fn decoded(channel: Option<usize>, seconds: &[Option<usize>]) -> Option<Vec<(String, Option<usize>)>> {
        // Two channels of 16 bits.
        let mut header = wave::header(48_000, u32::MAX);
        (header[22], header[32]) = (2, 4);
        let mut channels = Channels::new(Format::read(&mut &header[..]).unwrap(), channel)?;
        let mut generator = Generator::new(RATE);
        let mut found = Vec::new();
        for k in 0..48_000 * seconds.len() {
            let place = k as f64 / 1920.0;
            let sample = wave::sample_bytes(0.4 * generator.sample(RATE.label(place as u32), place.fract(), 25.0));
            // Music in the other channel.
            let other = wave::sample_bytes(0.3 * (k as f64 * 0.03).sin());
            let mut block = [other, other];
            if let Some(index) = seconds[k / 48_000] {
                block[index] = sample;
            }
            if let Some(Event::Frame { label, .. }) = channels.push(&block.concat()) {
                found.push((label.to_string(), channels.followed()));
            }
        }
        Some(found)
    }

    #[test]
    fn the_channel_with_timecode_is_found_and_followed() {
        let right = decoded(None, &[Some(1), Some(1)]).unwrap();
        assert!(right.len() >= 48 && right.iter().all(|(_, channel)| *channel == Some(2)), "{right:?}");
        assert_eq!(right.last().unwrap().0, "00:00:01:23");
        assert!(decoded(None, &[Some(0)]).unwrap().len() >= 23);
        // It moves to the left one, which is followed after a second without the right one.
        let moved = decoded(None, &[Some(1), Some(0), Some(0), Some(0)]).unwrap();
        assert_eq!((moved[0].1, moved.last().unwrap().1), (Some(2), Some(1)));
        assert!((23 + 46..=25 + 50).contains(&moved.len()), "{}", moved.len());
    }

    #[test]
    fn a_fixed_channel_is_the_only_one() {
        assert!(decoded(Some(2), &[Some(1)]).unwrap().len() >= 23);
        assert_eq!(decoded(Some(1), &[Some(1)]), Some(Vec::new()));
        assert_eq!([Some(0), Some(3)].map(|channel| decoded(channel, &[None])), [None, None]);
    }
}
