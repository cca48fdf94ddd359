//! `send timecode`: a running show is the master of timecode, for Art-Net, MIDI and sound.

use std::fs::{File, OpenOptions};
use std::io::{self, IsTerminal, Seek, SeekFrom, Write};
use std::net::{Ipv4Addr, SocketAddrV4};
use std::os::fd::AsFd;
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};

use bench_dragon::chase::artnet::PORT;
use bench_dragon::chase::ltc::wave;
use bench_dragon::chase::master::signal::{ArtNet, Ltc, Mtc, SOUND_RATE, Signal};
use bench_dragon::chase::master::{MasterClock, MasterSummary, Sink};
use bench_dragon::chase::timecode::FrameRate;
use bench_dragon::client::feed::Delivery;
use bench_dragon::client::polling::poll_until;
use bench_dragon::messages::sentence::Expected;
use bench_dragon::outputs::send::network::{DestinationError, Outlet, Route, destination};
use nix::poll::{PollFd, PollFlags, PollTimeout};

use super::super::chase::ScheduleArguments;
use super::super::{CommandError, Common, Output, not_writable, stop_on_signals};

/// Arguments of `send timecode`.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct TimecodeArguments {
    #[command(subcommand)]
    kind: Kind,
}

#[derive(Debug, Clone, clap::Subcommand)]
enum Kind {
    /// ArtTimeCode of Art-Net, a packet each frame
    Artnet {
        /// A console, or a broadcast address; the default port is 6454
        #[arg(long, value_name = "ADDR[:PORT]", value_parser = artnet_destination)]
        to: SocketAddrV4,
        /// The address of this machine's interface to send by; without it, the machine's routes decide
        #[arg(long, value_name = "IP")]
        interface: Option<Ipv4Addr>,
        #[command(flatten)]
        clock: ClockArguments,
    },
    /// MIDI timecode: quarter frames, and full frames after each jump
    Mtc {
        /// A raw MIDI device such as /dev/snd/midiC1D0, or - for standard output
        device: PathBuf,
        #[command(flatten)]
        clock: ClockArguments,
    },
    /// Linear timecode as sound: 48,000 samples of 16 bits a second, one channel
    Ltc {
        /// A new WAV file, which is complete when the command ends, or - for standard output, as for aplay
        file: PathBuf,
        #[command(flatten)]
        clock: ClockArguments,
    },
}

/// The options of every timecode that is sent.
#[derive(Debug, Clone, Copy, clap::Args)]
struct ClockArguments {
    #[command(flatten)]
    schedule: ScheduleArguments,
    /// The frame rate: 23.976, 24, 25, 29.97, 29.97df or 30
    #[arg(long, value_name = "RATE", default_value = "30", value_parser = fps)]
    fps: FrameRate,
}

fn artnet_destination(text: &str) -> Result<SocketAddrV4, DestinationError> {
    destination(text, Some(PORT))
}

fn fps(text: &str) -> Result<FrameRate, Expected> {
    text.parse().map_err(|_| Expected("23.976, 24, 25, 29.97, 29.97df or 30".into()))
}

/// Sends until a signal comes, or until the reader is gone.
pub(super) fn timecode(common: &Common, arguments: &TimecodeArguments) -> Result<(), CommandError> {
    common.check_names(false)?;
    match &arguments.kind {
        Kind::Artnet { to, interface, clock } => {
            let outlet = Outlet::open(&[*to], Route { interface: *interface, multicast_ttl: 1 })?;
            let what = format!("ArtTimeCode to {to}");
            let Packets(outlet) = run(common, clock, Box::new(ArtNet::new(clock.fps)), Packets(outlet), &what)?;
            match outlet.unsent() {
                0 => Ok(()),
                unsent => Err(CommandError::Failed(format!("{unsent} packets could not be sent"))),
            }
        }
        Kind::Mtc { device, clock } => {
            let stream = Stream::midi(device)?;
            let what = format!("MIDI timecode to {}", device.display());
            run(common, clock, Box::new(Mtc::new(clock.fps)), stream, &what).map(drop)
        }
        Kind::Ltc { file, clock } => {
            let mut stream = Stream::sound(file)?;
            stream.write(&wave::header(SOUND_RATE, u32::MAX))?;
            let what = format!("LTC to {}", file.display());
            let signal = if stream.is_file()? { Ltc::to_file(clock.fps) } else { Ltc::to_reader(clock.fps) };
            let stream = run(common, clock, Box::new(signal), stream, &what)?;
            Ok(stream.complete_sound().map_err(|error| named(file, error))?)
        }
    }
}

/// Sends a show's timecode to a sink, which is returned.
fn run<S: Sink>(
    common: &Common,
    clock: &ClockArguments,
    signal: Box<dyn Signal>,
    sink: S,
    what: &str,
) -> Result<S, CommandError> {
    let stop = stop_on_signals()?;
    let schedule = clock.schedule.schedule(Some(clock.fps))?;
    let mut master = MasterClock::new(schedule, clock.fps, signal, sink, &stop);
    if !common.json && !common.quiet {
        // Standard output may be the timecode's.
        eprintln!(
            "Sending \"{}\" as {what}: {} is t = 0 s, {} frames per second. Ctrl-C ends.",
            common.name(),
            schedule.offset,
            clock.fps
        );
    }
    poll_until(&stop, &common.names, Delivery::Newest, &mut master)?;
    let (sink, summary) = master.finish()?;
    let MasterSummary { frames, sent, jumps, lost_ms } = summary;
    if sink.is_standard_output() {
        if lost_ms > 0 {
            log::warn!("{lost_ms} ms of sound were left out");
        }
        return Ok(sink);
    }
    let mut output = Output::standard();
    if common.json {
        output.json(&summary)?;
    } else {
        let lost = if lost_ms > 0 { format!("; {lost_ms} ms of sound were left out") } else { String::new() };
        output.line(&format!("{frames} frames received; {sent} messages of timecode sent, {jumps} jumps{lost}"))?;
    }
    output.finish()?;
    Ok(sink)
}

/// A socket: its packets never wait, and the log reports those that cannot be sent.
struct Packets(Outlet);

impl Sink for Packets {
    fn is_ready(&mut self) -> bool {
        true
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.send(bytes);
        Ok(())
    }
}

/// A file, a device or standard output.
struct Stream {
    file: File,
    is_standard_output: bool,
    bytes: u64,
}

impl Stream {
    fn standard_output(advice: &str) -> Result<Self, CommandError> {
        if io::stdout().is_terminal() {
            let sentence = format!("standard output is a terminal, expected a pipe such as {advice}");
            return Err(CommandError::BadInput(sentence));
        }
        let file = File::from(io::stdout().as_fd().try_clone_to_owned()?);
        Ok(Self { file, is_standard_output: true, bytes: 0 })
    }

    fn of(file: File) -> Self {
        Self { file, is_standard_output: false, bytes: 0 }
    }

    fn midi(device: &Path) -> Result<Self, CommandError> {
        if device == Path::new("-") {
            return Self::standard_output("`| amidi -p hw:1 -s /dev/stdin`");
        }
        let expected = |error: io::Error| {
            CommandError::BadInput(format!(
                "{}: {error}, expected a raw MIDI device such as /dev/snd/midiC1D0",
                device.display()
            ))
        };
        let kind = device.metadata().map_err(expected)?.file_type();
        // To open a FIFO for writing alone waits for its reader.
        let opened = OpenOptions::new().write(true).read(kind.is_fifo()).open(device);
        opened.map(Self::of).map_err(expected)
    }

    fn sound(file: &Path) -> Result<Self, CommandError> {
        if file == Path::new("-") {
            return Self::standard_output("`| aplay --buffer-time=20000`");
        }
        File::create(file).map(Self::of).map_err(|error| not_writable(file.display(), &error))
    }

    fn is_file(&self) -> io::Result<bool> {
        Ok(self.file.metadata()?.is_file())
    }

    /// Writes the length of a sound into its header, if it is in a file.
    fn complete_sound(mut self) -> io::Result<()> {
        if self.is_standard_output || !self.is_file()? {
            return Ok(());
        }
        let sound = self.bytes.saturating_sub(wave::HEADER_BYTES as u64);
        self.file.seek(SeekFrom::Start(0))?;
        self.file.write_all(&wave::header(SOUND_RATE, sound.try_into().unwrap_or(u32::MAX)))
    }
}

impl Sink for Stream {
    fn is_ready(&mut self) -> bool {
        let mut descriptors = [PollFd::new(self.file.as_fd(), PollFlags::POLLOUT)];
        // Without an answer the write itself decides.
        nix::poll::poll(&mut descriptors, PollTimeout::ZERO).map_or(true, |ready| ready > 0)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.bytes += bytes.len() as u64;
        self.file.write_all(bytes)
    }

    fn is_standard_output(&self) -> bool {
        self.is_standard_output
    }
}

fn named(file: &Path, error: io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}: {error}", file.display()))
}
