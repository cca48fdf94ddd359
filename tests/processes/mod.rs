//! Real processes for tests: each is ended by a deadline or with its test. Shared by the tests that start some.

#![allow(dead_code, reason = "not every test file uses all of it")]

use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use serde_json::Value;

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

    pub fn id(&self) -> u32 {
        self.0.id()
    }

    pub fn signal(&self, signal: nix::sys::signal::Signal) {
        nix::sys::signal::kill(nix::unistd::Pid::from_raw(self.0.id() as i32), signal).unwrap();
    }

    /// The first line that the process prints within `seconds`.
    pub fn first_line_within(&mut self, seconds: u64) -> String {
        let mut output = BufReader::new(self.0.stdout.take().unwrap());
        let (sender, receiver) = mpsc::channel();
        std::thread::spawn(move || {
            let mut line = String::new();
            let _ = output.read_line(&mut line);
            let _ = sender.send(line);
            // A closed pipe would end the process.
            let _ = std::io::copy(&mut output, &mut std::io::sink());
        });
        receiver.recv_timeout(Duration::from_secs(seconds)).unwrap()
    }

    /// What the process printed, once it has ended by itself within `seconds`; nothing on standard output after
    /// [`first_line_within`](Self::first_line_within).
    pub fn output_within(mut self, seconds: u64) -> Output {
        let deadline = Instant::now() + Duration::from_secs(seconds);
        // Read beside waiting: a full pipe would stop the process.
        let [stdout, stderr] =
            [std::thread::spawn(reading(self.0.stdout.take())), std::thread::spawn(reading(self.0.stderr.take()))];
        let status = loop {
            if let Some(status) = self.0.try_wait().unwrap() {
                break status;
            }
            assert!(Instant::now() < deadline, "the process did not end within {seconds} s");
            std::thread::sleep(Duration::from_millis(10));
        };
        Output { status, stdout: stdout.join().unwrap(), stderr: stderr.join().unwrap() }
    }
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

/// The program with a service name that no other test has.
pub fn program(name: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bench-dragon"));
    command.args(["--name", &unique(name)]);
    command
}

pub fn unique(name: &str) -> String {
    format!("test_{}_{name}", std::process::id())
}

pub fn python() -> Command {
    let interpreter = std::env::var_os("BENCH_DRAGON_PYTHON").unwrap_or("python3".into());
    let mut command = Command::new(interpreter);
    command.current_dir(env!("CARGO_MANIFEST_DIR"));
    command
}

pub fn example(name: &str) -> Command {
    let target = std::env::current_exe().unwrap();
    Command::new(target.ancestors().nth(2).unwrap().join("examples").join(name))
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

pub fn json_lines(output: &Output) -> Vec<Value> {
    text(&output.stdout).lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

pub fn summary(output: &Output) -> Value {
    assert!(output.status.success(), "{}", text(&output.stderr));
    json_lines(output).pop().unwrap()
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
    let file = std::env::temp_dir().join(format!("{}.toml", unique(name)));
    std::fs::write(&file, scene).unwrap();
    file
}
