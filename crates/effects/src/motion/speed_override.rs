//! `motion.override`: an override slows down or speeds up rapid moves, probing moves, or both. Top speeds and feeds are
//! multiplied, accelerations stay. Where the recorded axes show the feed of the probing moves, an override of it is what they show.

use super::{MotionEffect, MotionParameter, Moves, acts_on};
use crate::effect::{Definition, Effect, Instance};

pub(super) struct SpeedOverride;

impl Effect for SpeedOverride {
    fn definition(&self) -> Definition {
        Definition {
            id: "motion.override",
            name: "override of rapid moves or feeds other than declared",
            remedy: "turn the override at the controller back, or declare it under [motion]",
            parameters: &[("override", "1", 1.0)],
            acts_on: acts_on(),
        }
    }
}

impl MotionEffect for SpeedOverride {
    fn limits(&self, moves: &Moves) -> Vec<MotionParameter> {
        let declared = moves.declared.program;
        let around =
            |name, value| MotionParameter::around(self.id().to_owned(), (name, "1"), value);
        let both = move |motion: &mut machine::Motion, factor: f64| {
            motion.program.rapid_override = declared.rapid_override * factor;
            motion.program.feed_override = declared.feed_override * factor;
        };
        let speed = around("speed", 1.0).setting(both);
        let rapid = around("rapid", declared.rapid_override)
            .setting(|motion, value| motion.program.rapid_override = value);
        let feed = around("feed", declared.feed_override)
            .setting(|motion, value| motion.program.feed_override = value);
        let seen = moves.feed_seen;
        let of_both = seen.map(|seen| seen.map(|share| share / declared.feed_override));
        [speed.seen(of_both), Some(rapid), feed.seen(seen)]
            .into_iter()
            .flatten()
            .collect()
    }

    fn sized_remedy(&self, _: &Instance<'_>, name: &str, size: &str, instead: &str) -> String {
        format!(
            "declare an override ({name}) of {size}{instead}, or turn the controller's override back"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::specimen::{longer, moves};

    /// At half the feed the probing move takes twice the time.
    #[test]
    fn a_feed_override_acts_on_the_probing_move() {
        let feed = &SpeedOverride.limits(&moves())[2];
        for (row, interval) in longer(feed, 0.5).iter().zip(&moves().intervals) {
            assert!((row - interval.distance / interval.feed).abs() < 1e-12);
        }
    }
}
