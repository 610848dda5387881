//! `fixture.shift`: the clamped part sits off its nominal place.
//!
//! d = n·t, t in the part frame. Typical 5–100 µm, of a part that lies as
//! somebody put it some millimetres. A part cut in this clamping lies where it was cut: it cannot show.

use machine::Chain;

use crate::effect::{ActsOn, Constants, Effect, Instance, Registration, Subject};
use crate::library::{ChainError, Parameter, Variant};
use crate::observation::Observations;

pub(super) struct FixtureShift;

impl Effect for FixtureShift {
    fn id(&self) -> &'static str {
        "fixture.shift"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "the clamped part sits off its nominal place".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "set the work offset from datum touches, or clean and clamp again"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        parameters()
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn {
            registration: Registration::Part,
            ..ActsOn::of(Subject::Session)
        }
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        if rows.cut_here {
            return Vec::new();
        }
        vec![way()]
    }

    fn declared(&self, _: &Chain, _: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        vec![way()]
    }
}

fn parameters() -> Vec<Parameter> {
    ["x", "y", "z"]
        .map(|name| Parameter::new(name, "m", 1e-2))
        .into()
}

fn way() -> Variant {
    Variant::linear("fixture.shift", parameters(), |rows| {
        [0, 1, 2]
            .map(|k| rows.machine_column(false, |pose, _| pose.sensitivity.part[k]))
            .into()
    })
    .with_errors([0, 1, 2].map(ChainError::Part))
}

#[cfg(test)]
mod tests {
    use crate::specimen::predicts;

    #[test]
    fn a_shifted_part_meets_the_ball_along_the_normal() {
        predicts(
            "fixture.shift",
            &[("x", 2e-5, "m"), ("z", -1e-5, "m")],
            |seen| 2e-5 * seen.row.normal.x - 1e-5 * seen.row.normal.z,
        );
    }
}
