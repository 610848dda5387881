//! `motion.<A>.velocity`: the top speed of an axis is other than declared. A move of length d that reaches it takes
//! d·(1/v′ − 1/v) longer, less what the shorter ramps save.

use machine::Chain;

use super::{Limit, Moves, UNDECLARABLE, acts_on, of_moving_axes, unit};
use crate::effect::{ActsOn, Effect, Instance};
use crate::library::Parameter;

pub(super) struct Velocity;

impl Effect for Velocity {
    fn id(&self) -> &'static str {
        "motion.<A>.velocity"
    }

    fn describe(&self, of: &Instance<'_>) -> String {
        format!("top speed of axis {} other than declared", of.axis)
    }

    fn remedy(&self) -> &'static str {
        "declare the top speed that the axis reaches under [motion], or set the controller to what is declared"
    }

    fn parameters(&self, chain: &Chain, of: &Instance<'_>) -> Vec<Parameter> {
        let unit = unit(of.turns(chain), "m/s", "rad/s");
        vec![Parameter::new("velocity", unit, 1.0)]
    }

    fn acts_on(&self) -> ActsOn {
        acts_on()
    }

    fn undeclarable(&self) -> Option<&'static str> {
        Some(UNDECLARABLE)
    }

    fn limits(&self, moves: &Moves) -> Vec<Limit> {
        of_moving_axes(moves, self.id(), |axis, turns, effect, limits| {
            let what = ("velocity", unit(turns, "m/s", "rad/s"));
            Limit::around(effect, what, limits.velocity)
                .of_axis(axis, |limits, value| limits.velocity = value)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::specimen::{longer, moves};

    #[test]
    fn only_moves_that_reach_it_show_a_lower_speed() {
        let limit = &Velocity.limits(&moves())[1];
        assert_eq!(
            (limit.effect.as_str(), limit.declared),
            ("motion.Y.velocity", Some(0.3))
        );
        let longer = longer(limit, 0.2);
        assert!(longer.iter().any(|s| s.abs() < 1e-12) && longer.iter().any(|s| *s > 0.1));
    }
}
