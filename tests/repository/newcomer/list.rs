//! The commands of the pages that are not run as printed, and the reasons: a line each, all of which the test prints. A
//! command that is on no list is run. A line without a command on a page is a failure.

/// Commands that begin with the first text, and the reason.
pub type Line = (&'static str, &'static str);

/// Commands that are not run.
pub const NOT_HERE: &[Line] = &[
    (".venv/bin/python benches/", "measures for minutes"),
    ("apt install ./target/packaging/", "changes the machine: tests/packages/debian.sh does it on a clean Debian"),
    ("apt-get install", "changes the machine"),
    ("bench-dragon chase ltc show.wav", "the reader's own recording"),
    ("bench-dragon chase mtc /dev/snd/", "needs a MIDI device: tests/processes/chase.rs pipes the bytes of mido"),
    ("bench-dragon chase psn", "needs a network with multicast: tests/processes/chase.rs has a tracker"),
    (
        "bench-dragon send timecode mtc /dev/snd/",
        "needs a MIDI device: tests/processes/timecode.rs reads the bytes by mido",
    ),
    ("cargo +nightly", "needs a nightly toolchain"),
    ("cargo build", "builds for minutes: tests/run builds each way"),
    ("cargo deny check", "needs cargo-deny and the network"),
    ("cargo install --path", "builds for minutes: tests/newcomer/debian.sh installs the program"),
    ("cargo install", "builds another program for minutes"),
    ("cd / && /tmp/installed/bin/bench-dragon", "needs the cargo install before it: tests/newcomer/debian.sh has both"),
    ("chromium --kiosk", "needs a screen: tests/browser/view.rs opens the pages without one"),
    ("colcon build", "needs ROS 2"),
    ("du -c /dev/shm/iox2_*", "shows files of a tunnel"),
    ("iox2", "needs the tunnel, which builds for minutes: tests/processes/tunnel.rs has two hosts and both ends"),
    (
        "java -cp HdrHistogram.jar",
        "needs Java and HdrHistogram: tests/processes/soak.rs reads the file by HdrHistogram's Python",
    ),
    ("pip install maturin", "another program"),
    ("pip install target/packaging/", "needs the wheel: tests/packages/debian.sh installs it"),
    ("python3 benches/", "measures for minutes"),
    ("python3 examples/python/ros2_", "needs ROS 2"),
    ("python3 tests/python/conduct_peer.py", "measures: tests/browser/conduct.rs runs it"),
    ("ros2 ", "needs ROS 2"),
    ("rustup", "downloads a toolchain"),
    ("rviz2", "needs ROS 2"),
    ("source /opt/ros/jazzy/setup.bash", "needs ROS 2"),
    ("source install/setup.bash", "needs ROS 2"),
    ("ssh HERE", "needs two machines"),
    ("sudo env \"PATH=$PATH\" tests/newcomer/debian.sh", "half an hour, with a mirror of Debian"),
    ("stress-ng", "loads the machine for hours"),
    ("tar -xf target/packaging/", "needs the tarball that packaging/build makes"),
    ("tests/run", "runs this test itself"),
    ("tests/timings", "runs this test itself"),
];

/// Commands that are not run; their files and the names of tests in them are looked up.
pub const LOOKED_UP: &[Line] =
    &[("cargo test", "a test, which tests/run runs"), ("cargo bench", "measures for minutes")];

/// Commands that are run if these programs are installed.
pub const NEEDS: &[Line] = &[
    ("bench-dragon send timecode ltc - | aplay", "aplay"),
    ("curl", "curl promtool"),
    ("ffmpeg", "ffmpeg rsvg-convert"),
    ("for svg in", "rsvg-convert"),
];

/// Commands that are run with `BENCH_DRAGON_LONG=1`.
pub const LONG: &[Line] = &[
    ("bench-dragon --scene config/long.toml trade", "takes minutes"),
    ("bench-dragon --scene config/turnaround.toml trade", "takes a minute"),
    ("bench-dragon trade", "takes a minute"),
    ("cargo run --release -- trade", "takes a minute"),
];

/// A part of a command, its replacement, and the reason.
pub const INSTEAD: &[(&str, &str, &str)] = &[
    ("--duration 8h", "--duration 2", "shorter"),
    ("--duration 1h", "--duration 2", "shorter"),
    ("--duration 10m", "--duration 2", "shorter"),
    ("--duration 75", "--duration 2", "shorter"),
    ("--duration 60 ", "--duration 2 ", "shorter"),
    ("--duration 60s ", "--duration 2 ", "shorter"),
    ("--duration 40s", "--duration 2", "shorter"),
    ("--seconds 60", "--seconds 2", "shorter"),
    ("--rate RATE", "--rate 60", "the reader's own number"),
    ("--name NAME", "--name mine", "the reader's own name"),
    ("events --certify FILE", "--scene tests/scenes/tiny_1.toml events --certify proof.jsonl", "the reader's own file"),
    ("verify FILE", "verify proof.jsonl", "the reader's own file"),
];

const LIGHT_SCENE: &str = "sed '/^\\[publish\\]/a precision = \"f32\"' config/paper.toml > light.toml";

const OSC_MAP: &str = "sed -n '/^\\[\\[messages/,/^```/p' docs/show-control.md | grep -v '```' > qlab.toml";

/// The commands that a page's text has its reader start before.
pub const BEFORE: &[(&str, &[&str])] = &[
    ("bench-dragon --name gold control hold", &["bench-dragon --name gold run"]),
    ("bench-dragon send osc --messages --map", &[OSC_MAP]),
    ("curl", &["bench-dragon run", "bench-dragon metrics"]),
    ("python3 examples/python/subscribe.py --light", &[LIGHT_SCENE, "bench-dragon --scene light.toml run"]),
    ("python3 examples/python/subscribe.py --seconds", &["bench-dragon run"]),
    ("python3 examples/python/hermite.py --other-machine", &["bench-dragon run"]),
    ("python3 examples/python/stage_socket.py", &["bench-dragon view"]),
    ("python3 examples/python/cyclone_listener.py", &["bench-dragon run --ros2"]),
];

/// A file that must contain a text before the command makes sense: a person is slower than this test.
pub const AFTER: &[(&str, &str, &str)] = &[("bench-dragon verify show.jsonl", "show.jsonl", "\"type\":\"second\"")];

/// Exit codes other than 0, and a text that must be printed with them.
pub const CODES: &[(&str, &[i32], &str)] = &[
    // The verdict depends on the machine as well; but each process ended on request, and every count is correct.
    ("bench-dragon soak --duration", &[0, 1], SOAK_ENDED),
    ("bench-dragon soak --name mine", &[0, 1], SOAK_ENDED),
    ("cargo run --release -- soak", &[0, 1], SOAK_ENDED),
    ("time bench-dragon replay show.mcap --start 1e9", &[2], "error: "),
];

const SOAK_ENDED: &str = "pass  processes that ended by themselves or hung";
