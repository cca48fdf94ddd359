//! The files of a bag: a directory that `ros2 bag record` wrote, with `metadata.yaml` and one or several recordings.

use std::fs::read_dir;
use std::io;
use std::path::{Path, PathBuf};

use super::error::ReadError;

/// The file that lists the recordings, in their order.
const METADATA: &str = "metadata.yaml";
/// The key of the list in this file.
const LIST: &str = "relative_file_paths:";

/// Returns the recordings of a directory in the order of `metadata.yaml`. A killed recorder leaves no `metadata.yaml`:
/// then the order follows the numbers at the end of the names.
///
/// # Errors
/// [`ReadError::Bag`]
pub(super) fn recordings_of(directory: &Path) -> Result<Vec<PathBuf>, ReadError> {
    let failed = |of: &str, error: io::Error| ReadError::Bag(format!("{of}{error}"));
    let listed = match std::fs::read_to_string(directory.join(METADATA)) {
        Ok(text) => listed(&text).into_iter().map(PathBuf::from).collect(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
        Err(error) => return Err(failed("its metadata.yaml: ", error)),
    };
    if !listed.is_empty() {
        return listed.into_iter().map(|name| present(directory, &name)).collect();
    }
    let entries = read_dir(directory).map_err(|error| failed("", error))?;
    let files = entries.flatten().map(|entry| entry.path());
    let mut files: Vec<_> = files.filter(|file| file.extension().is_some_and(|ending| ending == "mcap")).collect();
    files.sort_by_cached_key(|file| number_at_the_end(file));
    if files.is_empty() { Err(ReadError::Bag("no file of this directory ends in .mcap".to_owned())) } else { Ok(files) }
}

/// Returns the path of a listed recording.
fn present(directory: &Path, name: &Path) -> Result<PathBuf, ReadError> {
    let path = directory.join(name);
    let name = name.display();
    match path.extension() {
        Some(ending) if ending != "mcap" => Err(ReadError::Bag(format!("its recording {name} is no .mcap"))),
        _ if path.is_file() => Ok(path),
        _ => Err(ReadError::Bag(format!("its metadata.yaml lists {name}, which is not there"))),
    }
}

/// Returns the file names of the list in `metadata.yaml`: lines that begin with a dash, as rosbag2 writes them, or in
/// brackets.
fn listed(metadata: &str) -> Vec<String> {
    let mut lines = metadata.lines().map(str::trim);
    let Some(rest) = lines.find_map(|line| line.strip_prefix(LIST)) else { return Vec::new() };
    let name = |text: &str| text.trim().trim_matches(['"', '\'']).to_owned();
    match rest.trim().strip_prefix('[') {
        Some(list) => list.trim_end_matches(']').split(',').map(name).filter(|name| !name.is_empty()).collect(),
        None => lines.map_while(|line| line.strip_prefix("- ").map(name)).collect(),
    }
}

/// Returns the number at the end of a file's name, and the name.
fn number_at_the_end(file: &Path) -> (u64, PathBuf) {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let digits = stem.trim_end_matches(|letter: char| letter.is_ascii_digit()).len();
    (stem[digits..].parse().unwrap_or(0), file.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_is_read_as_rosbag2_and_as_other_programs_write_it() {
        let rosbag2 = "rosbag2_bagfile_information:\n  version: 9\n  compression_mode: \"\"\n  relative_file_paths:\n    \
                       - live_0.mcap\n    - \"of two_1.mcap\"\n  files:\n    - path: live_0.mcap\n";
        assert_eq!(listed(rosbag2), ["live_0.mcap", "of two_1.mcap"]);
        assert_eq!(listed("a:\n  relative_file_paths: ['live.mcap', b.mcap]\n"), ["live.mcap", "b.mcap"]);
        assert_eq!(listed("a:\n  relative_file_paths: []\n"), [""; 0]);
        assert_eq!(listed("no: list\n"), [""; 0]);
    }

    #[test]
    fn names_are_in_the_order_of_their_numbers() {
        let mut files =
            ["live_10.mcap", "live_9.mcap", "live.mcap", "live_9999999999999999999999.mcap"].map(PathBuf::from);
        files.sort_by_cached_key(|file| number_at_the_end(file));
        assert_eq!(files[2..], ["live_9.mcap", "live_10.mcap"].map(PathBuf::from));
    }
}
