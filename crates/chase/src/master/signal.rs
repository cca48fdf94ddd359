//! The bytes of timecode and their moments. In: a course of places, moments. Out: messages of Art-Net or MIDI, or
//! sound. Pure.
//!
//! While a show stands, Art-Net and LTC repeat the label, so that receivers stop at once and at the place; MIDI has a
//! full frame for that.

use super::course::Course;
use crate::ltc::generator::Generator;
use crate::ltc::wave::sample_bytes;
use crate::timecode::{FrameRate, Label};
use crate::{artnet, mtc};

/// Samples per second of the sound.
pub const SOUND_RATE: u32 = 48_000;
/// The level of the sound: 6 dB below full scale.
const LEVEL: f64 = 0.5;
/// The least and the most samples of a piece of sound: a pipe with room for a page has room for it.
const LEAST_SAMPLES: u64 = 48;
const MOST_SAMPLES: u64 = 1920;
/// The time by which the sound for a reader may be late before sound is left out, in nanoseconds.
const MOST_BEHIND_NS: u64 = 250_000_000;
/// The frames by which labels may be late before they are left out.
const MOST_LATE: f64 = 2.0;

/// Bytes to be written at a moment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Due {
    /// CLOCK_MONOTONIC in nanoseconds.
    pub at_ns: u64,
    /// The bytes.
    pub bytes: Vec<u8>,
    /// Messages, or frames of sound, that the bytes complete.
    pub counts: u64,
}

/// A kind of timecode.
pub trait Signal {
    /// Returns the next bytes, unless they are due after `until_ns`. Without a course there is no show.
    fn next(&mut self, course: Option<&Course>, now_ns: u64, until_ns: u64) -> Option<Due>;
    /// Handles a jump of the course.
    fn jump(&mut self);
    /// Returns the milliseconds of sound that were left out.
    fn lost_ms(&self) -> u64 {
        0
    }
}

/// The moments of equal parts of frames.
#[derive(Debug, Clone)]
struct Steps {
    /// Steps of a frame, and the multiple at which steps begin.
    per_frame: f64,
    first: f64,
    /// The latest step.
    latest: Option<f64>,
    /// The moment of the next label of a course that does not run.
    sample_ns: u64,
}

/// The reason of a message.
enum Reason {
    /// The course has come to this step.
    Step(f64),
    /// A label is due because the course does not run.
    Standing,
}

impl Steps {
    fn new(per_frame: f64, first: f64) -> Self {
        Self { per_frame, first, latest: None, sample_ns: 0 }
    }

    fn next(&mut self, course: &Course, now_ns: u64, until_ns: u64) -> Option<(u64, Reason)> {
        if !course.runs() {
            self.latest = None;
            let at_ns = self.sample_ns.max(now_ns);
            return (at_ns < until_ns).then(|| {
                self.sample_ns = at_ns + (1e9 / course.nominal()) as u64;
                (at_ns, Reason::Standing)
            });
        }
        let place = course.at(now_ns) * self.per_frame;
        let following = self.latest.map(|latest| latest + 1.0);
        let on_time = following.filter(|step| place - step <= MOST_LATE * self.per_frame);
        let step = on_time.unwrap_or_else(|| (place / self.first).ceil() * self.first);
        let at_ns = course.moment(step / self.per_frame);
        (at_ns < until_ns).then(|| {
            self.latest = Some(step);
            (at_ns, Reason::Step(step))
        })
    }
}

/// ArtTimeCode: a packet at the beginning of each frame.
pub struct ArtNet {
    rate: FrameRate,
    steps: Steps,
}

impl ArtNet {
    /// Creates the packets of a rate.
    pub fn new(rate: FrameRate) -> Self {
        Self { rate, steps: Steps::new(1.0, 1.0) }
    }
}

impl Signal for ArtNet {
    fn next(&mut self, course: Option<&Course>, now_ns: u64, until_ns: u64) -> Option<Due> {
        let course = course?;
        let (at_ns, reason) = self.steps.next(course, now_ns, until_ns)?;
        let label = match reason {
            Reason::Step(frame) => course.label(frame),
            Reason::Standing => course.label(course.at(at_ns)),
        };
        let packet = artnet::encode(&artnet::TimeCode { stream: 0, label, rate: self.rate });
        Some(Due { at_ns, bytes: packet.to_vec(), counts: 1 })
    }

    fn jump(&mut self) {
        self.steps.latest = None;
    }
}

/// MIDI timecode: four quarter frames a frame, and a full frame after each jump and where the show stands.
pub struct Mtc {
    rate: FrameRate,
    steps: Steps,
    /// The label of the latest full frame since the latest quarter frame or jump.
    located: Option<Label>,
    has_run: bool,
}

impl Mtc {
    /// Creates the messages of a rate.
    pub fn new(rate: FrameRate) -> Self {
        // Eight quarter frames carry a label.
        Self { rate, steps: Steps::new(4.0, 8.0), located: None, has_run: false }
    }

    fn full(&mut self, label: Label, at_ns: u64) -> Due {
        self.located = Some(label);
        Due { at_ns, bytes: mtc::encode_full(label, self.rate).to_vec(), counts: 1 }
    }
}

impl Signal for Mtc {
    fn next(&mut self, course: Option<&Course>, now_ns: u64, until_ns: u64) -> Option<Due> {
        let course = course?;
        if self.located.is_none() && !self.has_run {
            return Some(self.full(course.label(course.at(now_ns)), now_ns));
        }
        loop {
            let (at_ns, reason) = self.steps.next(course, now_ns, until_ns)?;
            match reason {
                Reason::Step(quarter) => {
                    (self.located, self.has_run) = (None, true);
                    // The label belongs to the moment of piece 0.
                    let piece = quarter.rem_euclid(8.0);
                    let label = course.label((quarter - piece) / 4.0);
                    let bytes = mtc::encode_quarter(label, self.rate, piece as u8).to_vec();
                    return Some(Due { at_ns, bytes, counts: 1 });
                }
                Reason::Standing => {
                    let label = course.label(course.at(at_ns));
                    if self.located != Some(label) {
                        return Some(self.full(label, at_ns));
                    }
                }
            }
        }
    }

    fn jump(&mut self) {
        self.steps.latest = None;
        (self.located, self.has_run) = (None, false);
    }
}

/// LTC as samples of 16 bits of one channel. The sound begins with the show; without a show it is silent.
pub struct Ltc {
    generator: Generator,
    /// The moment of sample 0, and the number of samples so far.
    began_ns: Option<u64>,
    samples: u64,
    /// The frame of the latest sample.
    frame: i64,
    most_behind_ns: u64,
    lost_ns: u64,
}

impl Ltc {
    /// Creates the sound of a rate for a reader, who hears it as it comes: late sound is left out.
    pub fn to_reader(rate: FrameRate) -> Self {
        let generator = Generator::new(rate);
        Self { generator, began_ns: None, samples: 0, frame: 0, most_behind_ns: MOST_BEHIND_NS, lost_ns: 0 }
    }

    /// Creates the sound of a rate for a file, which has every sample, however late it is written.
    pub fn to_file(rate: FrameRate) -> Self {
        Self { most_behind_ns: u64::MAX, ..Self::to_reader(rate) }
    }

    /// Returns the sample of a moment.
    fn sample(&mut self, course: &Course, at_ns: u64) -> f64 {
        if course.runs() {
            let place = course.at(at_ns);
            self.frame = place.floor() as i64;
            return self.generator.sample(course.label(place.floor()), place - place.floor(), course.pace());
        }
        // One label after the other at the speed of timecode: the same one while the show stands.
        let place = at_ns as f64 * 1e-9 * course.nominal();
        let began_ns = at_ns - ((place - place.floor()) / course.nominal() * 1e9) as u64;
        self.frame = place.floor() as i64;
        self.generator.sample(course.label(course.at(began_ns)), place - place.floor(), course.nominal())
    }
}

impl Signal for Ltc {
    fn next(&mut self, course: Option<&Course>, now_ns: u64, _until_ns: u64) -> Option<Due> {
        if course.is_none() && self.began_ns.is_none() {
            return None;
        }
        let mut began_ns = *self.began_ns.get_or_insert(now_ns);
        let sample_ns = 1e9 / f64::from(SOUND_RATE);
        let behind_ns = (now_ns - began_ns).saturating_sub((self.samples as f64 * sample_ns) as u64);
        if behind_ns > self.most_behind_ns {
            if self.lost_ns == 0 {
                let behind_ms = behind_ns / 1_000_000;
                log::warn!(
                    "the sound is {behind_ms} ms late, because its reader or this machine is too slow: it jumps over \
                     that time"
                );
            }
            self.lost_ns += behind_ns;
            began_ns += behind_ns;
            self.began_ns = Some(began_ns);
        } else if behind_ns > MOST_BEHIND_NS {
            let behind_ms = behind_ns / 1_000_000;
            log::warn!("this machine is {behind_ms} ms late: the labels of that time are those of the newest frame");
        }
        let due = ((now_ns - began_ns) as f64 / sample_ns) as u64 + 1;
        let count = due.saturating_sub(self.samples).min(MOST_SAMPLES);
        if count < LEAST_SAMPLES {
            return None;
        }
        let mut bytes = Vec::with_capacity(2 * count as usize);
        let mut counts = 0;
        for index in self.samples..self.samples + count {
            let at_ns = began_ns + (index as f64 * sample_ns) as u64;
            let before = self.frame;
            let value = course.map_or(0.0, |course| self.sample(course, at_ns));
            counts += u64::from(course.is_some() && before != self.frame);
            bytes.extend(sample_bytes(LEVEL * value));
        }
        self.samples += count;
        Some(Due { at_ns: now_ns, bytes, counts })
    }

    /// The place is in each sample.
    fn jump(&mut self) {}

    fn lost_ms(&self) -> u64 {
        self.lost_ns / 1_000_000
    }
}

#[cfg(test)]
mod tests {
    use bench_dragon_messages::FrameHeader;
    use bench_dragon_messages::state::PlaybackState::{self, Paused, Playing};

    use super::*;
    use crate::ltc::{Decoder, Event};
    use crate::schedule::Schedule;

    const BEGAN_NS: u64 = 7_000_000_123;

    /// A frame of a show, from this moment on (in seconds): simulated time, rate, playback, epoch.
    type Change = (f64, f64, f64, PlaybackState, u32);

    /// Returns what a signal writes, polled every 2 ms for some seconds, in a show of these changes.
    fn written(signal: &mut impl Signal, rate: FrameRate, seconds: f64, changes: &[Change]) -> Vec<Due> {
        let (mut written, mut before) = (Vec::new(), None);
        for poll in 0..(seconds * 500.0) as u64 {
            let now_ns = BEGAN_NS + poll * 2_000_000;
            let of = |moment: f64| BEGAN_NS + (moment * 1e9) as u64;
            let &(from, sim_time, time_scale, playback, epoch) =
                changes.iter().rev().find(|change| of(change.0) <= now_ns).unwrap();
            let header = FrameHeader { sim_time, time_scale, playback: playback as u32, epoch, ..Default::default() };
            let schedule = Schedule { offset: "01:00:00:00".parse().unwrap(), speed: 1.0 };
            let course = Course::of(&header, of(from), &schedule, rate);
            if before.is_some_and(|before| !course.continues(&before)) {
                signal.jump();
            }
            before = Some(course);
            while let Some(due) = signal.next(Some(&course), now_ns, now_ns + 2_000_000) {
                written.push(due);
            }
        }
        written
    }

    /// Seconds since the beginning.
    fn since(due: &Due) -> f64 {
        (due.at_ns - BEGAN_NS) as f64 * 1e-9
    }

    #[test]
    fn a_packet_of_art_net_is_sent_at_the_moment_of_its_label_and_repeated_while_the_show_stands() {
        for rate in FrameRate::ALL {
            let changes = [(0.0, 50.0, 1.0, Playing, 0), (3.0, 53.0, 0.0, Paused, 0), (4.0, 200.0, 0.0, Paused, 1)];
            let all = written(&mut ArtNet::new(rate), rate, 5.0, &changes);
            let offset = rate.frame("01:00:00:00".parse().unwrap()).unwrap();
            let frame = |due: &Due| {
                let timecode = artnet::decode(&due.bytes).unwrap();
                assert_eq!(timecode.rate.type_code(), rate.type_code());
                rate.frame(timecode.label).unwrap() - offset
            };
            let (playing, standing): (Vec<_>, Vec<_>) = all.iter().partition(|due| since(due) < 3.0);
            assert!(playing.windows(2).all(|pair| frame(pair[1]) == frame(pair[0]) + 1));
            assert!(playing.len() as f64 > 3.0 * rate.per_second() - 2.0);
            for due in playing {
                let ideal = rate.seconds(f64::from(frame(due))) - 50.0;
                assert!((since(due) - ideal).abs() < 1e-6, "{rate}: {} for {ideal}", since(due));
            }
            assert!(standing.len() as f64 > 1.9 * rate.per_second());
            for due in standing {
                let place = if since(due) < 4.0 { 53.0 } else { 200.0 };
                assert_eq!(frame(due), (place * rate.per_second() + 1e-6) as u32, "{rate} at {}", since(due));
            }
        }
    }

    #[test]
    fn midi_has_quarter_frames_at_their_moments_and_full_frames_after_a_seek_and_a_pause() {
        let rate = FrameRate::Drop2997;
        let changes = [(0.0, 59.0, 1.0, Playing, 0), (2.0, 90.0, 1.0, Playing, 1), (3.0, 91.0, 0.0, Paused, 1)];
        let all = written(&mut Mtc::new(rate), rate, 4.0, &changes);
        let offset = rate.frame("01:00:00:00".parse().unwrap()).unwrap();
        let mut decoder = mtc::Decoder::default();
        let (mut located, mut running) = (Vec::new(), 0);
        for due in &all {
            for event in due.bytes.iter().filter_map(|byte| decoder.push(*byte)) {
                match event {
                    mtc::Event::Running { label, rate: of } => {
                        assert_eq!(of, rate);
                        let frames = f64::from(rate.frame(label).unwrap() - offset) + mtc::LABEL_AGE;
                        let sim_time = since(due) + if since(due) < 2.0 { 59.0 } else { 88.0 };
                        assert!((rate.seconds(frames) - sim_time).abs() < 1e-6, "{label} at {}", since(due));
                        running += 1;
                    }
                    mtc::Event::Located { label, .. } => located.push((since(due), label.to_string())),
                    event => panic!("{event:?}"),
                }
            }
        }
        assert!(running > 38, "{running}");
        // 59 s are 1,768.2 frames, 90 s 2,697.3 and 91 s 2,727.3: two labels left out after the first 1,800.
        let labels = ["01:00:58:28", "01:01:29:29", "01:01:30:29"];
        assert_eq!(Vec::from_iter(located.iter().map(|(_, label)| label.as_str())), labels);
        assert!(located.iter().zip([0.0, 2.0, 3.0]).all(|((at, _), from)| (at - from).abs() < 0.003), "{located:?}");
    }

    #[test]
    fn the_sound_has_each_label_at_its_moment_and_stands_with_the_show() {
        let rate = FrameRate::Ebu25;
        let changes = [(0.0, 50.0, 1.0, Playing, 0), (2.0, 52.02, 0.0, Paused, 0)];
        let all = written(&mut Ltc::to_reader(rate), rate, 4.0, &changes);
        let sound = Vec::from_iter(all.iter().flat_map(|due| due.bytes.iter().copied()));
        assert!((sound.len() / 2).abs_diff(192_000) < 100, "{} samples", sound.len() / 2);
        assert!((99..=102).contains(&all.iter().map(|due| due.counts).sum::<u64>()));
        let mut decoder = Decoder::new(f64::from(SOUND_RATE));
        let (mut ran, mut stood) = (0, 0);
        for sample in sound.chunks_exact(2) {
            let event = decoder.push(f32::from(i16::from_le_bytes([sample[0], sample[1]])) / 32_768.0);
            let Some(Event::Frame { label, end, .. }) = event else { continue };
            let (end, frame) = (end / 48_000.0, f64::from(rate.frame(label).unwrap()) - 90_000.0);
            if end < 1.999 {
                assert!((50.0 + end - (frame + 1.0) / 25.0).abs() < 5e-5, "{label} ends at {end} s");
                ran += 1;
            } else if end > 2.1 {
                assert_eq!(frame, 1300.0, "52.02 s are 1,300.5 frames: {label} at {end}");
                stood += 1;
            }
        }
        assert!(ran > 46 && stood > 46, "{ran} {stood}");
    }

    #[test]
    fn a_second_of_late_sound_is_left_out_for_a_reader_and_written_to_a_file() {
        let rate = FrameRate::Ebu25;
        let header = FrameHeader { sim_time: 50.0, time_scale: 1.0, ..Default::default() };
        let schedule = Schedule { offset: "01:00:00:00".parse().unwrap(), speed: 1.0 };
        let course = Course::of(&header, BEGAN_NS, &schedule, rate);
        let written = |mut signal: Ltc| {
            let mut bytes = 0;
            for now_ns in [BEGAN_NS + 2_000_000, BEGAN_NS + 1_000_000_000] {
                while let Some(due) = signal.next(Some(&course), now_ns, now_ns) {
                    bytes += due.bytes.len();
                }
            }
            (bytes / 2, signal.lost_ms())
        };
        assert!(matches!(written(Ltc::to_file(rate)), (47_900..48_100, 0)));
        assert!(matches!(written(Ltc::to_reader(rate)), (0..200, 990..1000)));
    }
}
