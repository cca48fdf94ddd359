//! The test of `crates/netdev`, which is outside the workspace: RustDDS sees the interfaces of this machine.

use std::net::Ipv4Addr;
use std::process::Command;

use netdev::{Ipv4Net, get_interfaces};

/// `ip -4 -o address` prints a line for each address: number, name, "inet", address/prefix.
#[test]
fn the_addresses_are_those_that_the_system_prints() {
    let Ok(output) = Command::new("/usr/sbin/ip").args(["-4", "-o", "address"]).output() else {
        println!("NOT RUN: no ip (iproute2)");
        return;
    };
    let printed = String::from_utf8(output.stdout).unwrap();
    let expected: Vec<(u32, Ipv4Addr, u32)> = printed
        .lines()
        .map(|line| {
            let words: Vec<&str> = line.split_whitespace().collect();
            let (address, prefix) = words[3].split_once('/').unwrap();
            (words[0].trim_end_matches(':').parse().unwrap(), address.parse().unwrap(), prefix.parse().unwrap())
        })
        .collect();
    let interfaces = get_interfaces();
    let found = interfaces.iter().flat_map(|interface| interface.ipv4.iter().map(|net| (interface.index, *net)));
    let found: Vec<(u32, Ipv4Addr, u32)> =
        found.map(|(index, net)| (index, net.addr(), u32::from(net.netmask()).count_ones())).collect();
    assert!(!expected.is_empty() && expected.iter().all(|one| found.contains(one)), "{printed}{found:?}");
    // The loopback interface, the first, has every address.
    let loopback: Vec<Ipv4Addr> = interfaces[0].ipv4.iter().map(Ipv4Net::addr).collect();
    assert!(interfaces[0].is_loopback() && !interfaces[0].is_multicast());
    assert!(expected.iter().all(|(_, address, _)| loopback.contains(address)), "{printed}{loopback:?}");
}
