//! Datagrams for a newly matched remote endpoint, repeated for some time: the endpoint may know ours later than RustDDS
//! reports the match, and any datagram can be lost.
//!
//! Old messages are withheld from a new reader of a transient-local topic by a GAP. RustDDS retransmits 5 ms after the
//! reader's request (`NACK_RESPONSE_DELAY`, `rtps/constant.rs:25`); a GAP that comes later leaves the reader with old
//! messages first. Held by the tests of transient-local topics in the table of [`readers`](super::readers).
//!
//! The first requests of a new Fast DDS client are requested again. RustDDS drops a request that comes before its
//! discovery thread has matched the client's writer (`Reader::process_received_data`, `rtps/reader.rs:744`). It then
//! sends an ACKNACK without requests (`Reader::send_preemptive_acknack_to`, `rtps/reader.rs:1426`), which Fast DDS
//! answers after its heartbeat period of 3 s. Without this half of all first calls take 3 s, and a
//! `hold` must not. A writer retransmits the messages that it has and that are not acknowledged; RustDDS
//! drops a message that comes twice. NACK_FRAG and the ACKNACKs of RustDDS have separate counters. Held by
//! `a_hundred_new_clients_each_get_the_answer_to_their_first_call`.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use rustdds::GUID;

use super::wire;

/// The requests that are requested from a new client: as many calls as clients make before the first answer.
const FIRST_REQUESTS: u32 = 4;
/// The times after a match at which requests are requested, in milliseconds. The first one usually suffices.
const REQUEST_TIMES: [u64; 4] = [0, 50, 250, 1000];
/// The time in milliseconds for a new reader to discover the writer.
const WITHHOLD_TIME: u32 = 1000;

/// A datagram from a local endpoint to a remote one.
pub(super) struct Repeated {
    local: GUID,
    remote: GUID,
    subject: Subject,
    since: Instant,
    /// The number of the next round.
    round: u32,
}

enum Subject {
    FirstRequests,
    /// The first messages of this number.
    Withheld(u32),
}

impl Repeated {
    /// Creates the request of the local `reader` for the first messages of `writer`, if `writer` is one of Fast DDS.
    pub(super) fn first_requests(reader: GUID, writer: GUID) -> Option<Self> {
        wire::is_fast_dds(writer).then(|| Self::new(reader, writer, Subject::FirstRequests))
    }

    /// Withholds the first `last` messages of the local `writer` from `reader`.
    pub(super) fn withheld(writer: GUID, reader: GUID, last: u64) -> Self {
        // A writer of events is replaced long before its numbers exceed 32 bits.
        Self::new(writer, reader, Subject::Withheld(u32::try_from(last).unwrap_or(u32::MAX - 1)))
    }

    fn new(local: GUID, remote: GUID, subject: Subject) -> Self {
        Self { local, remote, subject, since: Instant::now(), round: 0 }
    }

    /// Returns the remote endpoint.
    pub(super) fn remote(&self) -> GUID {
        self.remote
    }

    /// Returns the time of a round after the match, `None` after the last round.
    fn time(&self, round: u32) -> Option<Duration> {
        let milliseconds = match self.subject {
            Subject::FirstRequests => REQUEST_TIMES.get(round as usize).copied(),
            Subject::Withheld(_) => (round < WITHHOLD_TIME).then_some(round.into()),
        };
        milliseconds.map(Duration::from_millis)
    }

    /// Sends the datagram if it is due. Returns true if it must be sent again later.
    pub(super) fn serve(&mut self, addresses: &[SocketAddr], now: Instant) -> bool {
        let elapsed = now.duration_since(self.since);
        let is_due = |time: Duration| time <= elapsed;
        if self.time(self.round).is_some_and(is_due) {
            let datagram = match self.subject {
                Subject::FirstRequests => wire::request(self.local, self.remote, 1..=FIRST_REQUESTS, self.round),
                Subject::Withheld(last) => wire::gap(self.local, self.remote, 1..=last),
            };
            wire::send(&datagram, addresses.iter().copied());
            while self.time(self.round).is_some_and(is_due) {
                self.round += 1;
            }
        }
        self.time(self.round).is_some()
    }
}

#[cfg(test)]
mod tests {
    use std::net::UdpSocket;

    use super::*;

    /// Returns the milliseconds at which datagrams come, and that at which the end is reported.
    fn times(mut repeated: Repeated, polls: impl IntoIterator<Item = u64>) -> (Vec<u64>, Option<u64>) {
        let receiver = UdpSocket::bind("127.0.0.1:0").unwrap();
        receiver.set_nonblocking(true).unwrap();
        let address = [receiver.local_addr().unwrap()];
        let mut sent = Vec::new();
        let since = repeated.since;
        for time in polls {
            let continues = repeated.serve(&address, since + Duration::from_millis(time));
            // Loopback delivers within the call.
            if receiver.recv(&mut [0; 200]).is_ok() {
                sent.push(time);
            }
            if !continues {
                return (sent, Some(time));
            }
        }
        (sent, None)
    }

    #[test]
    fn requests_come_at_their_times_and_old_messages_are_withheld_for_a_second() {
        let (local, fast, other) =
            (GUID::from_bytes([9; 16]), GUID::from_bytes([1, 15, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 0, 0, 1, 3]), [1, 16]);
        let mut cyclone = fast.to_bytes();
        cyclone[..2].copy_from_slice(&other);
        assert!(Repeated::first_requests(local, GUID::from_bytes(cyclone)).is_none());
        let requests = Repeated::first_requests(local, fast).unwrap();
        assert_eq!(times(requests, (0..2000).step_by(2)), (vec![0, 50, 250, 1000], Some(1000)));
        // A poll that comes late sends once.
        let requests = Repeated::first_requests(local, fast).unwrap();
        assert_eq!(times(requests, [0, 300, 302, 999, 1500]), (vec![0, 300, 1500], Some(1500)));
        let withheld = Repeated::withheld(local, fast, 3);
        let polls = [0, 1, 1, 5, 400, 998, 999, 1000];
        assert_eq!(times(withheld, polls), (vec![0, 1, 5, 400, 998, 999], Some(999)));
    }
}
