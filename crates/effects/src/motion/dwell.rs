//! `motion.dwell`: the machine stands still after each touch. Every row takes longer by the same time.

use super::{MotionEffect, MotionParameter, Moves, acts_on};
use crate::effect::{Definition, Effect, Instance};

/// Longest standstill, s.
const LONGEST: f64 = 20.0;

pub(super) struct Dwell;

impl Effect for Dwell {
    fn definition(&self) -> Definition {
        Definition {
            id: "motion.dwell",
            name: "standstill after each touch other than declared",
            remedy: "declare the standstill after each touch under [motion], or shorten it at the controller",
            parameters: &[("dwell", "s", 1.0)],
            acts_on: acts_on(),
        }
    }
}

impl MotionEffect for Dwell {
    fn limits(&self, moves: &Moves) -> Vec<MotionParameter> {
        let declared = moves.declared.program.touch_dwell;
        let tried = vec![declared + 0.1];
        let limit =
            MotionParameter::linear(self.id(), ("dwell", "s"), declared, tried, [0.0, LONGEST]);
        vec![limit.setting(|motion, value| motion.program.touch_dwell = value)]
    }

    fn sized_remedy(&self, _: &Instance<'_>, _: &str, size: &str, instead: &str) -> String {
        format!(
            "declare a standstill of {size} after each touch{instead}, or shorten it at the controller"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::specimen::{longer, moves};

    #[test]
    fn every_row_takes_the_same_time_longer() {
        let longer = longer(&Dwell.limits(&moves())[0], 0.07);
        assert!(longer.iter().all(|s| (s - 0.07).abs() < 1e-12));
    }
}
