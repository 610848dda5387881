//! `motion.<A>.velocity`: the top speed of an axis is other than declared. A move of length d that reaches it takes
//! d·(1/v′ − 1/v) longer, less what the shorter ramps save.

use super::axis_limit::{AxisLimit, Tried};

pub(super) const VELOCITY: AxisLimit = AxisLimit {
    id: "motion.<A>.velocity",
    name: "velocity",
    description: "top speed of axis <A> other than declared",
    remedy: "declare the top speed that the axis reaches under [motion], or set the controller to what is declared",
    units: ["m/s", "rad/s"],
    largest: 1.0,
    tried: |limits| Tried::Around(limits.velocity),
    set: |limits, value| limits.velocity = value,
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::MotionEffect;
    use crate::motion::specimen::{longer, moves};

    #[test]
    fn only_moves_that_reach_it_show_a_lower_speed() {
        let limit = &VELOCITY.limits(&moves())[1];
        assert_eq!(
            (limit.effect.as_str(), limit.declared),
            ("motion.Y.velocity", Some(0.3))
        );
        let longer = longer(limit, 0.2);
        assert!(longer.iter().any(|s| s.abs() < 1e-12) && longer.iter().any(|s| *s > 0.1));
    }
}
