//! A reader of a page who types its commands.

use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;

use nix::sched::{CloneFlags, unshare};

use super::harness::{Place, example, text};
use super::list::{AFTER, BEFORE, CODES};
use super::pages::without_variables;
use super::terminal::{Terminal, wait_until};

/// Returns the beginnings of the commands in the lists that only this file uses.
pub fn beginnings() -> impl Iterator<Item = &'static str> {
    BEFORE.iter().map(|line| line.0).chain(AFTER.iter().map(|line| line.0)).chain(CODES.iter().map(|line| line.0))
}

/// A program that runs until it is stopped.
struct Resident {
    /// Two programs of one kind cannot run at once: two publishers of one name, two servers at one port.
    kind: String,
    terminal: Terminal,
}

/// A separate checkout, network and iceoryx2 for one page.
pub struct Reader {
    place: Place,
    residents: Vec<Resident>,
    terminals: usize,
}

impl Reader {
    /// Moves the calling thread into a separate network.
    pub fn new(root: &Path, page: &str) -> Self {
        unshare(CloneFlags::CLONE_NEWNET).unwrap();
        // Addresses on the pages belong to this machine here, and no packet leaves the machine.
        for settings in ["link set lo up multicast on", "address add 10.0.0.7/32 dev lo", "route add default dev lo"] {
            let output = Command::new("ip").args(settings.split(' ')).output().unwrap();
            assert!(output.status.success(), "ip {settings}: {}", text(&output.stderr));
        }
        let name = page.chars().filter(|c| c.is_ascii_alphanumeric()).collect::<String>();
        let place = Place::new(&name);
        check_out(root, place.folder());
        write_programs(root, &place.folder().join(".bin"));
        Self { place, residents: Vec::new(), terminals: 0 }
    }

    /// Types a command, and waits until it has ended or, if it runs until it is stopped, until it has begun.
    pub fn run(&mut self, command: &str) -> Result<(), String> {
        let own = without_variables(command);
        if let Some((_, before)) = BEFORE.iter().find(|line| own.starts_with(line.0)) {
            before.iter().try_for_each(|command| self.run(command))?;
        }
        if let Some(kind) = resident_kind(own) {
            return self.start(command, kind);
        }
        if let Some((_, file, words)) = AFTER.iter().find(|line| own.starts_with(line.0)) {
            let file = self.place.folder().join(file);
            wait_until(words, || std::fs::read_to_string(&file).is_ok_and(|text| text.contains(words)))?;
        }
        let mut terminal = self.terminal(command);
        let code = terminal.code()?;
        let expected = CODES.iter().find(|line| own.starts_with(line.0));
        let (_, codes, printed) = expected.copied().unwrap_or(("", &[0], ""));
        let as_expected = codes.contains(&code) && terminal.text().contains(printed);
        if as_expected { Ok(()) } else { Err(terminal.report(&format!("ended with code {code}"))) }
    }

    fn start(&mut self, command: &str, kind: String) -> Result<(), String> {
        if let Some(earlier) = self.residents.iter().position(|resident| resident.kind == kind) {
            self.stop(earlier)?;
        }
        let first = if is_publisher(&kind) { "iceoryx2 services:" } else { "\n" };
        let mut terminal = self.terminal(command);
        terminal.until("first line", |terminal| terminal.text().contains(first) || terminal.ended().is_some())?;
        self.residents.push(Resident { kind, terminal });
        Ok(())
    }

    /// Ends the programs that still run, publishers last. A subscriber must have received a message by then.
    pub fn end_section(&mut self) -> Result<(), String> {
        let mut outcome = Ok(());
        let publishes = self.residents.iter().any(|resident| is_publisher(&resident.kind));
        self.residents.sort_by_key(|resident| !is_publisher(&resident.kind));
        while let Some(last) = self.residents.len().checked_sub(1) {
            let ended = if publishes { self.await_frames(last) } else { Ok(()) };
            outcome = outcome.and(ended).and(self.stop(last));
        }
        outcome
    }

    fn await_frames(&mut self, resident: usize) -> Result<(), String> {
        let (publishers, watching) = self.residents.split_at_mut(resident);
        let Resident { kind, terminal: watching } = &mut watching[0];
        // A recording that is played again ends by itself.
        let mut has_ended = || publishers.iter_mut().all(|publisher| publisher.terminal.ended().is_some());
        let file = self.place.folder().join("show.mcap");
        match kind.as_str() {
            "watch" => watching.until("frames", |watching| watching.text().contains("received ") || has_ended()),
            // About a second of recording.
            "record" => watching.until("file", |_| std::fs::metadata(&file).is_ok_and(|file| file.len() > 700_000)),
            _ => Ok(()),
        }
    }

    fn stop(&mut self, resident: usize) -> Result<(), String> {
        let mut terminal = self.residents.remove(resident).terminal;
        match terminal.interrupt()? {
            0 => Ok(()),
            code => Err(terminal.report(&format!("ended with code {code}"))),
        }
    }

    fn terminal(&mut self, command: &str) -> Terminal {
        self.terminals += 1;
        let folder = self.place.folder();
        let path = format!("{}:{}", folder.join(".bin").display(), programs_path());
        Terminal::open(command, folder, folder.join(format!(".bin/output-{}", self.terminals)), &path)
    }
}

/// Returns the folders of installed programs: `tests/run` unpacks promtool beside Python.
pub fn programs_path() -> String {
    let path = std::env::var("PATH").unwrap();
    let python = std::env::var("BENCH_DRAGON_PYTHON").unwrap_or_default();
    let promtool = Path::new(&python).ancestors().nth(2).map(|folder| folder.join("prometheus/usr/bin"));
    promtool.map_or(path.clone(), |promtool| format!("{path}:{}", promtool.display()))
}

fn is_publisher(kind: &str) -> bool {
    kind.starts_with("publisher")
}

/// Returns the kind of the program that a command starts and that runs until it is stopped, if any.
fn resident_kind(command: &str) -> Option<String> {
    if command.starts_with("python3 examples/python/stage_socket.py") {
        return Some("socket".to_owned());
    }
    let arguments = command.strip_prefix("bench-dragon ").or(command.strip_prefix("cargo run --release -- "))?;
    let words = Vec::from_iter(arguments.split(' '));
    let ends = ["--duration", "--recover", "--help", "--version"].iter().any(|option| words.contains(option));
    let subcommand = words.iter().find(|word| {
        ["run", "replay", "watch", "view", "design", "record", "send", "chase", "control", "metrics"].contains(word)
    });
    let name = words.iter().skip_while(|word| **word != "--name").nth(1).unwrap_or(&"bench_dragon");
    match *subcommand? {
        _ if ends => None,
        "run" | "replay" => Some(format!("publisher {name}")),
        "control" if !words.contains(&"osc") => None,
        kind @ ("send" | "chase" | "control") => {
            Some(format!("{kind} {}", words.iter().skip_while(|word| **word != kind).nth(1)?))
        }
        other => Some(other.to_owned()),
    }
}

/// Returns the files of the repository as they are, without ignored files; if there is no repository, all but built
/// files.
fn files(root: &Path) -> Vec<String> {
    // The checkout may belong to another user, as in a container.
    let list = ["-c", "safe.directory=*", "ls-files", "-z", "--cached", "--others", "--exclude-standard"];
    match Command::new("git").args(list).current_dir(root).output() {
        Ok(output) if output.status.success() => {
            text(&output.stdout).split_terminator('\0').map(str::to_owned).collect()
        }
        _ => files_below(root, ""),
    }
}

fn files_below(root: &Path, folder: &str) -> Vec<String> {
    let entries = std::fs::read_dir(root.join(folder)).unwrap().flatten();
    let names = entries.map(|entry| (entry.file_name().into_string().unwrap(), entry.path().is_dir()));
    let below = |(name, is_folder): (String, bool)| match is_folder {
        true if ["target", ".venv", ".git"].contains(&name.as_str()) => Vec::new(),
        true => files_below(root, &format!("{folder}{name}/")),
        false => vec![format!("{folder}{name}")],
    };
    names.flat_map(below).collect()
}

fn check_out(root: &Path, checkout: &Path) {
    for name in files(root) {
        let name = name.as_str();
        let copy = checkout.join(name);
        std::fs::create_dir_all(copy.parent().unwrap()).unwrap();
        let file = root.join(name);
        // A file that was deleted is still listed.
        if file.is_symlink() {
            symlink(std::fs::read_link(file).unwrap(), copy).unwrap();
        } else if file.exists() {
            std::fs::copy(file, copy).unwrap();
        }
    }
}

/// Writes the programs that a newcomer has built or installed, under the names of the pages.
fn write_programs(root: &Path, folder: &Path) {
    std::fs::create_dir(folder).unwrap();
    let program = PathBuf::from(env!("CARGO_BIN_EXE_bench-dragon"));
    symlink(&program, folder.join("bench-dragon")).unwrap();
    let examples = PathBuf::from(example("subscriber").get_program()).parent().unwrap().to_owned();
    let cargo = format!(
        "case \"$1 $2 $3\" in\n\
         'run --release --') shift 3; exec {program} \"$@\" ;;\n\
         'run --release --example') shift 3; exec {examples}/\"$@\" ;;\n\
         *) exec {cargo} \"$@\" --offline ;;\n\
         esac\n",
        program = program.display(),
        examples = examples.display(),
        cargo = env!("CARGO"),
    );
    let python = std::env::var("BENCH_DRAGON_PYTHON").unwrap_or("python3".to_owned());
    let python = if python.contains('/') { root.join(python).display().to_string() } else { python };
    for (name, script) in [
        ("cargo", cargo),
        ("python3", format!("exec {python} \"$@\"\n")),
        // Without a network: the installed packages must already satisfy the page.
        ("pip", format!("exec {python} -m pip \"$@\"\n")),
    ] {
        std::fs::write(folder.join(name), format!("#!/bin/sh\n{script}")).unwrap();
        std::fs::set_permissions(folder.join(name), std::fs::Permissions::from_mode(0o755)).unwrap();
    }
}
