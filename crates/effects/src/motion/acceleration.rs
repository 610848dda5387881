//! `motion.<A>.acceleration`: an axis gathers speed slower or faster than declared.
//!
//! A move that reaches top speed v takes v·(1/a′ − 1/a) longer, a short one of length d takes 2·√d·(1/√a′ − 1/√a).

use machine::Chain;

use super::{Limit, Moves, UNDECLARABLE, acts_on, of_moving_axes, unit};
use crate::effect::{ActsOn, Effect, Instance};
use crate::library::Parameter;

/// Least and longest time to top speed where no acceleration is declared, s.
const RAMPS: [f64; 2] = [2e-3, 3.0];

pub(super) struct Acceleration;

impl Effect for Acceleration {
    fn id(&self) -> &'static str {
        "motion.<A>.acceleration"
    }

    fn describe(&self, of: &Instance<'_>) -> String {
        format!("acceleration of axis {} other than declared", of.axis)
    }

    fn remedy(&self) -> &'static str {
        "declare the acceleration that the axis reaches under [motion], or set the controller to what is declared"
    }

    fn parameters(&self, chain: &Chain, of: &Instance<'_>) -> Vec<Parameter> {
        let unit = unit(of.turns(chain), "m/s²", "rad/s²");
        vec![Parameter::new("acceleration", unit, 10.0)]
    }

    fn acts_on(&self) -> ActsOn {
        acts_on()
    }

    fn undeclarable(&self) -> Option<&'static str> {
        Some(UNDECLARABLE)
    }

    fn limits(&self, moves: &Moves) -> Vec<Limit> {
        of_moving_axes(moves, self.id(), |axis, turns, effect, limits| {
            let what = ("acceleration", unit(turns, "m/s²", "rad/s²"));
            let limit = match limits.acceleration {
                Some(declared) => Limit::around(effect, what, declared),
                None => {
                    Limit::between(effect, what, [1, 0].map(|end| limits.velocity / RAMPS[end]))
                }
            };
            limit.of_axis(axis, |limits, value| limits.acceleration = Some(value))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::specimen::{longer, moves};

    /// Half the acceleration: by hand for a trapezoid, whose jerk adds the same where the ramp still holds it.
    #[test]
    fn a_move_at_top_speed_takes_v_over_a_longer() {
        let limit = &Acceleration.limits(&moves())[0];
        assert_eq!(
            (limit.effect.as_str(), limit.declared),
            ("motion.X.acceleration", Some(2.0))
        );
        let longer = longer(limit, 1.0);
        // v/a′ − v/a = 0.15 s, and a′/j − a/j = −0.02 s, for each of the two moves of 0.15 m of X.
        let far = (0..40)
            .filter(|k| k % 2 == 0)
            .max_by(|a, b| longer[*a].total_cmp(&longer[*b]));
        assert!(
            far.is_some_and(|far| longer[far] > 0.2 && longer[far] < 0.4),
            "{longer:?}"
        );
        assert!(longer.iter().all(|s| *s >= -1e-12));
    }
}
