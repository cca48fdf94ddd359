//! The arguments after `--ros-args`, as ROS 2's launch files and `ros2 run` append them: understood, or refused with a
//! sentence that names what is understood.
//!
//! In: the arguments of the process. Out: the program's own arguments, and the names of the node. Called by `main`
//! before the command line is parsed, and by the commands that publish over ROS 2.

use std::ffi::OsString;

use bench_dragon::ros2_messages::settings::{Ros2Settings, StampClock, Topic};

use super::CommandError;

/// The start of these arguments.
const BEGIN: &str = "--ros-args";
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
    /// Returns the publisher's name: that of `--name`, with the node's names in place of its last word and the words
    /// before it.
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
    let (mut own, mut names) = (Vec::new(), NodeNames::default());
    let mut arguments = arguments.into_iter();
    while let Some(argument) = arguments.next() {
        // What follows belongs to no option.
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
                "-r" | "--remap" | "-p" | "--param" | "--log-level" => section.next(),
                _ => return Err(not_understood(&flag)),
            };
            let Some(value) = value.map(|value| value.to_string_lossy().into_owned()) else {
                return Err(not_understood(&flag));
            };
            own.extend(translate(&flag, &value, &mut names)?.map(OsString::from));
        }
    }
    own.extend(arguments);
    Ok((own, names))
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
         -p rate:=HZ, -p use_sim_time:=true or false, --log-level debug, info, warn, error or fatal, or -- at the end"
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
            ("--params-file /tmp/file", "--params-file"),
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
