//! Processes of the graph that end, stand still, and are started again.

use probecell_msgs::to_cdr;

use super::{Event, Executor};
use crate::{Instance, START, Stamp, journal::Journal, topics};

impl Executor {
    /// Takes back the start of a node, before the first event: nothing reaches it until [`Executor::restart`] starts it.
    pub fn start_later(&mut self, name: &str) {
        if let Some(node) = self.position(name) {
            self.queue.retain(|_, event| event.node() != Some(node));
            self.ended.insert(node);
            self.unstarted.insert(node);
        }
    }

    /// Ends the process of a node at this instant, as SIGKILL does: its state, its timers and its latched messages are lost, and
    /// nothing reaches it until [`Executor::restart`].
    pub fn kill(&mut self, name: &str) {
        let Some(node) = self.position(name) else {
            return;
        };
        // What it has published is delivered.
        self.run_until(self.now);
        let journal = topics::journal_name(name);
        if let Some(message) = self.journals[node].take() {
            self.record(&journal, to_cdr(&message));
        }
        for topic in self.nodes[node].outputs() {
            self.retained.remove(topic.name);
        }
        self.paused.remove(&node);
        self.queue.retain(|_, event| {
            let repeated =
                matches!(event, Event::Arrival { repeat_of, .. } if *repeat_of == Some(node));
            event.node() != Some(node) && !repeated
        });
        self.ended.insert(node);
    }

    /// Restarts a node, as the launcher does when its process has ended: its state, its timers and its latched messages
    /// are lost, and its publications are numbered from 1 again. It receives the latched messages of the others.
    pub fn restart(&mut self, fresh: Box<dyn Instance>) {
        let Some(node) = self
            .nodes
            .iter()
            .position(|node| node.name() == fresh.name())
        else {
            return;
        };
        self.kill(fresh.name());
        self.ended.remove(&node);
        self.now = Stamp(self.now.0 + 1);
        let journal = topics::journal_name(fresh.name());
        let starts = u32::from(!self.unstarted.remove(&node));
        let incarnation = self.journals[node].incarnation() + starts;
        self.journals[node] = Journal::new(fresh.name(), incarnation);
        for topic in fresh.outputs() {
            self.counts.remove(topic.name);
        }
        self.counts.remove(&journal);
        self.nodes[node] = fresh;
        self.run_timer(node, START);
        for port in 0..self.nodes[node].inputs().len() {
            let topic = self.nodes[node].inputs()[port].name;
            let latched = self.retained.get(topic).cloned().unwrap_or_default();
            for (sequence, payload) in latched {
                self.deliver((node, port), sequence, &payload);
            }
        }
    }

    /// Holds the process of a node, as SIGSTOP does, until [`Executor::resume`] or its end.
    pub fn pause(&mut self, name: &str) {
        if let Some(node) = self
            .position(name)
            .filter(|node| !self.ended.contains(node))
        {
            self.paused.entry(node).or_default();
        }
    }

    /// Lets the process of a node go on: its timers are late, and what has arrived meanwhile waits for it.
    pub fn resume(&mut self, name: &str) {
        let held = self
            .position(name)
            .and_then(|node| self.paused.remove(&node));
        for event in held.into_iter().flatten() {
            self.schedule(self.now, event);
        }
    }

    /// Sets the clock of a node to be ahead by so many ns of [`Executor::now`]. Only while its process has ended: the clock
    /// of a process is never set.
    pub fn set_clock(&mut self, name: &str, ahead: i64) {
        if let Some(node) = self.position(name).filter(|node| self.ended.contains(node)) {
            self.clocks[node] = ahead;
        }
    }
}
