//! `probe.trigger_latency`: the position is latched `tau` after contact, while the probe moves on at its feed.
//!
//! d = −v·tau. Typical 0.1–3 ms. At a single feed it is a ball radius.

use crate::effect::{ActsOn, Definition, Effect, Subject};
use crate::observation::Observations;
use crate::variant::Variant;
use inference::discrepancy::Covariate;

pub(super) struct TriggerLatency;

impl Effect for TriggerLatency {
    fn definition(&self) -> Definition {
        Definition {
            id: "probe.trigger_latency",
            name: "trigger latency: the position is latched late",
            remedy: "qualify the probe at the measuring feed, or measure slower",
            parameters: &[("tau", "s", 0.03)],
            acts_on: ActsOn::of(Subject::Probe)
                .triggered()
                .covariates(&[Covariate::Feed]),
        }
    }

    fn variant(&self) -> Option<Variant> {
        let parameters = self.definition().parameters();
        let variant = Variant::linear(self.id(), parameters, |rows| {
            vec![rows.reading_column(|row| -row.feed)]
        });
        Some(variant)
    }

    fn is_shown(&self, rows: &Observations) -> bool {
        rows.rows.iter().any(|row| row.feed != 0.0)
    }
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    #[test]
    fn the_error_is_feed_times_delay() {
        predicts("probe.trigger_latency", &[("tau", 1e-3, "s")], |seen| {
            -1e-3 * seen.row.feed
        });
    }
}
