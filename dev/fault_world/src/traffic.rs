//! Messages on their routes: late, lost, or twice.

use std::{cell::RefCell, collections::BTreeMap, rc::Rc};

use cell_tests::BEGIN;
use graph::{Link, Published, Stamp};

use crate::fault::{Fault, Kind, Route};

/// A message that has reached a subscriber.
pub(crate) struct Taken {
    pub(crate) now: Stamp,
    pub(crate) topic: String,
    pub(crate) payload: Vec<u8>,
    pub(crate) by: &'static str,
}

/// The routes of messages under the faults of a run.
pub(crate) struct Traffic {
    seed: u64,
    windows: Vec<(Stamp, Stamp, Route, Kind)>,
    last: BTreeMap<(String, &'static str), Stamp>,
    pub(crate) taken: Vec<Taken>,
}

impl Traffic {
    pub(crate) fn new(seed: u64, faults: &[Fault]) -> Self {
        let window = |fault: &Fault| {
            let (route, seconds) = match &fault.kind {
                Kind::Lose(route, seconds, _)
                | Kind::Delay(route, seconds, _)
                | Kind::Repeat(route, seconds, _) => (*route, *seconds),
                _ => return None,
            };
            let begin = BEGIN.after_s(fault.at);
            Some((begin, begin.after_s(seconds), route, fault.kind.clone()))
        };
        Self {
            seed,
            windows: faults.iter().filter_map(window).collect(),
            last: BTreeMap::new(),
            taken: Vec::new(),
        }
    }

    /// All routes are as they should be again.
    pub(crate) fn heal(&mut self) {
        self.windows.clear();
    }
}

/// Shared between the executor, which asks it, and the world, which reads it.
pub(crate) struct Shared(pub(crate) Rc<RefCell<Traffic>>);

impl Link for Shared {
    fn arrivals(&mut self, now: Stamp, published: &Published, to: &'static str) -> Vec<Stamp> {
        self.0.borrow_mut().arrivals(now, published, to)
    }

    fn taken(&mut self, now: Stamp, topic: &str, payload: &[u8], by: &'static str) {
        self.0.borrow_mut().taken.push(Taken {
            now,
            topic: topic.to_owned(),
            payload: payload.to_vec(),
            by,
        });
    }
}

impl Traffic {
    fn arrivals(&mut self, now: Stamp, published: &Published, to: &'static str) -> Vec<Stamp> {
        let key = (published.topic.clone(), to);
        let (mut at, mut lost, mut again) = (now, false, Vec::new());
        for (begin, end, route, kind) in &self.windows {
            let acts =
                now >= *begin && now < *end && route.to == to && route.topic == published.topic;
            if !acts {
                continue;
            }
            // Windows overlap, and each has a chance of its own.
            let numbers = [self.seed, published.sequence, begin.0 as u64];
            let chance = chance(&[route.topic, route.to], &numbers);
            match kind {
                Kind::Lose(_, _, one_in) => lost |= chance.is_multiple_of(u64::from(*one_in)),
                Kind::Delay(_, _, by) => {
                    at = at.max(now.after_s(by * (chance % 1000) as f64 / 999.0));
                }
                Kind::Repeat(_, _, after) => again.push(*after),
                _ => {}
            }
        }
        if lost {
            return Vec::new();
        }
        // On one topic messages keep their order.
        let last = self.last.entry(key).or_insert(at);
        at = at.max(*last);
        *last = at;
        let again = again.into_iter().map(|after| at.after_s(after));
        std::iter::once(at).chain(again).collect()
    }
}

/// A number that depends on all of these and on nothing else (FNV-1a).
pub(crate) fn chance(texts: &[&str], numbers: &[u64]) -> u64 {
    let bytes = texts.iter().flat_map(|text| text.bytes().chain([0]));
    let bytes = bytes.chain(numbers.iter().flat_map(|number| number.to_le_bytes()));
    let hash = bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    // The low bits of FNV-1a depend on the low bits of the input only.
    hash ^ (hash >> 29)
}
