//! Environment variables, a line each (`ROS_DOMAIN_ID=7`), and names: applied, or refused with a sentence that names
//! them.

use bench_dragon::client::shared_memory::service_name;
use bench_dragon::ros2::environment::{Network, Range, check_name, warnings};
use fastrand::Rng;

use super::Target;
use super::bytes::{changed, one, renumbered};

pub const TARGET: Target = Target { name: "environment", run, seeds, mutate, cases: 100_000 };

const VARIABLES: [&str; 7] = [
    "ROS_DOMAIN_ID",
    "ROS_AUTOMATIC_DISCOVERY_RANGE",
    "ROS_LOCALHOST_ONLY",
    "ROS_STATIC_PEERS",
    "ROS_DISTRO",
    "RMW_IMPLEMENTATION",
    "CYCLONEDDS_URI",
];
const VALUES: [&str; 22] = [
    "stage/left",
    "1st",
    "_x/a_",
    "",
    " ",
    "0",
    "1",
    "42",
    "232",
    "233",
    "65536",
    "-1",
    "+7",
    "0x10",
    "SUBNET",
    "LOCALHOST",
    "OFF",
    "SYSTEM_DEFAULT",
    "humble",
    "jazzy",
    "rmw_cyclonedds_cpp",
    "\u{9f99}",
];

fn run(data: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(data) else { return false };
    let lines: Vec<(&str, &str)> = text.lines().filter_map(|line| line.split_once('=')).collect();
    let variable = |name: &str| lines.iter().find(|(known, _)| *known == name).map(|(_, value)| (*value).to_owned());
    let set = |name: &str| variable(name).filter(|value| !value.trim().is_empty());
    match Network::of(variable) {
        Ok(network) => {
            let domain = set("ROS_DOMAIN_ID").map_or(Ok(0), |text| text.trim().parse::<i128>());
            assert_eq!(domain, Ok(i128::from(network.domain)));
            assert!(network.domain <= 232, "{network:?}");
            // A setting for this machine alone allows no other range.
            let alone = set("ROS_LOCALHOST_ONLY").is_some_and(|value| value.trim() == "1");
            assert!(!alone || network.range == Range::Localhost, "{network:?}");
            assert!(network.sentence().contains(&network.domain.to_string()));
        }
        Err(error) => {
            let sentence = error.to_string();
            assert!(VARIABLES.iter().any(|name| sentence.contains(name) && set(name).is_some()), "{sentence}");
        }
    }
    let sentences = warnings(variable);
    let names_one = |text: &String| VARIABLES.iter().any(|name| text.starts_with(name) && set(name).is_some());
    assert!(sentences.iter().all(names_one), "{sentences:?}");
    // Other peers and another implementation have no effect, so there is a warning.
    let is_own = |value: String| value.trim().ends_with("cyclonedds_cpp");
    let is_warned = |name| sentences.iter().any(|text| text.starts_with(name));
    assert!(set("ROS_STATIC_PEERS").is_none() || is_warned("ROS_STATIC_PEERS"), "{sentences:?}");
    assert!(set("RMW_IMPLEMENTATION").is_none_or(is_own) || is_warned("RMW_IMPLEMENTATION"), "{sentences:?}");
    // The rest of each line is used as a name.
    for (_, name) in lines {
        if check_name(name).is_ok() {
            assert!(name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"_/".contains(&byte)), "{name}");
            let is_word = |word: &str| !word.is_empty() && !word.ends_with('_') && !word.as_bytes()[0].is_ascii_digit();
            assert!(name.split('/').all(is_word) && !name.contains("__"), "{name}");
        }
        let _ = service_name(name, "poses");
    }
    true
}

fn seeds() -> Vec<Vec<u8>> {
    let pairs = VARIABLES.iter().flat_map(|name| VALUES.iter().map(move |value| format!("{name}={value}\n")));
    let all = VARIABLES.iter().zip(VALUES.iter().skip(2)).map(|(name, value)| format!("{name}={value}\n"));
    pairs.chain([all.collect()]).map(String::into_bytes).collect()
}

fn mutate(data: &[u8], random: &mut Rng) -> Vec<u8> {
    let text = String::from_utf8_lossy(data).into_owned();
    match random.u8(..4) {
        0 => changed(data, random),
        1 => renumbered(&text, random).into_bytes(),
        _ => format!("{}={}\n{text}", one(&VARIABLES, random), one(&VALUES, random)).into_bytes(),
    }
}
