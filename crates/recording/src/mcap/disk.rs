//! Where the bytes of a recording go. What is written between two flushes reaches the file as a whole or not at all, and
//! room on the disk is taken before it is needed, so that a full disk still has room for the end of the file.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::os::fd::AsFd;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use nix::errno::Errno;
use nix::fcntl::{FallocateFlags, fallocate};
use nix::sys::resource::{Resource, getrlimit};

/// Room that is taken at a time.
const STEP: u64 = 8 << 20;

/// A file that grows by flushes. Clones are the same file.
#[derive(Clone)]
pub(super) struct Disk(Arc<Mutex<Inner>>);

struct Inner {
    file: File,
    /// What has been written since the last flush.
    buffer: Vec<u8>,
    /// Bytes in the file.
    flushed: u64,
    /// Bytes that the file may have with the room that was taken.
    reserved: u64,
    /// After a write has failed the file is left as it stands.
    failed: bool,
}

impl Disk {
    /// An empty file.
    pub fn new(file: File) -> Self {
        Self(Arc::new(Mutex::new(Inner { file, buffer: Vec::new(), flushed: 0, reserved: 0, failed: false })))
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Bytes in the file, and those that the next flush brings.
    pub fn position(&self) -> u64 {
        let inner = self.inner();
        inner.flushed + inner.buffer.len() as u64
    }

    /// Takes room for so many bytes in all.
    ///
    /// # Errors
    /// There is none: the disk is full, or the process may not write larger files.
    pub fn reserve(&self, bytes: u64) -> io::Result<()> {
        let mut inner = self.inner();
        if bytes <= inner.reserved {
            return Ok(());
        }
        let most = getrlimit(Resource::RLIMIT_FSIZE).map_or(u64::MAX, |(soft, _)| soft);
        if bytes > most {
            return Err(Errno::EFBIG.into());
        }
        let took = inner.allocate(bytes.saturating_add(STEP).min(most)).or_else(|error| match error {
            Errno::ENOSPC | Errno::EDQUOT => inner.allocate(bytes),
            other => Err(other),
        });
        match took {
            Err(error @ (Errno::ENOSPC | Errno::EDQUOT | Errno::EFBIG)) => Err(error.into()),
            // A file system that takes no room ahead: a full disk then shows in a write.
            Err(_) => {
                inner.reserved = most;
                Ok(())
            }
            Ok(()) => Ok(()),
        }
    }

    /// Waits until what was flushed would survive a loss of power.
    pub fn sync(&self) -> io::Result<()> {
        // Not under the lock, which nobody else needs while this lasts: the file is one thread's.
        let file = self.inner().file.try_clone()?;
        match file.sync_data() {
            // Pipes and devices have no such thing.
            Err(error) if error.raw_os_error() == Some(nix::libc::EINVAL) => Ok(()),
            done => done,
        }
    }

    /// Gives back the room that was not needed.
    pub fn release(&self) {
        let mut inner = self.inner();
        let length = inner.flushed;
        inner.reserved = length;
        // Of a device there is nothing to give back.
        let _ = inner.file.set_len(length);
    }
}

impl Inner {
    fn allocate(&mut self, bytes: u64) -> Result<(), Errno> {
        let (from, length) = (self.flushed, bytes - self.flushed);
        let [from, length] = [from, length].map(|number| i64::try_from(number).unwrap_or(i64::MAX));
        fallocate(self.file.as_fd(), FallocateFlags::FALLOC_FL_KEEP_SIZE, from, length)?;
        self.reserved = bytes;
        Ok(())
    }
}

impl Seek for Disk {
    /// Tells the position, for which the writer asks.
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.position()),
            _ => Err(io::ErrorKind::Unsupported.into()),
        }
    }
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.inner().buffer.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let mut inner = self.inner();
        let Inner { file, buffer, flushed, failed, .. } = &mut *inner;
        if *failed {
            return Err(io::Error::other("an earlier write has failed"));
        }
        if let Err(error) = file.write_all(buffer) {
            // What arrived of it is no whole chunk.
            let _ = file.set_len(*flushed);
            let _ = file.seek(SeekFrom::Start(*flushed));
            buffer.clear();
            *failed = true;
            return Err(error);
        }
        *flushed += buffer.len() as u64;
        buffer.clear();
        Ok(())
    }
}
