//! `fixture.tilt`: the clamped part is turned off its nominal pose, about the origin of its frame.
//!
//! d = n·(ε × p). Typical 20–200 µrad. A part cut in this clamping lies as it was cut: it cannot show.

use machine::Chain;

use crate::effect::{ActsOn, Constants, Effect, Instance, Registration, Subject};
use crate::library::{Parameter, Variant};
use crate::observation::Observations;

pub(super) struct FixtureTilt;

impl Effect for FixtureTilt {
    fn id(&self) -> &'static str {
        "fixture.tilt"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "the clamped part is tilted".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "align the part by its datums, or clean and clamp again"
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
    ["a", "b", "c"]
        .map(|name| Parameter::new(name, "rad", 1e-3))
        .into()
}

fn way() -> Variant {
    Variant::linear("fixture.tilt", parameters(), |rows| {
        [3, 4, 5]
            .map(|k| rows.machine_column(false, |pose, _| pose.sensitivity.part[k]))
            .into()
    })
}

#[cfg(test)]
mod tests {
    use crate::specimen::predicts;

    #[test]
    fn a_tilted_part_lifts_its_far_side() {
        predicts("fixture.tilt", &[("b", 1e-4, "rad")], |seen| {
            let (p, n) = (seen.row.position, seen.row.normal);
            1e-4 * (n.x * p.z - n.z * p.x)
        });
    }
}
