//! `motion.latency`: the controller waits before each move. A row takes as many times longer as it has moves, its probing
//! move included.

use machine::Chain;

use super::{Limit, MotionEffect, Moves, UNDECLARABLE, acts_on};
use crate::effect::{ActsOn, Effect, Instance};
use crate::library::Parameter;

/// Longest delay, s.
const LONGEST: f64 = 5.0;

pub(super) struct Latency;

impl Effect for Latency {
    fn id(&self) -> &'static str {
        "motion.latency"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "delay of the controller before each move other than declared".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "declare the delay before each move under [motion], or look for what the controller waits for"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        vec![Parameter::new("latency", "s", 0.2)]
    }

    fn acts_on(&self) -> ActsOn {
        acts_on()
    }

    fn undeclarable(&self) -> Option<&'static str> {
        Some(UNDECLARABLE)
    }
}

impl MotionEffect for Latency {
    fn limits(&self, moves: &Moves) -> Vec<Limit> {
        let declared = moves.declared.program.latency;
        let tried = vec![declared + 0.05];
        let limit = Limit::linear(self.id(), ("latency", "s"), declared, tried, [0.0, LONGEST]);
        vec![limit.setting(|motion, value| motion.program.latency = value)]
    }

    fn sized_remedy(&self, _: &Instance<'_>, _: &str, size: &str, instead: &str) -> String {
        format!(
            "declare a delay of {size} before each move{instead}, or look for what the controller waits for"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::specimen::{longer, moves};

    #[test]
    fn every_move_of_a_row_waits() {
        let longer = longer(&Latency.limits(&moves())[0], 0.01);
        for (row, interval) in longer.iter().zip(&moves().intervals) {
            let waits = interval.targets.len() as f64 + 1.0;
            assert!((row - 0.01 * waits).abs() < 1e-12);
        }
    }
}
