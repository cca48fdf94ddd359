//! Stale files of processes that were killed during their start. The library iceoryx2 cleans up after killed processes
//! whenever a node is created or dropped, but its version 0.10.0 fails at files that such a process had not finished:
//!
//! - in a node's folder: it cannot remove the folder, leaves the whole dead node, and fails again each time;
//! - in shared memory: it waits without end for the file to be finished, and so does the program that created the node;
//! - among the services: every later attempt to open that service fails.
//!
//! So [`remove_unfinished_files`] is called before a node is created. Publishers of frames and subscribers also call
//! [`spawn_reaper`], on a thread that is not real-time. The mode of a file shows whether it is finished, because its
//! creator sets the mode last. A file that is still being created is left alone; on a busy disk this takes seconds,
//! because iceoryx2 syncs the files of nodes and services.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::Once;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use ::iceoryx2::config::Config;
use ::iceoryx2::prelude::*;

use super::own_files::OwnFiles;
use super::{SHARED_MEMORY, entries};

/// The mode of an unfinished file below iceoryx2's folder.
const UNFINISHED: u32 = 0o600;
/// The mode of an unfinished file in shared memory.
const UNFINISHED_MEMORY: u32 = 0o200;
/// The time after which an unfinished file is stale. Creating a file in memory takes less than a thousandth of this.
const LONGEST_MAKING: Duration = Duration::from_secs(2);
/// The interval of [`spawn_reaper`].
const INTERVAL: Duration = Duration::from_millis(500);

/// The number of files of this process that another program has removed.
static LOST: AtomicU64 = AtomicU64::new(0);

/// The state of a listed node's process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Life {
    Dead,
    NotKnownDead,
}

/// Removes unfinished files of dead nodes, so that iceoryx2 can remove the rest, and nodes that were never listed.
/// Files that cannot be removed stay.
pub fn remove_unfinished_files() {
    let config = Config::global_config();
    let mut nodes = BTreeMap::new();
    let listed = Node::<ipc::Service>::list(config, |state| {
        let life = if matches!(state, NodeState::Dead(_)) { Life::Dead } else { Life::NotKnownDead };
        nodes.insert(state.node_id().value().to_string(), life);
        CallbackProgression::Continue
    });
    if listed.is_err() {
        return;
    }
    let all = entries(Path::new(&config.global.node_dir().to_string()));
    for folder in all.iter().filter(|folder| folder.is_dir()) {
        let id = folder.file_name().unwrap_or_default().to_string_lossy();
        match nodes.get(id.as_ref()) {
            Some(Life::Dead) => remove_all(with_mode(folder, UNFINISHED)),
            // The process was killed before its node was listed: no other program removes the node.
            None if is_old(folder) && !entries(folder).iter().any(|file| is_being_written(file)) => {
                let monitor = format!("{}{id}.", config.global.prefix);
                let its_own =
                    |file: &&PathBuf| file.file_name().is_some_and(|name| name.to_string_lossy().starts_with(&monitor));
                remove_all(all.iter().filter(its_own).cloned().chain(entries(folder)).collect());
                let _ = fs::remove_dir(folder);
            }
            _ => {}
        }
    }
}

/// Starts a thread that removes unfinished shared memory and services of killed processes, and keeps the files of this
/// process, which it touches each hour.
pub fn spawn_reaper() {
    static STARTED: Once = Once::new();
    STARTED.call_once(|| {
        std::thread::spawn(|| {
            let (mut seen, mut own) = (BTreeMap::new(), OwnFiles::default());
            loop {
                remove_what_stays_unfinished(&mut seen);
                LOST.store(own.look(Instant::now()), Ordering::Relaxed);
                std::thread::sleep(INTERVAL);
            }
        });
    });
}

/// Returns the number of files of this process that another program has removed, so that processes that come later do
/// not find this one. Found within two seconds once [`spawn_reaper`] has been called.
pub fn lost_files() -> u64 {
    LOST.load(Ordering::Relaxed)
}

/// Removes files that have been unfinished for long; `seen` has the moment of the first sight of each, independent of
/// the file system's clock.
fn remove_what_stays_unfinished(seen: &mut BTreeMap<PathBuf, Instant>) {
    let config = Config::global_config();
    let prefix = config.global.prefix.to_string();
    let ours = |file: &PathBuf| file.file_name().is_some_and(|name| name.to_string_lossy().starts_with(&prefix));
    let memory = with_mode(Path::new(SHARED_MEMORY), UNFINISHED_MEMORY);
    let services = with_mode(Path::new(&config.global.service_dir().to_string()), UNFINISHED);
    let unfinished: BTreeSet<_> = memory.into_iter().chain(services).filter(ours).collect();
    seen.retain(|file, _| unfinished.contains(file));
    let (now, mut old) = (Instant::now(), Vec::new());
    for file in unfinished {
        let since = *seen.entry(file.clone()).or_insert(now);
        // Memory is never synced, and processes that wait for the file may have it open for writing too.
        if now - since >= LONGEST_MAKING && (file.starts_with(SHARED_MEMORY) || !is_being_written(&file)) {
            old.push(file);
        }
    }
    remove_all(old);
}

/// Returns the files of this mode in a folder.
fn with_mode(folder: &Path, mode: u32) -> Vec<PathBuf> {
    let has_mode =
        |file: &PathBuf| file.metadata().is_ok_and(|of| of.is_file() && of.permissions().mode() & 0o777 == mode);
    entries(folder).into_iter().filter(has_mode).collect()
}

/// Returns true if a process has a file open for writing, as its creator has until the file is finished; others open it
/// to read. Only root sees the processes of other users.
fn is_being_written(file: &Path) -> bool {
    let identity = |file: &Path| file.metadata().map(|of| (of.dev(), of.ino())).ok();
    let Some(file) = identity(file) else { return false };
    // A link there has the permissions that the file was opened with.
    let writable = |open: &PathBuf| open.symlink_metadata().is_ok_and(|link| link.mode() & 0o200 != 0);
    let open_files = entries(Path::new("/proc")).into_iter().flat_map(|process| entries(&process.join("fd")));
    open_files.filter(writable).any(|open| identity(&open) == Some(file))
}

fn remove_all(files: Vec<PathBuf>) {
    // Another process may have removed the file first.
    files.iter().for_each(|file| drop(fs::remove_file(file)));
}

/// Returns true if nothing has changed in a folder for long.
fn is_old(folder: &Path) -> bool {
    let changed = folder.metadata().and_then(|of| of.modified());
    let is_old = |elapsed: Duration| elapsed > LONGEST_MAKING;
    changed.is_ok_and(|changed| changed.elapsed().is_ok_and(is_old))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_that_is_not_listed_yet_stays_while_a_process_makes_it() {
        let _only = super::super::only_test_with_open_files();
        // This makes the folder of all nodes, as iceoryx2 has it.
        let _node = super::super::node().unwrap();
        let nodes = Config::global_config().global.node_dir().to_string();
        let folder = Path::new(&nodes).join(format!("test_{}", std::process::id()));
        fs::create_dir(&folder).unwrap();
        let details = fs::File::create(folder.join("details")).unwrap();
        let long_ago = std::time::SystemTime::now() - 2 * LONGEST_MAKING;
        fs::File::open(&folder).unwrap().set_modified(long_ago).unwrap();
        remove_unfinished_files();
        assert!(folder.join("details").exists());
        drop(details);
        remove_unfinished_files();
        assert!(!folder.exists());
    }

    #[test]
    fn only_what_stays_unfinished_is_removed() {
        let _only = super::super::only_test_with_open_files();
        let prefix = Config::global_config().global.prefix.to_string();
        let file = |name: &str, mode| {
            let file = Path::new(SHARED_MEMORY).join(format!("{prefix}test_{}_{name}", std::process::id()));
            fs::write(&file, "").unwrap();
            fs::set_permissions(&file, fs::Permissions::from_mode(mode)).unwrap();
            file
        };
        let [unfinished, finished] = [file("unfinished", 0o200), file("finished", 0o600)];
        let mut seen = BTreeMap::new();
        remove_what_stays_unfinished(&mut seen);
        assert!(unfinished.exists() && finished.exists());
        for since in seen.values_mut() {
            *since -= LONGEST_MAKING;
        }
        remove_what_stays_unfinished(&mut seen);
        assert!(!unfinished.exists() && finished.exists());
        fs::remove_file(finished).unwrap();
    }
}
