//! Whoever publishes a topic of the robot: that it is one node, and how its clock stands against the arrival of its messages.
//!
//! A message arrives after its stamp by the difference of two clocks, which is the same for all messages of a publisher, and by
//! its way over the bus, which is never shorter than nothing and often longer. So the smallest of the newest messages is kept:
//! load and jitter delay many of them, seldom all. The difference of this between two publishers is that of their clocks.

use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

/// The smallest of the messages of this time is taken ...
const WINDOW: Duration = Duration::from_secs(1);
/// ... and of at least so many messages, where there are fewer in it ...
const AT_LEAST: usize = 10;
/// ... but of none that is older: a probe's level is published once a second at least.
const LONGEST: Duration = Duration::from_secs(10);
/// Fewer messages say nothing of a clock: one late message of a few is not rare.
const ENOUGH: usize = 5;
/// ns; stamps that go back by less are messages of several threads of one node that passed each other.
const PASSED: i64 = 1_000_000;
/// A node that has published nothing for this long has left the topic.
const LEFT: Duration = Duration::from_secs(1);

/// Who publishes a topic, and when.
#[derive(Debug)]
pub(super) struct Publisher {
    topic: String,
    /// Arrival of each message, and its arrival minus its stamp, ns; the first counts from `epoch`.
    messages: VecDeque<(Instant, i64)>,
    epoch: Option<Instant>,
    newest: i64,
    /// Nodes that were heard, with the instant of their last message; the last one is the newest.
    nodes: Vec<([u8; 16], Instant)>,
}

impl Publisher {
    pub(super) fn new(topic: &str) -> Self {
        Self {
            topic: topic.to_owned(),
            messages: VecDeque::new(),
            epoch: None,
            newest: i64::MIN,
            nodes: Vec::new(),
        }
    }

    pub(super) fn topic(&self) -> &str {
        &self.topic
    }

    /// Takes a message with its stamp, ns by the publisher's clock.
    ///
    /// # Errors
    /// A sentence: another node publishes the topic as well, or the clock has gone back.
    pub(super) fn hear(
        &mut self,
        arrival: Instant,
        stamp: i64,
        node: [u8; 16],
    ) -> Result<(), String> {
        let alone = self.is_alone(arrival, node);
        let back = self.newest.saturating_sub(stamp);
        let went_back = self.newest != i64::MIN && back > PASSED;
        if went_back {
            self.messages.clear();
        }
        self.newest = if went_back {
            stamp
        } else {
            self.newest.max(stamp)
        };
        let epoch = *self.epoch.get_or_insert(arrival);
        let since = arrival.saturating_duration_since(epoch).as_nanos() as i64;
        self.messages
            .push_back((arrival, since.saturating_sub(stamp)));
        self.forget_old(arrival);
        if !alone {
            return Err(format!(
                "two nodes publish {}: it must have one publisher",
                self.topic
            ));
        }
        if went_back {
            return Err(format!(
                "the stamps of {} have gone back by {:.1} ms",
                self.topic,
                back as f64 * 1e-6
            ));
        }
        Ok(())
    }

    /// False where a node goes on that another has taken over from: both publish. One that was started anew is another node.
    fn is_alone(&mut self, arrival: Instant, node: [u8; 16]) -> bool {
        self.nodes
            .retain(|(_, last)| arrival.saturating_duration_since(*last) < LEFT);
        let known = self.nodes.iter().position(|(id, _)| *id == node);
        let alone = known.is_none_or(|index| index + 1 == self.nodes.len());
        if let Some(index) = known {
            self.nodes.remove(index);
        }
        self.nodes.push((node, arrival));
        alone
    }

    fn forget_old(&mut self, arrival: Instant) {
        let age = |first: Option<&(Instant, i64)>| {
            first.map_or(Duration::ZERO, |(at, _)| {
                arrival.saturating_duration_since(*at)
            })
        };
        while age(self.messages.front()) > LONGEST
            || (self.messages.len() > AT_LEAST && age(self.messages.front()) > WINDOW)
        {
            self.messages.pop_front();
        }
    }

    /// The smallest arrival minus stamp, ns since `epoch` of whoever is compared; `None`: too few messages yet.
    fn lead(&self, epoch: Instant) -> Option<i64> {
        let own = self.epoch?;
        let shift = own.checked_duration_since(epoch).map_or_else(
            || -(epoch.saturating_duration_since(own).as_nanos() as i64),
            |later| later.as_nanos() as i64,
        );
        if self.messages.len() < ENOUGH {
            return None;
        }
        let smallest = self.messages.iter().map(|(_, lead)| *lead).min()?;
        Some(smallest.saturating_add(shift))
    }

    /// By how much the clock of this publisher is ahead of another's, ns; `None`: too few messages yet.
    pub(super) fn ahead_of(&self, other: &Self) -> Option<i64> {
        let epoch = self.epoch?;
        Some(other.lead(epoch)?.saturating_sub(self.lead(epoch)?))
    }

    /// By how much one message of another topic is stamped ahead of this publisher's clock, ns: negative where it has been late.
    pub(super) fn ahead(&self, arrival: Instant, stamp: i64) -> Option<i64> {
        let epoch = self.epoch?;
        let since = arrival.saturating_duration_since(epoch).as_nanos() as i64;
        Some(
            self.lead(epoch)?
                .saturating_sub(since.saturating_sub(stamp)),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ONE: [u8; 16] = [1; 16];
    const TWO: [u8; 16] = [2; 16];

    fn ms(count: u64) -> Duration {
        Duration::from_millis(count)
    }

    #[test]
    fn two_nodes_of_one_topic_are_told_and_one_that_was_started_anew_is_not() {
        let begin = Instant::now();
        let mut both = Publisher::new("/joint_states");
        let mut told = Vec::new();
        for (at, node) in [(0, ONE), (4, ONE), (5, TWO), (8, ONE), (12, ONE), (35, TWO)] {
            told.push(both.hear(begin + ms(at), at as i64, node).is_err());
        }
        assert_eq!(told, [false, false, false, true, false, true]);
        let mut anew = Publisher::new("/joint_states");
        for (at, node) in [(0, ONE), (4, ONE), (900, TWO), (904, TWO), (2100, ONE)] {
            anew.hear(begin + ms(at), at as i64, node)
                .expect("one at a time");
        }
    }

    #[test]
    fn late_messages_do_not_move_a_clock_and_few_say_nothing() {
        let begin = Instant::now();
        let (mut joints, mut contact) = (Publisher::new("/joints"), Publisher::new("/contact"));
        for number in 0..10_u64 {
            // Nine of ten messages are late by up to 90 ms; the contact's clock is 7 ms behind.
            let sent = ms(100 * number);
            let late = ms(10 * (number % 10));
            let stamp = 1_700_000_000_000_000_000 + sent.as_nanos() as i64;
            joints.hear(begin + sent, stamp, ONE).expect("in order");
            contact
                .hear(begin + sent + late, stamp - 7_000_000, TWO)
                .expect("in order");
            let known = joints.ahead_of(&contact);
            assert_eq!(known.is_some(), number >= 4);
        }
        assert_eq!(joints.ahead_of(&contact), Some(7_000_000));
    }

    #[test]
    fn a_clock_that_goes_back_is_told_by_how_much() {
        let begin = Instant::now();
        let mut one = Publisher::new("/joints");
        one.hear(begin, 5_000_000_000, ONE).expect("the first");
        one.hear(begin, 4_999_500_000, ONE).expect("passed");
        let told = one.hear(begin + ms(4), 3_000_000_000, ONE);
        let told = told.expect_err("it has gone back");
        assert_eq!(told, "the stamps of /joints have gone back by 2000.0 ms");
    }
}
