//! A file that a command writes: it appears under its name when it is complete.

use std::ffi::OsString;
use std::fs::{File, Metadata, OpenOptions, Permissions};
use std::io::{self, Write};
use std::os::fd::AsRawFd;
use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};
use std::path::{Path, PathBuf};

use rustix::fs::{AtFlags, CWD, Mode, OFlags};
use tempfile::{Builder, NamedTempFile};

use super::{CommandError, not_writable};

/// A file that is being written. A regular file is written beside its name, so that until [`finish`](Self::finish) an
/// earlier file stays as it is. Errors name the file.
#[derive(Debug)]
pub struct NewFile {
    shown: String,
    writer: Writer,
}

#[derive(Debug)]
enum Writer {
    /// A device or a pipe, or a file in a folder that takes no second one.
    Direct(File),
    /// A file that has no name until it is complete: nothing is left of it if the command is ended.
    Unnamed(File, PathBuf),
    /// A file beside its name, where the file system knows no files without a name.
    Beside(NamedTempFile, PathBuf),
}

impl NewFile {
    /// Creates a file, or opens a device or a pipe.
    ///
    /// # Errors
    /// Bad input: the file cannot be written.
    pub fn create(file: &Path) -> Result<Self, CommandError> {
        let writer = writer(file).map_err(|error| not_writable(file.display(), &error))?;
        Ok(Self { shown: file.display().to_string(), writer })
    }

    /// Completes the file under its name.
    ///
    /// # Errors
    /// Failed: the disk is full, or the folder has changed.
    pub fn finish(self) -> Result<(), CommandError> {
        let Self { shown, writer } = self;
        let done = match writer {
            Writer::Direct(_) => Ok(()),
            Writer::Unnamed(written, file) => written.sync_all().and_then(|()| name(&written, &file)),
            Writer::Beside(written, file) => {
                written.as_file().sync_all().and_then(|()| Ok(written.persist(file).map(drop)?))
            }
        };
        done.map_err(|error| named(&shown, error).into())
    }
}

impl Write for NewFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = match &mut self.writer {
            Writer::Direct(file) | Writer::Unnamed(file, _) => file.write(bytes),
            // The library's errors name its own file.
            Writer::Beside(file, _) => file.as_file_mut().write(bytes),
        };
        written.map_err(|error| named(&self.shown, error))
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn writer(file: &Path) -> io::Result<Writer> {
    // `/dev/stdout` may be a regular file that the shell has opened.
    if file.starts_with("/dev") || file.starts_with("/proc") {
        return File::create(file).map(Writer::Direct);
    }
    let existing = match OpenOptions::new().write(true).open(file) {
        Ok(opened) => Some((opened.metadata()?, opened)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => return Err(error),
    };
    let beside = match existing {
        Some((metadata, opened)) if !metadata.is_file() => return Ok(Writer::Direct(opened)),
        Some((metadata, _)) => file.canonicalize().and_then(|file| beside(file, Some(&metadata))),
        None if file.is_symlink() => return File::create(file).map(Writer::Direct),
        None => beside(file.to_owned(), None),
    };
    beside.or_else(|_| File::create(file).map(Writer::Direct))
}

/// Creates the file that is to replace `file`, with the owner and the permissions of an earlier one.
fn beside(file: PathBuf, earlier: Option<&Metadata>) -> io::Result<Writer> {
    let writer = match unnamed(folder_of(&file)) {
        Ok(written) => Writer::Unnamed(written, file),
        Err(_) => {
            let mut builder = Builder::new();
            let builder = builder.permissions(Permissions::from_mode(0o666));
            Writer::Beside(builder.prefix(&prefix(&file)).tempfile_in(folder_of(&file))?, file)
        }
    };
    if let (Some(earlier), Writer::Unnamed(written, _)) = (earlier, &writer) {
        owned_as(written, earlier)?;
    } else if let (Some(earlier), Writer::Beside(written, _)) = (earlier, &writer) {
        owned_as(written.as_file(), earlier)?;
    }
    Ok(writer)
}

fn owned_as(file: &File, earlier: &Metadata) -> io::Result<()> {
    fchown(file, Some(earlier.uid()), Some(earlier.gid()))?;
    file.set_permissions(earlier.permissions())
}

fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Returns the beginning of the name that a file has beside another.
fn prefix(file: &Path) -> OsString {
    let mut prefix = OsString::from(".");
    prefix.push(file.file_name().unwrap_or_default());
    prefix
}

/// Opens a file without a name on the file system of a folder.
fn unnamed(folder: &Path) -> io::Result<File> {
    let flags = OFlags::TMPFILE | OFlags::WRONLY | OFlags::CLOEXEC;
    let file = File::from(rustix::fs::open(folder, flags, Mode::from_raw_mode(0o666))?);
    // The file gets its name by way of this link, which a system without /proc does not have.
    descriptor(&file).metadata()?;
    Ok(file)
}

fn descriptor(file: &File) -> PathBuf {
    PathBuf::from(format!("/proc/self/fd/{}", file.as_raw_fd()))
}

/// Gives a file without a name this one. A link cannot replace an earlier file, a renamed file can.
fn name(written: &File, file: &Path) -> io::Result<()> {
    let link = |path: &Path| Ok(rustix::fs::linkat(CWD, descriptor(written), CWD, path, AtFlags::SYMLINK_FOLLOW)?);
    let linked = Builder::new().prefix(&prefix(file)).make_in(folder_of(file), link)?;
    Ok(linked.persist(file).map(drop)?)
}

/// Returns an error with the file's name before it.
fn named(file: &str, error: io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{file}: {error}"))
}
