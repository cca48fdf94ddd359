//! `run --histograms`: the distributions of wake-up lateness and step cost as an HdrHistogram interval log.
//!
//! In: the samples of the loop, on the statistics thread. Out: a text file of format version 1.3, with two lines for
//! each ten seconds. Their tags are `lateness` and `step`, their values nanoseconds. Each histogram is encoded as V2
//! and compressed, so that HistogramLogProcessor, HistogramLogAnalyzer and the readers of HdrHistogram's ports read the
//! file. The sum over all lines of a tag is the distribution of the percentiles in the run's summary.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::time::{Duration, UNIX_EPOCH};

use hdrhistogram::serialization::V2DeflateSerializer;
use hdrhistogram::serialization::interval_log::{IntervalLogWriterBuilder, Tag};

use super::{Durations, Sample};

/// The header of every interval log.
const LEGEND: &str = "\"StartTimestamp\",\"Interval_Length\",\"Interval_Max\",\"Interval_Compressed_Histogram\"\n";
/// The length of an interval, in seconds: short enough to find a bad minute, long enough for a small log of a night.
const INTERVAL_S: f64 = 10.0;

/// The log of a run's distributions.
pub struct HistogramLog<W = File> {
    file: W,
    /// Its name in errors.
    name: String,
    rate: f64,
    serializer: V2DeflateSerializer,
    /// The interval of the latest sample, and its distributions.
    interval: u64,
    durations: Durations,
    text: Vec<u8>,
    failure: Option<String>,
}

impl HistogramLog {
    /// Creates the file of a run of `rate` frames per second that begins at `began_ns` of CLOCK_REALTIME.
    ///
    /// # Errors
    /// The file cannot be created.
    pub fn create(file: &Path, rate: f64, began_ns: u64) -> io::Result<Self> {
        Ok(Self::new(File::create(file)?, file.display().to_string(), rate, began_ns))
    }
}

impl<W: Write> HistogramLog<W> {
    fn new(file: W, name: String, rate: f64, began_ns: u64) -> Self {
        let (serializer, durations) = (V2DeflateSerializer::new(), Durations::new());
        let mut log = Self { file, name, rate, serializer, interval: 0, durations, text: Vec::new(), failure: None };
        let begun = IntervalLogWriterBuilder::new()
            .add_comment(&format!("[Logged with bench-dragon {}]", env!("CARGO_PKG_VERSION")))
            .add_comment("[Histogram log format version 1.3]")
            .with_start_time(UNIX_EPOCH + Duration::from_nanos(began_ns))
            .begin_log_with(&mut log.text, &mut log.serializer);
        // Writing to memory cannot fail.
        debug_assert!(begun.is_ok());
        log.text.extend(LEGEND.as_bytes());
        log.write();
        log
    }

    /// Counts a frame.
    pub fn record(&mut self, sample: &Sample) {
        let interval = (sample.tick as f64 / self.rate / INTERVAL_S) as u64;
        if interval > self.interval {
            self.close_interval();
            self.interval = interval;
        }
        self.durations.record(sample, (1e9 / self.rate) as u64);
    }

    /// Writes the last interval. Returns the reason why the log is incomplete, as a sentence, or `None` if it is
    /// complete.
    pub fn finish(mut self) -> Option<String> {
        self.close_interval();
        self.failure
    }

    fn close_interval(&mut self) {
        let begins = Duration::from_secs_f64(self.interval as f64 * INTERVAL_S);
        let length = Duration::from_secs_f64(INTERVAL_S);
        let Durations { lateness, step } = &self.durations;
        if lateness.is_empty() {
            return;
        }
        // A builder without comments and times writes no header. Writing to memory, and serializing a histogram within
        // its bounds, cannot fail.
        if let Ok(mut log) = IntervalLogWriterBuilder::new().begin_log_with(&mut self.text, &mut self.serializer) {
            for (tag, histogram) in [("lateness", lateness), ("step", step)] {
                let written = log.write_histogram(histogram, begins, length, Tag::new(tag));
                debug_assert!(written.is_ok(), "{written:?}");
            }
        }
        self.durations.clear();
        self.write();
    }

    /// Writes the lines in memory. After a failure it writes nothing.
    fn write(&mut self) {
        if self.failure.is_none()
            && let Err(error) = self.file.write_all(&self.text)
        {
            let sentence = format!("{}: {error}: the histograms are cut", self.name);
            log::error!("{sentence}; the show continues");
            self.failure = Some(sentence);
        }
        self.text.clear();
    }
}
