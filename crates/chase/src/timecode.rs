//! Timecode: labels, frame rates, drop frame. Pure.
//!
//! A label counts frames of a day. Drop frame (SMPTE ST 12-1) leaves out the labels 00 and 01 of each minute, except of
//! each tenth minute, so that labels follow the time of day at 30000/1001 frames per second.

use std::fmt;
use std::str::FromStr;

use bench_dragon_messages::sentence::Expected;

/// Frames in ten minutes of drop frame: 600 seconds of 30 labels, without two labels in nine minutes.
const DROP_TEN_MINUTES: u32 = 17_982;
/// Frames in a minute of drop frame that has no label 00 and 01.
const DROP_MINUTE: u32 = 1_798;

/// A frame rate, with its way to count labels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameRate {
    /// 24 frames per second: film.
    Film24,
    /// 25 frames per second: EBU.
    Ebu25,
    /// 30000/1001 frames per second, 30 labels per second without omissions.
    NonDrop2997,
    /// 30000/1001 frames per second, drop frame.
    Drop2997,
    /// 30 frames per second: SMPTE.
    Smpte30,
    /// 24000/1001 frames per second, 24 labels per second: film on video.
    Film23976,
}

/// A label of timecode. It may name no frame: [`FrameRate::frame`] decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Label {
    /// 0 to 23.
    pub hours: u8,
    /// 0 to 59.
    pub minutes: u8,
    /// 0 to 59.
    pub seconds: u8,
    /// 0 to the labels of a second minus one.
    pub frames: u8,
}

impl FrameRate {
    /// Every rate.
    pub const ALL: [Self; 6] =
        [Self::Film24, Self::Ebu25, Self::NonDrop2997, Self::Drop2997, Self::Smpte30, Self::Film23976];

    /// Returns the name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Film24 => "24",
            Self::Ebu25 => "25",
            Self::NonDrop2997 => "29.97",
            Self::Drop2997 => "29.97df",
            Self::Smpte30 => "30",
            Self::Film23976 => "23.976",
        }
    }

    /// Returns the rate of a type code, which Art-Net and MIDI timecode share: 0 to 3. Type 3 is 30 frames per second,
    /// or 29.97 without drop frame.
    pub const fn of_type(code: u8) -> Option<Self> {
        match code {
            0 => Some(Self::Film24),
            1 => Some(Self::Ebu25),
            2 => Some(Self::Drop2997),
            3 => Some(Self::Smpte30),
            _ => None,
        }
    }

    /// Returns the labels of a second.
    pub const fn labels(self) -> u32 {
        match self {
            Self::Film24 | Self::Film23976 => 24,
            Self::Ebu25 => 25,
            Self::NonDrop2997 | Self::Drop2997 | Self::Smpte30 => 30,
        }
    }

    /// Returns the seconds of a number of frames.
    pub fn seconds(self, frames: f64) -> f64 {
        match self {
            Self::NonDrop2997 | Self::Drop2997 => frames * 1001.0 / 30_000.0,
            Self::Film23976 => frames * 1001.0 / 24_000.0,
            _ => frames / f64::from(self.labels()),
        }
    }

    /// Returns the frames per second.
    pub fn per_second(self) -> f64 {
        1.0 / self.seconds(1.0)
    }

    /// Returns the type code, which Art-Net and MIDI timecode share. It cannot distinguish 23.976 from 24, nor 29.97
    /// without drop frame from 30.
    pub const fn type_code(self) -> u8 {
        match self {
            Self::Film24 | Self::Film23976 => 0,
            Self::Ebu25 => 1,
            Self::Drop2997 => 2,
            Self::NonDrop2997 | Self::Smpte30 => 3,
        }
    }

    /// Returns the frames of a day of labels.
    pub const fn frames_per_day(self) -> u32 {
        match self {
            Self::Drop2997 => 144 * DROP_TEN_MINUTES,
            _ => 86_400 * self.labels(),
        }
    }

    /// Returns the number of a label's frame, counted from 00:00:00:00; `None` for a label that names no frame.
    pub fn frame(self, label: Label) -> Option<u32> {
        let Label { hours, minutes, seconds, frames } = label;
        let [hours, minutes, seconds, frames] = [hours, minutes, seconds, frames].map(u32::from);
        if hours >= 24 || minutes >= 60 || seconds >= 60 || frames >= self.labels() {
            return None;
        }
        let total_minutes = 60 * hours + minutes;
        let counted = (60 * total_minutes + seconds) * self.labels() + frames;
        match self {
            Self::Drop2997 if minutes % 10 != 0 && seconds == 0 && frames < 2 => None,
            Self::Drop2997 => Some(counted - 2 * (total_minutes - total_minutes / 10)),
            _ => Some(counted),
        }
    }

    /// Returns the label of a frame; frames past the end of the day begin again at 00:00:00:00.
    pub fn label(self, frame: u32) -> Label {
        let frame = frame % self.frames_per_day();
        let counted = match self {
            Self::Drop2997 => {
                let (tens, rest) = (frame / DROP_TEN_MINUTES, frame % DROP_TEN_MINUTES);
                // The first minute of ten has all of its 1,800 labels.
                let minutes = if rest < 1800 { 0 } else { (rest - 1800) / DROP_MINUTE + 1 };
                frame + 18 * tens + 2 * minutes
            }
            _ => frame,
        };
        let (seconds, frames) = (counted / self.labels(), counted % self.labels());
        // A day has fewer than 24 hours of seconds here, so every part is in the range of a byte.
        Label {
            hours: (seconds / 3600) as u8,
            minutes: (seconds / 60 % 60) as u8,
            seconds: (seconds % 60) as u8,
            frames: frames as u8,
        }
    }
}

impl fmt::Display for FrameRate {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

impl FromStr for FrameRate {
    type Err = Expected;

    fn from_str(text: &str) -> Result<Self, Expected> {
        let named = Self::ALL.into_iter().find(|rate| rate.name() == text);
        named.ok_or(Expected("auto, 23.976, 24, 25, 29.97, 29.97df or 30".into()))
    }
}

impl fmt::Display for Label {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:02}:{:02}:{:02}:{:02}", self.hours, self.minutes, self.seconds, self.frames)
    }
}

impl FromStr for Label {
    type Err = Expected;

    fn from_str(text: &str) -> Result<Self, Expected> {
        let part = |word: &str, below: u8| {
            let is_number = (1..=2).contains(&word.len()) && word.bytes().all(|byte| byte.is_ascii_digit());
            word.parse::<u8>().ok().filter(|number| is_number && *number < below)
        };
        // A semicolon or a comma before the frames is the usual sign of drop frame.
        let words: Vec<_> = text.trim().split([':', ';', ',']).collect();
        let label = |words: &[&str]| {
            let [hours, minutes, seconds, frames] = words else { return None };
            Some(Self {
                hours: part(hours, 24)?,
                minutes: part(minutes, 60)?,
                seconds: part(seconds, 60)?,
                frames: part(frames, 30)?,
            })
        };
        label(&words).ok_or(Expected("a label hours:minutes:seconds:frames such as 01:00:00:00".into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn label(text: &str) -> Label {
        text.parse().unwrap()
    }

    #[test]
    fn drop_frame_has_the_frames_of_the_literature() {
        // davidheidelberger.com and andrewduncan.ws: counts of drop frame.
        let known =
            [("00:01:00;02", 1800), ("00:10:00;00", 17_982), ("01:00:00;00", 107_892), ("23:59:59;29", 2_589_407)];
        for (text, frame) in known {
            assert_eq!(FrameRate::Drop2997.frame(label(text)), Some(frame), "{text}");
            assert_eq!(FrameRate::Drop2997.label(frame), label(text), "{frame}");
        }
        assert_eq!(FrameRate::Drop2997.frames_per_day(), 2_589_408);
        assert!((FrameRate::Drop2997.seconds(2_589_408.0) - 86_399.913_6).abs() < 1e-9);
    }

    /// Counts through all labels of a day, as a clock does, without a formula.
    #[test]
    fn every_label_of_a_day_has_the_frame_at_which_a_counter_reaches_it() {
        for rate in FrameRate::ALL {
            let mut frame = 0;
            let parts = (0..24).flat_map(|h| (0..60).flat_map(move |m| (0..60).map(move |s| (h, m, s))));
            for (hours, minutes, seconds) in parts {
                for frames in 0..31u8 {
                    let label = Label { hours, minutes, seconds, frames };
                    let dropped = rate == FrameRate::Drop2997 && seconds == 0 && frames < 2 && minutes % 10 != 0;
                    if dropped || u32::from(frames) >= rate.labels() {
                        assert_eq!(rate.frame(label), None, "{rate} {label}");
                    } else {
                        assert_eq!((rate.frame(label), rate.label(frame)), (Some(frame), label), "{rate}");
                        frame += 1;
                    }
                }
            }
            assert_eq!((frame, rate.label(frame)), (rate.frames_per_day(), label("0:0:0:0")));
        }
    }

    #[test]
    fn labels_and_rates_are_read_or_refused_with_a_sentence() {
        assert_eq!(label("1:02:03:04").to_string(), "01:02:03:04");
        for text in ["", "1:2:3", "24:00:00:00", "00:60:00:00", "00:00:00:30", "a:b:c:d", "+1:0:0:0", "001:0:0:0"] {
            assert!(text.parse::<Label>().unwrap_err().to_string().contains("01:00:00:00"), "{text}");
        }
        assert!(FrameRate::ALL.iter().all(|rate| rate.name().parse() == Ok(*rate)));
        assert!("23.98".parse::<FrameRate>().unwrap_err().to_string().contains("29.97df"));
        assert_eq!(
            [0, 1, 2, 3, 4].map(FrameRate::of_type).map(|rate| rate.map(FrameRate::name)),
            [Some("24"), Some("25"), Some("29.97df"), Some("30"), None]
        );
    }
}
