//! Files that commands write: an earlier file stays until the new one is complete, and errors name the file.

use std::io::Read;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::Path;
use std::process::{Command, Output};

use nix::sys::signal::Signal;

use crate::harness::{Process, can_run, root, text, wait_until};

const SCENE: &str = "tests/scenes/missed_contact.toml";

fn run(arguments: &[&str], file: &Path) -> Output {
    let mut program = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    let scene = if arguments[0] == "record" { None } else { Some(["--scene", SCENE]) };
    Process::start(program.args(scene.iter().flatten()).args(arguments).arg(file)).output()
}

/// The commands that write one file, without its name.
const WRITERS: [&[&str]; 4] = [
    &["draw", "--output"],
    &["solve", "--at", "0,1,2,3,4,5,6,7,8,9,10,11,12", "--output"],
    &["events", "--certify"],
    &["record", "--force", "--recover", "tests/fuzz/corpus/recording/small.mcap", "--output"],
];

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_new_file_replaces_an_earlier_one_with_its_permissions() {
    let folder = tempfile::tempdir().unwrap();
    for (number, writer) in WRITERS.iter().enumerate() {
        let [fresh, earlier, link] =
            ["fresh", "earlier", "link"].map(|name| folder.path().join(format!("{number}{name}")));
        std::fs::write(&earlier, "earlier").unwrap();
        std::fs::set_permissions(&earlier, PermissionsExt::from_mode(0o640)).unwrap();
        std::os::unix::fs::symlink(&earlier, &link).unwrap();
        for file in [&fresh, &link] {
            let output = run(writer, file);
            assert!(output.status.success(), "{writer:?}: {}", text(&output.stderr));
        }
        let [new, replaced] = [&fresh, &earlier].map(|file| std::fs::read(file).unwrap());
        assert!(new == replaced && new.len() > 100, "{writer:?}: {} and {} bytes", new.len(), replaced.len());
        assert!(link.is_symlink() && earlier.metadata().unwrap().mode() & 0o777 == 0o640, "{writer:?}");
        // As any program creates a file: by the umask.
        let usual = folder.path().join("usual");
        std::fs::write(&usual, "").unwrap();
        assert_eq!(fresh.metadata().unwrap().mode(), usual.metadata().unwrap().mode(), "{writer:?}");
    }
    assert_eq!(names(folder.path()).len(), 3 * WRITERS.len() + 1);
}

#[test]
fn devices_and_pipes_are_written_as_they_come() {
    for writer in WRITERS {
        let output = run(writer, Path::new("/dev/full"));
        let printed = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{writer:?}: {printed}");
        assert!(printed.contains("/dev/full: No space left on device"), "{writer:?}: {printed}");
    }
    let folder = tempfile::tempdir().unwrap();
    let (pipe, file) = (folder.path().join("pipe"), folder.path().join("file"));
    nix::unistd::mkfifo(&pipe, nix::sys::stat::Mode::S_IRWXU).unwrap();
    let reader = std::thread::spawn({
        let pipe = pipe.clone();
        move || {
            let mut read = String::new();
            std::fs::File::open(pipe).unwrap().read_to_string(&mut read).unwrap();
            read
        }
    });
    assert!(run(WRITERS[0], &pipe).status.success());
    let read = reader.join().unwrap();
    assert!(run(WRITERS[0], &file).status.success());
    assert_eq!(read, std::fs::read_to_string(&file).unwrap());
    assert_eq!(text(&run(WRITERS[0], Path::new("/dev/stdout")).stdout), read);
    // A regular file that is open as standard output is not renamed.
    let mut shell = Command::new("sh");
    shell.args([
        "-c",
        "exec \"$0\" --scene \"$1\" draw -o /dev/stdout > \"$2\"",
        env!("CARGO_BIN_EXE_bench-dragon"),
        SCENE,
    ]);
    let before = file.metadata().unwrap().ino();
    assert!(shell.arg(&file).status().unwrap().success());
    assert_eq!((std::fs::read_to_string(&file).unwrap(), file.metadata().unwrap().ino()), (read, before));
}

#[test]
fn a_full_disk_leaves_the_earlier_file() {
    if !can_run(root("make a small disk")) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let disk = folder.path().to_str().unwrap();
    let mount =
        |arguments: &[&str]| assert!(Command::new(arguments[0]).args(&arguments[1..]).status().unwrap().success());
    mount(&["mount", "-t", "tmpfs", "-o", "size=8k", "tmpfs", disk]);
    let file = folder.path().join("earlier");
    let checked = std::panic::catch_unwind(|| {
        for writer in WRITERS {
            std::fs::write(&file, "earlier").unwrap();
            let output = run(writer, &file);
            let printed = text(&output.stderr);
            assert_eq!(output.status.code(), Some(1), "{writer:?}: {printed}");
            let sentence = format!("{}: No space left on device", file.display());
            assert!(printed.contains(&sentence) && printed.lines().count() == 1, "{writer:?}: {printed}");
            assert_eq!(std::fs::read_to_string(&file).unwrap(), "earlier", "{writer:?}");
            assert_eq!(names(folder.path()), ["earlier"], "{writer:?}");
        }
    });
    mount(&["umount", "--lazy", disk]);
    checked.unwrap();
}

/// A command that is ended leaves neither a part of its file nor a file beside it.
#[test]
fn an_ended_command_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("proof.jsonl");
    std::fs::write(&file, "earlier").unwrap();
    for signal in [Signal::SIGINT, Signal::SIGTERM, Signal::SIGKILL] {
        // The tests may have been started where a signal is ignored.
        let mut program = Command::new("env");
        program.args(["--default-signal=INT,TERM", env!("CARGO_BIN_EXE_bench-dragon")]);
        // Its proof would take minutes.
        program.args(["--scene", "tests/scenes/x5.toml", "events", "--certify"]).arg(&file);
        let child = Process::start(&mut program);
        // The bytes that it has written, by the system's account.
        let written = || {
            let counts = std::fs::read_to_string(format!("/proc/{}/io", child.id())).unwrap();
            counts.lines().find_map(|line| line.strip_prefix("wchar: ")?.parse::<u64>().ok()).unwrap()
        };
        wait_until("a part of a certificate", || written() > 100_000);
        child.signal(signal);
        assert!(!child.output().status.success(), "{signal}");
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "earlier", "{signal}");
        assert_eq!(names(folder.path()), ["proof.jsonl"], "{signal}");
    }
}
