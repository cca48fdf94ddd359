//! Shells of a newcomer: one for each command, in a separate checkout and network.

use std::fs::File;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;

use super::harness::patience;

/// A command in a shell, whose output goes to a file.
pub struct Terminal {
    pub command: String,
    shell: Child,
    output: PathBuf,
    status: Option<ExitStatus>,
}

impl Terminal {
    pub fn open(command: &str, folder: &Path, output: PathBuf, path: &str) -> Self {
        let file = File::create(&output).unwrap();
        // The process that started this test may ignore Ctrl-C.
        let mut bash = Command::new("env");
        bash.args(["--default-signal=INT", "bash", "-o", "pipefail", "-c", command])
            .current_dir(folder)
            .env("PATH", path)
            .env("PYTHONUNBUFFERED", "1");
        bash.env("PIP_NO_INDEX", "1").env("PIP_DISABLE_PIP_VERSION_CHECK", "1").env("PIP_ROOT_USER_ACTION", "ignore");
        // The tests set these variables themselves.
        bash.env_remove("BENCH_DRAGON_LONG").env_remove("RUST_LOG").process_group(0);
        bash.stdin(Stdio::null()).stdout(file.try_clone().unwrap()).stderr(file);
        Self { command: command.to_owned(), shell: bash.spawn().unwrap(), output, status: None }
    }

    /// Returns the text printed so far, on both streams.
    pub fn text(&self) -> String {
        String::from_utf8_lossy(&std::fs::read(&self.output).unwrap()).into_owned()
    }

    pub fn ended(&mut self) -> Option<ExitStatus> {
        if self.status.is_none() {
            self.status = self.shell.try_wait().unwrap();
        }
        self.status
    }

    /// Waits for the end and returns the exit code.
    pub fn code(&mut self) -> Result<i32, String> {
        self.until("end", |terminal| terminal.ended().is_some())?;
        let status = self.status.expect("it has just ended");
        status.code().ok_or_else(|| self.report(&format!("ended by signal {:?}", status.signal())))
    }

    /// Sends Ctrl-C to every process of the terminal and returns the exit code.
    pub fn interrupt(&mut self) -> Result<i32, String> {
        if self.ended().is_none() {
            self.signal(Signal::SIGINT);
        }
        self.code()
    }

    /// Waits until a condition holds.
    pub fn until(&mut self, what: &str, mut is_so: impl FnMut(&mut Self) -> bool) -> Result<(), String> {
        wait_until(what, || is_so(self)).map_err(|late| self.report(&late))
    }

    /// Returns the error with the printed text.
    pub fn report(&self, what: &str) -> String {
        format!("{}\n{what}; it printed:\n{}", self.command, self.text())
    }

    fn signal(&self, signal: Signal) {
        // The command may have ended meanwhile.
        let _ = killpg(Pid::from_raw(self.shell.id() as i32), signal);
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        if self.ended().is_none() {
            self.signal(Signal::SIGKILL);
            let _ = self.shell.wait();
        }
    }
}

/// Waits until a condition holds.
pub fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) -> Result<(), String> {
    let began = Instant::now();
    while !is_so() {
        if began.elapsed() > patience() {
            return Err(format!("no {what} within {:?}", patience()));
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    Ok(())
}
