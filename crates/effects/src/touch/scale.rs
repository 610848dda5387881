//! `axis.<A>.scale`: true travel = reading × (1 + k) (ISO 230-2; ISO 841 names the axes).
//!
//! δq = k·q from the axis's zero. Typical 5–50 µm/m for linear axes; a rotary axis with a wrong gear ratio is distinguished from its
//! indexing only over many turns. The geared joints of an arm have whole-numbered ratios and no scale error.

use machine::Chain;

use crate::effect::{ActsOn, Constants, Definition, Effect, Instance, Subject};
use crate::observation::Observations;
use crate::variant::{Parameter, Variant, is_arm};

pub(super) struct Scale;

impl Effect for Scale {
    fn definition(&self) -> Definition {
        Definition {
            id: "axis.<A>.scale",
            name: "scale of axis <A>: its true travel differs from the reading in proportion to it",
            remedy: "calibrate the axis with an interferometer or a step gauge, and correct its scale",
            parameters: &[],
            acts_on: ActsOn::of(Subject::Machine),
        }
    }

    fn parameters(&self, chain: &Chain, of: &Instance<'_>) -> Vec<Parameter> {
        let unit = if of.turns(chain) { "rad/rad" } else { "m/m" };
        vec![Parameter::new("k", unit, 1e-3)]
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        let variants = rows.chain.axis_names().map(Instance::on);
        variants
            .filter_map(|of| self.on_joint(&rows.chain, &of))
            .collect()
    }

    fn declared(&self, chain: &Chain, of: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        self.on_joint(chain, of).into_iter().collect()
    }
}

impl Scale {
    fn on_joint(&self, chain: &Chain, of: &Instance<'_>) -> Option<Variant> {
        let (axis, _) = of.joint(chain)?;
        if of.turns(chain) && is_arm(chain) {
            return None;
        }
        let parameters = self.parameters(chain, of);
        Some(Variant::linear(of.id(self.id()), parameters, move |rows| {
            vec![rows.machine_column(true, |pose, _| {
                pose.sensitivity.axes[axis] * pose.positions[axis]
            })]
        }))
    }
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    #[test]
    fn the_error_grows_from_the_zero_of_the_axis() {
        predicts("axis.X.scale", &[("k", 2e-5, "m/m")], |seen| {
            -seen.normal.x * 2e-5 * seen.position("X")
        });
    }
}
