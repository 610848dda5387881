//! `motion.latency`: the controller waits before each move. A row takes that much longer per move, its probing move
//! included.

use super::{MotionEffect, MotionParameter, Moves, acts_on};
use crate::effect::{Definition, Effect, Instance};

/// Longest delay, s.
const LONGEST: f64 = 5.0;

pub(super) struct Latency;

impl Effect for Latency {
    fn definition(&self) -> Definition {
        Definition {
            id: "motion.latency",
            name: "delay of the controller before each move other than declared",
            remedy: "declare the delay before each move under [motion], or look for what the controller waits for",
            parameters: &[("latency", "s", 0.2)],
            acts_on: acts_on(),
        }
    }
}

impl MotionEffect for Latency {
    fn limits(&self, moves: &Moves) -> Vec<MotionParameter> {
        let declared = moves.declared.program.latency;
        let tried = vec![declared + 0.05];
        let limit =
            MotionParameter::linear(self.id(), ("latency", "s"), declared, tried, [0.0, LONGEST]);
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
