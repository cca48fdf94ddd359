//! The arguments after `--ros-args`, as ROS 2's launch files and `ros2 run` append them: understood, or refused with a
//! sentence that names what is understood.
//!
//! In: the arguments of the process. Out: the program's own arguments, and the names of the node.

use std::ffi::OsString;
use std::fs::File;
use std::io::Read;

use bench_dragon::ros2_messages::settings::{Ros2Settings, StampClock, Topic};

use super::CommandError;

/// The start of these arguments.
const BEGIN: &str = "--ros-args";
/// The most bytes of a file of parameters.
const MOST_BYTES: u64 = 1 << 16;
/// The commands that understand these arguments.
const COMMANDS: [&str; 2] = ["run", "replay"];

/// The node's names after `-r`.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct NodeNames {
    /// The value of `__ns`, which begins with a slash.
    namespace: Option<String>,
    /// The value of `__node`.
    node: Option<String>,
}

impl NodeNames {
    /// Returns the publisher's name: the value of `--name`, with the node's names in place of its last word and of the
    /// words before that word.
    pub fn applied_to(&self, name: &str) -> String {
        let (before, last) = name.rsplit_once('/').unwrap_or(("", name));
        let namespace = self.namespace.as_deref().map_or(before, |namespace| namespace.trim_matches('/'));
        let last = self.node.as_deref().unwrap_or(last);
        if namespace.is_empty() { last.to_owned() } else { format!("{namespace}/{last}") }
    }
}

/// Translates the arguments after `--ros-args`, up to `--` or the end, to the program's own.
///
/// # Errors
/// Bad input: an argument that is not understood, or a command that understands none.
pub fn translated(arguments: impl IntoIterator<Item = OsString>) -> Result<(Vec<OsString>, NodeNames), CommandError> {
    let (mut own, mut names): (Vec<OsString>, _) = (Vec::new(), NodeNames::default());
    // Files of parameters, and the place of their options: a file is about nodes, whose names may follow it.
    let (mut files, mut place) = (Vec::new(), 0);
    let mut arguments = arguments.into_iter();
    while let Some(argument) = arguments.next() {
        // The arguments after this one belong to no option.
        if argument == "--" {
            own.push(argument);
            break;
        }
        if argument != BEGIN {
            own.push(argument);
            continue;
        }
        if !own.iter().any(|argument| COMMANDS.iter().any(|command| argument == command)) {
            let sentence = format!("{BEGIN} is understood by the commands {}", COMMANDS.join(" and "));
            return Err(CommandError::BadInput(sentence));
        }
        let mut section = arguments.by_ref().take_while(|argument| argument != "--");
        while let Some(flag) = section.next() {
            let flag = flag.to_string_lossy().into_owned();
            let value = match &*flag {
                BEGIN => continue,
                "-r" | "--remap" | "-p" | "--param" | "--log-level" | "--params-file" => section.next(),
                _ => return Err(not_understood(&flag)),
            };
            let Some(value) = value.map(|value| value.to_string_lossy().into_owned()) else {
                return Err(not_understood(&flag));
            };
            if flag == "--params-file" {
                files.push(value);
            } else {
                own.extend(translate(&flag, &value, &mut names)?.map(OsString::from));
            }
        }
        place = own.len();
    }
    own.extend(arguments);
    let node = format!("/{}", names.applied_to(&name_option(&own)));
    for file in files {
        for (line, parameter) in parameters(&file, &node)? {
            let option = translate("-p", &parameter, &mut names).map_err(|_| {
                let sentence =
                    format!("{file}, line {line}: {parameter} is not understood, expected rate, scene or use_sim_time");
                CommandError::BadInput(sentence)
            })?;
            if let Some(option) = option {
                own.insert(place, OsString::from(option));
                place += 1;
            }
        }
    }
    Ok((own, names))
}

/// Returns the value of `--name`, or its default.
fn name_option(own: &[OsString]) -> String {
    let own: Vec<_> = own.iter().map(|argument| argument.to_string_lossy()).collect();
    let joined = own.iter().find_map(|argument| argument.strip_prefix("--name="));
    let next = || own.iter().zip(own.iter().skip(1)).find(|(option, _)| *option == "--name").map(|(_, name)| &**name);
    joined.or_else(next).unwrap_or("bench_dragon").to_owned()
}

/// Returns the parameters of a node in a file as launch_ros writes it, each with its line, as `NAME:=VALUE`.
///
/// # Errors
/// Bad input: a file that cannot be read, or another form of YAML. As in rclcpp, a file for other nodes sets no
/// parameters.
fn parameters(file: &str, node: &str) -> Result<Vec<(usize, String)>, CommandError> {
    let bad = |sentence: String| CommandError::BadInput(format!("{BEGIN} --params-file: {file}{sentence}"));
    let text = read(file).map_err(|error| bad(format!(": {error}, expected a file of parameters (YAML)")))?;
    let (mut depth, mut found) = (0, Vec::new());
    for (line, content) in text.lines().enumerate().map(|(at, content)| (at + 1, content.trim_end())) {
        let entry = content.trim_start();
        if entry.is_empty() || entry.starts_with('#') || content == "---" {
            continue;
        }
        let indent = content.len() - entry.len();
        let (key, value) = entry.split_once(':').unwrap_or(("", ""));
        let (key, value) = (unquoted(key), unquoted(value.trim()));
        depth = match (indent, depth, value) {
            (0, _, "") if !key.is_empty() => {
                let is_own = key == "/**" || format!("/{}", key.trim_start_matches('/')) == node;
                if is_own { 1 } else { 3 }
            }
            (1.., 1, "") if key == "ros__parameters" => 2,
            (1.., 2, value) if !key.is_empty() && !value.is_empty() => {
                found.push((line, format!("{key}:={value}")));
                2
            }
            // The parameters of another node.
            (1.., 3, _) => 3,
            _ => {
                let sentence = "expected NODE, ros__parameters and NAME: VALUE, a line each";
                return Err(bad(format!(", line {line}, {sentence}")));
            }
        };
    }
    Ok(found)
}

/// Reads a regular file of [`MOST_BYTES`] at most.
fn read(path: &str) -> std::io::Result<String> {
    let mut text = String::new();
    let file = File::open(path)?;
    if !file.metadata()?.is_file() {
        return Err(std::io::Error::other("this is no regular file"));
    }
    if file.take(MOST_BYTES + 1).read_to_string(&mut text)? as u64 > MOST_BYTES {
        return Err(std::io::Error::other(format!("it has more than {MOST_BYTES} bytes")));
    }
    Ok(text)
}

/// Returns a scalar of YAML without its quotes.
fn unquoted(text: &str) -> &str {
    let inner = |quote| text.strip_prefix(quote)?.strip_suffix(quote);
    inner('"').or_else(|| inner('\'')).unwrap_or(text)
}

/// Returns the program's own option for a flag and its value, or sets a name of the node.
fn translate(flag: &str, value: &str, names: &mut NodeNames) -> Result<Option<String>, CommandError> {
    let refused = || not_understood(&format!("{flag} {value}"));
    let option = match (flag, value.split_once(":=")) {
        ("-r" | "--remap", Some(("__ns", namespace))) if namespace.starts_with('/') => {
            names.namespace = Some(namespace.to_owned());
            None
        }
        ("-r" | "--remap", Some(("__node" | "__name", node))) if !node.is_empty() && !node.contains('/') => {
            names.node = Some(node.to_owned());
            None
        }
        ("-p" | "--param", Some((name @ ("rate" | "scene"), value))) => Some(format!("--{name}={value}")),
        ("-p" | "--param", Some(("use_sim_time", value))) => {
            let value = value.to_lowercase();
            value.parse::<bool>().map_err(|_| refused())?;
            Some(format!("--use-sim-time={value}"))
        }
        ("--log-level", None) => match &*value.to_lowercase() {
            "debug" => Some("-vv".to_owned()),
            "info" => Some("-v".to_owned()),
            "warn" => None,
            "error" | "fatal" => Some("--quiet".to_owned()),
            _ => return Err(refused()),
        },
        _ => return Err(refused()),
    };
    Ok(option)
}

fn not_understood(argument: &str) -> CommandError {
    CommandError::BadInput(format!(
        "{BEGIN}: {argument} is not understood, expected -r __ns:=/NAMESPACE, -r __node:=NAME, -p scene:=FILE, \
         -p rate:=HZ, -p use_sim_time:=true or false, --params-file FILE, \
         --log-level debug, info, warn, error or fatal, or -- at the end"
    ))
}

/// The parameter `use_sim_time` of ROS 2.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct UseSimTime {
    /// The clock of the stamps: /clock, or wall time
    #[arg(long, value_name = "BOOL", hide = true)]
    use_sim_time: Option<bool>,
}

impl UseSimTime {
    /// Returns the clock of the stamps, if it is given.
    pub fn stamps(self) -> Option<StampClock> {
        self.use_sim_time.map(|sim| if sim { StampClock::Sim } else { StampClock::Wall })
    }

    /// Sets the clock of the stamps.
    ///
    /// # Errors
    /// Bad input: stamps on simulated time without the topic `clock`.
    pub fn apply(&self, settings: Option<&mut Ros2Settings>) -> Result<(), CommandError> {
        let Some(use_sim_time) = self.use_sim_time else { return Ok(()) };
        let has_clock = settings.as_ref().is_some_and(|settings| settings.topics.contains_key(&Topic::Clock));
        if use_sim_time && !has_clock {
            let sentence = "use_sim_time is true and this show does not publish /clock, expected a scene with \"clock\" among \
                            publish.ros2.topics: a show sets the time and follows no other clock";
            return Err(CommandError::BadInput(sentence.to_owned()));
        }
        if let (Some(settings), Some(stamps)) = (settings, self.stamps()) {
            settings.stamps = stamps;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Result<(String, NodeNames), String> {
        match translated(text.split(' ').map(OsString::from)) {
            Ok((own, names)) => {
                let own: Vec<_> = own.iter().map(|argument| argument.to_string_lossy()).collect();
                Ok((own.join(" "), names))
            }
            Err(CommandError::BadInput(sentence)) => Err(sentence),
            Err(other) => panic!("{other:?}"),
        }
    }

    #[test]
    fn the_arguments_of_a_launch_file_become_the_programs_own() {
        let (own, names) = of("p run --ros2 --ros-args -r __node:=gold -r __ns:=/hall/left --ros-args -p rate:=50 \
                               --param use_sim_time:=True --log-level INFO -p scene:=a=b.toml -- --quiet")
        .unwrap();
        assert_eq!(own, "p run --ros2 --rate=50 --use-sim-time=true -v --scene=a=b.toml --quiet");
        assert_eq!(names.applied_to("bench_dragon"), "hall/left/gold");
        // Launch files append them to every node.
        let (own, names) = of("p run --ros-args").unwrap();
        assert_eq!((&*own, names.applied_to("a/b")), ("p run", "a/b".to_owned()));
        let (_, names) = of("p replay x.mcap --ros-args -r __ns:=/hall").unwrap();
        assert_eq!(names.applied_to("a/b"), "hall/b");
        let (_, names) = of("p replay x.mcap --ros-args -r __ns:=/ --remap __name:=c").unwrap();
        assert_eq!((names.applied_to("a/b"), names.applied_to("b")), ("c".to_owned(), "c".to_owned()));
        // A file of that name.
        assert_eq!(of("p check -- --ros-args").unwrap().0, "p check -- --ros-args");
    }

    /// A file as launch_ros 0.26 writes it.
    #[test]
    fn a_file_of_parameters_is_that_of_its_node() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("launch_params_1").display().to_string();
        let of_file = |text: &str, arguments: &str| {
            std::fs::write(&file, text).unwrap();
            of(&arguments.replace("FILE", &file)).map(|(own, _)| own)
        };
        let launched = "p run --ros-args -r __node:=gold -r __ns:=/hall --params-file FILE -- --quiet";
        let text = "/hall/gold:\n  ros__parameters:\n    rate: 20.0\n    scene: 'a: b.toml'\n    use_sim_time: false\n";
        let own = "p run --rate=20.0 --scene=a: b.toml --use-sim-time=false --quiet";
        assert_eq!(of_file(text, launched).unwrap(), own);
        // The names may follow, comments and other nodes stand in the file, and a later parameter counts last.
        let text =
            "# Both.\n---\nother:\n  ros__parameters:\n    depth: {x: 1}\n/**:\n  ros__parameters:\n\n    rate: 30\n";
        assert_eq!(of_file(text, "p run --ros-args --params-file FILE").unwrap(), "p run --rate=30");
        let text = "b:\n  ros__parameters:\n    rate: 7\n";
        assert_eq!(of_file(text, "p run --name b --ros-args --params-file FILE").unwrap(), "p run --name b --rate=7");
        for text in ["", "other:\n  ros__parameters:\n    rate: 1\n"] {
            assert_eq!(of_file(text, launched).unwrap(), "p run --quiet");
        }
        for (text, expected) in [
            ("/**:\n  ros__parameters:\n    colour: red\n", "line 3: colour:=red is not understood"),
            ("/**:\n  ros__parameters:\n    rate: [1,\n      2]\n", "line 4, expected NODE, ros__parameters"),
            ("/**: {ros__parameters: {rate: 1}}\n", "line 1, expected NODE"),
            ("  rate: 1\n", "line 1, expected NODE"),
            ("/**:\n  rate: 1\n", "line 2, expected NODE"),
            ("/**:\n  ros__parameters:\n    rate:\n", "line 3, expected NODE"),
            ("rate\n", "line 1, expected NODE"),
            (&"#".repeat(70_000), "more than 65536 bytes"),
        ] {
            let sentence = of_file(text, launched).unwrap_err();
            assert!(sentence.contains(expected) && sentence.contains("launch_params_1"), "{expected}: {sentence}");
        }
        assert!(of("p run --ros-args --params-file /nowhere").unwrap_err().contains("/nowhere: No such file"));
        assert!(of("p run --ros-args --params-file /dev/zero").unwrap_err().contains("no regular file"));
    }

    #[test]
    fn what_is_not_understood_is_named_with_what_is() {
        for (text, named) in [
            ("-r", "-r is not"),
            ("-r poses:=/other", "-r poses:=/other"),
            ("-r __ns:=hall", "-r __ns:=hall"),
            ("-r __node:=a/b", "-r __node:=a/b"),
            ("-p speed:=2", "-p speed:=2"),
            ("-p use_sim_time:=maybe", "use_sim_time:=maybe"),
            ("-p rate", "-p rate"),
            ("--log-level loud", "--log-level loud"),
            ("--log-level rcl:=debug", "rcl:=debug"),
            ("--enclave /x", "--enclave"),
        ] {
            let sentence = of(&format!("p run --ros-args {text}")).unwrap_err();
            assert!(sentence.contains(named) && sentence.contains("-r __node:=NAME"), "{sentence}");
        }
        assert!(of("p watch --ros-args -r __node:=a").unwrap_err().contains("run and replay"));
    }
}
