//! `probe.trigger_latency`: the position is latched `tau` after contact, while the probe moves on at its feed.
//!
//! d = −v·tau. Typical 0.1–3 ms. At a single feed it is a ball radius.

use inference::discrepancy::Covariate;
use machine::Chain;

use crate::effect::{ActsOn, Constants, Effect, Instance, Subject};
use crate::library::{Parameter, Variant};
use crate::observation::Observations;

pub(super) struct TriggerLatency;

impl Effect for TriggerLatency {
    fn id(&self) -> &'static str {
        "probe.trigger_latency"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "trigger latency: the position is latched late".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "qualify the probe at the measuring feed, or measure slower"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        parameters()
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn {
            triggered: true,
            covariates: &[Covariate::Feed],
            ..ActsOn::of(Subject::Probe)
        }
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        if rows.rows.iter().all(|row| row.feed == 0.0) {
            return Vec::new();
        }
        vec![way()]
    }

    fn declared(&self, _: &Chain, _: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        vec![way()]
    }
}

fn parameters() -> Vec<Parameter> {
    vec![Parameter::new("tau", "s", 0.03)]
}

fn way() -> Variant {
    Variant::linear("probe.trigger_latency", parameters(), |rows| {
        vec![rows.reading_column(|row| -row.feed)]
    })
}

#[cfg(test)]
mod tests {
    use crate::specimen::predicts;

    #[test]
    fn the_error_is_feed_times_delay() {
        predicts("probe.trigger_latency", &[("tau", 1e-3, "s")], |seen| {
            -1e-3 * seen.row.feed
        });
    }
}
