//! `probe.trigger_latency`: the position is latched `tau` after contact, while the probe moves on at its feed.
//!
//! d = −v·tau. Typical 0.1–3 ms. At a single feed it is a ball radius.

use super::{Parameter, Variant};
use crate::observation::Observations;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    if observations.rows.iter().all(|row| row.feed == 0.0) {
        return;
    }
    variants.push(Variant::linear(
        "probe.trigger_latency",
        vec![Parameter::new("tau", "s", 0.03)],
        |observations| vec![observations.reading_column(|row| -row.feed)],
    ));
}
