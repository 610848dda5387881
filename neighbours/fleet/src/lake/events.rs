//! What was done to a machine and no recording tells: a service, a crash.

use anyhow::bail;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::Lake;
use super::add::{Rows, write};
use super::commit::Commit;
use super::rows::Value;
use super::schema::EVENTS;

/// Something that was done to a machine.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Event {
    /// Name of the machine.
    pub machine: String,
    /// Instant, µs since 1970.
    pub time: i64,
    /// `service`, `crash`, `tool_change` or another word.
    pub kind: String,
    /// What was done.
    pub text: String,
}

impl Lake {
    /// Adds events, and gives how many were new.
    ///
    /// # Errors
    /// An event without machine or kind; the lake cannot be written.
    pub fn add_events(&self, events: &[Event]) -> anyhow::Result<usize> {
        let _lock = self.lock()?;
        let mut commit = Commit::begin(self.root())?;
        let known = self.keys(&EVENTS)?;
        let mut rows = Rows::default();
        let mut count = 0;
        for event in events {
            if event.machine.is_empty() || event.kind.is_empty() {
                bail!("an event needs a machine and a kind");
            }
            let content = format!(
                "{}\n{}\n{}\n{}",
                event.machine, event.time, event.kind, event.text
            );
            let key = super::add::hexadecimal(&Sha256::digest(content));
            if known.contains(&key) {
                continue;
            }
            count += 1;
            rows.push(
                &EVENTS,
                vec![
                    Value::Text(key),
                    event.machine.as_str().into(),
                    Value::Null,
                    Value::Moment(event.time),
                    event.kind.as_str().into(),
                    event.text.as_str().into(),
                ],
            );
        }
        write(&mut commit, &rows)?;
        commit.finish()?;
        Ok(count)
    }
}
