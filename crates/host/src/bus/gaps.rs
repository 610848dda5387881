//! Counts what is missing and what came twice, by the sequence numbers on the wire.
//!
//! For streams without recovery: best effort, publishers without a cache. The first sample of a publisher
//! sets the start, since what came before it was not owed.

use std::collections::BTreeMap;

use super::wire::Gid;

/// Position of a sample in the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    /// The next one.
    Consecutive,
    /// `count` samples from number `first` on are missing before it.
    AfterGap { first: u64, count: u64 },
    /// Seen before, or older than one seen.
    Duplicate,
}

/// Last sequence number of every publisher.
#[derive(Debug, Default)]
pub(crate) struct Gaps {
    last: BTreeMap<Gid, u64>,
}

impl Gaps {
    pub(crate) fn classify(&mut self, publisher: Gid, sequence: u64) -> Order {
        match self.last.get_mut(&publisher) {
            None => {
                self.last.insert(publisher, sequence);
                Order::Consecutive
            }
            Some(last) if sequence <= *last => Order::Duplicate,
            Some(last) => {
                let first = *last + 1;
                *last = sequence;
                if sequence == first {
                    Order::Consecutive
                } else {
                    Order::AfterGap {
                        first,
                        count: sequence - first,
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_and_duplicates_are_told_per_publisher() {
        let mut gaps = Gaps::default();
        let (a, b) = ([1; 16], [2; 16]);
        assert_eq!(gaps.classify(a, 5), Order::Consecutive);
        assert_eq!(gaps.classify(b, 1), Order::Consecutive);
        assert_eq!(gaps.classify(a, 6), Order::Consecutive);
        assert_eq!(gaps.classify(a, 6), Order::Duplicate);
        assert_eq!(gaps.classify(a, 10), Order::AfterGap { first: 7, count: 3 });
        assert_eq!(gaps.classify(a, 9), Order::Duplicate);
        assert_eq!(gaps.classify(b, 2), Order::Consecutive);
    }
}
