//! The readers of one writer, and what the writer owes each of them beyond what RustDDS 0.15.1 does. Pure.
//!
//! In: the matched readers, and each message that is written. Out: [`Owed`], which the writer's topic sends.
//!
//! | reader | is owed | because RustDDS | held by the test |
//! |---|---|---|---|
//! | new, of a transient-local writer | no message but the latest, or those of the lifespan; a volatile one none | offers all that it keeps, whatever the reader's durability and depth (`Writer::matched_reader_update`, `rtps/writer.rs:2074`) | `a_late_subscriber_gets_the_current_alert`, `a_late_volatile_subscriber`, `a_late_subscriber_of_rosout` |
//! | best-effort | an acknowledgement of every message, in its name | waits for it without end (`Writer::remove_all_acked_changes_but_keep_depth`, `rtps/writer.rs:1660`) | `subscribers_that_come_and_go` |
//! | slow, or dead and not known to be | an acknowledgement of old messages, in its name | keeps them for it, and refuses further ones (`WriterSendBuffer::admit_blocking`, `rtps/writer_send_buffer.rs:199`) | `a_stopped_subscriber_stops_no_other`, `a_stopped_client_stops_no_other` |
//!
//! A dead reader leaves with its participant ([`departures`](super::departures)), held by
//! `the_ports_of_a_killed_subscriber`. The tests are those of `tests/ros2/fast_dds`.

use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

use rustdds::GUID;

/// The age from which messages are acknowledged. A new subscriber takes milliseconds, on a busy machine a second.
/// RustDDS ignores the acknowledgement if the reader itself has acknowledged more.
const AGE: Duration = Duration::from_secs(2);
/// The interval of the acknowledgements of a writer. RustDDS removes old messages every six seconds
/// (`rtps/writer.rs:312`).
const INTERVAL: Duration = Duration::from_millis(500);

/// The readers of a writer.
pub(super) struct Readers {
    kind: Kind,
    /// Messages of the writer until now.
    written: u64,
    /// Some of the last counts of messages with their times, the oldest first. With a lifespan, all within it.
    marks: VecDeque<(Instant, u64)>,
    known: BTreeMap<GUID, Reader>,
}

/// The history of a writer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// A reader may request the last messages of this number.
    Volatile(u64),
    /// A late reader that requests the history gets the latest message.
    Latest,
    /// A late reader that requests the history gets the messages of this time.
    Lifespan(Duration),
}

/// The requests of a remote reader.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Requests {
    /// True if the reader requests the history.
    pub(super) transient_local: bool,
    /// True if the reader acknowledges messages.
    pub(super) reliable: bool,
}

struct Reader {
    requests: Requests,
    /// The time at which the reader was first seen.
    since: Instant,
}

/// The debts of a writer at one time.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Owed {
    /// Readers in whose names the first messages of these numbers are acknowledged.
    pub(super) acknowledgements: Vec<(GUID, u64)>,
    /// New readers that must not get the first messages of these numbers.
    pub(super) withheld: Vec<(GUID, u64)>,
}

impl Owed {
    /// Returns what acknowledges all but the latest `kept` of `written` messages in the names of these readers.
    pub(super) fn all_but(kept: u64, written: u64, readers: impl Iterator<Item = GUID>) -> Self {
        let last = written.saturating_sub(kept);
        Self {
            acknowledgements: readers.filter(|_| last > 0).map(|reader| (reader, last)).collect(),
            ..Self::default()
        }
    }
}

impl Readers {
    /// Creates the state of a writer without readers.
    pub(super) fn new(kind: Kind) -> Self {
        Self { kind, written: 0, marks: VecDeque::new(), known: BTreeMap::new() }
    }

    /// Begins again, for a new writer of the same topic.
    pub(super) fn restart(&mut self) {
        *self = Self::new(self.kind);
    }

    /// Counts a message of the writer.
    pub(super) fn count(&mut self, now: Instant) {
        if let Kind::Lifespan(lifespan) = self.kind {
            self.marks.push_back((now, self.written));
            while self.marks.pop_front_if(|(then, _)| now.duration_since(*then) > lifespan).is_some() {}
        }
        self.written += 1;
    }

    /// Returns the messages that a late reader which requests the history gets.
    fn kept(&self, now: Instant) -> u64 {
        match self.kind {
            Kind::Volatile(_) => 0,
            Kind::Latest => self.written.min(1),
            Kind::Lifespan(lifespan) => {
                let first = self.marks.iter().find(|(then, _)| now.duration_since(*then) <= lifespan);
                first.map_or(0, |(_, before)| self.written - before)
            }
        }
    }

    /// Returns the messages of the writer until now.
    pub(super) fn written(&self) -> u64 {
        self.written
    }

    /// Returns true if the writer has no readers.
    pub(super) fn is_empty(&self) -> bool {
        self.known.is_empty()
    }

    /// Returns true if one of the readers, or all of them, request the history.
    pub(super) fn request_history(&self) -> (bool, bool) {
        let mut requests = self.known.values().map(|reader| reader.requests.transient_local);
        (requests.clone().any(|one| one), requests.all(|one| one))
    }

    /// Takes the matched readers of now. Returns what is due.
    pub(super) fn update(&mut self, matched: &BTreeMap<GUID, Requests>, now: Instant) -> Owed {
        self.known.retain(|guid, _| matched.contains_key(guid));
        let new: Vec<(GUID, Requests)> = matched.iter().map(|(guid, requests)| (*guid, *requests)).collect();
        let new: Vec<_> = new.into_iter().filter(|(guid, _)| !self.known.contains_key(guid)).collect();
        self.known.extend(new.iter().map(|(guid, requests)| (*guid, Reader { requests: *requests, since: now })));
        if let Kind::Volatile(depth) = self.kind {
            return Owed { acknowledgements: self.acknowledgements(depth, now), ..Owed::default() };
        }
        let last = |requests: Requests| self.written - if requests.transient_local { self.kept(now) } else { 0 };
        let withheld = new.into_iter().map(|(guid, requests)| (guid, last(requests)));
        Owed { withheld: withheld.filter(|(_, last)| *last > 0).collect(), ..Owed::default() }
    }

    fn acknowledgements(&mut self, depth: u64, now: Instant) -> Vec<(GUID, u64)> {
        let is_due = self.marks.back().is_none_or(|(last, _)| now.duration_since(*last) >= INTERVAL);
        let best_effort = self.known.iter().filter(|(_, reader)| !reader.requests.reliable);
        let best_effort = best_effort.filter(|(_, reader)| is_due || reader.since == now);
        let mut due: Vec<(GUID, u64)> = best_effort.map(|(guid, _)| (*guid, self.written)).collect();
        if is_due {
            self.marks.push_back((now, self.written));
            while let Some((then, written)) = self.marks.pop_front_if(|(then, _)| now.duration_since(*then) >= AGE) {
                let written = written.min(self.written.saturating_sub(depth));
                let reliable = self.known.iter().filter(|(_, reader)| reader.requests.reliable && reader.since <= then);
                due.extend(reliable.map(|(guid, _)| (*guid, written)).filter(|(_, written)| *written > 0));
            }
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RELIABLE: Requests = Requests { transient_local: false, reliable: true };
    const BEST_EFFORT: Requests = Requests { transient_local: false, reliable: false };
    const LATCHED: Requests = Requests { transient_local: true, reliable: true };

    fn guid(number: u8) -> GUID {
        GUID::from_bytes([number; 16])
    }

    fn matched(readers: &[(u8, Requests)]) -> BTreeMap<GUID, Requests> {
        readers.iter().map(|(number, requests)| (guid(*number), *requests)).collect()
    }

    fn write(readers: &mut Readers, messages: u64) {
        (0..messages).for_each(|_| readers.count(Instant::now()));
    }

    #[test]
    fn a_best_effort_reader_has_every_message_and_a_slow_one_those_of_two_seconds_ago() {
        let (mut readers, start) = (Readers::new(Kind::Volatile(10)), Instant::now());
        let both = matched(&[(1, RELIABLE), (2, BEST_EFFORT)]);
        let at =
            |readers: &mut Readers, ms: u64| readers.update(&both, start + Duration::from_millis(ms)).acknowledgements;
        write(&mut readers, 100);
        assert_eq!(at(&mut readers, 0), [(guid(2), 100)], "new");
        write(&mut readers, 20);
        assert_eq!(at(&mut readers, 100), [], "not due");
        assert_eq!(at(&mut readers, 500), [(guid(2), 120)]);
        write(&mut readers, 1);
        assert_eq!(at(&mut readers, 2000), [(guid(2), 121), (guid(1), 100)]);
        // The last ten may be requested however old they are.
        assert_eq!(at(&mut readers, 2500), [(guid(2), 121), (guid(1), 111)]);
    }

    #[test]
    fn of_few_messages_none_is_old() {
        let acknowledged = |written| Owed::all_but(3, written, [guid(1), guid(2)].into_iter()).acknowledgements;
        assert_eq!(acknowledged(3), []);
        assert_eq!(acknowledged(10), [(guid(1), 7), (guid(2), 7)]);
    }

    #[test]
    fn a_reader_of_a_second_ago_has_acknowledged_nothing() {
        let (mut readers, start) = (Readers::new(Kind::Volatile(1)), Instant::now());
        write(&mut readers, 50);
        readers.update(&matched(&[]), start);
        let one = matched(&[(1, RELIABLE)]);
        let later = |ms| start + Duration::from_millis(ms);
        assert_eq!(readers.update(&one, later(1000)), Owed::default());
        assert_eq!(readers.update(&one, later(2000)), Owed::default(), "the mark is older than the reader");
        assert_eq!(readers.update(&one, later(3000)).acknowledgements, [(guid(1), 49)]);
    }

    #[test]
    fn a_new_reader_of_a_latched_topic_gets_the_latest_message_at_most() {
        let (mut readers, now) = (Readers::new(Kind::Latest), Instant::now());
        let owed =
            |readers: &mut Readers, matched: &[(u8, Requests)]| readers.update(&self::matched(matched), now).withheld;
        assert_eq!(owed(&mut readers, &[(1, LATCHED)]), [], "nothing is written");
        write(&mut readers, 3);
        let all = [(1, LATCHED), (2, LATCHED), (3, RELIABLE)];
        assert_eq!(owed(&mut readers, &all), [(guid(2), 2), (guid(3), 3)]);
        assert_eq!(owed(&mut readers, &all), [], "once");
        assert_eq!(readers.request_history(), (true, false));
        // One that comes again is new.
        assert_eq!(owed(&mut readers, &[(1, LATCHED)]), []);
        assert_eq!(owed(&mut readers, &all), [(guid(2), 2), (guid(3), 3)]);
        assert!(!readers.is_empty());
    }

    #[test]
    fn a_late_reader_gets_the_messages_of_the_lifespan() {
        let (mut readers, start) = (Readers::new(Kind::Lifespan(Duration::from_secs(10))), Instant::now());
        let at = |seconds| start + Duration::from_secs(seconds);
        (0..30).for_each(|second| readers.count(at(second)));
        let mut withheld =
            |number, requests, seconds| readers.update(&matched(&[(number, requests)]), at(seconds)).withheld;
        // Messages of seconds 20 to 29 stay, and that of 19 is ten seconds old.
        assert_eq!(withheld(1, LATCHED, 29), [(guid(1), 19)]);
        assert_eq!(withheld(2, LATCHED, 38), [(guid(2), 28)]);
        assert_eq!(withheld(3, LATCHED, 60), [(guid(3), 30)]);
        assert_eq!(withheld(4, RELIABLE, 60), [(guid(4), 30)]);
    }
}
