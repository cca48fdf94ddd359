//! The program's log: lines on standard error and, with ROS 2, on `/rosout`.

use std::io::{IsTerminal, Write};

use super::commands::Common;
use super::commands::folded::{COLUMNS, folded};

/// Writes each record that the level admits to standard error, and queues it for `/rosout`.
struct ProgramLogger(env_logger::Logger);

impl log::Log for ProgramLogger {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        self.0.enabled(metadata)
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.0.matches(record) {
            self.0.log(record);
            #[cfg(feature = "ros2")]
            bench_dragon::ros2::rosout::enqueue(record);
        }
    }

    fn flush(&self) {
        self.0.flush();
    }
}

/// Sets the log's level as the command line requests.
pub fn set_up(common: &Common) {
    let level = match (common.quiet, common.verbose) {
        (true, _) => log::LevelFilter::Error,
        (false, 0) => log::LevelFilter::Warn,
        (false, 1) => log::LevelFilter::Info,
        (false, _) => log::LevelFilter::Debug,
    };
    iceoryx2::prelude::set_log_level(match level {
        log::LevelFilter::Debug => iceoryx2::prelude::LogLevel::Debug,
        log::LevelFilter::Info => iceoryx2::prelude::LogLevel::Warn,
        // This program reports iceoryx2's refusals in its own words.
        _ => iceoryx2::prelude::LogLevel::Fatal,
    });
    // RustDDS and ros2-client log every large message and every end, which is of no use to a user.
    let of_dds = if common.verbose > 1 { log::LevelFilter::Warn } else { log::LevelFilter::Off };
    let mut builder = env_logger::Builder::new();
    builder.filter_level(level).filter_module("rustdds", of_dds).filter_module("ros2_client", of_dds);
    if std::io::stderr().is_terminal() {
        // A file or a journal keeps a line for each record.
        builder.format(|out, record| {
            let (level, style) = (record.level(), out.default_level_style(record.level()));
            let (time, target, text) = (out.timestamp(), record.target(), record.args());
            let line = format!("[{time} {style}{level:<5}{style:#} {target}] {text}");
            writeln!(out, "{}", folded(&line, COLUMNS))
        });
    }
    let logger = builder.build();
    log::set_max_level(logger.filter());
    // Fails for a second logger of a process, which this program never sets.
    let _ = log::set_boxed_logger(Box::new(ProgramLogger(logger)));
}
