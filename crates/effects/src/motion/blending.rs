//! `motion.blending`: the controller rounds corners, or stops exactly, other than declared. Successive positioning moves
//! overlap by a share of the shorter of both ramps; a machine without declared ramps has none to share.

use super::{MotionEffect, MotionParameter, Moves, acts_on};
use crate::effect::{Definition, Effect, Instance};

pub(super) struct Blending;

impl Effect for Blending {
    fn definition(&self) -> Definition {
        Definition {
            id: "motion.blending",
            name: "path blending or exact stop other than declared",
            remedy: "declare the blending under [motion], or choose the controller's path mode to match",
            parameters: &[("blending", "1", 1.0)],
            acts_on: acts_on(),
        }
    }
}

impl MotionEffect for Blending {
    fn limits(&self, moves: &Moves) -> Vec<MotionParameter> {
        let declared = moves.declared.program.blending;
        let shares = [0.0, 0.25, 0.5, 0.75, 1.0].into_iter();
        let tried = shares
            .filter(|share| (share - declared).abs() > 0.1)
            .collect();
        let limit =
            MotionParameter::linear(self.id(), ("blending", "1"), declared, tried, [0.0, 1.0]);
        vec![limit.setting(|motion, value| motion.program.blending = value)]
    }

    fn sized_remedy(&self, _: &Instance<'_>, _: &str, size: &str, instead: &str) -> String {
        format!(
            "declare a blending of {size}{instead}, or choose the controller's path mode to match"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::specimen::{longer, moves};

    /// A row saves at each corner at most the ramp: v/a + a/j = 0.19 s.
    #[test]
    fn a_row_saves_time_at_each_corner() {
        let longer = longer(&Blending.limits(&moves())[0], 1.0);
        for (row, interval) in longer.iter().zip(&moves().intervals) {
            let corners = interval.targets.len() as f64 - 1.0;
            assert!(*row < 0.0 && *row > -0.191 * corners, "{row}");
        }
    }
}
