//! `probe.stylus_length`: the ball centre off along the probe mount's z.
//!
//! d = −n·R(mount)·(0, 0, dz). Typical 2–50 µm.

use crate::effect::{ActsOn, Definition, Effect, Registration, Subject};
use crate::variant::{ChainError, Variant};

pub(super) struct StylusLength;

impl Effect for StylusLength {
    fn definition(&self) -> Definition {
        Definition {
            id: "probe.stylus_length",
            name: "stylus longer or shorter than declared",
            remedy: "measure the length of the probe again on a datum surface",
            parameters: &[("dz", "m", 3e-4)],
            acts_on: ActsOn::of(Subject::Probe).registered(Registration::ProbeOfArm),
        }
    }

    fn variant(&self) -> Option<Variant> {
        let parameters = self.definition().parameters();
        let variant = Variant::linear(self.id(), parameters, |rows| {
            vec![rows.machine_column(false, |pose, _| pose.sensitivity.mount[2])]
        });
        Some(variant.with_errors([ChainError::Ball(2)]))
    }
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    #[test]
    fn a_longer_probe_is_seen_along_its_axis() {
        predicts("probe.stylus_length", &[("dz", 2e-5, "m")], |seen| {
            -seen.normal.z * 2e-5
        });
    }
}
