//! Heartbeat supervision: a driver whose machine moves monitors the gate, `machine_state`.
//!
//! The gate publishes a [`GateHeartbeat`] every [`HEARTBEAT_PERIOD`]. A driver stops its machine when no new one has arrived
//! for [`GATE_SILENCE`], or when they come from another process than before: what the former one has started is
//! supervised by nobody.

use probecell_msgs::GateHeartbeat;
use serde::{Deserialize, Serialize};

use crate::Stamp;

/// s between two signs of life of the gate.
pub const HEARTBEAT_PERIOD: f64 = 0.1;
/// s without a sign of life after which a driver stops its machine.
pub const GATE_SILENCE: f64 = 1.0;

/// What a driver knows of the gate.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GateWatch {
    started: u64,
    count: u64,
    heard: Option<Stamp>,
}

impl GateWatch {
    /// Takes a sign of life at the instant `now`. True when it is the first of another process than the one known. A
    /// heartbeat that was counted already, or that comes late from an earlier process, is none. Which process is the later
    /// one, its start tells, unless the wall clock was set back in between: once the known one is silent, any other has
    /// succeeded it.
    pub fn beat(&mut self, now: Stamp, beat: &GateHeartbeat) -> bool {
        let succeeds = beat.started != self.started && self.is_silent(now);
        if !succeeds && (beat.started, beat.count) <= (self.started, self.count) {
            return false;
        }
        let replaced = self.started != 0 && beat.started != self.started;
        (self.started, self.count) = (beat.started, beat.count);
        self.heard = Some(now);
        replaced
    }

    /// Takes a command of the gate as a sign of life.
    pub fn command(&mut self, now: Stamp) {
        self.heard = self.heard.max(Some(now));
    }

    /// No message of the gate has been received for longer than [`GATE_SILENCE`].
    pub fn is_silent(&self, now: Stamp) -> bool {
        self.heard
            .is_none_or(|heard| now.since_s(heard) > GATE_SILENCE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn beat(started: u64, count: u64) -> GateHeartbeat {
        GateHeartbeat {
            started,
            count,
            ..GateHeartbeat::default()
        }
    }

    #[test]
    fn only_a_heartbeat_that_was_not_counted_yet_is_a_sign_of_life() {
        let mut watch = GateWatch::default();
        assert!(watch.is_silent(Stamp(0)));
        assert!(!watch.beat(Stamp(0), &beat(7, 1)));
        assert!(!watch.beat(Stamp(0).after_s(0.1), &beat(7, 2)));
        // What a link delivers late is no evidence of the present.
        for late in [beat(7, 1), beat(7, 2), beat(6, 900)] {
            assert!(!watch.beat(Stamp(0).after_s(1.0), &late));
        }
        assert!(!watch.is_silent(Stamp(0).after_s(1.05)));
        assert!(watch.is_silent(Stamp(0).after_s(1.15)));
    }

    #[test]
    fn another_process_is_told_from_the_known_one() {
        let mut watch = GateWatch::default();
        assert!(!watch.beat(Stamp(0), &beat(7, 30)));
        assert!(watch.beat(Stamp(1), &beat(8, 1)));
        assert!(!watch.beat(Stamp(2), &beat(8, 2)));
    }

    #[test]
    fn a_process_by_a_clock_set_back_succeeds_the_known_one_once_that_is_silent() {
        let mut watch = GateWatch::default();
        let after = |seconds| Stamp(0).after_s(seconds);
        assert!(!watch.beat(after(0.0), &beat(8, 900)));
        assert!(!watch.beat(after(0.9), &beat(7, 1)));
        assert!(watch.is_silent(after(1.1)));
        assert!(watch.beat(after(1.1), &beat(7, 3)));
        assert!(!watch.beat(after(1.2), &beat(7, 4)));
        assert!(!watch.is_silent(after(2.0)));
        assert!(watch.is_silent(after(2.3)));
    }
}
