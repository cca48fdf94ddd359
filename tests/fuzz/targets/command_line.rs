//! Command lines, an argument a line: parsed, or refused with a sentence and exit code 2. No command is executed.

#[path = "../../../src/main.rs"]
#[allow(dead_code, unused_imports, reason = "the program's sources, of which its command line is used")]
pub(crate) mod program;

use std::ffi::OsString;
use std::sync::OnceLock;

use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches};
use fastrand::Rng;
use program::CommandLine;

use super::Target;
use super::bytes::{NUMBERS, changed, one, renumbered};

pub const TARGET: Target = Target { name: "command_line", run, seeds, mutate, cases: 4000 };

/// Most arguments of a case.
const MOST_ARGUMENTS: usize = 40;

fn run(data: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(data) else { return false };
    let arguments: Vec<&str> = text.lines().take(MOST_ARGUMENTS).collect();
    // Names of hosts would be looked up in the network.
    if arguments.iter().any(|argument| argument.starts_with("--to") || *argument == "send") && !is_numeric(&arguments) {
        return false;
    }
    let own = ["bench-dragon"].iter().chain(&arguments).map(OsString::from);
    let Ok((own, _)) = program::ros_args::translated(own) else { return false };
    match CommandLine::command().try_get_matches_from(own) {
        Ok(matches) => {
            assert!(CommandLine::from_arg_matches(&matches).is_ok(), "{arguments:?}");
            check_values(&matches);
            true
        }
        Err(error) => {
            check_refusal(&error, &arguments);
            false
        }
    }
}

/// Numbers that a person gives to an option, of any command: its name, from, to.
const RANGES: [(&str, f64, f64); 7] = [
    ("duration", 5e-324, 1e9),
    ("realtime", 1.0, 99.0),
    ("ttl", 1.0, 255.0),
    ("display_rate", 5e-324, f64::MAX),
    ("width", 1.0, 1e5),
    ("height", 1.0, 1e5),
    ("max_skipped", 0.0, 1.0),
];

/// Asserts that accepted values are within their ranges, and that a time equals its text.
fn check_values(matches: &clap::ArgMatches) {
    if let Some((_, of)) = matches.subcommand() {
        check_values(of);
    }
    for (name, least, greatest) in RANGES {
        let Ok(Some(mut raw)) = matches.try_get_raw(name) else { continue };
        let Some(text) = raw.next_back().and_then(|raw| raw.to_str()) else { continue };
        let text = text.trim();
        let units = [("s", 1.0), ("m", 60.0), ("h", 3600.0), ("px", 1.0), ("mm", 1.0), ("%", 0.01), ("", 1.0)];
        let in_unit =
            |(unit, factor): &(&str, f64)| Some(text.strip_suffix(unit)?.trim().parse::<f64>().ok()? * factor);
        let number = units.iter().find_map(in_unit).or_else(|| seconds_of_parts(text));
        let number = number.unwrap_or_else(|| panic!("--{name} takes {text:?}"));
        assert!(number >= least && number <= greatest, "--{name} takes {text}");
        if let ("duration", Ok(Some(seconds))) = (name, matches.try_get_one::<f64>(name)) {
            assert!((seconds - number).abs() <= 1e-12 * number, "--duration {text}: {seconds}");
        }
    }
}

/// Returns the seconds of `1:30` or `1h30m`: each part counts sixty times the part after it.
fn seconds_of_parts(text: &str) -> Option<f64> {
    if text.contains(':') {
        return text.split(':').try_fold(0.0, |sum, part| Some(60.0 * sum + part.parse::<f64>().ok()?));
    }
    let parts = text.split_inclusive(['h', 'm', 's']);
    parts.map(str::trim).try_fold(0.0, |sum, part| {
        let (number, unit) = part.split_at(part.len() - 1);
        let factor = [("h", 3600.0), ("m", 60.0), ("s", 1.0)].into_iter().find(|(name, _)| *name == unit)?.1;
        Some(sum + factor * number.trim().parse::<f64>().ok()?)
    })
}

fn check_refusal(error: &clap::Error, arguments: &[&str]) {
    let shown = error.render().to_string();
    assert!([0, 2].contains(&error.exit_code()) && !shown.is_empty(), "{arguments:?}: {shown}");
    assert_eq!(error.exit_code() == 0, !error.use_stderr(), "{arguments:?}: {shown}");
    if error.kind() == ErrorKind::ValueValidation {
        // The sentence names the value and its option, and gives the error.
        let reason = shown.split_once(">': ").or_else(|| shown.split_once("': ")).map(|(_, reason)| reason.trim());
        let is_one = reason.is_some_and(|reason| !reason.is_empty() && !reason.starts_with("For more"));
        assert!(is_one, "{arguments:?}: {shown}");
    }
}

/// Returns true if no argument that could be a host is a name.
fn is_numeric(arguments: &[&str]) -> bool {
    let is_host = |text: &&&str| text.contains(':') || text.contains("--to");
    arguments
        .iter()
        .filter(is_host)
        .all(|text| text.bytes().all(|byte| !byte.is_ascii_alphabetic() || b"to".contains(&byte)))
        && arguments.iter().all(|text| !text.contains("--to") || *text == "--to")
        && !arguments.windows(2).any(|pair| pair[0] == "--to" && !pair[1].starts_with(|c: char| c.is_ascii_digit()))
}

/// The words of command lines.
struct Words {
    /// Every subcommand, a line each: `send` and `psn`.
    commands: Vec<String>,
    options: Vec<String>,
    /// Each subcommand with each of its options.
    pairs: Vec<String>,
}

fn words() -> &'static Words {
    static WORDS: OnceLock<Words> = OnceLock::new();
    WORDS.get_or_init(|| {
        let mut words = Words {
            commands: Vec::new(),
            options: ["-v", "-o", "-h", "-V", "--", "--ros-args", "-r", "-p", "--log-level"]
                .map(str::to_owned)
                .to_vec(),
            pairs: Vec::new(),
        };
        let mut left = vec![(String::new(), CommandLine::command())];
        while let Some((path, command)) = left.pop() {
            for argument in command.get_arguments().filter_map(clap::Arg::get_long) {
                words.options.push(format!("--{argument}"));
                words.pairs.push(format!("{path}--{argument}"));
            }
            for subcommand in command.get_subcommands() {
                let path = format!("{path}{}\n", subcommand.get_name());
                words.commands.push(path.trim_end().to_owned());
                left.push((path, subcommand.clone()));
            }
        }
        words.options.sort();
        words.options.dedup();
        words
    })
}

const VALUES: [&str; 32] = [
    "__ns:=/a",
    "__node:=b",
    "use_sim_time:=true",
    "rate:=-1",
    "40-20",
    "1-4294967295",
    "5m",
    "1.5m",
    "1h30m",
    "1:30",
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
    let Words { commands, pairs, .. } = words();
    let values = VALUES.iter().chain(&NUMBERS);
    let given = pairs.iter().flat_map(|pair| values.clone().map(move |value| format!("{pair}={value}")));
    commands.iter().chain(pairs).cloned().chain(given).map(String::into_bytes).collect()
}

fn mutate(data: &[u8], random: &mut Rng) -> Vec<u8> {
    let Words { commands, options, .. } = words();
    let text = String::from_utf8_lossy(data).into_owned();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..1 + random.usize(..4) {
        let made = match random.u8(..6) {
            0 => one(commands, random).clone(),
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
