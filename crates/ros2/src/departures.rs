//! Participants that have died without a farewell.
//!
//! RustDDS 0.15.1 sends to a killed participant until its lease ends, and here no lease ends
//! ([`matching`](super::matching)). Meanwhile another participant may have taken its UDP port, and gets messages that are
//! not meant for it: pushes (`Writer::send_message_to_readers`), and repairs that name no participant
//! (`Writer::handle_repair_frags_send_worker`). Parts of a message that a GAP then withdraws make a reader of Fast DDS
//! 2.14 hang ([`gap`](super::wire::gap)). The readers of the dead participant also hold up the others. So this file finds
//! out who has died, and the matches say farewell in its name.
//!
//! In: the addresses of remote endpoints, and the table of UDP sockets of the kernel. Out: the participants whose life
//! sign is due, and those that have died: on this machine those whose sockets are gone, elsewhere those whose addresses
//! belong to a newer participant.
//! A participant lists all addresses of its machine. It is on this machine if all of them are, and it is succeeded by
//! one that lists the same. Machines share single addresses, such as those of the loopback interface or of containers'
//! bridges, but not all. The participants of one process of Cyclone DDS share all, and live side by side.
//!
//! Held by `the_ports_of_a_killed_subscriber_are_silent_within_seconds` and `all_clients_of_one_process_are_answered`.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::net::{SocketAddr, UdpSocket};
use std::ops::Bound;
use std::time::{Duration, Instant};

use super::ports::{Sockets, read_all_sockets, read_sockets};
use super::wire::{Prefix, are_of_one_process};

/// The interval at which sockets are read. Reading takes a fraction of a millisecond, and a new process needs longer to
/// join the network.
const INTERVAL: Duration = Duration::from_millis(20);
/// The interval of the life signs of a participant. RustDDS looks for leases that have ended every two seconds.
const LIFE_SIGN_INTERVAL: Duration = Duration::from_secs(1);
/// The most life signs at one time. RustDDS queues eight (`dds/participant.rs:291`) and drops the others.
const MOST_LIFE_SIGNS: usize = 4;
/// The most participants that are remembered as dead or as having left. Their datagrams can come for some seconds.
const REMEMBERED: usize = 1000;

/// The remote participants of a network.
#[derive(Default)]
pub(super) struct Departures {
    participants: BTreeMap<Prefix, Participant>,
    /// The participants by the order of their discovery, from 1.
    order: BTreeMap<Prefix, u64>,
    discovered: u64,
    /// The participants that have died or left.
    died: VecDeque<Prefix>,
    checked: Option<Instant>,
    /// The participant that was last given a life sign, and the time of it.
    life_sign: Option<(Prefix, Instant)>,
}

#[derive(Default)]
struct Participant {
    addresses: BTreeSet<SocketAddr>,
    /// The sockets that its ports had when they were noted, if it is on this machine.
    sockets: Option<BTreeSet<u64>>,
}

impl Departures {
    /// Notes that a participant has been discovered.
    pub(super) fn discovered(&mut self, participant: Prefix) {
        self.discovered += 1;
        self.order.entry(participant).or_insert(self.discovered);
    }

    /// Notes the addresses of remote endpoints. Returns the dead participants among them, and those that had the same
    /// addresses before: of such participants the latest lives.
    pub(super) fn note(&mut self, endpoints: impl IntoIterator<Item = (Prefix, Vec<SocketAddr>)>) -> Vec<Prefix> {
        let (mut table, mut dead) = (None, Vec::new());
        for (prefix, mut addresses) in endpoints {
            if self.died.contains(&prefix) {
                dead.push(prefix);
                continue;
            }
            if addresses.iter().any(|address| !address.ip().is_loopback()) {
                addresses.retain(|address| !address.ip().is_loopback());
            }
            let participant = self.participants.entry(prefix).or_default();
            let known = participant.addresses.len();
            participant.addresses.extend(addresses);
            if participant.addresses.len() == known {
                continue;
            }
            let table = table.get_or_insert_with(read_all_sockets).as_ref();
            let is_here = participant.addresses.iter().all(|address| is_local(*address));
            let sockets = table.filter(|_| is_here).map(|table| participant.sockets_in(table));
            if sockets.as_ref().is_some_and(BTreeSet::is_empty) && participant.has_no_socket() {
                dead.push(prefix);
            }
            participant.sockets = sockets.filter(|sockets| !sockets.is_empty());
            dead.extend(self.earlier_than_the_latest_at(prefix));
        }
        self.remember(&dead);
        dead
    }

    /// Returns all participants with the addresses of this one but the one that was discovered last, and those of its
    /// process.
    fn earlier_than_the_latest_at(&self, prefix: Prefix) -> Vec<Prefix> {
        let addresses = &self.participants[&prefix].addresses;
        let with = self.participants.iter().filter(|(_, other)| other.addresses == *addresses);
        let with: Vec<Prefix> = with.map(|(prefix, _)| *prefix).collect();
        let latest = with.iter().copied().max_by_key(|prefix| self.order.get(prefix)).unwrap_or(prefix);
        with.into_iter().filter(|prefix| *prefix != latest && !are_of_one_process(*prefix, latest)).collect()
    }

    fn remember(&mut self, dead: &[Prefix]) {
        dead.iter().for_each(|prefix| self.forget(*prefix));
        for prefix in dead.iter().filter(|prefix| !self.died.contains(prefix)).copied().collect::<BTreeSet<_>>() {
            self.died.push_back(prefix);
        }
        self.died.drain(..self.died.len().saturating_sub(REMEMBERED));
    }

    /// Returns the participants of this machine whose sockets are gone. Looks at them if a participant has come or some
    /// time has passed.
    pub(super) fn gone(&mut self, has_come: bool, now: Instant) -> Vec<Prefix> {
        let is_due = has_come || self.checked.is_none_or(|checked| now.duration_since(checked) >= INTERVAL);
        if !is_due || self.participants.is_empty() {
            return Vec::new();
        }
        self.checked = Some(now);
        read_sockets().map_or_else(Vec::new, |sockets| self.gone_from(&sockets))
    }

    fn gone_from(&mut self, table: &Sockets) -> Vec<Prefix> {
        let is_gone = |participant: &Participant| {
            let Some(before) = &participant.sockets else { return false };
            let now = participant.sockets_in(table);
            before.is_disjoint(&now) && (!now.is_empty() || participant.has_no_socket())
        };
        let gone: Vec<Prefix> =
            self.participants.iter().filter(|(_, known)| is_gone(known)).map(|(prefix, _)| *prefix).collect();
        self.remember(&gone);
        gone
    }

    /// Returns true if a participant is on this machine.
    pub(super) fn is_here(&self, participant: Prefix) -> bool {
        self.participants.get(&participant).is_some_and(|participant| participant.sockets.is_some())
    }

    /// Returns the participants whose life sign is due, of those that are not known to have left. They take turns, so
    /// that few are due at one time, however often this is called.
    pub(super) fn due(&mut self, now: Instant) -> Vec<Prefix> {
        let (last, given) = *self.life_sign.get_or_insert(([0; 12], now));
        let step = LIFE_SIGN_INTERVAL / self.participants.len().max(1) as u32;
        let number = (now.duration_since(given).as_nanos() / step.as_nanos()).min(MOST_LIFE_SIGNS as u128) as usize;
        let later = self.participants.range((Bound::Excluded(last), Bound::Unbounded));
        let in_turn = later.chain(self.participants.range(..=last));
        let due: Vec<Prefix> = in_turn.take(number).map(|(prefix, _)| *prefix).collect();
        if let Some(last) = due.last() {
            // After a pause the others do not catch up.
            let given = if number < MOST_LIFE_SIGNS { given + step * number as u32 } else { now };
            self.life_sign = Some((*last, given));
        }
        due
    }

    /// Notes that a participant has said farewell: it never comes back. Its announcements can come after its farewell,
    /// over another socket, when a living participant has its addresses already.
    pub(super) fn left(&mut self, participant: Prefix) {
        self.remember(&[participant]);
    }

    /// Forgets a participant that may come back.
    pub(super) fn forget(&mut self, participant: Prefix) {
        self.participants.remove(&participant);
        self.order.remove(&participant);
    }
}

impl Participant {
    /// Returns the sockets of its ports.
    fn sockets_in(&self, table: &Sockets) -> BTreeSet<u64> {
        self.addresses.iter().filter_map(|address| table.get(&address.port())).flatten().copied().collect()
    }

    /// Returns true if its addresses are free: a reading of the table can miss a socket.
    fn has_no_socket(&self) -> bool {
        self.addresses.iter().all(|address| UdpSocket::bind(address).is_ok())
    }
}

/// Returns true for an address of this machine: sockets can be bound to it.
fn is_local(address: SocketAddr) -> bool {
    UdpSocket::bind((address.ip(), 0)).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const OLD: Prefix = [1; 12];
    const NEW: Prefix = [2; 12];

    fn note(departures: &mut Departures, prefix: Prefix, address: SocketAddr) -> Vec<Prefix> {
        departures.note([(prefix, vec![address])])
    }

    /// A machine with containers: its bridge's address is also that of other machines' bridges.
    #[test]
    fn machines_that_share_some_addresses_end_no_participant_of_each_other() {
        let mut departures = Departures::default();
        let shared: SocketAddr = "172.17.0.1:7411".parse().unwrap();
        let here = free_address();
        for (number, own) in [(1, "198.51.100.1:7411"), (2, "198.51.100.2:7411")] {
            departures.discovered([number; 12]);
            // No socket of this machine has the port of the loopback address.
            let addresses = vec![here, shared, own.parse().unwrap()];
            assert_eq!(departures.note([([number; 12], addresses)]), [[0; 12]; 0]);
        }
        assert_eq!(departures.gone(true, Instant::now()), [[0; 12]; 0]);
    }

    #[test]
    fn a_participant_whose_socket_is_closed_is_gone_at_once() {
        let mut departures = Departures::default();
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let address = socket.local_addr().unwrap();
        let now = Instant::now();
        assert_eq!(note(&mut departures, OLD, address), [[0; 12]; 0]);
        assert_eq!(departures.gone(true, now), [[0; 12]; 0]);
        assert_eq!(note(&mut departures, NEW, free_address()), [NEW], "no socket has this port");
        drop(socket);
        assert_eq!(departures.gone(false, now), [[0; 12]; 0], "looked at a moment ago");
        // The port may have been taken again.
        let _other = UdpSocket::bind(address);
        assert_eq!(departures.gone(true, now), [OLD]);
        assert_eq!(departures.gone(true, now), [[0; 12]; 0], "once");
    }

    /// Returns an address of this machine that no socket has.
    fn free_address() -> SocketAddr {
        UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap()
    }

    #[test]
    fn a_dead_participant_that_is_reported_late_ends_no_living_one() {
        let mut departures = Departures::default();
        departures.discovered(OLD);
        departures.discovered(NEW);
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let address = socket.local_addr().unwrap();
        // The port is that of the new one already when the endpoints of the old one are detected.
        assert_eq!(note(&mut departures, NEW, address), [[0; 12]; 0]);
        assert_eq!(note(&mut departures, OLD, address), [OLD]);
        // A datagram of the old one that comes still later.
        departures.discovered(OLD);
        assert_eq!(note(&mut departures, OLD, address), [OLD]);
        assert_eq!(departures.gone(true, Instant::now()), [[0; 12]; 0]);
    }

    #[test]
    fn a_participant_that_has_left_and_is_reported_later_ends_no_living_one() {
        let mut departures = Departures::default();
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let address = socket.local_addr().unwrap();
        departures.discovered(OLD);
        assert_eq!(note(&mut departures, OLD, address), [[0; 12]; 0]);
        departures.left(OLD);
        departures.discovered(NEW);
        assert_eq!(note(&mut departures, NEW, address), [[0; 12]; 0]);
        departures.discovered(OLD);
        assert_eq!(note(&mut departures, OLD, address), [OLD]);
        assert_eq!(note(&mut departures, NEW, address), [[0; 12]; 0]);
        assert_eq!(departures.participants.keys().collect::<Vec<_>>(), [&NEW]);
        // One whose lease has ended may come back.
        departures.forget(NEW);
        departures.discovered(NEW);
        assert_eq!(note(&mut departures, NEW, address), [[0; 12]; 0]);
    }

    #[test]
    fn a_participant_elsewhere_is_gone_when_a_newer_one_has_its_address() {
        let mut departures = Departures::default();
        departures.discovered(OLD);
        departures.discovered(NEW);
        // Documentation addresses (RFC 5737).
        let [one, other] = ["198.51.100.1:7411", "198.51.100.2:7411"].map(|address| address.parse().unwrap());
        assert_eq!(note(&mut departures, OLD, one), [[0; 12]; 0]);
        assert_eq!(note(&mut departures, OLD, one), [[0; 12]; 0]);
        assert_eq!(note(&mut departures, NEW, other), [[0; 12]; 0], "another machine");
        assert_eq!(departures.gone(true, Instant::now()), [[0; 12]; 0]);
        departures.discovered([3; 12]);
        assert_eq!(note(&mut departures, [3; 12], one), [OLD]);
    }

    /// The names are those of two participants of one process, and of one of another process, of Cyclone DDS 11.0.1.
    #[test]
    fn participants_of_one_process_of_cyclone_share_its_socket() {
        let [one, beside, later] = [[1, 16, 0x7f, 0x1a, 9, 1], [1, 16, 0x7f, 0x1a, 9, 2], [1, 16, 0x33, 0x80, 9, 1]]
            .map(|start| std::array::from_fn(|byte| *start.get(byte).unwrap_or(&7)));
        // A documentation address (RFC 5737).
        for address in [free_address(), "198.51.100.1:7411".parse().unwrap()] {
            let (mut departures, socket) = (Departures::default(), UdpSocket::bind(address));
            for prefix in [one, beside] {
                departures.discovered(prefix);
                assert_eq!(note(&mut departures, prefix, address), [[0; 12]; 0]);
            }
            assert_eq!(departures.gone(true, Instant::now()), [[0; 12]; 0]);
            departures.discovered(later);
            assert_eq!(note(&mut departures, later, address), [one, beside]);
            drop(socket);
        }
    }

    /// RustDDS loses the life signs that do not fit into its queue.
    #[test]
    fn life_signs_take_turns_and_few_are_due_at_once_however_often_one_asks() {
        let (mut departures, start) = (Departures::default(), Instant::now());
        let prefixes: Vec<Prefix> = (1..=40).map(|number| [number; 12]).collect();
        // Documentation addresses (RFC 5737).
        let address = |prefix: Prefix| SocketAddr::from(([198, 51, 100, prefix[0]], 7411));
        prefixes.iter().for_each(|prefix| assert_eq!(note(&mut departures, *prefix, address(*prefix)), [[0; 12]; 0]));
        let mut asked_at = |milliseconds: u64| -> Vec<Prefix> {
            let now = start + Duration::from_millis(milliseconds);
            (0..20).flat_map(|_| departures.due(now)).collect()
        };
        asked_at(0);
        let mut signs = BTreeMap::<Prefix, usize>::new();
        for frame in 1..=180 {
            let due = asked_at(frame * 1000 / 60);
            assert!(due.len() <= MOST_LIFE_SIGNS, "{}", due.len());
            due.into_iter().for_each(|prefix| *signs.entry(prefix).or_default() += 1);
        }
        assert_eq!(signs, prefixes.into_iter().map(|prefix| (prefix, 3)).collect());
        assert_eq!(asked_at(60_000).len(), MOST_LIFE_SIGNS, "after a pause");
        assert_eq!(asked_at(60_000 + 25).len(), 1);
    }

    /// As when the kernel's table misses a line.
    #[test]
    fn a_socket_that_a_table_misses_is_still_there() {
        let mut departures = Departures::default();
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        assert_eq!(note(&mut departures, OLD, socket.local_addr().unwrap()), [[0; 12]; 0]);
        assert_eq!(departures.gone_from(&BTreeMap::from([(1, BTreeSet::from([1]))])), [[0; 12]; 0]);
        drop(socket);
        assert_eq!(departures.gone_from(&BTreeMap::from([(1, BTreeSet::from([1]))])), [OLD]);
    }
}
