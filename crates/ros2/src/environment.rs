//! The environment variables of ROS 2 that choose a network, and legal ROS names.
//!
//! In: the process's environment. Out: a [`Network`], or an error for a value that would select another network than
//! RustDDS joins; [`warnings`] for what has no effect. Called when the ROS 2 transport opens.

use super::Ros2Error;

/// The greatest domain whose ports exist (ROS 2 documentation, "The ROS_DOMAIN_ID").
const GREATEST_DOMAIN: u16 = 232;

/// The network in which ROS 2 processes find each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Network {
    /// ROS_DOMAIN_ID, by default 0.
    pub domain: u16,
    /// The range of discovery.
    pub range: Range,
}

/// The range of discovery.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Range {
    /// All machines that multicast reaches.
    Subnet,
    /// This machine.
    Localhost,
}

impl Network {
    /// Returns the network that the environment selects. `variable` returns the value of a variable that is set.
    ///
    /// # Errors
    /// [`Ros2Error::Environment`] for a value that ROS 2 does not know or that RustDDS cannot honour.
    pub fn of(variable: impl Fn(&str) -> Option<String>) -> Result<Self, Ros2Error> {
        let set = |name: &str| variable(name).filter(|value| !value.trim().is_empty());
        let refused = |sentence: String| Err(Ros2Error::Environment(sentence));
        let domain = match set("ROS_DOMAIN_ID") {
            None => 0,
            Some(text) => match text.trim().parse::<u16>() {
                Ok(domain) if domain <= GREATEST_DOMAIN => domain,
                _ => {
                    return refused(format!(
                        "ROS_DOMAIN_ID is \"{text}\", expected a whole number from 0 to {GREATEST_DOMAIN}"
                    ));
                }
            },
        };
        // Deprecated since Iron. Enabled, it prevails over the range and the peers, as in rcl (ros2/rcl#1069).
        match set("ROS_LOCALHOST_ONLY").as_deref().map(str::trim) {
            Some("1") => return Ok(Self { domain, range: Range::Localhost }),
            None | Some("0") => (),
            Some(other) => return refused(format!("ROS_LOCALHOST_ONLY is \"{other}\", expected 0 or 1")),
        }
        let range = match set("ROS_AUTOMATIC_DISCOVERY_RANGE").as_deref().map(str::trim) {
            None | Some("SUBNET" | "SYSTEM_DEFAULT") => Range::Subnet,
            Some("LOCALHOST") => Range::Localhost,
            Some("OFF") => {
                return refused(
                    "ROS_AUTOMATIC_DISCOVERY_RANGE is OFF, with which RustDDS would reach no process: set it to LOCALHOST \
                     or SUBNET, or run without ROS 2"
                        .to_owned(),
                );
            }
            Some(other) => {
                return refused(format!(
                    "ROS_AUTOMATIC_DISCOVERY_RANGE is \"{other}\", expected SUBNET, LOCALHOST, OFF or SYSTEM_DEFAULT"
                ));
            }
        };
        Ok(Self { domain, range })
    }

    /// Returns the network in words.
    pub fn sentence(self) -> String {
        let range = match self.range {
            Range::Subnet => "the subnet",
            Range::Localhost => "this machine only",
        };
        format!("domain {}, {range}", self.domain)
    }
}

/// Checks that a name can be a ROS 2 namespace: words joined by slashes (ROS 2 design, "Topic and Service name
/// mapping"). A word has letters, digits and single underscores, and does not begin with a digit.
///
/// # Errors
/// [`Ros2Error::Name`].
pub fn check_name(name: &str) -> Result<(), Ros2Error> {
    let legal = |word: &str| {
        word.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
            && word.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
            && !word.contains("__")
            && !word.ends_with('_')
    };
    if name.split('/').all(legal) { Ok(()) } else { Err(Ros2Error::Name(name.to_owned())) }
}

/// The variables of other implementations of DDS, which choose a network or a profile.
const OF_OTHERS: [&str; 4] =
    ["ROS_DISCOVERY_SERVER", "CYCLONEDDS_URI", "FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE"];
/// The implementations with which RustDDS communicates.
const UNDERSTOOD: [&str; 3] = ["rmw_fastrtps_cpp", "rmw_fastrtps_dynamic_cpp", "rmw_cyclonedds_cpp"];

/// Returns a sentence for each variable that ROS 2 or another DDS honours and RustDDS does not.
pub fn warnings(variable: impl Fn(&str) -> Option<String>) -> Vec<String> {
    let set = |name: &str| variable(name).filter(|value| !value.trim().is_empty());
    let is_local = set("ROS_LOCALHOST_ONLY").is_some_and(|value| value.trim() == "1");
    let overridden =
        ["ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"].into_iter().filter(|name| set(name).is_some());
    let mut sentences = Vec::new();
    if is_local {
        sentences.extend(overridden.map(|name| format!("{name} has no effect, since ROS_LOCALHOST_ONLY is 1")));
    } else if let Some(peers) = set("ROS_STATIC_PEERS") {
        sentences.push(format!(
            "ROS_STATIC_PEERS is \"{peers}\", which RustDDS cannot honour: others find this publisher by multicast, or by \
             naming this machine in their own ROS_STATIC_PEERS"
        ));
    }
    if let Some(other) = set("RMW_IMPLEMENTATION").filter(|name| !UNDERSTOOD.contains(&name.trim())) {
        sentences.push(format!(
            "RMW_IMPLEMENTATION is \"{other}\", which does not find this publisher: it publishes by DDS, to nodes with {}",
            UNDERSTOOD.join(", ")
        ));
    }
    let ignored = OF_OTHERS.into_iter().filter(|name| set(name).is_some());
    sentences.extend(ignored.map(|name| {
        format!(
            "{name} is set, which RustDDS cannot honour: others find this publisher by multicast, with its own settings"
        )
    }));
    sentences.extend(other_distribution(variable));
    sentences
}

/// Returns a warning if `ROS_DISTRO` names another distribution than this program was built for. Humble writes some of
/// the graph's messages in another form than later distributions; the topics do not differ.
fn other_distribution(variable: impl Fn(&str) -> Option<String>) -> Option<String> {
    let built = ros2_client::COMPILED_ROS_DISTRO;
    let distribution = variable("ROS_DISTRO").filter(|name| !name.trim().is_empty() && name != built.as_str())?;
    Some(format!(
        "ROS_DISTRO is {distribution} and this program was built for {built}: topics arrive, but `ros2 node list` may \
         not show it (for Humble, build with `--no-default-features --features cli,humble`)"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_distribution_gives_a_warning() {
        let built = ros2_client::COMPILED_ROS_DISTRO.as_str();
        let warning = |value: Option<&str>| other_distribution(|_| value.map(str::to_owned));
        assert_eq!((warning(None), warning(Some("")), warning(Some(built))), (None, None, None));
        assert!(warning(Some("foxy")).is_some_and(|text| text.contains("foxy") && text.contains(built)));
    }

    #[test]
    fn what_has_no_effect_is_named_in_a_warning() {
        let of = |variables: &[(&str, &str)]| {
            warnings(|name| variables.iter().find(|(of, _)| *of == name).map(|(_, value)| (*value).to_owned()))
        };
        assert_eq!(of(&[("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp"), ("ROS_LOCALHOST_ONLY", "1")]), [""; 0]);
        assert_eq!(of(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"), ("CYCLONEDDS_URI", "")]), [""; 0]);
        for (variable, value, expected) in [
            ("RMW_IMPLEMENTATION", "rmw_zenoh_cpp", "rmw_fastrtps_cpp"),
            ("ROS_DISCOVERY_SERVER", "127.0.0.1:11811", "multicast"),
            ("ROS_STATIC_PEERS", "192.168.1.2", "\"192.168.1.2\""),
            ("CYCLONEDDS_URI", "file:///c.xml", "RustDDS"),
            ("FASTRTPS_DEFAULT_PROFILES_FILE", "f.xml", "RustDDS"),
        ] {
            let sentences = of(&[(variable, value)]);
            let [sentence] = &sentences[..] else { panic!("{sentences:?}") };
            assert!(sentence.starts_with(variable) && sentence.contains(expected), "{sentence}");
        }
        let local = [("ROS_LOCALHOST_ONLY", "1"), ("ROS_STATIC_PEERS", "a"), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")];
        let expected = ["ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"]
            .map(|name| format!("{name} has no effect, since ROS_LOCALHOST_ONLY is 1"));
        assert_eq!(of(&local), expected);
    }

    fn network(variables: &[(&str, &str)]) -> Result<Network, String> {
        Network::of(|name| {
            variables.iter().find(|(variable, _)| *variable == name).map(|(_, value)| (*value).to_owned())
        })
        .map_err(|error| error.to_string())
    }

    #[test]
    fn the_environment_of_ros_people_is_honoured_or_refused() {
        let found = |domain, range| Ok(Network { domain, range });
        assert_eq!(network(&[]), found(0, Range::Subnet));
        assert_eq!(network(&[("ROS_DOMAIN_ID", "")]), found(0, Range::Subnet));
        assert_eq!(network(&[("ROS_DOMAIN_ID", "42")]), found(42, Range::Subnet));
        assert_eq!(network(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")]), found(0, Range::Localhost));
        assert_eq!(network(&[("ROS_AUTOMATIC_DISCOVERY_RANGE", "SYSTEM_DEFAULT")]), found(0, Range::Subnet));
        assert_eq!(network(&[("ROS_LOCALHOST_ONLY", "1")]), found(0, Range::Localhost));
        assert_eq!(network(&[("ROS_LOCALHOST_ONLY", "0")]), found(0, Range::Subnet));
        // ros2/rcl#1069: localhost prevails.
        for other in [("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF"), ("ROS_STATIC_PEERS", "192.168.1.2")] {
            assert_eq!(network(&[("ROS_LOCALHOST_ONLY", "1"), other]), found(0, Range::Localhost));
        }
        for (variable, value, expected) in [
            ("ROS_DOMAIN_ID", "233", "0 to 232"),
            ("ROS_DOMAIN_ID", "-1", "0 to 232"),
            ("ROS_DOMAIN_ID", "house", "0 to 232"),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF", "LOCALHOST"),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "near", "SUBNET"),
            ("ROS_LOCALHOST_ONLY", "yes", "0 or 1"),
        ] {
            let sentence = network(&[(variable, value)]).unwrap_err();
            assert!(sentence.contains(variable) && sentence.contains(expected), "{sentence}");
        }
    }

    #[test]
    fn names_that_ros_takes() {
        for name in ["bench_dragon", "stage/left", "a1", "_x"] {
            check_name(name).unwrap();
        }
        for name in ["", "1st", "a b", "a-b", "a__b", "a/", "/a", "a//b", "ä", "a_"] {
            assert!(check_name(name).is_err(), "{name}");
        }
    }
}
