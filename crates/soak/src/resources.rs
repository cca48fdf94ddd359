//! The resources of a process, read from /proc.

use std::collections::BTreeSet;
use std::os::unix::fs::MetadataExt;

/// The folder of Linux for shared memory.
const SHARED_MEMORY: &str = "/dev/shm/";
/// The unit of a file's blocks, in bytes.
const BLOCK: u64 = 512;

/// The resources of a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Resources {
    /// Resident memory with used shared memory, in bytes.
    pub resident_bytes: u64,
    /// Open file descriptors.
    pub file_descriptors: u64,
    /// Pages in use of the files in /dev/shm that the process has mapped, in bytes.
    pub shared_memory_bytes: u64,
}

impl Resources {
    /// Returns the resources of the process `id`, or `None` if it has ended.
    pub fn of(id: u32) -> Option<Self> {
        let pages = std::fs::read_to_string(format!("/proc/{id}/statm")).ok()?;
        let pages: u64 = pages.split_whitespace().nth(1)?.parse().ok()?;
        let page = nix::unistd::sysconf(nix::unistd::SysconfVar::PAGE_SIZE).ok().flatten().unwrap_or(4096);
        Some(Self {
            resident_bytes: pages * page as u64,
            file_descriptors: std::fs::read_dir(format!("/proc/{id}/fd")).ok()?.count() as u64,
            shared_memory_bytes: shared_memory_bytes(id)?,
        })
    }
}

/// Returns a child process of the process `parent`, or `None` if it has none.
pub fn child_of(parent: u32) -> Option<u32> {
    let processes = std::fs::read_dir("/proc").ok()?.flatten();
    let numbers = processes.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    numbers.into_iter().find(|number| parent_of(*number) == Some(parent))
}

/// Returns the parent of a process (proc(5), stat).
fn parent_of(id: u32) -> Option<u32> {
    let stat = std::fs::read_to_string(format!("/proc/{id}/stat")).ok()?;
    // The name before may contain spaces and parentheses.
    stat.rsplit_once(')')?.1.split_whitespace().nth(1)?.parse().ok()
}

fn shared_memory_bytes(id: u32) -> Option<u64> {
    let maps = std::fs::read_to_string(format!("/proc/{id}/maps")).ok()?;
    let files: BTreeSet<_> = maps.lines().filter_map(|line| Some(&line[line.find(SHARED_MEMORY)?..])).collect();
    Some(files.iter().filter_map(|file| std::fs::metadata(file).ok()).map(|file| file.blocks() * BLOCK).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_holds_something_and_a_missing_one_nothing() {
        let mine = Resources::of(std::process::id()).unwrap();
        assert!(mine.resident_bytes > 100_000 && mine.file_descriptors >= 3, "{mine:?}");
        assert_eq!(Resources::of(u32::MAX), None);
    }
}
