//! `motion.<A>.jerk`: the acceleration of an axis builds up slower or faster than declared. A move whose ramps hold the
//! acceleration takes a·(1/j′ − 1/j) longer.

use super::axis_limit::{AxisLimit, Tried};

/// Least and longest time in which the acceleration builds up where no jerk is declared, s.
const RISES: [f64; 2] = [4e-3, 1.0];

pub(super) const JERK: AxisLimit = AxisLimit {
    id: "motion.<A>.jerk",
    name: "jerk",
    description: "jerk of axis <A> other than declared",
    remedy: "declare the jerk that the axis is limited to under [motion], or set the controller to what is declared",
    units: ["m/s³", "rad/s³"],
    largest: 100.0,
    tried: |limits| match (limits.jerk, limits.acceleration) {
        (Some(declared), _) => Tried::Around(declared),
        (None, Some(a)) => Tried::Between([1, 0].map(|end| a / RISES[end])),
        (None, None) => {
            Tried::Between([1, 0].map(|end| limits.velocity / f64::powi(RISES[end], 2)))
        }
    },
    set: |limits, value| limits.jerk = Some(value),
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::MotionEffect;
    use crate::motion::specimen::{longer, moves};

    #[test]
    fn a_move_that_holds_its_acceleration_takes_a_over_j_longer() {
        let limit = &JERK.limits(&moves())[0];
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
