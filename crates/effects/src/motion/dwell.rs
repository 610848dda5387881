//! `motion.dwell`: the machine stands still after each touch. Every row takes the same time longer.

use machine::Chain;

use super::{Limit, MotionEffect, Moves, UNDECLARABLE, acts_on};
use crate::effect::{ActsOn, Effect, Instance};
use crate::library::Parameter;

/// Longest standstill, s.
const LONGEST: f64 = 20.0;

pub(super) struct Dwell;

impl Effect for Dwell {
    fn id(&self) -> &'static str {
        "motion.dwell"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "standstill after each touch other than declared".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "declare the standstill after each touch under [motion], or shorten it at the controller"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        vec![Parameter::new("dwell", "s", 1.0)]
    }

    fn acts_on(&self) -> ActsOn {
        acts_on()
    }

    fn undeclarable(&self) -> Option<&'static str> {
        Some(UNDECLARABLE)
    }
}

impl MotionEffect for Dwell {
    fn limits(&self, moves: &Moves) -> Vec<Limit> {
        let declared = moves.declared.program.touch_dwell;
        let tried = vec![declared + 0.1];
        let limit = Limit::linear(self.id(), ("dwell", "s"), declared, tried, [0.0, LONGEST]);
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
