//! Sound as `arecord`, `ffmpeg` and files have it: RIFF WAVE. In: a stream of bytes. Out: samples of each channel.
//!
//! A program that records into a pipe does not know the length of its sound, and writes 0 or the greatest number
//! instead. So the samples continue to the end of the stream, whatever length is stated.

use std::io::{self, ErrorKind, Read};

/// The most bytes of a chunk before the samples.
const MOST_CHUNK_BYTES: u32 = 1 << 20;
/// The bytes before the samples in a sound that is written.
pub const HEADER_BYTES: usize = 44;
const PCM: u16 = 1;
const FLOAT: u16 = 3;
const EXTENSIBLE: u16 = 0xfffe;

/// The reason why a stream has no samples.
#[derive(Debug, thiserror::Error)]
pub enum WaveError {
    /// No header of a sound, or a form of samples that is not read.
    #[error("{0}, expected RIFF WAVE with 8, 16, 24 or 32 bits or 32-bit floats and 8,000 to 192,000 samples a second")]
    Format(&'static str),
    /// The stream cannot be read.
    #[error(transparent)]
    Read(#[from] io::Error),
}

/// The form of the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Format {
    /// Samples per second and channel.
    pub sample_rate: u32,
    /// The number of bytes of the samples of all channels at one time.
    pub block_bytes: usize,
    sample_bytes: usize,
    is_float: bool,
}

impl Format {
    /// Reads a header up to the first sample.
    ///
    /// # Errors
    /// [`WaveError`]
    pub fn read(stream: &mut impl Read) -> Result<Self, WaveError> {
        let refused = WaveError::Format;
        let mut riff = [0; 12];
        fill(stream, &mut riff)?;
        if !riff.starts_with(b"RIFF") || !riff.ends_with(b"WAVE") {
            return Err(refused("the sound has no header"));
        }
        let mut format = None;
        loop {
            let mut header = [0; 8];
            fill(stream, &mut header)?;
            let [a, b, c, d, length @ ..] = header;
            let length = u32::from_le_bytes(length);
            match &[a, b, c, d] {
                b"data" => return format.ok_or(refused("the header names no format")),
                _ if length > MOST_CHUNK_BYTES => return Err(refused("the header is damaged")),
                b"fmt " => {
                    let mut chunk = vec![0; length as usize];
                    fill(stream, &mut chunk)?;
                    format = Some(Self::of(&chunk).ok_or(refused("the samples have another form"))?);
                }
                _ => {
                    // Chunks have an even length.
                    io::copy(&mut stream.take(u64::from(length + length % 2)), &mut io::sink())?;
                }
            }
        }
    }

    fn of(chunk: &[u8]) -> Option<Self> {
        let number = |at: usize| Some(u16::from_le_bytes([*chunk.get(at)?, *chunk.get(at + 1)?]));
        let kind = match number(0)? {
            EXTENSIBLE => number(24)?,
            kind => kind,
        };
        let (channels, sample_rate) = (number(2)?, u32::from(number(4)?) | u32::from(number(6)?) << 16);
        let (block_bytes, bits) = (usize::from(number(12)?), number(14)?);
        let is_known = matches!((kind, bits), (PCM, 8 | 16 | 24 | 32) | (FLOAT, 32));
        let sample_bytes = usize::from(bits / 8);
        let fits = block_bytes == sample_bytes * usize::from(channels) && block_bytes > 0;
        let is_valid = is_known && fits && (8_000..=192_000).contains(&sample_rate);
        is_valid.then_some(Self { sample_rate, block_bytes, sample_bytes, is_float: kind == FLOAT })
    }

    /// Returns the number of channels.
    pub fn channels(&self) -> usize {
        self.block_bytes / self.sample_bytes
    }

    /// Returns the sample of a channel, counted from 0, in a block: -1 to 1, or -4 to 4 for floats.
    pub fn sample(&self, block: &[u8], channel: usize) -> f32 {
        let begin = channel * self.sample_bytes;
        let sample = block.get(begin..begin + self.sample_bytes).unwrap_or_default();
        match *sample {
            [byte] => (f32::from(byte) - 128.0) / 128.0,
            [a, b] => f32::from(i16::from_le_bytes([a, b])) / 32_768.0,
            [a, b, c] => i32::from_le_bytes([0, a, b, c]) as f32 / 2_147_483_648.0,
            [a, b, c, d] if self.is_float => {
                let value = f32::from_le_bytes([a, b, c, d]);
                if value.is_finite() { value.clamp(-4.0, 4.0) } else { 0.0 }
            }
            [a, b, c, d] => i32::from_le_bytes([a, b, c, d]) as f32 / 2_147_483_648.0,
            _ => 0.0,
        }
    }
}

/// Returns the bytes of a sample from -1 to 1 in 16 bits.
pub fn sample_bytes(value: f64) -> [u8; 2] {
    ((value * 32_767.0).round() as i16).to_le_bytes()
}

/// Returns the header of a sound of one channel in 16 bits, with `sound_bytes` bytes of samples. The greatest number
/// stands for a length that is not known.
pub fn header(sample_rate: u32, sound_bytes: u32) -> [u8; HEADER_BYTES] {
    let mut header = [0; HEADER_BYTES];
    let mut rest = &mut header[..];
    let mut put = |bytes: &[u8]| {
        let (begin, end) = std::mem::take(&mut rest).split_at_mut(bytes.len());
        begin.copy_from_slice(bytes);
        rest = end;
    };
    put(b"RIFF");
    put(&sound_bytes.saturating_add(HEADER_BYTES as u32 - 8).to_le_bytes());
    put(b"WAVEfmt ");
    put(&16u32.to_le_bytes());
    // The form, the channels.
    [PCM, 1].iter().for_each(|number| put(&number.to_le_bytes()));
    [sample_rate, 2 * sample_rate].iter().for_each(|number| put(&number.to_le_bytes()));
    // The bytes of a block, the bits of a sample.
    [2u16, 16].iter().for_each(|number| put(&number.to_le_bytes()));
    put(b"data");
    put(&sound_bytes.to_le_bytes());
    header
}

fn fill(stream: &mut impl Read, bytes: &mut [u8]) -> Result<(), WaveError> {
    stream.read_exact(bytes).map_err(|error| match error.kind() {
        ErrorKind::UnexpectedEof => WaveError::Format("the sound ends before its first sample"),
        _ => WaveError::Read(error),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(kind: u16, channels: u16, rate: u32, bits: u16) -> Vec<u8> {
        let block = channels * bits / 8;
        let mut bytes = b"RIFF\xff\xff\xff\xffWAVEjunk\x03\0\0\0abc\0fmt \x10\0\0\0".to_vec();
        bytes.extend([kind, channels].iter().flat_map(|number| number.to_le_bytes()));
        bytes.extend([rate, rate * u32::from(block)].iter().flat_map(|number| number.to_le_bytes()));
        bytes.extend([block, bits].iter().flat_map(|number| number.to_le_bytes()));
        bytes.extend(b"data\xff\xff\xff\xff");
        bytes
    }

    #[test]
    fn the_usual_forms_are_read() {
        for (kind, bits, sample, value) in [
            (PCM, 8, vec![64], -0.5),
            (PCM, 16, vec![0, 0x40], 0.5),
            (PCM, 24, vec![0, 0, 0xc0], -0.5),
            (PCM, 32, vec![0, 0, 0, 0x40], 0.5),
            (FLOAT, 32, 0.25f32.to_le_bytes().to_vec(), 0.25),
        ] {
            let format = Format::read(&mut &header(kind, 2, 48_000, bits)[..]).unwrap();
            assert_eq!((format.sample_rate, format.block_bytes), (48_000, usize::from(bits / 4)));
            assert_eq!(format.sample(&sample, 0), value, "{bits} bits");
            let second = [vec![0; sample.len()], sample].concat();
            assert_eq!((format.channels(), format.sample(&second, 1)), (2, value), "{bits} bits");
        }
    }

    #[test]
    fn other_streams_are_refused_with_a_sentence() {
        let whole = header(PCM, 1, 48_000, 16);
        for length in 0..whole.len() {
            assert!(Format::read(&mut &whole[..length]).unwrap_err().to_string().contains("expected RIFF WAVE"));
        }
        for bad in
            [header(2, 1, 48_000, 16), header(PCM, 0, 48_000, 16), header(PCM, 1, 0, 16), header(FLOAT, 1, 48_000, 16)]
        {
            assert!(Format::read(&mut &bad[..]).is_err());
        }
        assert!(Format::read(&mut &[0u8; 4096][..]).is_err());
    }
}
