//! `probe.stylus_offset`: the ball centre off the spindle axis, in the probe mount's x and y.
//!
//! d = −n·R(mount)·(dx, dy, 0). Typical 2–50 µm; touches at two spindle angles 180° apart distinguish it from a shifted
//! fixture.

use crate::effect::{ActsOn, Definition, Effect, Registration, Subject};
use crate::variant::{ChainError, Variant};

pub(super) struct StylusOffset;

impl Effect for StylusOffset {
    fn definition(&self) -> Definition {
        Definition {
            id: "probe.stylus_offset",
            name: "stylus ball off the spindle axis",
            remedy: "centre the stylus, or measure its offset again on a ring or a sphere",
            parameters: &[("dx", "m", 3e-4), ("dy", "m", 3e-4)],
            acts_on: ActsOn::of(Subject::Probe).registered(Registration::ProbeOfArm),
        }
    }

    fn variant(&self) -> Option<Variant> {
        let parameters = self.definition().parameters();
        let variant = Variant::linear(self.id(), parameters, |rows| {
            [0, 1]
                .map(|k| rows.machine_column(false, |pose, _| pose.sensitivity.mount[k]))
                .into()
        });
        Some(variant.with_errors([0, 1].map(ChainError::Ball)))
    }
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    #[test]
    fn the_offset_turns_with_the_spindle() {
        predicts(
            "probe.stylus_offset",
            &[("dx", 2e-5, "m"), ("dy", -1e-5, "m")],
            |seen| {
                let (sin, cos) = seen.position("S").sin_cos();
                let (x, y) = (cos * 2e-5 + sin * 1e-5, sin * 2e-5 - cos * 1e-5);
                -(seen.normal.x * x + seen.normal.y * y)
            },
        );
    }
}
