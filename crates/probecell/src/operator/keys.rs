//! The operators' keys in force, on a topic, signed by the cell's key.

use std::time::{Duration, Instant};

use cell::{Cell, keys::KeyFolder};
use graph::topics;
use host::{
    bus::{Bus, Publisher},
    bus_qos,
};
use probecell_msgs::to_cdr;
use signatures::{SecretKey, operators};

/// Between two looks at the folder of keys.
const PERIOD: Duration = Duration::from_millis(500);

/// Publishes the list of operators, and each change of it.
pub(super) struct Keys {
    folder: KeyFolder,
    key: SecretKey,
    publisher: Publisher,
    published: Option<u64>,
    looked: Option<Instant>,
    /// What is wrong with the folder, so that it is said once.
    trouble: Option<String>,
}

impl Keys {
    /// Announces the topic.
    pub(super) fn new(bus: &Bus, cell: &Cell) -> anyhow::Result<Self> {
        let folder = KeyFolder::of(cell)?;
        let topic = topics::OPERATOR_KEYS;
        let name = cell.topic(topic.name);
        Ok(Self {
            key: folder.private()?,
            folder,
            publisher: bus.publisher(&name, topic.message, bus_qos(topic.qos))?,
            published: None,
            looked: None,
            trouble: None,
        })
    }

    /// Publishes the list if it is not the one published last. Gives what is wrong with it, when that is new.
    pub(super) fn publish_changes(&mut self) -> Option<String> {
        if self.looked.is_some_and(|last| last.elapsed() < PERIOD) {
            return None;
        }
        self.looked = Some(Instant::now());
        let trouble = self.publish().err().map(|error| format!("{error:#}"));
        let new = trouble.clone().filter(|_| trouble != self.trouble);
        self.trouble = trouble;
        new
    }

    fn publish(&mut self) -> anyhow::Result<()> {
        let operators = self.folder.operators()?;
        if self.published == Some(operators.number) {
            return Ok(());
        }
        let instant = host::now();
        let keys = operators::signed(&self.key, operators.message(instant.header("")));
        self.publisher.publish(to_cdr(&keys), instant.0)?;
        self.published = Some(operators.number);
        Ok(())
    }
}
