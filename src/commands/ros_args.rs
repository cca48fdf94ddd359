//! The arguments after `--ros-args`, as ROS 2's launch files and `ros2 run` append them: understood, or refused with a
//! sentence that names what is understood.
//!
//! In: the arguments of the process. Out: the program's own arguments, and the names of the node.

mod parameters;

use std::collections::BTreeMap;
use std::ffi::OsString;

use bench_dragon::ros2_messages::settings::{Ros2Settings, StampClock, Topic};

use super::CommandError;
use parameters::{Parameter, Parameters, Value};

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
    /// Returns the publisher's name: the value of `--name`, with the node's names in place of its last word and of the
    /// words before that word.
    pub fn applied_to(&self, name: &str) -> String {
        let (before, last) = name.rsplit_once('/').unwrap_or(("", name));
        let namespace = self.namespace.as_deref().map_or(before, |namespace| namespace.trim_matches('/'));
        let last = self.node.as_deref().unwrap_or(last);
        if namespace.is_empty() { last.to_owned() } else { format!("{namespace}/{last}") }
    }
}

/// Translates the arguments after `--ros-args`, up to `--` or the end, to the program's own. As in rcl, the first of
/// two rules for a name counts. The last of two values of a parameter counts, and the last level of the log.
///
/// # Errors
/// Bad input: an argument that is not understood, or a command that understands none.
pub fn translated(arguments: impl IntoIterator<Item = OsString>) -> Result<(Vec<OsString>, NodeNames), CommandError> {
    let (mut own, mut node): (Vec<OsString>, _) = (Vec::new(), NodeArguments::default());
    // The place of the options, which are known once the node's name is.
    let mut place = 0;
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
            node.read(&flag, &value)?;
        }
        place = own.len();
    }
    own.extend(arguments);
    let NodeArguments { names, parameters, log_level } = node;
    let name = format!("/{}", names.applied_to(&name_option(&own)));
    let parameters: BTreeMap<_, _> =
        parameters.of(&name).map(|parameter| (parameter.name.clone(), parameter)).collect();
    let options = parameters.values().map(option).collect::<Result<Vec<_>, _>>()?;
    own.splice(place..place, options.into_iter().chain(log_level).map(OsString::from));
    Ok((own, names))
}

/// Returns the value of `--name`, or its default.
fn name_option(own: &[OsString]) -> String {
    let own: Vec<_> = own.iter().map(|argument| argument.to_string_lossy()).collect();
    let joined = own.iter().find_map(|argument| argument.strip_prefix("--name="));
    let next = || own.iter().zip(own.iter().skip(1)).find(|(option, _)| *option == "--name").map(|(_, name)| &**name);
    joined.or_else(next).unwrap_or("bench_dragon").to_owned()
}

/// The arguments of a node.
#[derive(Default)]
struct NodeArguments {
    names: NodeNames,
    parameters: Parameters,
    /// The program's own option for the level of the log.
    log_level: Option<String>,
}

impl NodeArguments {
    /// Reads a flag and its value.
    fn read(&mut self, flag: &str, value: &str) -> Result<(), CommandError> {
        let refused = || not_understood(&format!("{flag} {value}"));
        match (flag, value.split_once(":=")) {
            ("-r" | "--remap", Some(("__ns", namespace))) if namespace.starts_with('/') => {
                self.names.namespace.get_or_insert_with(|| namespace.to_owned());
            }
            ("-r" | "--remap", Some(("__node" | "__name", node))) if !node.is_empty() && !node.contains('/') => {
                self.names.node.get_or_insert_with(|| node.to_owned());
            }
            ("-p" | "--param", _) => self.parameters.add_rule(value).ok_or_else(refused)?,
            ("--params-file", _) => {
                let bad = |error| CommandError::BadInput(format!("{BEGIN} --params-file: {error}"));
                self.parameters.add_file(value).map_err(bad)?;
            }
            ("--log-level", None) => {
                let option = match &*value.to_lowercase() {
                    "debug" => Some("-vv"),
                    "info" => Some("-v"),
                    "warn" => None,
                    "error" | "fatal" => Some("--quiet"),
                    _ => return Err(refused()),
                };
                self.log_level = option.map(str::to_owned);
            }
            _ => return Err(refused()),
        }
        Ok(())
    }
}

/// Returns the program's own option for a parameter.
fn option(parameter: &Parameter) -> Result<String, CommandError> {
    let Parameter { name, value, place } = parameter;
    let expected = match (&**name, value) {
        ("rate", Value::Number(rate)) => return Ok(format!("--rate={rate}")),
        ("use_sim_time", Value::Bool(is_sim)) => return Ok(format!("--use-sim-time={is_sim}")),
        ("scene", Value::Text(file)) if !file.contains("$(") => return Ok(format!("--scene={file}")),
        ("rate", _) => "a number",
        ("use_sim_time", _) => "true or false",
        ("scene", Value::Text(_)) => "a file: ROS 2 replaces a substitution only in launch files",
        ("scene", _) => "a file as a text",
        _ => {
            let sentence = "is not understood, expected the parameters rate, scene and use_sim_time";
            return Err(CommandError::BadInput(format!("{BEGIN}: {place} {sentence}")));
        }
    };
    let described = value.described();
    Err(CommandError::BadInput(format!("{BEGIN}: {place} is {described}, expected {expected}")))
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
        assert_eq!(own, "p run --ros2 --rate=50 --scene=a=b.toml --use-sim-time=true -v --quiet");
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

    /// As rcl: the first rule for a name, the last value of a parameter, the last level of the log.
    #[test]
    fn of_two_rules_the_first_counts_and_of_two_values_the_last() {
        let (own, names) = of("p run --ros-args -r __ns:=/a -r __node:=b --ros-args -r __ns:=/c -r __name:=d \
                               -p rate:=20 -p rate:=30.5 --log-level debug --log-level error")
        .unwrap();
        assert_eq!((&*own, names.applied_to("x")), ("p run --rate=30.5 --quiet", "a/b".to_owned()));
        let (own, _) = of("p run --ros-args -p bench_dragon:rate:=20 -p other:rate:=30").unwrap();
        assert_eq!(own, "p run --rate=20");
    }

    /// Files as launch_ros 0.26 and people write them. What rcl reads in each was read from its sources (9.2.0).
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
        // The names may follow, comments and other nodes stand in the file.
        let text =
            "# Both.\n---\nother:\n  ros__parameters:\n    depth: {x: 1}\n/**:\n  ros__parameters:\n\n    rate: 30\n";
        assert_eq!(of_file(text, "p run --ros-args --params-file FILE").unwrap(), "p run --rate=30");
        let text = "b:\n  ros__parameters:\n    rate: 7\n";
        assert_eq!(of_file(text, "p run --name b --ros-args --params-file FILE").unwrap(), "p run --name b --rate=7");
        for text in ["", "# nothing\n", "---\n", "other:\n  ros__parameters:\n    rate: 1\n"] {
            assert_eq!(of_file(text, launched).unwrap(), "p run --quiet");
        }
        // The section's full name is the node's, or a pattern that matches it.
        let rate = "ros__parameters:\n";
        for (section, is_own) in [
            ("/hall/gold", true),
            ("hall/gold", true),
            ("hall:\n  gold", true),
            ("/hall:\n  gold", true),
            ("/:\n  hall/gold", true),
            ("/**", true),
            ("/**/gold", true),
            ("/hall/**", true),
            ("/*/gold", true),
            ("/hall/*", true),
            ("/hall/gold/**", true),
            ("/**/**/gold/**", true),
            ("gold", false),
            ("/gold", false),
            ("/*", false),
            ("/*/*/gold", false),
            ("/**/jade", false),
            ("stage:\n  gold", false),
            ("hall:\n  jade", false),
        ] {
            let levels = section.lines().count() * 2;
            let text = format!("{section}:\n{:levels$}{rate}{:levels$}  rate: 20.0\n", "", "");
            let expected = if is_own { "p run --rate=20.0 --quiet" } else { "p run --quiet" };
            assert_eq!(of_file(&text, launched).unwrap(), expected, "{text}");
        }
        // Two nodes in one namespace.
        let text = "hall:\n  jade:\n    ros__parameters: {rate: 1}\n  gold: {ros__parameters: {rate: 20, \
                    use_sim_time: no}}\n";
        assert_eq!(of_file(text, launched).unwrap(), "p run --rate=20 --use-sim-time=false --quiet");
    }

    /// `Node(parameters=["p.yaml", {"rate": 30}])` becomes two files.
    #[test]
    fn a_parameter_of_a_later_file_or_rule_counts() {
        let folder = tempfile::tempdir().unwrap();
        let [own, general, all] = ["p.yaml", "launch_params_1", "all.yaml"].map(|name| folder.path().join(name));
        std::fs::write(&own, "/gold:\n  ros__parameters:\n    rate: 20.0\n    scene: a.toml\n").unwrap();
        std::fs::write(&general, "/**:\n  ros__parameters:\n    rate: 30\n").unwrap();
        std::fs::write(&all, "/**:\n  ros__parameters:\n    rate: 10\ngold:\n  ros__parameters:\n    rate: 20\n")
            .unwrap();
        let [own, general, all] = [own, general, all].map(|path| path.display().to_string());
        let rate = |arguments: String| of(&format!("p run --ros-args -r __node:=gold {arguments}")).unwrap().0;
        let given = rate(format!("--params-file {own} --params-file {general}"));
        assert_eq!(given, "p run --rate=30 --scene=a.toml");
        assert_eq!(rate(format!("--params-file {own} -p rate:=40")), "p run --rate=40 --scene=a.toml");
        assert_eq!(rate(format!("--params-file {general} --params-file {own}")), "p run --rate=20.0 --scene=a.toml");
        // As in rcl, `-p` joins the section `/**`, which stands where it first stood.
        assert_eq!(rate(format!("--params-file {all} -p rate:=40")), "p run --rate=20");
        assert_eq!(rate(format!("--params-file {all} -p gold:rate:=40")), "p run --rate=40");
    }

    #[test]
    fn a_file_that_is_not_understood_is_refused_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("launch_params_1").display().to_string();
        let deep = |levels: usize| format!("{}{}", "{a: ".repeat(levels), "}".repeat(levels));
        let of_parameters = |text: &str| format!("/**:\n  ros__parameters:\n    {text}\n");
        for (text, expected) in [
            (of_parameters("colour: red"), "line 3: colour is not understood, expected the parameters rate, scene and"),
            (of_parameters("loop: {rate: 1}"), "line 3: loop.rate is not understood"),
            (of_parameters("rate: [1,\n      2]"), "line 3: rate is a list, expected a number"),
            (of_parameters("rate: '30'"), "line 3: rate is the text \"30\", expected a number"),
            (of_parameters("rate: fast"), "line 3: rate is the text \"fast\", expected a number"),
            (of_parameters("rate: 017"), "line 3: rate is the text \"017\", expected a number"),
            (of_parameters("rate: !!str 30"), "line 3: rate is the text \"30\", expected a number"),
            (of_parameters("rate: yes"), "line 3: rate is true, expected a number"),
            (of_parameters("rate: $(var rate)"), "rate is the text \"$(var rate)\", expected a number"),
            (of_parameters("scene: 5"), "line 3: scene is the number 5, expected a file as a text"),
            (of_parameters("scene: $(find-pkg-share x)/a.toml"), "only in launch files"),
            (of_parameters("use_sim_time: 1"), "line 3: use_sim_time is the number 1, expected true or false"),
            (of_parameters("use_sim_time: 'true'"), "line 3: use_sim_time is the text \"true\", expected true or"),
            (of_parameters("rate:"), "expected names of nodes"),
            (of_parameters("rate: [[1]]"), "line 3, expected names of nodes"),
            (of_parameters("rate: &a 30\n    scene: *a"), "line 4, expected names of nodes"),
            (of_parameters("rate: \"30"), "line "),
            ("  rate: 1\n".to_owned(), "line 1, expected names of nodes"),
            ("/**:\n  rate: 1\n".to_owned(), "line 2, expected names of nodes"),
            ("ros__parameters:\n  rate: 1\n".to_owned(), "line 2, expected names of nodes"),
            ("rate\n".to_owned(), "line 1, expected names of nodes"),
            ("- rate\n".to_owned(), "line 1, expected names of nodes"),
            ("/gold*:\n  ros__parameters:\n    rate: 1\n".to_owned(), "\"gold*\" in \"/gold*\" is no name of a node"),
            ("hall:\n  /gold:\n    ros__parameters:\n      rate: 1\n".to_owned(), "in \"hall//gold\" is no name"),
            (deep(40), "line 1, expected names of nodes"),
            (deep(10_000), "line 1"),
            ("#".repeat(70_000), "more than 65536 bytes"),
        ] {
            std::fs::write(&file, &text).unwrap();
            let sentence = of(&format!("p run --ros-args --params-file {file}")).unwrap_err();
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
            ("-p rate", "-p rate"),
            ("-p rate:=", "-p rate:="),
            ("--log-level loud", "--log-level loud"),
            ("--log-level rcl:=debug", "rcl:=debug"),
            ("--enclave /x", "--enclave"),
        ] {
            let sentence = of(&format!("p run --ros-args {text}")).unwrap_err();
            assert!(sentence.contains(named) && sentence.contains("-r __node:=NAME"), "{sentence}");
        }
        for (text, expected) in [
            ("-p speed:=2", "-p speed:=2 is not understood, expected the parameters rate, scene and use_sim_time"),
            ("-p use_sim_time:=maybe", "use_sim_time:=maybe is the text \"maybe\", expected true or false"),
            ("-p rate:='30'", "-p rate:='30' is the text \"30\", expected a number"),
        ] {
            let sentence = of(&format!("p run --ros-args {text}")).unwrap_err();
            assert!(sentence.contains(expected), "{sentence}");
        }
        assert!(of("p watch --ros-args -r __node:=a").unwrap_err().contains("run and replay"));
    }
}
