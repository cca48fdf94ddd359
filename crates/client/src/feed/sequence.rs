//! Gaps in the frames of a publisher, and the beginnings of runs. Pure.

/// Follows the `sequence` of received frames, which counts a run's frames without gaps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SequenceTracker {
    latest: Option<Latest>,
}

/// The highest sequence received of the present run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Latest {
    run_id: u64,
    sequence: u64,
}

impl SequenceTracker {
    /// Returns the run of the latest frame; `None` before the first.
    pub fn run(&self) -> Option<u64> {
        self.latest.map(|latest| latest.run_id)
    }

    /// Records a frame. Returns the number of frames missing between the latest frame of its run and this frame, or
    /// `None` for the first received frame of a run. A frame that is not newer than the latest has no gap before it and
    /// closes no gap.
    pub fn advance(&mut self, run_id: u64, sequence: u64) -> Option<u64> {
        match &mut self.latest {
            Some(latest) if latest.run_id == run_id => {
                let step = sequence.saturating_sub(latest.sequence);
                latest.sequence += step;
                Some(step.saturating_sub(1))
            }
            _ => {
                self.latest = Some(Latest { run_id, sequence });
                None
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_frame_that_comes_again_or_too_late_counts_nothing() {
        let mut tracker = SequenceTracker::default();
        let missed: Vec<_> = [3, 3, 1, 5, 4, 6].map(|sequence| tracker.advance(9, sequence)).to_vec();
        assert_eq!(missed, [None, Some(0), Some(0), Some(1), Some(0), Some(0)]);
    }

    #[test]
    fn the_largest_sequences_do_not_overflow() {
        let mut tracker = SequenceTracker::default();
        let missed = [0, u64::MAX, 0, u64::MAX].map(|sequence| tracker.advance(0, sequence));
        assert_eq!(missed, [None, Some(u64::MAX - 1), Some(0), Some(0)]);
    }

    proptest! {
        #[test]
        fn received_and_missed_frames_of_each_run_are_its_span(
            runs in proptest::collection::vec(proptest::collection::btree_set(0..1_u64 << 40, 1..50), 1..8),
        ) {
            let mut tracker = SequenceTracker::default();
            for (run_id, sequences) in runs.iter().enumerate() {
                let sequences: &BTreeSet<u64> = sequences;
                let (mut starts, mut missed) = (0, 0);
                for sequence in sequences {
                    match tracker.advance(run_id as u64, *sequence) {
                        None => starts += 1,
                        Some(gap) => missed += gap,
                    }
                }
                let span = sequences.last().unwrap() - sequences.first().unwrap() + 1;
                prop_assert_eq!(starts, 1);
                prop_assert_eq!(sequences.len() as u64 + missed, span);
            }
        }
    }
}
