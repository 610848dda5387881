//! `probe.stylus_offset`: the ball centre off the spindle axis, in the probe mount's x and y.
//!
//! d = −n·R(mount)·(dx, dy, 0). Typical 2–50 µm; seen twice with the spindle turned by 180°, it parts from a shifted
//! fixture.

use machine::Chain;

use crate::effect::{ActsOn, Constants, Effect, Instance, Registration, Subject};
use crate::library::{ChainError, Parameter, Variant};
use crate::observation::Observations;

pub(super) struct StylusOffset;

impl Effect for StylusOffset {
    fn id(&self) -> &'static str {
        "probe.stylus_offset"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "stylus ball off the spindle axis".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "centre the stylus, or measure its offset again on a ring or a sphere"
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
    vec![
        Parameter::new("dx", "m", 3e-4),
        Parameter::new("dy", "m", 3e-4),
    ]
}

fn way() -> Variant {
    Variant::linear("probe.stylus_offset", parameters(), |rows| {
        [0, 1]
            .map(|k| rows.machine_column(false, |pose, _| pose.sensitivity.mount[k]))
            .into()
    })
    .with_errors([0, 1].map(ChainError::Ball))
}

#[cfg(test)]
mod tests {
    use crate::specimen::predicts;

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
