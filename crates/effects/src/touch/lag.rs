//! `axis.<A>.lag`: the position read leads the true one by speed × time.
//!
//! δq = −tau·q̇. Typical 0–20 µm at probing feed.

use machine::Chain;

use crate::effect::{ActsOn, Constants, Definition, Effect, Instance, Subject};
use crate::observation::Observations;
use crate::variant::Variant;

pub(super) struct Lag;

impl Effect for Lag {
    fn definition(&self) -> Definition {
        Definition {
            id: "axis.<A>.lag",
            name: "lag of axis <A>: its reading leads the true position in proportion to speed",
            remedy: "measure slower, or raise the velocity gain of the position loop",
            parameters: &[("tau", "s", 0.03)],
            acts_on: ActsOn::of(Subject::Machine),
        }
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        (rows.chain.axis_names().enumerate())
            .filter(|(axis, _)| !rows.prescribed.contains(axis))
            .filter_map(|(_, name)| self.on_joint(&rows.chain, &Instance::on(name)))
            .collect()
    }

    fn declared(&self, chain: &Chain, of: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        self.on_joint(chain, of).into_iter().collect()
    }
}

impl Lag {
    fn on_joint(&self, chain: &Chain, of: &Instance<'_>) -> Option<Variant> {
        let (axis, _) = of.joint(chain)?;
        let parameters = self.parameters(chain, of);
        Some(Variant::linear(of.id(self.id()), parameters, move |rows| {
            vec![rows.machine_column(false, |pose, _| {
                pose.sensitivity.axes[axis] * -pose.speeds[axis]
            })]
        }))
    }
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    #[test]
    fn the_true_position_trails_the_approach() {
        predicts("axis.X.lag", &[("tau", 1e-3, "s")], |seen| {
            -1e-3 * seen.row.feed * seen.normal.x.powi(2)
        });
    }
}
