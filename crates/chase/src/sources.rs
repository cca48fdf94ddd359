//! The sources of time: a socket, a MIDI device, a stream of sound. Each is read by one thread, which stamps what it
//! decodes. In: bytes from outside. Out: [`Input`]s in a channel.

use std::fs::File;
use std::io::{self, Read};
use std::net::{IpAddr, Ipv4Addr, SocketAddr, SocketAddrV4, UdpSocket};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::time::Duration;

use bench_dragon_client::clock::{monotonic_ns, sleep_until};
use socket2::{Domain, Protocol, Socket, Type};

use crate::ltc::channels::Channels;
use crate::ltc::wave::{Format, WaveError};
use crate::timecode::{FrameRate, Label};
use crate::{artnet, ltc, mtc, psn};

/// The longest wait for a datagram: the delay of an end.
const SOCKET_TIMEOUT: Duration = Duration::from_millis(200);
/// Greater than any datagram of Art-Net and PosiStageNet.
const DATAGRAM_BYTES: usize = 2048;
/// The number of bytes of sound that are read at once.
const SOUND_BYTES: usize = 16_384;

/// A message of a source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Input {
    /// A frame of timecode.
    Frame {
        /// Its label.
        label: Label,
        /// The rate by the source's own account.
        rate: FrameRate,
        /// Frames since the moment of the label.
        age: f64,
        /// The moment, CLOCK_MONOTONIC in nanoseconds.
        at_ns: u64,
        /// The sender and its stream, where there may be several.
        sender: Option<(IpAddr, u8)>,
    },
    /// A label at which the source stands.
    Located {
        /// The label.
        label: Label,
        /// The rate.
        rate: FrameRate,
        /// The moment, CLOCK_MONOTONIC in nanoseconds.
        at_ns: u64,
    },
    /// Timecode that runs backward, at a moment.
    Backward(u64),
    /// A position of the tracker, metres in the sender's axes.
    Position {
        /// The position.
        position: [f32; 3],
        /// The moment, CLOCK_MONOTONIC in nanoseconds.
        at_ns: u64,
    },
    /// A position that is invalid by the source's own account.
    Invalid,
    /// A malformed message.
    Malformed,
    /// The stream has ended.
    End,
}

/// The reason why a source cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// The address cannot be listened at.
    #[error("cannot listen at {address}: {source}")]
    Listen {
        /// The address.
        address: SocketAddrV4,
        /// The system's error.
        source: io::Error,
    },
    /// The file or device cannot be opened.
    #[error("{file}: {source}, expected {expected}")]
    Open {
        /// The file.
        file: String,
        /// The system's error.
        source: io::Error,
        /// The kind of file.
        expected: &'static str,
    },
    /// The sound has fewer channels.
    #[error("the sound has no channel {channel}, expected --channel from 1 to {channels}")]
    Channel {
        /// The channel, counted from 1.
        channel: usize,
        /// The channels of the sound.
        channels: usize,
    },
    /// The stream has no samples.
    #[error("{file}: {source}")]
    Sound {
        /// The file.
        file: String,
        /// The reason.
        source: WaveError,
    },
}

/// Reads ArtTimeCode at an address until `stop` is set.
///
/// # Errors
/// [`SourceError::Listen`]
pub fn artnet(address: SocketAddrV4, stop: &Arc<AtomicBool>) -> Result<Receiver<Input>, SourceError> {
    let socket = listening(address, None).map_err(|source| SourceError::Listen { address, source })?;
    Ok(datagrams(socket, stop, |datagram, from, at_ns, inputs| match artnet::decode(datagram) {
        Ok(artnet::TimeCode { stream, label, rate }) => {
            inputs.push(Input::Frame { label, rate, age: 0.0, at_ns, sender: Some((from.ip(), stream)) });
        }
        Err(artnet::NotTimeCode::Other) => (),
        Err(artnet::NotTimeCode::Malformed) => inputs.push(Input::Malformed),
    }))
}

/// Reads the positions of a tracker, of a multicast group or at this machine's own address, until `stop` is set.
///
/// # Errors
/// [`SourceError::Listen`]
pub fn psn(
    address: SocketAddrV4,
    interface: Option<Ipv4Addr>,
    tracker: u16,
    stop: &Arc<AtomicBool>,
) -> Result<Receiver<Input>, SourceError> {
    let mut has_warned = false;
    let group = address.ip().is_multicast().then(|| interface.unwrap_or(Ipv4Addr::UNSPECIFIED));
    let socket = listening(address, group).map_err(|source| SourceError::Listen { address, source })?;
    Ok(datagrams(socket, stop, move |datagram, _, at_ns, inputs| match psn::decode(datagram) {
        Ok(trackers) => {
            for seen in trackers.iter().filter(|it| it.id == tracker) {
                // Status 0: the position is the last one known.
                let is_valid = seen.status != 0.0;
                if !is_valid && !std::mem::replace(&mut has_warned, true) {
                    log::warn!("tracker {tracker} comes with status 0, by which its place is not known: it is ignored");
                }
                inputs.push(if is_valid { Input::Position { position: seen.position, at_ns } } else { Input::Invalid });
            }
        }
        Err(psn::Malformed) => inputs.push(Input::Malformed),
    }))
}

/// Returns a socket that shares its port with other programs of this machine, and joins a group by an interface.
fn listening(address: SocketAddrV4, group: Option<Ipv4Addr>) -> io::Result<UdpSocket> {
    let socket = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
    socket.set_reuse_address(true)?;
    let own = if group.is_some() { Ipv4Addr::UNSPECIFIED } else { *address.ip() };
    socket.bind(&SocketAddrV4::new(own, address.port()).into())?;
    if let Some(interface) = group {
        socket.join_multicast_v4(address.ip(), &interface)?;
    }
    socket.set_read_timeout(Some(SOCKET_TIMEOUT))?;
    Ok(socket.into())
}

fn datagrams(
    socket: UdpSocket,
    stop: &Arc<AtomicBool>,
    mut decode: impl FnMut(&[u8], SocketAddr, u64, &mut Vec<Input>) + Send + 'static,
) -> Receiver<Input> {
    let (sender, inputs) = mpsc::channel();
    let stop = Arc::clone(stop);
    std::thread::spawn(move || {
        let (mut bytes, mut decoded) = (vec![0; DATAGRAM_BYTES], Vec::new());
        while !stop.load(Ordering::Relaxed) {
            // A timeout, or an error that the sender's machine has caused.
            let Ok((length, from)) = socket.recv_from(&mut bytes) else { continue };
            decode(&bytes[..length], from, monotonic_ns(), &mut decoded);
            if decoded.drain(..).try_for_each(|input| sender.send(input)).is_err() {
                return;
            }
        }
    });
    inputs
}

/// Opens a file, or standard input for `-`.
fn stream(file: &Path, expected: &'static str) -> Result<Box<dyn Read + Send>, SourceError> {
    if file == Path::new("-") {
        return Ok(Box::new(io::stdin()));
    }
    let failed = |source| SourceError::Open { file: file.display().to_string(), source, expected };
    let opened = File::open(file).map_err(failed)?;
    if opened.metadata().map_err(failed)?.is_dir() {
        return Err(failed(io::ErrorKind::IsADirectory.into()));
    }
    Ok(Box::new(opened))
}

/// Reads MIDI timecode from a raw MIDI device, or from standard input for `-`.
///
/// # Errors
/// [`SourceError::Open`]
pub fn mtc(device: &Path) -> Result<Receiver<Input>, SourceError> {
    let mut stream = stream(device, "a raw MIDI device such as /dev/snd/midiC1D0")?;
    let (sender, inputs) = mpsc::channel();
    std::thread::spawn(move || {
        let (mut decoder, mut bytes) = (mtc::Decoder::default(), [0; 256]);
        while let Some(length) = read(&mut stream, &mut bytes) {
            let at_ns = monotonic_ns();
            for event in bytes[..length].iter().filter_map(|byte| decoder.push(*byte)) {
                let input = match event {
                    mtc::Event::Running { label, rate } => {
                        Input::Frame { label, rate, age: mtc::LABEL_AGE, at_ns, sender: None }
                    }
                    mtc::Event::Located { label, rate } => Input::Located { label, rate, at_ns },
                    mtc::Event::Backward => Input::Backward(at_ns),
                    mtc::Event::Malformed => Input::Malformed,
                };
                if sender.send(input).is_err() {
                    return;
                }
            }
        }
        let _ = sender.send(Input::End);
    });
    Ok(inputs)
}

/// Reads LTC from a WAV file at its own speed, or as it comes from standard input for `-`: from a channel, counted from
/// 1, or from the one that has it.
///
/// # Errors
/// [`SourceError::Open`], [`SourceError::Channel`], or [`SourceError::Sound`] for a stream that is no sound.
pub fn ltc(file: &Path, channel: Option<usize>) -> Result<Receiver<Input>, SourceError> {
    let is_live = file == Path::new("-");
    let mut stream = stream(file, "a WAV file with LTC")?;
    let format = Format::read(&mut stream).map_err(|source| SourceError::Sound {
        file: if is_live { "standard input".to_owned() } else { file.display().to_string() },
        source,
    })?;
    let channels = format.channels();
    let decoder = Channels::new(format, channel)
        .ok_or(SourceError::Channel { channel: channel.unwrap_or_default(), channels })?;
    let (sender, inputs) = mpsc::channel();
    std::thread::spawn(move || {
        sound(&mut stream, format, decoder, is_live, &sender);
        let _ = sender.send(Input::End);
    });
    Ok(inputs)
}

/// Decodes sound to its end. The last sample of a piece that is read was recorded now; a file is read at its own speed.
fn sound(stream: &mut impl Read, format: Format, mut decoder: Channels, is_live: bool, inputs: &Sender<Input>) {
    let sample_ns = 1e9 / f64::from(format.sample_rate);
    // A file is read in pieces of 10 ms.
    let piece =
        format.block_bytes * if is_live { SOUND_BYTES / format.block_bytes } else { format.sample_rate as usize / 100 };
    let mut followed = None;
    let (mut bytes, mut held, mut samples) = (vec![0; piece.max(format.block_bytes)], 0, 0u64);
    let began_ns = monotonic_ns();
    while let Some(length) = read(stream, &mut bytes[held..]) {
        let filled = held + length;
        let whole = filled - filled % format.block_bytes;
        let last = samples + (whole / format.block_bytes) as u64;
        let now_ns = match is_live {
            true => monotonic_ns(),
            false => began_ns + (last as f64 * sample_ns) as u64,
        };
        sleep_until(now_ns);
        for block in bytes[..whole].chunks_exact(format.block_bytes) {
            samples += 1;
            let event = decoder.push(block);
            if decoder.followed() != followed {
                let channel = decoder.followed().unwrap_or_default();
                let is_usual = followed.is_none() && channel == 1;
                let level = if is_usual { log::Level::Info } else { log::Level::Warn };
                log::log!(level, "timecode is followed on channel {channel} of {}", format.channels());
                followed = decoder.followed();
            }
            let input = match event {
                None => continue,
                Some(ltc::Event::Malformed) => Input::Malformed,
                Some(ltc::Event::Backward) => Input::Backward(now_ns),
                Some(ltc::Event::Frame { label, rate, end }) => {
                    let at_ns = now_ns.saturating_sub(((last as f64 - end) * sample_ns) as u64);
                    // The label belongs to the frame that has ended.
                    Input::Frame { label, rate, age: 1.0, at_ns, sender: None }
                }
            };
            if inputs.send(input).is_err() {
                return;
            }
        }
        bytes.copy_within(whole..filled, 0);
        held = filled - whole;
    }
}

/// Reads some bytes; `None` at the end of a stream.
fn read(stream: &mut impl Read, bytes: &mut [u8]) -> Option<usize> {
    loop {
        match stream.read(bytes) {
            Ok(0) => return None,
            Ok(length) => return Some(length),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => (),
            Err(error) => {
                log::warn!("the source cannot be read any more: {error}");
                return None;
            }
        }
    }
}
