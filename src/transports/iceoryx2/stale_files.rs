//! What processes leave that were killed while they were starting. iceoryx2 cleans up after killed processes whenever a
//! node is made or dropped, but 0.10.0 stumbles over files that such a process had not finished:
//!
//! - in a node's folder: it cannot remove the folder, gives the whole dead node up, and tries again in vain each time;
//! - in shared memory: it waits for ever for somebody to finish the file, and so does the program that made the node;
//! - among the services: every later attempt to open that service fails.
//!
//! Whoever makes a node calls [`remove_unfinished_files`] before, and [`spawn_reaper`] on a thread that is not real-time.
//! Whether a file is unfinished shows in its mode, which its maker sets last.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::Once;
use std::time::{Duration, Instant};

use ::iceoryx2::config::Config;
use ::iceoryx2::prelude::*;

use super::memory::SHARED_MEMORY;

/// The mode of an unfinished file below iceoryx2's folder.
const UNFINISHED: u32 = 0o600;
/// The mode of an unfinished file in shared memory.
const UNFINISHED_MEMORY: u32 = 0o200;
/// Making a file takes less than a thousandth of this.
const LONGEST_MAKING: Duration = Duration::from_secs(2);
/// How often [`spawn_reaper`] looks.
const INTERVAL: Duration = Duration::from_millis(500);

/// Whether a listed node's process is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Life {
    Dead,
    NotKnownDead,
}

/// Removes unfinished files of dead nodes, so that iceoryx2 can remove the rest, and nodes that never came to be listed.
/// What cannot be removed stays.
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
            // Killed before it was listed: nobody else knows of it.
            None if is_old(folder) => {
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

/// Has a thread of this process remove unfinished shared memory and services of killed processes from now on.
pub fn spawn_reaper() {
    static STARTED: Once = Once::new();
    STARTED.call_once(|| {
        std::thread::spawn(|| {
            let mut seen = BTreeMap::new();
            loop {
                remove_what_stays_unfinished(&mut seen);
                std::thread::sleep(INTERVAL);
            }
        });
    });
}

/// Removes files that have been unfinished for long; `seen` remembers since when, so that no clock of a file system
/// matters.
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
        if now - *seen.entry(file.clone()).or_insert(now) >= LONGEST_MAKING {
            old.push(file);
        }
    }
    remove_all(old);
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    fs::read_dir(folder).map_or_else(|_| Vec::new(), |entries| entries.flatten().map(|entry| entry.path()).collect())
}

/// The files in a folder that have this mode.
fn with_mode(folder: &Path, mode: u32) -> Vec<PathBuf> {
    let has_mode =
        |file: &PathBuf| file.metadata().is_ok_and(|of| of.is_file() && of.permissions().mode() & 0o777 == mode);
    entries(folder).into_iter().filter(has_mode).collect()
}

fn remove_all(files: Vec<PathBuf>) {
    // Somebody else may have been quicker.
    files.iter().for_each(|file| drop(fs::remove_file(file)));
}

/// Whether nothing has changed in a folder for long.
fn is_old(folder: &Path) -> bool {
    let changed = folder.metadata().and_then(|of| of.modified());
    let is_old = |elapsed: Duration| elapsed > LONGEST_MAKING;
    changed.is_ok_and(|changed| changed.elapsed().is_ok_and(is_old))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_stays_unfinished_is_removed() {
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
