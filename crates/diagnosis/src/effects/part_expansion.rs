//! `thermal.part_expansion`: the part expands with its temperature above 20 °C and nobody compensates.
//!
//! d = alpha·ΔT·n·p about the part's origin, ΔT from the machine state's temperature `part`. 11–23 ppm/K for metals.

use super::{Parameter, Variant};
use crate::observation::Observations;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    if observations.rows.iter().all(|row| row.warmth.is_none()) {
        return;
    }
    variants.push(Variant::linear(
        "thermal.part_expansion",
        vec![Parameter::new("alpha", "1/K", 1e-4)],
        |observations| {
            vec![observations.machine_column(false, |_, row| {
                -row.position.coords * row.warmth.unwrap_or(0.0)
            })]
        },
    ));
}
