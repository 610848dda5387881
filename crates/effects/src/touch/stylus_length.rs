//! `probe.stylus_length`: the ball centre off along the probe mount's z.
//!
//! d = −n·R(mount)·(0, 0, dz). Typical 2–50 µm.

use machine::Chain;

use crate::effect::{ActsOn, Constants, Effect, Instance, Registration, Subject};
use crate::library::{ChainError, Parameter, Variant};
use crate::observation::Observations;

pub(super) struct StylusLength;

impl Effect for StylusLength {
    fn id(&self) -> &'static str {
        "probe.stylus_length"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "stylus longer or shorter than declared".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "measure the length of the probe again on a datum surface"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        parameters()
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn {
            registration: Registration::ProbeOfArm,
            ..ActsOn::of(Subject::Probe)
        }
    }

    fn offer(&self, _: &Observations) -> Vec<Variant> {
        vec![way()]
    }

    fn declared(&self, _: &Chain, _: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        vec![way()]
    }
}

fn parameters() -> Vec<Parameter> {
    vec![Parameter::new("dz", "m", 3e-4)]
}

fn way() -> Variant {
    Variant::linear("probe.stylus_length", parameters(), |rows| {
        vec![rows.machine_column(false, |pose, _| pose.sensitivity.mount[2])]
    })
    .with_errors([ChainError::Ball(2)])
}

#[cfg(test)]
mod tests {
    use crate::specimen::predicts;

    #[test]
    fn a_longer_probe_is_seen_along_its_axis() {
        predicts("probe.stylus_length", &[("dz", 2e-5, "m")], |seen| {
            -seen.normal.z * 2e-5
        });
    }
}
