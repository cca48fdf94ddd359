//! MIDI timecode (MIDI 1.0, "MIDI Time Code", quarter frames and full frames). From the bytes of a MIDI
//! device to labels, and back. Pure.
//!
//! Eight quarter frames carry a label in two frames of time. The label belongs to the moment of piece 0, so 7/4 frames
//! have passed when piece 7 has come. While timecode runs backward the pieces come from 7 to 0.

use crate::timecode::{FrameRate, Label};

/// Frames from the moment of a label to its last quarter frame.
pub const LABEL_AGE: f64 = 1.75;
/// The longest full frame: longer messages of a manufacturer are passed over.
const FULL_FRAME_BYTES: usize = 8;

/// A message about timecode.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// Eight quarter frames in order, the last of which has come now. The label was current [`LABEL_AGE`] frames ago.
    Running {
        /// The label.
        label: Label,
        /// The rate.
        rate: FrameRate,
    },
    /// Eight quarter frames in the reverse order: timecode runs backward.
    Backward,
    /// A full frame: the device stands at a label.
    Located {
        /// The label.
        label: Label,
        /// The rate.
        rate: FrameRate,
    },
    /// Bytes that are not a valid message about timecode.
    Malformed,
}

/// A decoder of the bytes of one device.
#[derive(Debug, Clone, Default)]
pub struct Decoder {
    /// The data nibbles of the pieces.
    pieces: [u8; 8],
    /// The pieces in order so far, from 0 upward and from 7 downward; 0 if one was missing since.
    ascending: u8,
    descending: u8,
    expects: Expects,
    message: Vec<u8>,
}

/// The meaning of the next data byte.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Expects {
    /// Data of another message.
    #[default]
    Other,
    /// The data of a quarter frame.
    QuarterFrame,
    /// Bytes of a system exclusive message.
    Exclusive,
}

impl Decoder {
    /// Handles a byte. Returns the message that the byte completes, if it is about timecode.
    pub fn push(&mut self, byte: u8) -> Option<Event> {
        match byte {
            // System real-time messages may come within any other message.
            0xf8.. => None,
            0xf7 if self.expects == Expects::Exclusive => {
                self.expects = Expects::Other;
                full_frame(&self.message)
            }
            0x80.. => {
                let was = std::mem::replace(
                    &mut self.expects,
                    match byte {
                        0xf0 => Expects::Exclusive,
                        0xf1 => Expects::QuarterFrame,
                        _ => Expects::Other,
                    },
                );
                self.message.clear();
                (was == Expects::QuarterFrame).then_some(Event::Malformed)
            }
            _ => match self.expects {
                Expects::Other => None,
                Expects::QuarterFrame => {
                    self.expects = Expects::Other;
                    self.quarter_frame(byte >> 4, byte & 0xf)
                }
                Expects::Exclusive => {
                    // One byte more shows that the message is longer than a full frame.
                    if self.message.len() <= FULL_FRAME_BYTES {
                        self.message.push(byte);
                    }
                    None
                }
            },
        }
    }

    fn quarter_frame(&mut self, piece: u8, nibble: u8) -> Option<Event> {
        self.pieces[usize::from(piece)] = nibble;
        let in_order = |count: u8, place: u8| if place == 0 || count == place { place + 1 } else { 0 };
        self.ascending = in_order(self.ascending, piece);
        self.descending = in_order(self.descending, 7 - piece);
        match (self.ascending, self.descending) {
            (8, _) => Some(self.label().map_or(Event::Malformed, |(label, rate)| Event::Running { label, rate })),
            (_, 8) => Some(Event::Backward),
            _ => None,
        }
    }

    /// Returns the label of all pieces, unless it names no frame.
    fn label(&self) -> Option<(Label, FrameRate)> {
        let [frames_low, frames, seconds_low, seconds, minutes_low, minutes, hours_low, hours] = self.pieces;
        let rate = FrameRate::of_type(hours >> 1 & 3)?;
        let label = Label {
            hours: hours_low | (hours & 1) << 4,
            minutes: minutes_low | minutes << 4,
            seconds: seconds_low | seconds << 4,
            frames: frames_low | frames << 4,
        };
        rate.frame(label).map(|_| (label, rate))
    }
}

/// Returns the event of a system exclusive message without its first and last byte; `None` for one of another kind.
fn full_frame(message: &[u8]) -> Option<Event> {
    // 7F: real time, a channel, 01 01: timecode, full frame.
    let &[0x7f, _channel, 0x01, 0x01, ref rest @ ..] = message else { return None };
    let located = |rest: &[u8]| {
        let &[hours, minutes, seconds, frames] = rest else { return None };
        let rate = FrameRate::of_type(hours >> 5)?;
        let label = Label { hours: hours & 0x1f, minutes, seconds, frames };
        rate.frame(label).map(|_| Event::Located { label, rate })
    };
    Some(located(rest).unwrap_or(Event::Malformed))
}

/// Returns the message of a piece, 0 to 7, of a label.
pub fn encode_quarter(label: Label, rate: FrameRate, piece: u8) -> [u8; 2] {
    let Label { hours, minutes, seconds, frames } = label;
    let value = match piece / 2 {
        0 => frames,
        1 => seconds,
        2 => minutes,
        _ => hours | rate.type_code() << 5,
    };
    let nibble = if piece.is_multiple_of(2) { value & 0xf } else { value >> 4 };
    [0xf1, piece << 4 | nibble]
}

/// Returns the full frame of a label, for all devices.
pub fn encode_full(label: Label, rate: FrameRate) -> [u8; 10] {
    let Label { hours, minutes, seconds, frames } = label;
    [0xf0, 0x7f, 0x7f, 0x01, 0x01, hours | rate.type_code() << 5, minutes, seconds, frames, 0xf7]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The quarter frames of 01:30:35:20 at 30: the MIDI specification's data in the order of its table.
    const QUARTERS: [u8; 16] =
        [0xf1, 0x04, 0xf1, 0x11, 0xf1, 0x23, 0xf1, 0x32, 0xf1, 0x4e, 0xf1, 0x51, 0xf1, 0x61, 0xf1, 0x76];
    const FULL: [u8; 10] = [0xf0, 0x7f, 0x7f, 0x01, 0x01, 0x61, 0x1e, 0x23, 0x14, 0xf7];

    fn events(bytes: impl IntoIterator<Item = u8>) -> Vec<Event> {
        let mut decoder = Decoder::default();
        bytes.into_iter().filter_map(|byte| decoder.push(byte)).collect()
    }

    fn known() -> (Label, FrameRate) {
        ("01:30:35:20".parse().unwrap(), FrameRate::Smpte30)
    }

    #[test]
    fn quarter_frames_and_full_frames_give_their_label() {
        let (label, rate) = known();
        assert_eq!(events(QUARTERS), [Event::Running { label, rate }]);
        assert_eq!(events(FULL), [Event::Located { label, rate }]);
        assert_eq!(Vec::from_iter((0..8).flat_map(|piece| encode_quarter(label, rate, piece))), QUARTERS);
        assert_eq!(encode_full(label, rate), FULL);
        // A clock byte within a message, a note between messages.
        let mixed = QUARTERS.chunks(2).flat_map(|pair| [pair[0], 0xf8, pair[1], 0x90, 0x40, 0x7f]);
        assert_eq!(events(mixed), [Event::Running { label, rate }]);
        assert_eq!(events(QUARTERS.repeat(3)).len(), 3);
    }

    #[test]
    fn a_label_is_used_only_after_eight_pieces_in_order() {
        for missing in 0..8 {
            let pairs = QUARTERS.chunks(2).enumerate().filter(|(piece, _)| *piece != missing);
            let bytes: Vec<u8> = pairs.flat_map(|(_, pair)| pair.to_vec()).collect();
            assert_eq!(events(bytes.clone()), [], "without piece {missing}");
            let then: Vec<u8> = bytes.into_iter().chain(QUARTERS).collect();
            assert_eq!(events(then).len(), 1);
        }
        // The bytes begin in the middle.
        assert_eq!(events(QUARTERS[6..].iter().copied().chain(QUARTERS)).len(), 1);
    }

    #[test]
    fn backward_timecode_is_told() {
        let backward = QUARTERS.chunks(2).rev().flat_map(|pair| pair.to_vec()).collect::<Vec<_>>().repeat(2);
        assert_eq!(events(backward), [Event::Backward, Event::Backward]);
    }

    #[test]
    fn labels_that_name_no_frame_are_malformed() {
        let mut quarters = QUARTERS;
        quarters[7] = 0x34;
        assert_eq!(events(quarters), [Event::Malformed], "more than 60 seconds");
        let mut full = FULL;
        full[8] = 30;
        assert_eq!(events(full), [Event::Malformed]);
        full[8] = 0x14;
        full[3] = 0x02;
        assert_eq!(events(full), [], "another message of the same kind");
        assert_eq!(events([0xf1, 0xf1, 0x04]), [Event::Malformed]);
        assert_eq!(events([0xf0].into_iter().chain([0x7f; 1000]).chain([0xf7])), []);
    }
}
