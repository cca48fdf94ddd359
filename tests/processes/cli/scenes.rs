//! The scenes of `config/`, read from their TOML without the program's own reader, and the binary's output for them.

use std::path::PathBuf;
use std::process::{Command, Output};

use bench_dragon::show::scene::Scene;
use serde_json::Value;

use crate::harness::{Process, text};

/// A scene file and its content.
pub struct SceneFile {
    pub name: String,
    pub path: PathBuf,
    pub content: toml::Table,
}

/// Returns every scene of the folder.
pub fn scenes() -> Vec<SceneFile> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/config");
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    // A stage and several dragons have events and sentences of their own: tests/commands/ground.rs,
    // tests/commands/require.rs, tests/processes/several.rs.
    let others = ["square.toml", "village.toml", "coil.toml", "crossing.toml"];
    paths.retain(|path| !others.iter().any(|name| path.ends_with(name)));
    paths.sort();
    let scenes: Vec<SceneFile> = paths.into_iter().map(SceneFile::read).collect();
    assert!(scenes.len() >= 8, "{folder} has only {} scenes", scenes.len());
    scenes
}

/// Returns the scene of that name.
pub fn scene(name: &str) -> SceneFile {
    scenes().into_iter().find(|scene| scene.name == name).unwrap()
}

impl SceneFile {
    fn read(path: PathBuf) -> Self {
        let content: toml::Table = std::fs::read_to_string(&path).unwrap().parse().unwrap();
        Self { name: content["name"].as_str().unwrap().to_owned(), path, content }
    }

    /// Returns the scene as the library reads it.
    pub fn load(&self) -> Scene {
        Scene::load(&self.path).unwrap()
    }

    /// Returns a number of the file.
    pub fn number(&self, table: &str, key: &str) -> f64 {
        float(&self.content[table][key])
    }

    pub fn benches(&self) -> usize {
        self.number("team", "benches") as usize
    }

    pub fn handles(&self) -> usize {
        self.benches() + 1
    }

    /// Returns the link of a bench, metres; the head is bench 0.
    pub fn link(&self, bench: usize) -> f64 {
        let board = if bench == 0 { "head_length" } else { "body_length" };
        self.number("team", board) - 2.0 * self.number("team", "hole_inset")
    }

    /// Returns the scene with one entry of a table changed, as a file in `folder`.
    pub fn with(&self, folder: &tempfile::TempDir, table: &str, key: &str, value: impl Into<toml::Value>) -> Self {
        let mut content = self.content.clone();
        match table {
            "" => content.insert(key.to_owned(), value.into()),
            _ => content[table].as_table_mut().unwrap().insert(key.to_owned(), value.into()),
        };
        let path = folder.path().join(format!("{}.toml", self.name));
        std::fs::write(&path, toml::to_string(&content).unwrap()).unwrap();
        Self::read(path)
    }

    /// Returns the program's command on this scene.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = program();
        command.arg("--scene").arg(&self.path).args(arguments);
        command
    }

    /// Runs the program on this scene.
    pub fn run(&self, arguments: &[&str]) -> Output {
        Process::start(&mut self.command(arguments)).output()
    }

    /// Returns the output of the program, which must end with exit code 0. Standard error has nothing but what a plan
    /// leaves out of the scene.
    pub fn answer(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let printed = text(&output.stderr);
        let is_other = |line: &&str| !(arguments.contains(&"plan") && line.contains("the plan leaves out "));
        let others = Vec::from_iter(printed.lines().filter(is_other));
        assert_eq!((output.status.code(), others), (Some(0), Vec::new()), "{} {arguments:?}", self.name);
        text(&output.stdout)
    }

    /// Returns the JSON lines that the program prints.
    pub fn json(&self, arguments: &[&str]) -> Vec<Value> {
        let lines = self.answer(&[&["--json"], arguments].concat());
        lines.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|error| panic!("{line}: {error}"))).collect()
    }

    /// Returns the sentence on standard error with which the program refuses; standard output must be empty.
    pub fn refusal(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let printed = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{} {arguments:?}: {printed}", self.name);
        assert!(output.stdout.is_empty(), "{} {arguments:?} prints on standard output", self.name);
        assert_eq!(printed.lines().count(), 1, "{} {arguments:?}: {printed}", self.name);
        printed
    }
}

/// Returns a number of a TOML file, written with or without a point.
pub fn float(value: &toml::Value) -> f64 {
    value.as_float().or(value.as_integer().map(|whole| whole as f64)).unwrap()
}

pub fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_bench-dragon"))
}

/// Fails unless an object has exactly these keys.
pub fn assert_keys(object: &Value, keys: &[&str]) {
    let mut expected = keys.to_vec();
    expected.sort_unstable();
    let found: Vec<&str> = object.as_object().unwrap().keys().map(String::as_str).collect();
    assert_eq!(found, expected, "{object}");
}

/// Returns the numbers of a JSON line in their order, null as NaN. Read by Rust itself, since `serde_json` may round
/// the last bit.
pub fn numbers(line: &str) -> Vec<f64> {
    let tokens = line.split(['[', ']', '{', '}', ',', ':']);
    tokens.filter_map(|token| if token == "null" { Some(f64::NAN) } else { token.parse().ok() }).collect()
}

/// Returns true if two numbers have the same bits; all NaN are equal.
pub fn same_bits(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
}
