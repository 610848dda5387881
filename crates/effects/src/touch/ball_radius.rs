//! `probe.ball_radius`: the effective ball is larger by dr than stored; constant pretravel counts with it (ISO 230-10).
//!
//! d = dr for every touch, whatever its direction. Typical 1–15 µm. A single feed cannot separate it from latency, and a part
//! cut too large looks the same unless something else measured it.

use crate::effect::{ActsOn, Definition, Effect, Subject};
use crate::variant::Variant;
use inference::discrepancy::Covariate;

pub(super) struct BallRadius;

impl Effect for BallRadius {
    fn definition(&self) -> Definition {
        Definition {
            id: "probe.ball_radius",
            name: "effective ball radius wrong, constant pretravel included",
            remedy: "qualify the probe again on a ring gauge or a sphere at the measuring feed",
            parameters: &[("dr", "m", 1e-3)],
            acts_on: ActsOn::of(Subject::Probe).covariates(&[Covariate::Feed]),
        }
    }

    fn variant(&self) -> Option<Variant> {
        let parameters = self.definition().parameters();
        let variant = Variant::linear(self.id(), parameters, |rows| {
            vec![rows.reading_column(|_| 1.0)]
        });
        Some(variant)
    }
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    #[test]
    fn every_touch_reads_the_same_error() {
        predicts("probe.ball_radius", &[("dr", 3e-6, "m")], |seen| {
            assert!(seen.row.pose.is_some());
            3e-6
        });
    }
}
