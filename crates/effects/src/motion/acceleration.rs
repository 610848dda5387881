//! `motion.<A>.acceleration`: an axis gathers speed slower or faster than declared.
//!
//! A move that reaches top speed v takes v·(1/a′ − 1/a) longer, a short one of length d takes 2·√d·(1/√a′ − 1/√a).

use super::axis_limit::{AxisLimit, Tried};

/// Least and longest time to top speed where no acceleration is declared, s.
const RAMPS: [f64; 2] = [2e-3, 3.0];

pub(super) const ACCELERATION: AxisLimit = AxisLimit {
    id: "motion.<A>.acceleration",
    name: "acceleration",
    description: "acceleration of axis <A> other than declared",
    remedy: "declare the acceleration that the axis reaches under [motion], or set the controller to what is declared",
    units: ["m/s²", "rad/s²"],
    largest: 10.0,
    tried: |limits| match limits.acceleration {
        Some(declared) => Tried::Around(declared),
        None => Tried::Between([1, 0].map(|end| limits.velocity / RAMPS[end])),
    },
    set: |limits, value| limits.acceleration = Some(value),
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::MotionEffect;
    use crate::motion::specimen::{longer, moves};

    /// Half the acceleration: by hand for a trapezoid, whose jerk adds the same where the ramp still holds it.
    #[test]
    fn a_move_at_top_speed_takes_v_over_a_longer() {
        let limit = &ACCELERATION.limits(&moves())[0];
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
