//! `thermal.part_expansion`: uncompensated thermal expansion of the part above 20 °C (ISO 1, ISO 230-3).
//!
//! d = alpha·ΔT·n·p about the part's origin, ΔT from the machine state's temperature `part`. 11–23 ppm/K for metals.

use crate::effect::{ActsOn, Definition, Effect, Subject};
use crate::observation::Observations;
use crate::variant::Variant;

pub(super) struct PartExpansion;

impl Effect for PartExpansion {
    fn definition(&self) -> Definition {
        Definition {
            id: "thermal.part_expansion",
            name: "thermal expansion of the part, uncompensated",
            remedy: "compensate sizes to 20 °C by the part's temperature, or let it cool before measuring",
            parameters: &[("alpha", "1/K", 1e-4)],
            acts_on: ActsOn::of(Subject::Part),
        }
    }

    fn variant(&self) -> Option<Variant> {
        let parameters = self.definition().parameters();
        let variant = Variant::linear(self.id(), parameters, |rows| {
            vec![rows.machine_column(false, |_, row| {
                -row.position.coords * row.kelvin_above_20_celsius.unwrap_or(0.0)
            })]
        });
        Some(variant)
    }

    fn is_shown(&self, rows: &Observations) -> bool {
        rows.rows
            .iter()
            .any(|row| row.kelvin_above_20_celsius.is_some())
    }
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    #[test]
    fn a_warm_part_is_larger() {
        predicts(
            "thermal.part_expansion",
            &[("alpha", 1.2e-5, "1/K")],
            |seen| {
                let kelvin = seen.row.kelvin_above_20_celsius.expect("a temperature");
                1.2e-5 * kelvin * seen.row.normal.dot(&seen.row.position.coords)
            },
        );
    }
}
