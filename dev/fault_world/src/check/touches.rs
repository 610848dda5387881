//! Touches: from the driver's trigger to the event.

use std::collections::{BTreeMap, BTreeSet};

use graph::{Published, topics};
use probecell_msgs::{Fault, ProbeEvent, ProbeTrigger};

use super::{Findings, Invariant, read};
use crate::traffic::Taken;

/// Touches of all sessions of the driver. Plans are of one session: a part ends with it.
#[derive(Default)]
pub(super) struct Touches {
    /// Plan and number of each trigger.
    triggers: BTreeSet<(String, u64)>,
    /// Of those that the process of `probe_events` that runs now has taken and not published.
    held: BTreeSet<(String, u64)>,
    events: BTreeMap<(String, u64), ProbeEvent>,
    numbers: BTreeMap<String, BTreeSet<u64>>,
    unusable: usize,
}

impl Touches {
    pub(super) fn new_session(&mut self) {
        self.events.clear();
    }

    pub(super) fn ended(&mut self, node: &str) {
        if node == "probe_events" {
            // What it held ends with it: the next number tells subscribers.
            self.held.clear();
        }
    }

    pub(super) fn taken(&mut self, taken: &Taken) {
        if taken.topic == topics::PROBE_TRIGGERS.name && taken.by == "probe_events" {
            let trigger: ProbeTrigger = read(&taken.payload);
            let key = (trigger.plan_id, trigger.sequence);
            if !self.events.contains_key(&key) {
                self.held.insert(key);
            }
        }
    }

    pub(super) fn published(&mut self, published: &Published, findings: &mut Findings) {
        if published.topic == topics::PROBE_TRIGGERS.name {
            let trigger: ProbeTrigger = read(&published.payload);
            let new =
                (self.numbers.entry(trigger.session.clone()).or_default()).insert(trigger.sequence);
            findings.expect(new, Invariant::Number, || {
                format!(
                    "trigger {} comes twice in {}",
                    trigger.sequence, trigger.session
                )
            });
            self.triggers.insert((trigger.plan_id, trigger.sequence));
        } else if published.topic == topics::PROBE_EVENTS.name {
            let event: ProbeEvent = read(&published.payload);
            let key = (event.plan_id.clone(), event.sequence);
            self.held.remove(&key);
            findings.expect(self.triggers.contains(&key), Invariant::TouchLost, || {
                format!("touch {} of {} was never triggered", key.1, key.0)
            });
            let before = self.events.insert(key, event.clone());
            findings.expect(before.is_none(), Invariant::TouchTwice, || {
                format!(
                    "touch {} of {} is published twice",
                    event.sequence, event.plan_id
                )
            });
        } else if published.topic == topics::PROBE_EVENTS_FAULTS.name {
            let fault: Fault = read(&published.payload);
            self.unusable += usize::from(fault.code == "trigger_not_usable");
        }
    }

    /// What was taken is an event, waits for its plan, or was reported as unusable.
    pub(super) fn end(&self, waiting: &[u64], findings: &mut Findings) {
        let silent = (self.held.iter())
            .filter(|(_, number)| !waiting.contains(number))
            .count();
        findings.expect(silent <= self.unusable, Invariant::TouchLost, || {
            format!(
                "{silent} triggers were taken by probe_events and are neither events nor reported: {:?}",
                self.held
            )
        });
    }

    pub(super) fn made(&self) -> usize {
        self.triggers.len()
    }
}
