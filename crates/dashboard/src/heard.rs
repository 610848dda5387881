//! Which samples of a publisher have been taken already, while two subscriptions read it or one follows on another.

use std::collections::BTreeMap;

use host::bus::Gid;

/// The last sequence number taken of each publisher; until [`Heard::freeze`], so that it grows no further.
///
/// A subscription that follows on another fetches what publishers of latched topics keep: what the first one took
/// already is not to be taken twice.
#[derive(Debug, Default)]
pub(crate) struct Heard {
    last: BTreeMap<Gid, u64>,
    frozen: bool,
}

impl Heard {
    /// Whether a sample is to be taken: it comes after all that were taken of its publisher, or has no number (0).
    pub(crate) fn is_new(&mut self, publisher: Gid, sequence: u64) -> bool {
        let last = self.last.get(&publisher).copied();
        if sequence != 0 && last.is_some_and(|last| sequence <= last) {
            return false;
        }
        if !self.frozen {
            self.last.insert(publisher, sequence);
        }
        true
    }

    /// From now on there is one subscription, which says nothing twice.
    pub(crate) fn freeze(&mut self) {
        self.frozen = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ONE: Gid = [1; 16];
    const OTHER: Gid = [2; 16];

    #[test]
    fn nothing_is_taken_twice_of_a_publisher_that_two_subscriptions_read() {
        let mut heard = Heard::default();
        let by_first = [1, 2, 3].map(|sequence| heard.is_new(ONE, sequence));
        assert_eq!(by_first, [true; 3]);
        // The second fetches its history; both then read on, and another publisher begins at one.
        let by_second = [1, 2, 3, 4].map(|sequence| heard.is_new(ONE, sequence));
        assert_eq!(by_second, [false, false, false, true]);
        assert!(!heard.is_new(ONE, 4));
        assert!(heard.is_new(OTHER, 1));
        assert!(heard.is_new(OTHER, 0) && heard.is_new(OTHER, 0));
    }

    #[test]
    fn once_frozen_it_holds_no_further_publishers() {
        let mut heard = Heard::default();
        assert!(heard.is_new(ONE, 7));
        heard.freeze();
        assert!(heard.is_new(OTHER, 1) && heard.is_new(ONE, 8));
        assert!(!heard.is_new(ONE, 7));
        assert_eq!(heard.last.len(), 1);
    }
}
