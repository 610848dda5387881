//! The samples of a stream next to given instants: the diagnosis reads no others.
//!
//! Times in ns since 1970. Samples arrive in the order of their stamps, an instant at most five seconds after its samples.

use std::collections::{BTreeSet, VecDeque};

use serde::{Deserialize, Serialize};

/// How long a sample is kept for an instant that may still arrive, ns.
const KEPT: i64 = 5_000_000_000;

/// Most turning samples that are kept; beyond, every second one goes.
const MAX_TURNING: usize = 10_000;

/// The first sample, those on both sides of each instant, those at which a stream turns, and those of the last five seconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Window<T> {
    first: Option<(i64, T)>,
    kept: Vec<(i64, T)>,
    /// Samples that differ from one of their neighbours in what acts on after it has ended, of all plans.
    turning: Vec<(i64, T)>,
    recent: VecDeque<(i64, T)>,
    /// The sample that was removed from `recent` last.
    removed: Option<(i64, T)>,
    instants: BTreeSet<i64>,
}

impl<T> Default for Window<T> {
    fn default() -> Self {
        Self {
            first: None,
            kept: Vec::new(),
            turning: Vec::new(),
            recent: VecDeque::new(),
            removed: None,
            instants: BTreeSet::new(),
        }
    }
}

impl<T: Clone> Window<T> {
    /// Adds a sample of a stream that acts at the instants alone.
    pub fn push(&mut self, at: i64, sample: T) {
        self.push_turning(at, sample, |_, _| true);
    }

    /// Adds a sample of a stream that acts on; `same` is true for two samples that act alike.
    pub fn push_turning(&mut self, at: i64, sample: T, same: impl Fn(&T, &T) -> bool) {
        if self.first.is_none() {
            self.first = Some((at, sample.clone()));
        }
        self.recent.push_back((at, sample));
        while self.recent.len() > 2 && self.recent[0].0 < at.saturating_sub(KEPT) {
            let (next, turns) = (
                self.recent[1].0,
                !same(&self.recent[0].1, &self.recent[1].1),
            );
            let Some((stamp, sample)) = self.recent.pop_front() else {
                break;
            };
            let turned = (self.removed.as_ref()).is_some_and(|(_, before)| !same(before, &sample));
            let removed = self.removed.replace((stamp, sample.clone()));
            let before = removed.map_or(i64::MIN, |(stamp, _)| stamp);
            if turns || turned {
                self.turning.push((stamp, sample.clone()));
                if self.turning.len() > MAX_TURNING {
                    let mut index = 0;
                    self.turning.retain(|_| {
                        index += 1;
                        index % 2 == 1
                    });
                }
            }
            // An instant between the samples before and after this one has this one as its neighbour.
            if before <= next && self.instants.range(before..=next).next().is_some() {
                self.kept.push((stamp, sample));
            }
        }
    }

    /// Keeps the samples on both sides of an instant.
    pub fn mark(&mut self, at: i64) {
        self.instants.insert(at);
    }

    /// Discards the instants and their samples when another plan begins; the first sample and the turning ones are kept.
    pub fn begin(&mut self) {
        self.kept.clear();
        self.instants.clear();
    }

    /// True when a sample after that instant has arrived, or none at all.
    pub fn is_past(&self, at: i64) -> bool {
        self.recent.back().is_none_or(|(stamp, _)| *stamp > at)
    }

    /// The samples kept, in order.
    pub fn samples(&self) -> Vec<T> {
        let mut samples: Vec<&(i64, T)> = (self.first.iter())
            .chain(&self.kept)
            .chain(&self.turning)
            .chain(&self.recent)
            .collect();
        samples.sort_by_key(|(stamp, _)| *stamp);
        samples.dedup_by_key(|(stamp, _)| *stamp);
        samples
            .into_iter()
            .map(|(_, sample)| sample.clone())
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples every 10 ms for a minute, instants now and then, marked late; against all samples of the stream.
    #[test]
    fn the_neighbours_of_every_instant_are_kept_and_little_else() {
        let period = 10_000_000;
        let mut window = Window::default();
        let mut instants = Vec::new();
        for number in 0..6000_i64 {
            window.push(number * period, number);
            if number % 777 == 500 {
                // Four seconds ago, between two samples; or on one.
                instants.push((number - 400) * period + if number % 2 == 0 { 3 } else { 0 });
                window.mark(instants[instants.len() - 1]);
            }
        }
        let samples = window.samples();
        for instant in instants {
            let before = instant / period;
            assert!(samples.contains(&before), "before {instant}");
            assert!(samples.contains(&(before + 1)), "behind {instant}");
        }
        assert_eq!(samples[0], 0, "the beginning of time is the first sample");
        assert!(
            samples.is_sorted() && samples.len() < 540,
            "{}",
            samples.len()
        );
    }
}
