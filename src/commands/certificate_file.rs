//! The file of a certificate that a command writes with `--certify`.

use std::io::{self, BufWriter};
use std::path::Path;

use bench_dragon::certify::CertificateLine;

use super::CommandError;
use super::new_file::NewFile;
use super::signals::are_searches_stopped;

/// A certificate that is being written.
pub struct CertificateFile(BufWriter<NewFile>);

impl CertificateFile {
    /// Creates the file.
    ///
    /// # Errors
    /// Bad input: the file cannot be written.
    pub fn create(file: &Path) -> Result<Self, CommandError> {
        Ok(Self(BufWriter::new(NewFile::create(file)?)))
    }

    /// Writes a line.
    ///
    /// # Errors
    /// The line cannot be written.
    pub fn write(&mut self, line: &CertificateLine) -> io::Result<()> {
        line.write(&mut self.0)
    }

    /// Completes the file under its name. Of a search that a signal has stopped no file is made.
    ///
    /// # Errors
    /// Failed: the disk is full, or the folder has changed.
    pub fn finish(self) -> Result<(), CommandError> {
        if are_searches_stopped() {
            log::warn!("the search was stopped: no certificate is written");
            return Ok(());
        }
        self.0.into_inner().map_err(io::Error::from)?.finish()
    }
}
