//! Real processes for tests: each ends by a deadline or with its test. Shared by the tests that start processes.

#![allow(dead_code, reason = "not every test file uses all of it")]

pub mod hosts;
mod requirements;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Output, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use nix::sys::wait::{Id, WaitPidFlag, waitid};
use nix::unistd::Pid;
use serde_json::Value;

pub use requirements::*;

/// The user id of a user without rights.
const OTHER_USER: u32 = 65534;

/// Returns the file of the program. Test programs that start no program are built without the program.
fn executable() -> &'static str {
    const FILE: Option<&str> = option_env!("CARGO_BIN_EXE_bench-dragon");
    FILE.expect("a test program that is built with the program")
}

/// Returns the time after which a process or its next line is missing: longer than a busy machine needs. The time
/// bounds a hang, not a speed. `tests/run` gives the tests of commands the time that the browser leaves: a minute of
/// computing may take a quarter of an hour.
pub fn patience() -> Duration {
    Duration::from_secs(if long() { 3600 } else { 1800 })
}

/// A process that does not outlive its test.
pub struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Process {
    pub fn start(command: &mut Command) -> Self {
        Self(command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap())
    }

    /// Starts a process whose standard input is the returned pipe.
    pub fn start_with_input(command: &mut Command) -> (Self, ChildStdin) {
        let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = piped.spawn().unwrap();
        let input = child.stdin.take().unwrap();
        (Self(child), input)
    }

    /// Starts two processes: the standard output of the first is the standard input of the second.
    pub fn start_piped(first: &mut Command, second: &mut Command) -> (Self, Self) {
        let mut first = Self::start(first);
        let output = first.0.stdout.take().unwrap();
        let piped = second.stdin(Stdio::from(output)).stdout(Stdio::piped()).stderr(Stdio::piped());
        (first, Self(piped.spawn().unwrap()))
    }

    pub fn id(&self) -> u32 {
        self.0.id()
    }

    pub fn signal(&self, signal: nix::sys::signal::Signal) {
        nix::sys::signal::kill(nix::unistd::Pid::from_raw(self.0.id() as i32), signal).unwrap();
    }

    /// Stops the process. `kill` returns before the signal takes effect; this returns once every thread is stopped.
    pub fn stop(&self) {
        self.signal(nix::sys::signal::Signal::SIGSTOP);
        let tasks = format!("/proc/{}/task", self.id());
        wait_until("every thread is stopped", || {
            std::fs::read_dir(&tasks).unwrap().flatten().all(|task| {
                let stat = std::fs::read_to_string(task.path().join("stat")).unwrap_or_default();
                // The state follows the name, which is in parentheses.
                stat.is_empty() || stat.rsplit_once(") ").is_some_and(|(_, rest)| rest.starts_with('T'))
            })
        });
    }

    /// Closes the reading end of standard output, as `| head` does after its last line.
    pub fn close_stdout(&mut self) {
        drop(self.0.stdout.take());
    }

    /// Closes the reading end of standard error.
    pub fn close_stderr(&mut self) {
        drop(self.0.stderr.take());
    }

    /// Returns the lines of standard output as they come; `output` must not be called afterwards.
    pub fn lines(&mut self) -> Lines {
        let stdout = self.0.stdout.take().unwrap();
        let errors = self.0.stderr.as_ref().and_then(|errors| errors.as_fd().try_clone_to_owned().ok());
        Lines { lines: sent_lines(stdout), errors, process: self.id() }
    }

    /// Returns the lines of standard error as they come. The result of `output` then has standard output alone.
    pub fn error_lines(&mut self) -> Lines {
        let stderr = self.0.stderr.take().unwrap();
        Lines { lines: sent_lines(stderr), errors: None, process: self.id() }
    }

    /// Waits until the process has printed a line with `what` on standard error. What follows the line stays there.
    pub fn until_error(&mut self, what: &str) {
        let mut stderr = self.0.stderr.take().unwrap();
        let (sender, receiver) = channel();
        let wanted = what.to_owned();
        std::thread::spawn(move || {
            let (mut printed, mut byte) = (Vec::new(), [0]);
            while !(printed.ends_with(b"\n") && text(&printed).contains(&wanted))
                && stderr.read_exact(&mut byte).is_ok()
            {
                printed.push(byte[0]);
            }
            let _ = sender.send((stderr, printed));
        });
        let (stderr, printed) = receiver.recv_timeout(patience()).unwrap();
        assert!(text(&printed).contains(what), "the process ended without \"{what}\": {}", text(&printed));
        self.0.stderr = Some(stderr);
    }

    /// Returns the first line that the process prints.
    pub fn first_line(&mut self) -> String {
        let mut output = BufReader::new(self.0.stdout.take().unwrap());
        let (sender, receiver) = channel();
        std::thread::spawn(move || {
            let mut line = String::new();
            let _ = output.read_line(&mut line);
            let _ = sender.send(line);
            // A closed pipe would end the process.
            let _ = std::io::copy(&mut output, &mut std::io::sink());
        });
        receiver.recv_timeout(patience()).unwrap()
    }

    /// Returns the output of the process, which must end by itself; without standard output after
    /// [`first_line`](Self::first_line).
    pub fn output(mut self) -> Output {
        let deadline = Instant::now() + patience();
        // Read while waiting: a full pipe would stop the process.
        let [stdout, stderr] =
            [std::thread::spawn(reading(self.0.stdout.take())), std::thread::spawn(reading(self.0.stderr.take()))];
        let status = loop {
            if let Some(status) = self.0.try_wait().unwrap() {
                break status;
            }
            assert!(Instant::now() < deadline, "the process did not end within {:?}", patience());
            std::thread::sleep(Duration::from_millis(10));
        };
        Output { status, stdout: stdout.join().unwrap(), stderr: stderr.join().unwrap() }
    }
}

/// Returns the lines that a thread reads from `output`.
fn sent_lines(output: impl Read + Send + 'static) -> Receiver<String> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        let lines = BufReader::new(output).lines().map_while(Result::ok);
        lines.take_while(|line| sender.send(line.clone()).is_ok()).for_each(drop);
    });
    receiver
}

/// Lines that a process prints while it runs.
pub struct Lines {
    lines: Receiver<String>,
    /// Standard error and the process, for the report of an early end.
    errors: Option<OwnedFd>,
    process: u32,
}

impl Lines {
    /// Returns the next line that contains `what`; earlier lines are dropped.
    pub fn until(&self, what: &str) -> String {
        // The last of these lines is the requested one.
        self.all_until(what).pop().unwrap()
    }

    /// Returns the lines up to and including the next one that contains `what`.
    pub fn all_until(&self, what: &str) -> Vec<String> {
        self.all_until_one(|line| line.contains(what), what)
    }

    /// Returns the lines up to and including the next one that `is_it` accepts.
    pub fn all_until_one(&self, is_it: impl Fn(&str) -> bool, what: &str) -> Vec<String> {
        let deadline = Instant::now() + patience();
        let mut lines = Vec::new();
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            lines.push(self.lines.recv_timeout(left).unwrap_or_else(|error| match error {
                RecvTimeoutError::Timeout => panic!("no \"{what}\" within {:?}", patience()),
                RecvTimeoutError::Disconnected => {
                    panic!("the output ended without \"{what}\" after {lines:?}; {}", self.complaint())
                }
            }));
            if lines.last().is_some_and(|line| is_it(line)) {
                return lines;
            }
        }
    }

    /// Returns the end of the process and the beginning of standard error, if they come at once.
    fn complaint(&self) -> String {
        let (sender, receiver) = channel();
        let errors = self.errors.as_ref().and_then(|errors| errors.try_clone().ok());
        std::thread::spawn(move || {
            let mut bytes = vec![0; 1 << 16];
            let length = errors.and_then(|errors| File::from(errors).read(&mut bytes).ok()).unwrap_or(0);
            sender.send(String::from_utf8_lossy(&bytes[..length]).into_owned())
        });
        let errors = receiver.recv_timeout(Duration::from_secs(2)).unwrap_or_default();
        // WNOWAIT leaves the process to its owner.
        let flags = WaitPidFlag::WEXITED | WaitPidFlag::WNOHANG | WaitPidFlag::WNOWAIT;
        let end = waitid(Id::Pid(Pid::from_raw(self.process as i32)), flags);
        format!("{end:?}; standard error: {errors}")
    }

    /// Returns the lines that have come and were not read, without waiting.
    pub fn so_far(&self) -> Vec<String> {
        self.lines.try_iter().collect()
    }

    /// Returns all lines until the process ends.
    pub fn rest(&self) -> Vec<String> {
        let deadline = Instant::now() + patience();
        let mut lines = Vec::new();
        loop {
            match self.lines.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
                Ok(line) => lines.push(line),
                Err(RecvTimeoutError::Disconnected) => return lines,
                Err(RecvTimeoutError::Timeout) => panic!("the process did not end within {:?}", patience()),
            }
        }
    }
}

/// A setting of a scene with which a subscriber loses nothing while a busy machine does not run it. The default queue
/// lasts a third of a second at 200 Hz, this queue two and a half seconds, and five at 100 Hz.
pub const LONG_QUEUE: &str = "queue = 500";

/// A separate iceoryx2: processes of other places are not visible, and stale files can be counted.
pub struct Place {
    folder: tempfile::TempDir,
    prefix: String,
}

impl Place {
    pub fn new(name: &str) -> Self {
        let (folder, prefix) = (tempfile::tempdir().unwrap(), format!("{}_", unique(&format!("place_{name}"))));
        std::fs::create_dir(folder.path().join("config")).unwrap();
        let settings = format!("[global]\nroot-path = \"{}/root/\"\nprefix = \"{prefix}\"\n", folder.path().display());
        std::fs::write(folder.path().join("config/iceoryx2.toml"), settings).unwrap();
        Self { folder, prefix }
    }

    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Returns the program in this place, under its usual name.
    pub fn program(&self) -> Command {
        let mut command = Command::new(executable());
        command.current_dir(self.folder());
        command
    }

    /// Returns the paper's scene with these further publish settings.
    pub fn scene_publishing(&self, settings: &str) -> PathBuf {
        let scene = include_str!("../../config/paper.toml").replace("[publish]", &format!("[publish]\n{settings}"));
        let file = self.folder().join("scene.toml");
        std::fs::write(&file, scene).unwrap();
        file
    }

    /// Runs the program in this place as the user without rights, from a copy that this user may read.
    pub fn as_other_user(&self, arguments: &[&str]) -> Output {
        let copy = self.folder().join("bench-dragon");
        if !copy.exists() {
            copy_program(&copy);
            std::fs::set_permissions(self.folder(), std::fs::Permissions::from_mode(0o755)).unwrap();
        }
        let mut command = Command::new("setpriv");
        command.args([&format!("--reuid={OTHER_USER}"), &format!("--regid={OTHER_USER}"), "--clear-groups"]);
        command.arg(copy).args(arguments).current_dir(self.folder());
        Process::start(&mut command).output()
    }

    /// Returns the files that exist in this place.
    pub fn left_behind(&self) -> Vec<PathBuf> {
        let mut files = self.shared_memory();
        files.extend(files_below(&self.folder().join("root")));
        files
    }

    fn shared_memory(&self) -> Vec<PathBuf> {
        let files = std::fs::read_dir("/dev/shm").unwrap().flatten();
        let ours = files.filter(|file| file.file_name().to_string_lossy().starts_with(&self.prefix));
        ours.map(|file| file.path()).collect()
    }

    /// Fails if ended processes have left more than the one small file that iceoryx2 always leaves.
    pub fn assert_clean(&self) {
        self.assert_clean_but_for(0);
    }

    /// Fails if ended processes have left more than that file and `others` further files.
    pub fn assert_clean_but_for(&self, others: usize) {
        let files = self.left_behind();
        assert!(files.len() <= 1 + others, "{} files are left behind: {files:#?}", files.len());
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.shared_memory().iter().for_each(|file| drop(std::fs::remove_file(file)));
    }
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let below = |file: PathBuf| if file.is_dir() { files_below(&file) } else { vec![file] };
    entries.flatten().flat_map(|entry| below(entry.path())).collect()
}

fn reading(pipe: Option<impl Read>) -> impl FnOnce() -> Vec<u8> {
    move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe {
            pipe.read_to_end(&mut bytes).unwrap();
        }
        bytes
    }
}

/// Copies the program in another process. In this process, children of other threads would inherit the file open for
/// writing, and the copy could not be started.
pub fn copy_program(to: &Path) {
    let copied = Command::new("cp").arg(executable()).arg(to).status().unwrap();
    assert!(copied.success());
}

/// Returns the program with a service name that no other test has.
pub fn program(name: &str) -> Command {
    let mut command = Command::new(executable());
    command.args(["--name", &unique(name)]);
    command
}

pub fn unique(name: &str) -> String {
    assert_used_by_one_module(name);
    format!("test_{}_{name}", std::process::id())
}

/// Fails if tests of two modules of one test program use the same name: their services would be the same, or their
/// files.
fn assert_used_by_one_module(name: &str) {
    static USERS: Mutex<BTreeMap<String, String>> = Mutex::new(BTreeMap::new());
    // A test runs on a thread with its name; threads that it starts itself have none.
    let thread = std::thread::current();
    let Some((module, _)) = thread.name().and_then(|test| test.split_once("::")) else { return };
    let mut users = USERS.lock().unwrap_or_else(PoisonError::into_inner);
    let user = users.entry(name.to_owned()).or_insert_with(|| module.to_owned()).clone();
    drop(users);
    assert_eq!(user, module, "the name \"{name}\" is used by tests of two modules");
}

pub fn python() -> Command {
    let interpreter = std::env::var_os("BENCH_DRAGON_PYTHON").unwrap_or("python3".into());
    let mut command = Command::new(interpreter);
    // A test reads each line as it is printed.
    command.current_dir(env!("CARGO_MANIFEST_DIR")).env("PYTHONUNBUFFERED", "1");
    command
}

/// Returns an example; cargo builds the examples with all tests, and not with one test file.
pub fn example(name: &str) -> Command {
    let target = std::env::current_exe().unwrap();
    let file = target.ancestors().nth(2).unwrap().join("examples").join(name);
    assert!(file.exists(), "{} does not exist: `cargo build --release --examples` builds it", file.display());
    Command::new(file)
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

pub fn json_lines(output: &Output) -> Vec<Value> {
    let value = |line| serde_json::from_str(line).unwrap_or_else(|error| panic!("{line:?} is no JSON: {error}"));
    text(&output.stdout).lines().map(value).collect()
}

pub fn summary(output: &Output) -> Value {
    assert!(output.status.success(), "{}", text(&output.stderr));
    json_lines(output).pop().unwrap()
}

/// Ends a process and returns the summary that it prints.
pub fn stopped(process: Process) -> Value {
    process.signal(nix::sys::signal::Signal::SIGINT);
    summary(&process.output())
}

/// Waits until a file has `bytes` bytes.
pub fn wait_for_bytes(file: &Path, bytes: u64) {
    let what = format!("{bytes} bytes in {}", file.display());
    wait_until(&what, || std::fs::metadata(file).is_ok_and(|data| data.len() >= bytes));
}

/// Returns the answer of a server of this machine, header and body, or nothing if it does not answer.
pub fn http_get(url: &str, accept: &str) -> String {
    let (address, _) = url.strip_prefix("http://").unwrap().split_once('/').unwrap();
    http_get_as(url, address, accept)
}

/// Returns the same, with a request for another host name.
pub fn http_get_as(url: &str, host: &str, accept: &str) -> String {
    let (address, path) = url.strip_prefix("http://").unwrap().split_once('/').unwrap();
    let answer = || -> std::io::Result<String> {
        let mut stream = std::net::TcpStream::connect(address)?;
        stream.set_read_timeout(Some(patience()))?;
        write!(stream, "GET /{path} HTTP/1.1\r\nHost: {host}\r\nAccept: {accept}\r\nConnection: close\r\n\r\n")?;
        let mut text = String::new();
        stream.read_to_string(&mut text)?;
        Ok(text)
    };
    answer().unwrap_or_default()
}

/// Waits until a condition holds, for [`patience`] at most.
pub fn wait_until(what: &str, mut holds: impl FnMut() -> bool) {
    let deadline = Instant::now() + patience();
    while !holds() {
        assert!(Instant::now() < deadline, "not within {:?}: {what}", patience());
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Returns the process of a publisher when a publisher answers commands. `program` returns the program with the name of
/// the publisher.
pub fn answering(mut publisher: Process, program: impl Fn() -> Command) -> Process {
    let deadline = Instant::now() + patience();
    loop {
        if let Some(status) = publisher.0.try_wait().unwrap() {
            panic!("the publisher ended with {status}: {}", text(&publisher.output().stderr));
        }
        let answer = Process::start(program().args(["control", "state"])).output();
        if answer.status.success() {
            return publisher;
        }
        if Instant::now() > deadline {
            // A running process must end before its output can be read.
            publisher.signal(nix::sys::signal::Signal::SIGINT);
            panic!("{}; the publisher: {}", text(&answer.stderr), text(&publisher.output().stderr));
        }
        wait(0.1);
    }
}

pub fn wait(seconds: f64) {
    std::thread::sleep(Duration::from_secs_f64(seconds));
}

pub fn scene_file(name: &str, replacements: &[(&str, &str)]) -> PathBuf {
    let mut scene = include_str!("../../config/paper.toml").to_owned();
    for (from, to) in replacements {
        assert!(scene.contains(from));
        scene = scene.replace(from, to);
    }
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{}.toml", unique(&format!("scene_{name}"))));
    std::fs::write(&file, scene).unwrap();
    file
}
