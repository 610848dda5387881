//! `probe.ball_radius`: the effective ball is larger by dr than stored; constant pretravel counts with it (ISO 230-10).
//!
//! d = dr for every touch, whatever its direction. Typical 1–15 µm. One feed cannot part it from latency, and a part
//! cut too large looks the same unless something else measured it.

use inference::discrepancy::Covariate;
use machine::Chain;

use crate::effect::{ActsOn, Constants, Effect, Instance, Subject};
use crate::library::{Parameter, Variant};
use crate::observation::Observations;

pub(super) struct BallRadius;

impl Effect for BallRadius {
    fn id(&self) -> &'static str {
        "probe.ball_radius"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "effective ball radius wrong, constant pretravel included".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "qualify the probe again on a ring gauge or a sphere at the measuring feed"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        parameters()
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn {
            covariates: &[Covariate::Feed],
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
    vec![Parameter::new("dr", "m", 1e-3)]
}

fn way() -> Variant {
    Variant::linear("probe.ball_radius", parameters(), |rows| {
        vec![rows.reading_column(|_| 1.0)]
    })
}

#[cfg(test)]
mod tests {
    use crate::specimen::predicts;

    #[test]
    fn every_touch_reads_the_same_error() {
        predicts("probe.ball_radius", &[("dr", 3e-6, "m")], |seen| {
            assert!(seen.row.pose.is_some());
            3e-6
        });
    }
}
