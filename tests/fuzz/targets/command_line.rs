//! Command lines, an argument a line: understood, or refused with a sentence and exit code 2. Nothing is carried out.

#[path = "../../../src/main.rs"]
#[allow(dead_code, unused_imports, reason = "the program's sources, of which its command line is used")]
mod program;

use clap::{CommandFactory, Parser};
use fastrand::Rng;
use program::CommandLine;

use super::Target;
use super::bytes::{NUMBERS, changed, one, renumbered};

pub const TARGET: Target = Target { name: "command_line", run, seeds, mutate, cases: 4000 };

/// Arguments of a case.
const MOST_ARGUMENTS: usize = 40;

fn run(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let arguments: Vec<&str> = text.lines().take(MOST_ARGUMENTS).collect();
    // Names of hosts are looked up in the network.
    if arguments.iter().any(|argument| argument.starts_with("--to") || *argument == "send") && !is_numeric(&arguments) {
        return;
    }
    if let Err(error) = CommandLine::try_parse_from(["bench-dragon"].iter().chain(&arguments)) {
        let shown = error.render().to_string();
        assert!([0, 2].contains(&error.exit_code()) && !shown.is_empty(), "{arguments:?}: {shown}");
        assert_eq!(error.exit_code() == 0, !error.use_stderr(), "{arguments:?}: {shown}");
    }
}

/// Whether no argument that could be a host is a name.
fn is_numeric(arguments: &[&str]) -> bool {
    let is_host = |text: &&&str| text.contains(':') || text.contains("--to");
    arguments
        .iter()
        .filter(is_host)
        .all(|text| text.bytes().all(|byte| !byte.is_ascii_alphabetic() || b"to".contains(&byte)))
        && arguments.iter().all(|text| !text.contains("--to") || *text == "--to")
        && !arguments.windows(2).any(|pair| pair[0] == "--to" && !pair[1].starts_with(|c: char| c.is_ascii_digit()))
}

/// Every subcommand, and every option by its name.
fn words() -> (Vec<String>, Vec<String>) {
    let command = CommandLine::command();
    let (mut names, mut options) = (Vec::new(), Vec::new());
    let mut left = vec![command];
    while let Some(command) = left.pop() {
        options.extend(command.get_arguments().filter_map(|argument| Some(format!("--{}", argument.get_long()?))));
        for subcommand in command.get_subcommands() {
            names.push(subcommand.get_name().to_owned());
            left.push(subcommand.clone());
        }
    }
    options.extend(["-v", "-o", "-h", "-V", "--"].map(str::to_owned));
    options.sort();
    options.dedup();
    (names, options)
}

const VALUES: [&str; 22] = [
    "60",
    "90s",
    "8h",
    "1e400h",
    "s",
    "",
    "contact",
    "0,60,contact",
    "all",
    "head,20-40",
    "1,2,9",
    "x,-y,z",
    "dark",
    "127.0.0.1:9464",
    "10.0.0.5:7",
    "https://show.example",
    "frames/%05d.svg",
    "1GB",
    "\u{9f99}",
    "-1",
    "show.mcap",
    "play",
];

fn seeds() -> Vec<Vec<u8>> {
    let (names, options) = words();
    let alone = names.iter().map(|name| name.clone().into_bytes());
    let run = options.iter().flat_map(|option| names.iter().take(20).map(move |name| format!("{name}\n{option}\n60")));
    alone.chain(run.map(String::into_bytes)).collect()
}

fn mutate(data: &[u8], random: &mut Rng) -> Vec<u8> {
    static WORDS: std::sync::OnceLock<(Vec<String>, Vec<String>)> = std::sync::OnceLock::new();
    let (names, options) = WORDS.get_or_init(words);
    let text = String::from_utf8_lossy(data).into_owned();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..1 + random.usize(..4) {
        let made = match random.u8(..6) {
            0 => one(names, random).clone(),
            1 | 2 => one(options, random).clone(),
            3 => (*one(&NUMBERS, random)).to_owned(),
            4 => format!("{}={}", one(options, random), one(&VALUES, random)),
            _ => (*one(&VALUES, random)).to_owned(),
        };
        let at = random.usize(..=lines.len());
        match random.u8(..8) {
            0 => return changed(text.as_bytes(), random),
            1 => return renumbered(&text, random).into_bytes(),
            2 if at < lines.len() => drop(lines.remove(at)),
            3 if at < lines.len() => lines[at] = made,
            _ => lines.insert(at, made),
        }
    }
    lines.join("\n").into_bytes()
}
