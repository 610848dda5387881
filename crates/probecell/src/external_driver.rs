//! A driver that others start: whether it is on the bus, by what it announces there.

use std::time::{Duration, Instant};

use cell::Cell;
use graph::{Topic, topics};
use host::bus::{EntityKind, Graph, TypeId};

use crate::operator::ProcessState;

/// Period at which the graph of the bus is read.
const PERIOD: Duration = Duration::from_millis(250);
/// A driver announces its topics one after the other; one that still lacks some after this time lacks them.
const ANNOUNCEMENT: Duration = Duration::from_secs(3);

/// Topics that a driver publishes.
pub(crate) const PUBLISHED: [Topic; 3] = [
    topics::CONTROLLER_STATUS,
    topics::PROBE_TRIGGERS,
    topics::CONTROLLER_REPLIES,
];

/// What is announced on one topic that a driver publishes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Announced {
    /// Nobody publishes it.
    Nothing,
    /// So many publishers of the type.
    Publishers(usize),
    /// Somebody publishes another type, or another version of it: what comes instead of what is expected.
    OtherType {
        /// Type and hash expected.
        expected: String,
        /// Type and hash announced.
        came: String,
    },
}

/// What is announced on a topic.
pub(crate) fn announced(graph: &Graph, namespace: &str, topic: Topic) -> Announced {
    let (name, expected) = (
        format!("{namespace}/{}", topic.name),
        TypeId::from(topic.message),
    );
    let publishers = || {
        let channels = graph.entities().iter().filter_map(|entity| {
            let channel = entity.channel.as_ref()?;
            (entity.kind == EntityKind::Publisher).then_some(channel)
        });
        channels.filter(|channel| channel.name == name)
    };
    // DDS has no hash.
    let is_expected = |ty: &TypeId| {
        ty.dds_name() == expected.dds_name()
            && (ty.hash().is_empty() || ty.hash() == expected.hash())
    };
    let count = publishers()
        .filter(|channel| is_expected(&channel.ty))
        .count();
    if count > 0 {
        return Announced::Publishers(count);
    }
    let type_and_hash = |ty: &TypeId| format!("{} {}", ty.ros_name(), ty.hash());
    publishers()
        .next()
        .map_or(Announced::Nothing, |other| Announced::OtherType {
            expected: type_and_hash(&expected),
            came: type_and_hash(&other.ty),
        })
}

/// A change of the driver that is reported.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    /// It is there, for the first time or again.
    Joined(String),
    /// It was there and has left.
    Left(String),
    /// Something that is there is not as it has to be.
    Wrong(String),
}

/// Watches for the driver of a cell.
pub(crate) struct ExternalDriver {
    namespace: String,
    starts: u32,
    present: bool,
    incomplete_since: Option<Instant>,
    reported: String,
    polled: Option<Instant>,
}

impl ExternalDriver {
    /// Of a cell whose driver others start.
    pub(crate) fn of(cell: &Cell) -> Option<Self> {
        cell.is_driver_external().then(|| Self {
            namespace: cell.namespace(),
            starts: 0,
            present: false,
            incomplete_since: None,
            reported: String::new(),
            polled: None,
        })
    }

    /// It is on the bus, with all its topics.
    pub(crate) fn is_present(&self) -> bool {
        self.present
    }

    /// What the cell waits for, before the driver has come.
    pub(crate) fn waiting(&self) -> String {
        let names = PUBLISHED.map(|topic| format!("{}/{}", self.namespace, topic.name));
        format!(
            "the cell waits for its external driver to publish {}",
            names.join(", ")
        )
    }

    /// As a process of the cell.
    pub(crate) fn state(&self) -> ProcessState {
        ProcessState {
            name: "external".to_owned(),
            running: self.present,
            starts: self.starts,
        }
    }

    /// Reads what is announced on the bus; gives what has changed.
    pub(crate) fn poll(&mut self, graph: impl FnOnce() -> Graph) -> Option<Change> {
        if self.polled.is_some_and(|polled| polled.elapsed() < PERIOD) {
            return None;
        }
        let now = Instant::now();
        self.polled = Some(now);
        self.judge(&graph(), now)
    }

    fn judge(&mut self, graph: &Graph, now: Instant) -> Option<Change> {
        let found = PUBLISHED.map(|topic| (topic.name, announced(graph, &self.namespace, topic)));
        let complete = found
            .iter()
            .all(|(_, one)| matches!(one, Announced::Publishers(_)));
        if self.present && !complete {
            self.present = false;
            self.incomplete_since = None;
            self.reported.clear();
            let text = "the external driver has left the bus; the cell waits for it".to_owned();
            return Some(Change::Left(text));
        }
        if complete && !self.present {
            self.present = true;
            self.starts += 1;
            self.reported.clear();
            let again = if self.starts > 1 { " again" } else { "" };
            return Some(Change::Joined(format!(
                "the external driver is there{again}"
            )));
        }
        let wrong = Self::wrong(&found)?;
        // While the first topics of several are announced, the others are not yet.
        let since = *self.incomplete_since.get_or_insert(now);
        let settled = complete || now.duration_since(since) >= ANNOUNCEMENT;
        if !settled || self.reported == wrong {
            return None;
        }
        self.reported.clone_from(&wrong);
        Some(Change::Wrong(wrong))
    }

    /// What is wrong with what is announced, where anything is announced.
    fn wrong(found: &[(&str, Announced)]) -> Option<String> {
        let is_nothing = |(_, one): &(&str, Announced)| *one == Announced::Nothing;
        if found.iter().all(is_nothing) {
            return None;
        }
        found.iter().find_map(|(topic, one)| match one {
            Announced::Nothing => Some(format!("the external driver does not publish {topic}")),
            Announced::OtherType { expected, came } => Some(format!(
                "the external driver speaks another version: {topic} is {came}, and {expected} is expected"
            )),
            Announced::Publishers(1) => None,
            Announced::Publishers(count) => Some(format!(
                "{count} drivers publish {topic}: all but one have to end"
            )),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn driver() -> ExternalDriver {
        ExternalDriver {
            namespace: "/cell".to_owned(),
            starts: 0,
            present: false,
            incomplete_since: None,
            reported: String::new(),
            polled: None,
        }
    }

    #[test]
    fn nothing_is_told_of_a_driver_that_is_not_there() {
        let mut driver = driver();
        assert_eq!(driver.judge(&Graph::default(), Instant::now()), None);
        assert!(!driver.is_present());
        let waiting = driver.waiting();
        assert!(waiting.contains("/cell/probe_triggers"), "{waiting}");
    }

    #[test]
    fn what_is_wrong_is_named() {
        let there = |count| Announced::Publishers(count);
        let of = |found: [Announced; 3]| {
            let names = PUBLISHED.map(|topic| topic.name);
            let pairs: Vec<_> = names.into_iter().zip(found).collect();
            ExternalDriver::wrong(&pairs)
        };
        assert_eq!(of([there(1), there(1), there(1)]), None);
        assert_eq!(
            of([Announced::Nothing, Announced::Nothing, Announced::Nothing]),
            None
        );
        let two = of([there(2), there(1), there(1)]).unwrap();
        assert!(two.contains("2 drivers publish controller_status"), "{two}");
        let other = Announced::OtherType {
            expected: "a/msg/A RIHS01_1".to_owned(),
            came: "a/msg/A RIHS01_2".to_owned(),
        };
        let version = of([other, there(1), there(1)]).unwrap();
        assert!(
            version.contains("controller_status is a/msg/A RIHS01_2"),
            "{version}"
        );
        let lacks = of([there(1), Announced::Nothing, there(1)]).unwrap();
        assert!(lacks.contains("does not publish probe_triggers"), "{lacks}");
    }
}
