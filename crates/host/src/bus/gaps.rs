//! Counts what is missing and what came twice, by the sequence numbers on the wire.
//!
//! For streams that nobody can ask again: best effort, publishers without a cache. The first sample of a publisher
//! sets the start, since what came before it was not owed.

use std::collections::BTreeMap;

use super::wire::Gid;

/// What a sequence number says about its sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// The next one.
    InOrder,
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
    pub(crate) fn place(&mut self, publisher: Gid, sequence: u64) -> Place {
        match self.last.get_mut(&publisher) {
            None => {
                self.last.insert(publisher, sequence);
                Place::InOrder
            }
            Some(last) if sequence <= *last => Place::Duplicate,
            Some(last) => {
                let first = *last + 1;
                *last = sequence;
                if sequence == first {
                    Place::InOrder
                } else {
                    Place::AfterGap {
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
        assert_eq!(gaps.place(a, 5), Place::InOrder);
        assert_eq!(gaps.place(b, 1), Place::InOrder);
        assert_eq!(gaps.place(a, 6), Place::InOrder);
        assert_eq!(gaps.place(a, 6), Place::Duplicate);
        assert_eq!(gaps.place(a, 10), Place::AfterGap { first: 7, count: 3 });
        assert_eq!(gaps.place(a, 9), Place::Duplicate);
        assert_eq!(gaps.place(b, 2), Place::InOrder);
    }
}
