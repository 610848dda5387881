//! `thermal.part_expansion`: the part expands with its temperature above 20 °C and nobody compensates (ISO 1, ISO 230-3).
//!
//! d = alpha·ΔT·n·p about the part's origin, ΔT from the machine state's temperature `part`. 11–23 ppm/K for metals.

use machine::Chain;

use crate::effect::{ActsOn, Constants, Effect, Instance, Subject};
use crate::library::{Parameter, Variant};
use crate::observation::Observations;

pub(super) struct PartExpansion;

impl Effect for PartExpansion {
    fn id(&self) -> &'static str {
        "thermal.part_expansion"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "thermal expansion of the part, uncompensated".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "compensate sizes to 20 °C by the part's temperature, or let it cool before measuring"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        parameters()
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn::of(Subject::Part)
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        if rows.rows.iter().all(|row| row.warmth.is_none()) {
            return Vec::new();
        }
        vec![way()]
    }

    fn declared(&self, _: &Chain, _: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        vec![way()]
    }
}

fn parameters() -> Vec<Parameter> {
    vec![Parameter::new("alpha", "1/K", 1e-4)]
}

fn way() -> Variant {
    Variant::linear("thermal.part_expansion", parameters(), |rows| {
        vec![rows.machine_column(false, |_, row| {
            -row.position.coords * row.warmth.unwrap_or(0.0)
        })]
    })
}

#[cfg(test)]
mod tests {
    use crate::specimen::predicts;

    #[test]
    fn a_warm_part_is_larger() {
        predicts(
            "thermal.part_expansion",
            &[("alpha", 1.2e-5, "1/K")],
            |seen| {
                let warmth = seen.row.warmth.expect("a temperature");
                1.2e-5 * warmth * seen.row.normal.dot(&seen.row.position.coords)
            },
        );
    }
}
