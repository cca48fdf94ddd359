//! The relief of a volatile writer by a second one of the same topic. Pure.
//!
//! For each new subscriber a volatile writer of RustDDS 0.15.1 lists the number of every message that it has written,
//! about 13 bytes each (`RtpsReaderProxy::set_pending_gap_up_to`, `rtps/rtps_reader_proxy.rs:506`). The list stays
//! until the subscriber acknowledges, and a best-effort or killed subscriber never acknowledges. A second writer
//! begins at 1. It writes nothing until the subscribers have discovered it. Then it writes alone, and the first writer
//! stays for the retransmission of its last messages. Held by `a_subscriber_loses_no_message_and_gets_none_twice`.

use std::time::{Duration, Instant};

/// The messages after which a writer is relieved: half an hour at 60 Hz, 1.3 MB for a new subscriber.
const MESSAGES: u64 = 100_000;
/// The time for subscribers to discover the second writer before it writes, and later to request messages of the first
/// one again. Both take about a second. RustDDS reports a match when it knows the subscriber, not when the subscriber
/// knows the writer, and Cyclone DDS drops messages that come before.
const OVERLAP: Duration = Duration::from_secs(10);

/// The state of a relief.
pub(super) struct Relief<Writer> {
    /// Messages of the writer, or since the latest attempt to create a second writer.
    written: u64,
    /// The writer that will write, and the time of its creation.
    next: Option<(Writer, Instant)>,
    /// The writer that has written, and the time of the end of its writing.
    previous: Option<(Writer, Instant)>,
}

impl<Writer> Default for Relief<Writer> {
    fn default() -> Self {
        Self { written: 0, next: None, previous: None }
    }
}

impl<Writer> Relief<Writer> {
    /// Counts a message of the writer.
    pub(super) fn count(&mut self) {
        self.written += 1;
    }

    /// Creates the second writer when it is due. Replaces `writer` by it when the subscribers have discovered it, which
    /// `is_matched` confirms on our side. Returns the first writer after its retransmissions.
    pub(super) fn serve(
        &mut self,
        writer: &mut Writer,
        now: Instant,
        create: impl FnOnce() -> Option<Writer>,
        is_matched: impl FnOnce(&Writer, &Writer) -> bool,
    ) -> Option<Writer> {
        if self.next.is_none() && self.written >= MESSAGES {
            self.next = create().map(|next| (next, now));
            // If that failed, the next attempt comes after as many messages.
            self.written = 0;
        }
        let is_discovered = |(next, created): &mut (Writer, Instant)| {
            now.duration_since(*created) >= OVERLAP && is_matched(writer, next)
        };
        if let Some((next, _)) = self.next.take_if(is_discovered) {
            *self = Self { written: 0, next: None, previous: Some((std::mem::replace(writer, next), now)) };
        }
        let (previous, _) = self.previous.take_if(|(_, ended)| now.duration_since(*ended) >= OVERLAP)?;
        Some(previous)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts `messages`.
    fn write(relief: &mut Relief<u8>, messages: u64) {
        (0..messages).for_each(|_| relief.count());
    }

    #[test]
    fn the_first_writer_stays_until_the_second_is_discovered_and_then_for_retransmissions() {
        let (mut relief, mut writer, start) = (Relief::default(), 1, Instant::now());
        let mut serve = |relief: &mut Relief<u8>, overlaps: f64, is_matched: bool| {
            let mut created = false;
            let create = || {
                created = true;
                Some(2)
            };
            let now = start + OVERLAP.mul_f64(overlaps);
            let ended = relief.serve(&mut writer, now, create, |first, second| {
                assert_eq!((*first, *second), (1, 2));
                is_matched
            });
            (created, writer, ended)
        };
        write(&mut relief, MESSAGES - 1);
        assert_eq!(serve(&mut relief, 0.0, true), (false, 1, None));
        write(&mut relief, 1);
        assert_eq!(serve(&mut relief, 0.0, true), (true, 1, None));
        write(&mut relief, MESSAGES);
        assert_eq!(serve(&mut relief, 0.9, true), (false, 1, None), "too early");
        assert_eq!(serve(&mut relief, 3.0, false), (false, 1, None), "not matched");
        assert_eq!(serve(&mut relief, 3.1, true), (false, 2, None));
        assert_eq!(serve(&mut relief, 4.0, true), (false, 2, None), "retransmissions");
        assert_eq!(serve(&mut relief, 4.2, true), (false, 2, Some(1)));
        assert_eq!(serve(&mut relief, 4.3, true), (false, 2, None));
    }

    #[test]
    fn a_failure_leaves_the_writer_for_as_many_messages() {
        let (mut relief, mut writer, start) = (Relief::default(), 1, Instant::now());
        write(&mut relief, MESSAGES);
        let mut attempts = 0;
        for _ in 0..2 {
            let create = || {
                attempts += 1;
                None
            };
            assert_eq!(relief.serve(&mut writer, start, create, |_, _| true), None);
        }
        assert_eq!((attempts, writer), (1, 1));
    }
}
