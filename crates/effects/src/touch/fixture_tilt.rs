//! `fixture.tilt`: the clamped part is turned off its nominal pose, about the origin of its frame.
//!
//! d = n·(ε × p) to first order; ε is a rotation vector, and its displacement is computed at finite size. Typical
//! 20–200 µrad, up to a degree for a part that was not aligned. A part cut in this clamping shows none: it was cut in its tilted pose.

use crate::effect::{ActsOn, Definition, Effect, Registration, Subject};
use crate::observation::Observations;
use crate::variant::{ChainError, Variant};

pub(super) struct FixtureTilt;

impl Effect for FixtureTilt {
    fn definition(&self) -> Definition {
        Definition {
            id: "fixture.tilt",
            name: "the clamped part is tilted",
            remedy: "align the part by its datums, or clean and clamp again",
            parameters: &[
                ("a", "rad", LARGEST),
                ("b", "rad", LARGEST),
                ("c", "rad", LARGEST),
            ],
            acts_on: ActsOn::of(Subject::Session).registered(Registration::Part),
        }
    }

    fn variant(&self) -> Option<Variant> {
        let parameters = self.definition().parameters();
        let variant = Variant::linear(self.id(), parameters, |rows| {
            [3, 4, 5]
                .map(|k| rows.machine_column(false, |pose, _| pose.sensitivity.part[k]))
                .into()
        });
        Some(variant.with_errors([3, 4, 5].map(ChainError::Part)))
    }

    fn is_shown(&self, rows: &Observations) -> bool {
        !rows.cut_here
    }
}

/// Largest tilt of a part that was not aligned, rad: about a degree.
const LARGEST: f64 = 2e-2;

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

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
