//! `fixture.tilt`: the clamped part is turned off its nominal pose, about the origin of its frame.
//!
//! d = n·(ε × p) to first order; ε is a rotation vector, and its displacement is computed at finite size
//! ([`crate::finite`]). Typical 20–200 µrad, of a part that lies as somebody put it up to a degree. A part cut in this
//! clamping lies as it was cut: it cannot show.

use machine::Chain;

use crate::effect::{ActsOn, Constants, Effect, Instance, Registration, Subject};
use crate::library::{ChainError, Parameter, Variant};
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

/// Largest tilt of a part that nobody has aligned, rad: a degree.
const LARGEST: f64 = 2e-2;

fn parameters() -> Vec<Parameter> {
    ["a", "b", "c"]
        .map(|name| Parameter::new(name, "rad", LARGEST))
        .into()
}

fn way() -> Variant {
    Variant::linear("fixture.tilt", parameters(), |rows| {
        [3, 4, 5]
            .map(|k| rows.machine_column(false, |pose, _| pose.sensitivity.part[k]))
            .into()
    })
    .with_errors([3, 4, 5].map(ChainError::Part))
}

#[cfg(test)]
mod tests {
    use crate::specimen::predicts;

    #[test]
    fn a_tilted_part_lifts_its_far_side() {
        predicts("fixture.tilt", &[("b", 1e-4, "rad")], |seen| {
            let (p, n) = (seen.row.position, seen.row.normal);
            let (sin, rest) = (1e-4_f64.sin(), 1.0 - 1e-4_f64.cos());
            // The part is turned about its y axis: where its point was met, the nominal chain sees it elsewhere.
            let ball = p + 0.003 * n;
            sin * (n.x * ball.z - n.z * ball.x) + rest * (n.x * ball.x + n.z * ball.z)
        });
    }

    /// At 8 mrad the second order of a face 50 mm off the origin is 1.6 µm: no derivative gives it.
    #[test]
    fn a_large_tilt_turns_the_part_by_a_finite_angle() {
        predicts("fixture.tilt", &[("b", 8e-3, "rad")], |seen| {
            let (p, n) = (seen.row.position, seen.row.normal);
            let ball = p + 0.003 * n;
            let (sin, rest) = (8e-3_f64.sin(), 1.0 - 8e-3_f64.cos());
            sin * (n.x * ball.z - n.z * ball.x) + rest * (n.x * ball.x + n.z * ball.z)
        });
    }
}
