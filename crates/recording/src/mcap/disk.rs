//! The output file of a recording. A failed flush leaves the file as it was before the flush, while a kill during a
//! flush can leave a part of its bytes. Disk space is reserved in advance, so that a full disk still has room for the
//! end of the file.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::os::fd::AsFd;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use nix::errno::Errno;
use nix::fcntl::{FallocateFlags, fallocate};
use nix::sys::resource::{Resource, getrlimit};

/// The bytes that are reserved at a time.
const STEP: u64 = 8 << 20;

/// A file that grows by flushes. Clones are the same file.
#[derive(Clone)]
pub(super) struct Disk(Arc<Mutex<Inner>>);

struct Inner {
    file: File,
    /// The bytes since the last flush.
    buffer: Vec<u8>,
    /// The number of bytes in the file.
    flushed: u64,
    /// The size of the file with the reserved space.
    reserved: u64,
    /// True after a failed write: the file is not changed any more.
    failed: bool,
}

impl Disk {
    /// Starts with an empty file.
    pub fn new(file: File) -> Self {
        Self(Arc::new(Mutex::new(Inner { file, buffer: Vec::new(), flushed: 0, reserved: 0, failed: false })))
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the bytes in the file and in the buffer.
    pub fn position(&self) -> u64 {
        let inner = self.inner();
        inner.flushed + inner.buffer.len() as u64
    }

    /// Reserves space for a file of `bytes` bytes.
    ///
    /// # Errors
    /// The disk is full, or the process may not write larger files.
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
            // The file system cannot reserve space: a full disk is then an error of a write.
            Err(_) => {
                inner.reserved = most;
                Ok(())
            }
            Ok(()) => Ok(()),
        }
    }

    /// Waits until the flushed bytes are on the disk.
    pub fn sync(&self) -> io::Result<()> {
        // Without the lock, since this can last.
        let file = self.inner().file.try_clone()?;
        match file.sync_data() {
            // Pipes and devices cannot be synchronised.
            Err(error) if error.raw_os_error() == Some(nix::libc::EINVAL) => Ok(()),
            done => done,
        }
    }

    /// Releases the reserved space that is unused.
    pub fn release(&self) {
        let mut inner = self.inner();
        let length = inner.flushed;
        inner.reserved = length;
        // A device has no length to set.
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
    /// Returns the position, the only seek of the writer.
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
            // The bytes written are no whole chunk.
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
