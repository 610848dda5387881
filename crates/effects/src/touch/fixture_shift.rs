//! `fixture.shift`: the clamped part is displaced from its nominal position.
//!
//! d = n·t, t in the part frame. Typical 5–100 µm, or some millimetres for a part that was not
//! aligned. A part cut in this clamping shows none: it was cut in its displaced position.

use crate::effect::{ActsOn, Definition, Effect, Registration, Subject};
use crate::observation::Observations;
use crate::variant::{ChainError, Variant};

pub(super) struct FixtureShift;

impl Effect for FixtureShift {
    fn definition(&self) -> Definition {
        Definition {
            id: "fixture.shift",
            name: "the clamped part is displaced from its nominal position",
            remedy: "set the work offset from datum touches, or clean and clamp again",
            parameters: &[("x", "m", 1e-2), ("y", "m", 1e-2), ("z", "m", 1e-2)],
            acts_on: ActsOn::of(Subject::Session).registered(Registration::Part),
        }
    }

    fn variant(&self) -> Option<Variant> {
        let parameters = self.definition().parameters();
        let variant = Variant::linear(self.id(), parameters, |rows| {
            [0, 1, 2]
                .map(|k| rows.machine_column(false, |pose, _| pose.sensitivity.part[k]))
                .into()
        });
        Some(variant.with_errors([0, 1, 2].map(ChainError::Part)))
    }

    fn is_shown(&self, rows: &Observations) -> bool {
        !rows.cut_here
    }
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    #[test]
    fn a_shifted_part_meets_the_ball_along_the_normal() {
        predicts(
            "fixture.shift",
            &[("x", 2e-5, "m"), ("z", -1e-5, "m")],
            |seen| 2e-5 * seen.row.normal.x - 1e-5 * seen.row.normal.z,
        );
    }
}
