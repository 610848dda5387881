//! `motion.<A>.jerk`: the acceleration of an axis builds up slower or faster than declared. A move whose ramps hold the
//! acceleration takes a·(1/j′ − 1/j) longer.

use machine::Chain;

use super::{Limit, Moves, UNDECLARABLE, acts_on, of_moving_axes, unit};
use crate::effect::{ActsOn, Effect, Instance};
use crate::library::Parameter;

/// Least and longest time in which the acceleration builds up where no jerk is declared, s.
const RISES: [f64; 2] = [4e-3, 1.0];

pub(super) struct Jerk;

impl Effect for Jerk {
    fn id(&self) -> &'static str {
        "motion.<A>.jerk"
    }

    fn describe(&self, of: &Instance<'_>) -> String {
        format!("jerk of axis {} other than declared", of.axis)
    }

    fn remedy(&self) -> &'static str {
        "declare the jerk that the axis is limited to under [motion], or set the controller to what is declared"
    }

    fn parameters(&self, chain: &Chain, of: &Instance<'_>) -> Vec<Parameter> {
        let unit = unit(of.turns(chain), "m/s³", "rad/s³");
        vec![Parameter::new("jerk", unit, 100.0)]
    }

    fn acts_on(&self) -> ActsOn {
        acts_on()
    }

    fn undeclarable(&self) -> Option<&'static str> {
        Some(UNDECLARABLE)
    }

    fn limits(&self, moves: &Moves) -> Vec<Limit> {
        of_moving_axes(moves, self.id(), |axis, turns, effect, limits| {
            let what = ("jerk", unit(turns, "m/s³", "rad/s³"));
            let limit = match (limits.jerk, limits.acceleration) {
                (Some(declared), _) => Limit::around(effect, what, declared),
                (None, Some(a)) => Limit::between(effect, what, [1, 0].map(|end| a / RISES[end])),
                (None, None) => {
                    let by_speed = |end: usize| limits.velocity / RISES[end].powi(2);
                    Limit::between(effect, what, [1, 0].map(by_speed))
                }
            };
            limit.of_axis(axis, |limits, value| limits.jerk = Some(value))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::specimen::{longer, moves};

    #[test]
    fn a_move_that_holds_its_acceleration_takes_a_over_j_longer() {
        let limit = &Jerk.limits(&moves())[0];
        assert_eq!(
            (limit.effect.as_str(), limit.declared),
            ("motion.X.jerk", Some(50.0))
        );
        // a·(1/j′ − 1/j) = 2·(1/25 − 1/50) = 0.04 s for each move that holds its acceleration. One that does not takes
        // ∛(32·d/j), which is less than 0.05 s more for d ≥ 10 mm; at most three moves, and ramps of less than 0.01 s.
        let longest = longer(limit, 25.0).into_iter().fold(0.0, f64::max);
        assert!(longest > 0.079 && longest < 0.16, "{longest}");
    }
}
