//! The contents of the packages that `packaging/build` makes, as far as they follow from the files of this checkout and
//! from the program. Also the versions that publisher and subscribers compare.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use crate::harness::{Process, can_run, program, python, root, text};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
/// The folder to which `packaging/build` has the program write its man pages and completions.
const MANUAL: &str = "target/packaging/manual/";

fn read(file: &str) -> String {
    std::fs::read_to_string(Path::new(ROOT).join(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
}

/// Returns the manual in a new folder.
fn manual() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let output = Process::start(program("manual").arg("write-manual").arg(folder.path())).output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    folder
}

/// Returns the commands that `bench-dragon --help` lists.
fn listed_commands() -> Vec<String> {
    let help = text(&Process::start(program("manual").arg("--help")).output().stdout);
    let (_, commands) = help.split_once("Commands:\n").expect("a list of commands");
    let lines = commands.lines().take_while(|line| !line.is_empty()).filter(|line| line.starts_with("  "));
    let words = lines.filter(|line| !line.starts_with("   ")).filter_map(|line| line.split_whitespace().next());
    words.filter(|word| *word != "help").map(str::to_owned).collect()
}

#[test]
fn every_command_has_a_man_page_and_completions() {
    let folder = manual();
    let file = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap_or_else(|_| panic!("no {name}"));
    let commands = listed_commands();
    assert!(commands.len() >= 16, "{commands:?}");
    let completions = ["bench-dragon", "_bench-dragon", "bench-dragon.fish"].map(|name| {
        let text = file(&format!("completions/{name}"));
        assert!(text.contains("--realtime") || text.contains("-l realtime"), "{name} has no option of run");
        text
    });
    for command in &commands {
        let page = file(&format!("man/bench-dragon-{command}.1"));
        assert!(page.contains(".SH SYNOPSIS") && page.contains(".SH OPTIONS"), "{command}: {page}");
        assert!(completions.iter().all(|text| text.contains(command.as_str())), "{command} is not completed");
    }
    assert!(file("man/bench-dragon-run.1").contains("realtime"));
    assert!(file("man/bench-dragon-send-osc.1").contains(".SH OPTIONS"));
    let hidden = std::fs::read_dir(folder.path().join("man")).unwrap();
    let hidden = hidden.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    assert!(!hidden.into_iter().any(|name| name.contains("soak-") || name.contains("manual")), "a hidden command");
    let mut bash = Command::new("bash");
    bash.arg("-n").arg(folder.path().join("completions/bench-dragon"));
    assert!(Process::start(&mut bash).output().status.success(), "bash does not read its completions");
}

#[test]
fn the_debian_package_lists_files_that_exist() {
    let folder = manual();
    let manifest: toml::Value = toml::from_str(&read("Cargo.toml")).unwrap();
    let deb = &manifest["package"]["metadata"]["deb"];
    let mut installed = BTreeSet::new();
    for asset in deb["assets"].as_array().unwrap() {
        let [source, target, mode] = [0, 1, 2].map(|at| asset[at].as_str().unwrap());
        assert_eq!(mode, if target == "usr/bin/" { "755" } else { "644" }, "{source}");
        installed.insert(target);
        let path = match source.strip_prefix(MANUAL) {
            Some(inner) => folder.path().join(inner),
            None if source.starts_with("target/release/") => continue,
            None => Path::new(ROOT).join(source),
        };
        let (parent, name) = (path.parent().unwrap(), path.file_name().unwrap().to_str().unwrap());
        let ending = name.strip_prefix('*').unwrap_or(name);
        let files = std::fs::read_dir(parent).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        assert!(files.into_iter().any(|file| file.ends_with(ending)), "{source} is not there");
    }
    for place in ["usr/bin/", "usr/share/man/man1/", "usr/lib/systemd/user/", "usr/share/bench-dragon/scenes/"] {
        assert!(installed.contains(place), "nothing in {place}");
    }
    for file in [deb["changelog"].as_str().unwrap(), deb["license-file"][0].as_str().unwrap()] {
        assert!(!read(file).is_empty());
    }
    let unit = read("packaging/debian/bench-dragon@.service");
    for line in ["Type=notify", "WatchdogSec=30", "Restart=on-failure", "LimitRTPRIO=90", "LimitMEMLOCK=infinity"] {
        assert!(unit.lines().any(|found| found == line), "the unit has no {line}");
    }
    assert!(unit.contains("SCENES=/usr/share/bench-dragon/scenes\n") && unit.contains("${SCENES}/%i.toml"));
}

#[test]
fn versions_are_one_and_the_program_prints_them() {
    let version = env!("CARGO_PKG_VERSION");
    let manifest: toml::Value = toml::from_str(&read("Cargo.toml")).unwrap();
    let maintainer = manifest["package"]["metadata"]["deb"]["maintainer"].as_str().unwrap();
    let (name, address) = maintainer.strip_suffix('>').unwrap().split_once(" <").unwrap();
    let changelog = read("packaging/debian/changelog");
    assert!(changelog.starts_with(&format!("bench-dragon ({version}-1) ")));
    assert!(changelog.contains(&format!("\n -- {maintainer}  ")));
    for file in ["packaging/ros2/bench_dragon/package.xml", "msgs/package.xml"] {
        assert!(read(file).contains(&format!("<version>{version}</version>")), "{file}");
        let maintainer = format!("<maintainer email=\"{address}\">{name}</maintainer>");
        assert!(read(file).contains(&maintainer), "{file} has another maintainer");
    }
    let lock: toml::Value = toml::from_str(&read("Cargo.lock")).unwrap();
    let iceoryx2 = lock["package"].as_array().unwrap().iter().find(|it| it["name"].as_str() == Some("iceoryx2"));
    let iceoryx2 = iceoryx2.unwrap()["version"].as_str().unwrap();
    assert!(read("packaging/python/pyproject.toml").contains(&format!("\"iceoryx2=={iceoryx2}\"")));

    // The layouts of the Python module are generated from the sources.
    let module = read("packaging/python/bench_dragon/layouts.py");
    let sent: BTreeSet<&str> = module.split_once("\nMESSAGES").unwrap().1.lines().skip(1).collect();
    let mut expected = BTreeSet::new();
    for class in module.split("\nclass ").skip(2) {
        let (name, _) = class.split_once('(').unwrap();
        let number = class.split_once("\n    LAYOUT = ").unwrap().1.lines().next().unwrap();
        if sent.contains(format!("    {name},").as_str()) {
            expected.insert(format!("{name}/{number}"));
        }
    }
    let printed = text(&Process::start(program("versions").arg("--version")).output().stdout);
    let lines: Vec<_> = printed.lines().collect();
    assert_eq!(lines[..2], [format!("bench-dragon {version}"), format!("iceoryx2 {iceoryx2}")]);
    let layouts = lines[2].strip_prefix("layouts ").unwrap().split(", ").map(str::to_owned);
    assert_eq!(layouts.collect::<BTreeSet<_>>(), expected);
    let changes = read("CHANGELOG.md");
    let changes = changes.lines().filter_map(|line| line.strip_prefix("### ")).flat_map(|line| line.split(", "));
    let changes = BTreeSet::from_iter(changes);
    for layout in expected.iter().filter(|layout| !layout.ends_with("/1")) {
        assert!(changes.contains(layout.as_str()), "CHANGELOG.md has no section for {layout}");
    }
}

/// ROS 2 is not on this machine: the launch file is compiled, and its names are looked up.
#[test]
fn the_ros_2_package_installs_what_its_launch_file_names() {
    let folder = "packaging/ros2/bench_dragon";
    let launch = read(&format!("{folder}/launch/show.launch.py"));
    let mut compile = python();
    compile.args(["-c", "import sys; compile(sys.stdin.read(), 'show.launch.py', 'exec')"]);
    let (compiled, mut input) = Process::start_with_input(&mut compile);
    std::io::Write::write_all(&mut input, launch.as_bytes()).unwrap();
    drop(input);
    let output = compiled.output();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let lists = read(&format!("{folder}/CMakeLists.txt"));
    for (named, file) in
        [("\"layouts\" / \"bench_dragon.rviz\"", "examples/rviz/bench_dragon.rviz"), ("\"scenes\"", "config/")]
    {
        assert!(launch.contains(named) && lists.contains(file) && Path::new(ROOT).join(file).exists(), "{named}");
    }
    for argument in ["scene", "name", "rate", "rviz"] {
        assert!(launch.contains(&format!("DeclareLaunchArgument(\"{argument}\"")), "no argument {argument}");
    }
    let publisher = Path::new(ROOT).join(folder).join("publisher");
    let mode = std::os::unix::fs::PermissionsExt::mode(&publisher.metadata().unwrap().permissions());
    assert_eq!(mode & 0o111, 0o111, "publisher is not executable");
}

/// Runs a script of `tests/packages` with a new folder, which needs minutes and the tools of `packaging/build`.
fn run_in_the_long_run(script: &str, arguments: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let mut script = Command::new(script);
    script.current_dir(ROOT).arg(folder.path().join("made")).args(arguments);
    let output = Process::start(&mut script).output();
    assert!(output.status.success(), "{}\n{}", text(&output.stdout), text(&output.stderr));
}

#[test]
fn two_checkouts_give_the_same_sources_and_sbom() {
    if std::env::var_os("BENCH_DRAGON_LONG").is_some() {
        run_in_the_long_run("tests/packages/alike.sh", &["sbom", "ros2"]);
    }
}

#[test]
fn packages_install_on_a_clean_debian() {
    if std::env::var_os("BENCH_DRAGON_LONG").is_some() && can_run(root("install Debian into a folder")) {
        run_in_the_long_run("tests/packages/debian.sh", &[]);
    }
}
