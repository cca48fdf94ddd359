//! The network interfaces of this machine, for RustDDS, in place of the crate of this name on crates.io.
//!
//! RustDDS 0.15.1 sends a message in one datagram if all its readers' addresses are in the subnet of an interface whose
//! MTU has room for it (`path_mtu_payload_for_peer`), and has no call that sets the limit. With the MTU of Ethernet it
//! divides all messages of more than 1,452 bytes, also those for readers on this machine. A reader of Fast DDS 2.14
//! that holds a part of a divided message which a GAP withdraws never returns from `take`, and what a burst of small
//! datagrams loses is repaired slowly. So the MTU here is that of the datagrams that other implementations send:
//!
//! - An address of this machine is reached over the loopback interface, whatever interface it belongs to. Linux does
//!   that, and the loopback interface takes the largest datagrams of UDP.
//! - A datagram for a subnet has up to 14,720 bytes, as with Cyclone DDS by default (Fast DDS: 65,500). The network
//!   divides it.
//!
//! In: the system's list of addresses. Out: [`Interface`], with what RustDDS reads of the original. Its test is in
//! `crates/ros2/src/interfaces.rs`.

use std::net::{Ipv4Addr, Ipv6Addr};

use nix::ifaddrs::{InterfaceAddress, getifaddrs};
use nix::net::if_::{InterfaceFlags, if_nametoindex};
use nix::sys::socket::SockaddrStorage;

/// The MTU of the loopback interface. Its own, 65,536 bytes, is more than a datagram of UDP can have.
const LOOPBACK_MTU: u32 = 65_000;
/// The MTU of all others: 14,720 bytes, and the 48 bytes of headers that RustDDS subtracts.
const SUBNET_MTU: u32 = 14_768;

/// A network interface.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Interface {
    /// The number of the interface, 0 if it is not known.
    pub index: u32,
    /// The most bytes of a packet.
    pub mtu: Option<u32>,
    /// The IPv4 addresses. The loopback interface also has those of the others, each as a subnet of its own.
    pub ipv4: Vec<Ipv4Net>,
    /// The IPv6 addresses.
    pub ipv6: Vec<Ipv6Net>,
    name: String,
    flags: InterfaceFlags,
}

/// An IPv4 address with its subnet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ipv4Net {
    address: Ipv4Addr,
    netmask: Ipv4Addr,
}

/// An IPv6 address.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ipv6Net {
    address: Ipv6Addr,
}

impl Interface {
    /// Returns true for the loopback interface.
    pub fn is_loopback(&self) -> bool {
        self.flags.contains(InterfaceFlags::IFF_LOOPBACK)
    }

    /// Returns true if the interface takes multicast packets.
    pub fn is_multicast(&self) -> bool {
        self.flags.contains(InterfaceFlags::IFF_MULTICAST)
    }
}

impl Ipv4Net {
    /// Returns the address.
    pub fn addr(&self) -> Ipv4Addr {
        self.address
    }

    /// Returns the mask of the subnet.
    pub fn netmask(&self) -> Ipv4Addr {
        self.netmask
    }
}

impl Ipv6Net {
    /// Returns the address.
    pub fn addr(&self) -> Ipv6Addr {
        self.address
    }
}

/// Returns the interfaces that have an address, the loopback interface first. Returns none if the system lists none.
pub fn get_interfaces() -> Vec<Interface> {
    let mut interfaces: Vec<Interface> = Vec::new();
    for address in getifaddrs().into_iter().flatten() {
        add(&mut interfaces, &address);
    }
    interfaces.sort_by_key(|interface| !interface.is_loopback());
    reach_own_addresses_over_loopback(&mut interfaces);
    interfaces
}

/// Adds an address to its interface.
fn add(interfaces: &mut Vec<Interface>, address: &InterfaceAddress) {
    let InterfaceAddress { interface_name: name, flags, address: Some(own), netmask, .. } = address else { return };
    let known = interfaces.iter().position(|interface| interface.name == *name);
    let place = known.unwrap_or_else(|| {
        let mtu = if flags.contains(InterfaceFlags::IFF_LOOPBACK) { LOOPBACK_MTU } else { SUBNET_MTU };
        let index = if_nametoindex(name.as_str()).unwrap_or_default();
        let (ipv4, ipv6) = (Vec::new(), Vec::new());
        interfaces.push(Interface { index, mtu: Some(mtu), ipv4, ipv6, name: name.clone(), flags: *flags });
        interfaces.len() - 1
    });
    let interface = &mut interfaces[place];
    let mask = netmask.as_ref().and_then(SockaddrStorage::as_sockaddr_in).map_or(Ipv4Addr::BROADCAST, |mask| mask.ip());
    if let Some(ipv4) = own.as_sockaddr_in() {
        interface.ipv4.push(Ipv4Net { address: ipv4.ip(), netmask: mask });
    } else if let Some(ipv6) = own.as_sockaddr_in6() {
        interface.ipv6.push(Ipv6Net { address: ipv6.ip() });
    }
}

fn reach_own_addresses_over_loopback(interfaces: &mut [Interface]) {
    let Some((loopback, others)) = interfaces.split_first_mut().filter(|(first, _)| first.is_loopback()) else {
        return;
    };
    let own = others.iter().flat_map(|interface| &interface.ipv4);
    loopback.ipv4.extend(own.map(|net| Ipv4Net { netmask: Ipv4Addr::BROADCAST, ..*net }));
}
