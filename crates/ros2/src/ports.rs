//! The UDP ports of this process's participant.
//!
//! RustDDS 0.15.1 takes the first number of a participant whose port for discovery is free. If the port for user traffic
//! of that number is taken, RustDDS listens at another one (`dds/participant.rs:1304`), and still announces the taken one
//! (`DiscoveredWriterData::new`, `discovery/sedp_messages.rs:795`). Then no acknowledgement arrives: a reliable subscriber
//! that misses one message gets no more, and a late one never gets the latest message. Fast DDS takes the two ports one
//! by one, so where its processes come and go there often is such a number. So this file occupies the ports for discovery
//! of such numbers while RustDDS chooses one. Held by `a_publisher_is_heard_where_its_usual_port_is_taken`.
//!
//! In: a domain, and the table of UDP sockets of the kernel. Out: sockets to hold, and whether a participant listens where
//! it is announced.

use std::collections::{BTreeMap, BTreeSet};
use std::net::{Ipv4Addr, UdpSocket};
use std::path::Path;

/// The UDP sockets of this network namespace.
const TABLES: [&str; 2] = ["/proc/net/udp", "/proc/net/udp6"];

/// The participants of a domain on one machine, as many as RustDDS tries (`dds/participant.rs:1267`).
const PARTICIPANTS: u16 = 120;

/// The readings of the tables that together miss no socket. One reading of three misses a given socket where two
/// processors do nothing but open and close others.
const READINGS: usize = 24;

/// The sockets of each port, by their inodes. No two sockets that exist at one time share an inode.
pub(super) type Sockets = BTreeMap<u16, BTreeSet<u64>>;

/// Returns the port for discovery of a participant, `None` beyond the ports that exist (RTPS 2.5, section 9.6.2.3).
fn discovery_port(domain: u16, participant: u16) -> Option<u16> {
    u16::try_from(7410 + 250 * u32::from(domain) + 2 * u32::from(participant)).ok()
}

/// Returns the port for user traffic of a participant, `None` beyond the ports that exist.
pub(super) fn user_port(domain: u16, participant: u16) -> Option<u16> {
    discovery_port(domain, participant)?.checked_add(1)
}

/// Occupies the ports for discovery before those of the first participant whose two ports are free.
pub(super) fn occupy(domain: u16) -> Vec<UdpSocket> {
    let bind = |port: Option<u16>| UdpSocket::bind((Ipv4Addr::UNSPECIFIED, port?)).ok();
    let mut occupied = Vec::new();
    for participant in 0..PARTICIPANTS {
        let Some(discovery) = bind(discovery_port(domain, participant)) else { continue };
        if bind(user_port(domain, participant)).is_some() {
            return occupied;
        }
        occupied.push(discovery);
    }
    // There is none. RustDDS has to choose one of these.
    Vec::new()
}

/// Returns true if this process has the port for user traffic of a participant, or if the system does not tell.
pub(super) fn is_own(domain: u16, participant: u16) -> bool {
    let (Some(port), Some(sockets)) = (user_port(domain, participant), read_all_sockets()) else { return true };
    let Ok(files) = std::fs::read_dir("/proc/self/fd") else { return true };
    let own: BTreeSet<_> = files.flatten().filter_map(|file| std::fs::read_link(file.path()).ok()).collect();
    let mut inodes = sockets.get(&port).into_iter().flatten();
    inodes.any(|inode| own.contains(Path::new(&format!("socket:[{inode}]"))))
}

/// Returns the sockets of this network namespace, those that were closed meanwhile among them. `None` if the system does
/// not list them.
pub(super) fn read_all_sockets() -> Option<Sockets> {
    let mut all = Sockets::new();
    for sockets in std::iter::repeat_with(read_sockets).take(READINGS).flatten() {
        sockets.into_iter().for_each(|(port, inodes)| all.entry(port).or_default().extend(inodes));
    }
    Some(all).filter(|all| !all.is_empty())
}

/// Returns sockets of this network namespace. `None` if the system does not list them: this process has some. The kernel
/// lists them in parts: if a socket is closed between two parts, one behind it is missed.
pub(super) fn read_sockets() -> Option<Sockets> {
    let tables = TABLES.map(|table| std::fs::read_to_string(table).unwrap_or_default());
    Some(sockets(&tables.concat())).filter(|sockets| !sockets.is_empty())
}

/// Reads a table of sockets: a line for each, with the local address as `ADDRESS:PORT`, in hexadecimal digits, in the
/// second column and the inode in the tenth.
fn sockets(table: &str) -> Sockets {
    let mut sockets = Sockets::new();
    for line in table.lines() {
        let columns: Vec<&str> = line.split_whitespace().collect();
        let [_, local, _, _, _, _, _, _, _, inode, ..] = columns[..] else { continue };
        let port = local.rsplit_once(':').and_then(|(_, port)| u16::from_str_radix(port, 16).ok());
        if let (Some(port), Ok(inode)) = (port, inode.parse()) {
            sockets.entry(port).or_default().insert(inode);
        }
    }
    sockets
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

    use super::*;

    /// Domains that no other test uses. Their ports are given to no one who asks for any.
    const DOMAIN: u16 = 101;
    const OTHERS: u16 = 100;

    fn bound(port: Option<u16>) -> std::io::Result<UdpSocket> {
        UdpSocket::bind((Ipv4Addr::UNSPECIFIED, port.unwrap()))
    }

    #[test]
    fn a_number_whose_second_port_is_taken_is_occupied() {
        assert_eq!((discovery_port(0, 0), user_port(0, 3)), (Some(7410), Some(7417)));
        assert_eq!(user_port(232, 119), None);
        let taken = bound(user_port(DOMAIN, 0)).unwrap();
        let occupied = occupy(DOMAIN);
        let ports: Vec<_> = occupied.iter().map(|socket| socket.local_addr().unwrap().port()).collect();
        assert_eq!(ports, [discovery_port(DOMAIN, 0).unwrap()]);
        assert!(bound(discovery_port(DOMAIN, 1)).is_ok() && bound(user_port(DOMAIN, 1)).is_ok());
        assert!(is_own(DOMAIN, 0) && !is_own(DOMAIN, 1));
        drop((taken, occupied));
        assert!(occupy(DOMAIN).is_empty());
    }

    #[test]
    fn no_socket_is_missed_while_others_come_and_go() {
        // The kernel lists this port behind those of the others.
        let kept = bound(user_port(DOMAIN, 2)).unwrap();
        let port = kept.local_addr().unwrap().port();
        let is_over = AtomicBool::new(false);
        let missed = std::thread::scope(|scope| {
            for port in [discovery_port, user_port] {
                let is_over = &is_over;
                scope.spawn(move || {
                    while !is_over.load(Relaxed) {
                        drop((0..60).map(|participant| bound(port(OTHERS, participant))).collect::<Vec<_>>());
                    }
                });
            }
            let is_missed = |_: &u8| read_all_sockets().is_none_or(|all| !all.contains_key(&port));
            let missed = (0..30).filter(is_missed).count();
            is_over.store(true, Relaxed);
            missed
        });
        assert_eq!(missed, 0);
    }

    /// Lines of Linux 6.1.
    #[test]
    fn a_table_has_ports_and_inodes() {
        let table = "   sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode ref pointer drops\n\
             \x20 123: 00000000:1CF3 00000000:0000 07 00000000:00000000 00:00000000 00000000     0        0 4026 2 0000000000000000 0\n\
             \x20 124: 0100007F:1CF3 00000000:0000 07 00000000:00000000 00:00000000 00000000     0        0 4027 2 0000000000000000 9\n\
             \x20 200: 00000000000000000000000000000000:1CE8 00000000000000000000000000000000:0000 07 00000000:00000000 00:00000000 00000000     0        0 77 2 0000000000000000 0\n";
        assert_eq!(
            sockets(table),
            BTreeMap::from([(7411, BTreeSet::from([4026, 4027])), (7400, BTreeSet::from([77]))])
        );
    }
}
