//! Two hosts on one machine: network namespaces joined by a cable.

use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::text;

/// Two network namespaces joined by a cable, each with one address.
pub struct Hosts {
    names: [String; 2],
    ends: [String; 2],
}

impl Hosts {
    /// # Errors
    /// The reason why this process may not make namespaces.
    pub fn new() -> Result<Self, String> {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let (process, number) = (std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        // The name of an interface has at most 15 bytes.
        let ends = ["l", "r"].map(|side| format!("bd{side}{number}_{process}"));
        let names = ["left", "right"].map(|side| format!("test_{process}_{side}_{number}"));
        let hosts = Self { names, ends };
        let Self { names: [left, right], ends } = &hosts;
        ip(&format!("netns add {left}"))?;
        ip(&format!("netns add {right}"))?;
        ip(&format!("link add {} netns {left} type veth peer name {} netns {right}", ends[0], ends[1]))?;
        for (host, end, address) in [(left, &ends[0], "10.77.0.1/24"), (right, &ends[1], "10.77.0.2/24")] {
            ip(&format!("-n {host} address add {address} dev {end}"))?;
            ip(&format!("-n {host} link set lo up"))?;
            ip(&format!("-n {host} link set {end} up multicast on"))?;
            ip(&format!("-n {host} route add default dev {end}"))?;
        }
        Ok(hosts)
    }

    /// Sets whether the cable carries multicast: "on" or "off".
    pub fn set_multicast(&self, multicast: &str) {
        for (host, end) in self.names.iter().zip(&self.ends) {
            ip(&format!("-n {host} link set {end} multicast {multicast}")).unwrap();
        }
    }

    /// Unplugs the cable.
    pub fn cut(&self) {
        self.set_right("down");
    }

    /// Plugs the cable in again.
    pub fn join(&self) {
        self.set_right("up");
        // It has gone with the cable.
        ip(&format!("-n {} route add default dev {}", self.names[1], self.ends[1])).unwrap();
    }

    fn set_right(&self, state: &str) {
        ip(&format!("-n {} link set {} {state}", self.names[1], self.ends[1])).unwrap();
    }

    /// Returns a command on a host, "left" or "right", in a folder.
    pub fn on(&self, host: &str, folder: &Path, command: &Command) -> Command {
        let name = &self.names[usize::from(host == "right")];
        let mut inside = Command::new("ip");
        inside.args(["netns", "exec", name]).arg(command.get_program()).args(command.get_args());
        inside.current_dir(folder);
        inside
    }

    /// Returns the number of bytes that the left host has sent so far.
    pub fn sent_bytes(&self) -> u64 {
        let mut command = Command::new("cat");
        command.arg(format!("/sys/class/net/{}/statistics/tx_bytes", self.ends[0]));
        let output = self.on("left", Path::new("/"), &command).output().unwrap();
        text(&output.stdout).trim().parse().unwrap()
    }
}

/// Runs `ip`.
fn ip(arguments: &str) -> Result<(), String> {
    let output = Command::new("ip").args(arguments.split_whitespace()).output().map_err(|error| error.to_string())?;
    if output.status.success() { Ok(()) } else { Err(text(&output.stderr)) }
}

impl Drop for Hosts {
    fn drop(&mut self) {
        for host in &self.names {
            let _ = Command::new("ip").args(["netns", "delete", host]).output();
        }
    }
}
