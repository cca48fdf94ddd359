//! What processes leave that were killed while they were starting. Called before a node is made.
//!
//! iceoryx2 cleans up after a killed process whenever a node is made, but 0.10.0 overlooks files that the process had
//! not finished: it then cannot remove the folder they are in, gives the whole dead node up, and tries in vain again
//! each time. A finished file can only be read; what an unfinished one announces does not exist yet.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::time::Duration;

use ::iceoryx2::config::Config;
use ::iceoryx2::prelude::*;

/// The mode of a file that is not finished.
const UNFINISHED: u32 = 0o600;
/// From beginning its folder to being listed a node takes less than a thousandth of this.
const LONGEST_START: Duration = Duration::from_secs(5);

/// Whether a listed node's process is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Life {
    Dead,
    NotKnownDead,
}

/// Removes unfinished files of dead nodes, so that iceoryx2 can remove the rest. What cannot be removed stays.
pub fn remove_unfinished_files() {
    let config = Config::global_config();
    let mut nodes = BTreeMap::new();
    let listed = Node::<ipc::Service>::list(config, |state| {
        let life = if matches!(state, NodeState::Dead(_)) { Life::Dead } else { Life::NotKnownDead };
        nodes.insert(state.node_id().value().to_string(), life);
        CallbackProgression::Continue
    });
    let Ok(folders) = fs::read_dir(config.global.node_dir().to_string()) else { return };
    for folder in folders.flatten().map(|entry| entry.path()).filter(|_| listed.is_ok()) {
        let id = folder.file_name().unwrap_or_default().to_string_lossy();
        match nodes.get(id.as_ref()) {
            Some(Life::Dead) => remove_unfinished(&folder),
            None if is_older(&folder, LONGEST_START) => {
                remove_unfinished(&folder);
                // Fails where something is left in it.
                let _ = fs::remove_dir(&folder);
            }
            _ => {}
        }
    }
}

fn remove_unfinished(folder: &Path) {
    let Ok(files) = fs::read_dir(folder) else { return };
    for file in files.flatten() {
        if file.metadata().is_ok_and(|of| of.is_file() && of.permissions().mode() & 0o777 == UNFINISHED) {
            let _ = fs::remove_file(file.path());
        }
    }
}

/// Whether nothing has changed in a folder for so long.
fn is_older(folder: &Path, age: Duration) -> bool {
    let changed = folder.metadata().and_then(|of| of.modified());
    folder.is_dir() && changed.is_ok_and(|changed| changed.elapsed().is_ok_and(|elapsed| elapsed > age))
}
