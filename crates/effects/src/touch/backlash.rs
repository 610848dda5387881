//! `axis.<A>.backlash`: lost motion on reversal (ISO 230-2, reversal error).
//!
//! δq = −½·b·sgn(speed): the slide hangs behind its drive, seen from either side. Typical 1–15 µm.

use machine::Chain;

use crate::effect::{ActsOn, Constants, Effect, Instance, Subject};
use crate::library::{Parameter, Variant};
use crate::observation::Observations;

pub(super) struct Backlash;

impl Effect for Backlash {
    fn id(&self) -> &'static str {
        "axis.<A>.backlash"
    }

    fn describe(&self, of: &Instance<'_>) -> String {
        format!("backlash of axis {}: lost motion on reversal", of.axis)
    }

    fn remedy(&self) -> &'static str {
        "adjust the preload of the screw, or correct the backlash compensation of the control"
    }

    fn parameters(&self, chain: &Chain, of: &Instance<'_>) -> Vec<Parameter> {
        let unit = if of.turns(chain) { "rad" } else { "m" };
        vec![Parameter::new("b", unit, 2e-4)]
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn::of(Subject::Machine)
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        (rows.chain.axis_names().enumerate())
            .filter(|(axis, _)| !rows.prescribed.contains(axis))
            .filter_map(|(_, name)| self.way(&rows.chain, &Instance::on(name)))
            .collect()
    }

    fn declared(&self, chain: &Chain, of: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        self.way(chain, of).into_iter().collect()
    }
}

impl Backlash {
    fn way(&self, chain: &Chain, of: &Instance<'_>) -> Option<Variant> {
        let (axis, _) = of.joint(chain)?;
        let parameters = self.parameters(chain, of);
        Some(Variant::linear(of.id(self.id()), parameters, move |rows| {
            vec![rows.machine_column(false, |pose, _| {
                let side = if pose.speeds[axis] == 0.0 {
                    0.0
                } else {
                    pose.speeds[axis].signum()
                };
                pose.sensitivity.axes[axis] * (-0.5 * side)
            })]
        }))
    }
}

#[cfg(test)]
mod tests {
    use crate::specimen::predicts;

    #[test]
    fn half_the_lost_motion_on_either_side() {
        predicts("axis.X.backlash", &[("b", 8e-6, "m")], |seen| {
            let across = seen.normal.x.abs();
            if across > 1e-6 { -4e-6 * across } else { 0.0 }
        });
    }
}
