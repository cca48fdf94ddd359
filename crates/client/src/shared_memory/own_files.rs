//! The files of this process in shared memory and in iceoryx2's folder, which are kept from programs that clean up. In:
//! the open files of this process. Out: new times of these files, and the number of those that are gone.
//!
//! Programs such as systemd-tmpfiles remove files by their age, which is that of the latest change, reading or writing.
//! The service logind removes the shared memory of a user who has logged out. All files of a node stay open in iceoryx2.
//! Linux lists open files, and marks those that were removed.

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use ::iceoryx2::config::Config;
use nix::fcntl::AT_FDCWD;
use nix::sys::stat::{UtimensatFlags, utimensat};
use nix::sys::time::TimeSpec;

use super::{SHARED_MEMORY, entries};

/// The interval at which files are touched.
const TOUCH_INTERVAL: Duration = Duration::from_secs(3600);
/// The mark of Linux behind the name of a removed file.
const REMOVED: &str = " (deleted)";
/// The ends of the names of files that exist as long as their service, node or port. Files of connections go with the
/// other process.
const LASTING: [&str; 6] =
    [".dynamic", ".service", ".port_tag", ".details", ".node_monitor", ".node_monitor_owner_lock"];

/// The files as they were seen before.
#[derive(Debug, Default)]
pub(super) struct OwnFiles {
    touched: Option<Instant>,
    /// The files that were gone at the latest look: a file that this process itself removes is still open for a moment.
    gone: BTreeSet<PathBuf>,
}

impl OwnFiles {
    /// Touches the files if an hour has passed. Returns the number of files that another program has removed: those that
    /// were gone at the look before too.
    pub(super) fn look(&mut self, now: Instant) -> u64 {
        let open: Vec<(PathBuf, PathBuf)> = open_files();
        let removed = |(_, file): &(PathBuf, PathBuf)| {
            let name = file.as_os_str().as_bytes().strip_suffix(REMOVED.as_bytes())?;
            let lasts = LASTING.iter().any(|end| name.ends_with(end.as_bytes()));
            lasts.then(|| file.clone())
        };
        let gone: BTreeSet<PathBuf> = open.iter().filter_map(removed).collect();
        let lost = gone.intersection(&self.gone).count() as u64;
        self.gone = gone;
        if self.touched.is_none_or(|touched| now - touched >= TOUCH_INTERVAL) {
            self.touched = Some(now);
            touch_all(&open);
        }
        lost
    }
}

/// Returns the open files of iceoryx2: the link to each in /proc, and its name.
fn open_files() -> Vec<(PathBuf, PathBuf)> {
    let config = Config::global_config();
    let root = config.global.root_path().to_string();
    let memory = Path::new(SHARED_MEMORY).join(config.global.prefix.to_string());
    let is_ours = |file: &Path| {
        let name = file.as_os_str().as_bytes();
        name.starts_with(root.as_bytes()) || name.starts_with(memory.as_os_str().as_bytes())
    };
    let with_name = |link: PathBuf| fs::read_link(&link).ok().map(|file| (link, file));
    let links = entries(Path::new("/proc/self/fd")).into_iter();
    links.filter_map(with_name).filter(|(_, file)| is_ours(file)).collect()
}

/// Touches open files, the folders below iceoryx2's that have them, and the files beside them in a node's folder.
fn touch_all(open: &[(PathBuf, PathBuf)]) {
    open.iter().for_each(|(link, _)| touch(link));
    let root = PathBuf::from(Config::global_config().global.root_path().to_string());
    let above = |file: &PathBuf| {
        let folders = file.ancestors().skip(1).take_while(|folder| folder.starts_with(&root));
        folders.map(Path::to_path_buf).collect::<Vec<_>>()
    };
    let folders: BTreeSet<PathBuf> = open.iter().flat_map(|(_, file)| above(file)).collect();
    folders.iter().for_each(|folder| touch(folder));
    let nodes = open.iter().filter(|(_, file)| file.extension().is_some_and(|end| end == "details"));
    nodes.filter_map(|(_, file)| file.parent()).flat_map(entries).for_each(|file| touch(&file));
}

/// Sets the times of a file to now. A file that is gone, or another user's, stays as it is.
fn touch(file: &Path) {
    let now = TimeSpec::UTIME_NOW;
    let _ = utimensat(AT_FDCWD, file, &now, &now, UtimensatFlags::FollowSymlink);
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::time::SystemTime;

    use super::*;

    const LONG_AGO: Duration = Duration::from_secs(20 * 86_400);

    fn age(file: &Path) -> Duration {
        SystemTime::now().duration_since(file.metadata().unwrap().modified().unwrap()).unwrap_or_default()
    }

    fn make_old(files: &[PathBuf]) {
        for file in files {
            File::open(file).unwrap().set_modified(SystemTime::now() - LONG_AGO).unwrap();
        }
    }

    #[test]
    fn every_file_of_a_node_and_its_services_is_touched_each_hour_and_missed_when_it_is_gone() {
        let _only = crate::shared_memory::only_test_with_open_files();
        let node = crate::shared_memory::node().unwrap();
        let name = format!("own_files_{}/test", std::process::id()).as_str().try_into().unwrap();
        let service = node.service_builder(&name).publish_subscribe::<u64>().open_or_create().unwrap();
        let _publisher = service.publisher_builder().create().unwrap();
        let mine = || open_files().into_iter().map(|(_, file)| file).collect::<Vec<_>>();
        let details = mine().into_iter().find(|file| file.extension().is_some_and(|end| end == "details")).unwrap();
        let files: Vec<PathBuf> = mine().into_iter().chain(entries(details.parent().unwrap())).collect();
        let has = |end: &str| files.iter().any(|file| file.extension().is_some_and(|own| own == end));
        assert!(["data", "dynamic", "service", "port_tag", "service_tag", "node_monitor"].into_iter().all(has));
        let (mut own, began) = (OwnFiles::default(), Instant::now());
        make_old(&files);
        own.look(began);
        assert!(files.iter().all(|file| age(file) < LONG_AGO / 2), "{files:?}");
        make_old(&files);
        own.look(began + Duration::from_secs(3599));
        assert!(files.iter().all(|file| age(file) > LONG_AGO / 2), "{files:?}");
        assert_eq!(own.look(began + Duration::from_secs(3600)), 0);
        assert!(files.iter().all(|file| age(file) < LONG_AGO / 2), "{files:?}");
        // As a program that cleans up does.
        let memory = files.iter().find(|file| file.extension().is_some_and(|end| end == "dynamic")).unwrap();
        fs::remove_file(memory).unwrap();
        assert_eq!(own.look(began), 0, "this process itself may be about to close it");
        assert_eq!(own.look(began), 1);
    }
}
