//! `thermal.spindle_growth`: the tool side grows along the mount's z as the spindle warms, first-order in time (ISO 230-3).
//!
//! e = g·(1 − exp(−t/tau))·z of the mount. Typical 10–80 µm with 1–40 min. Over a short session it is a drift.

use machine::Chain;

use crate::effect::{ActsOn, Constants, Coordinate, Effect, Instance, Subject};
use crate::library::{Parameter, Shape, Variant, logspace};
use crate::observation::Observations;

pub(super) struct SpindleGrowth;

impl Effect for SpindleGrowth {
    fn id(&self) -> &'static str {
        "thermal.spindle_growth"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "thermal growth of the spindle".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "warm the spindle up before measuring, or measure the tool length again"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        parameters()
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn {
            smooth_in: &[Coordinate::Time],
            ..ActsOn::of(Subject::Machine)
        }
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        let span = rows.span();
        if span <= 0.0 {
            return Vec::new();
        }
        vec![way(logspace(span / 40.0, span * 2.0, 14))]
    }

    fn declared(&self, _: &Chain, _: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        vec![way(Vec::new())]
    }
}

fn parameters() -> Vec<Parameter> {
    vec![Parameter::new("g", "m", 1e-3)]
}

fn way(trials: Vec<f64>) -> Variant {
    let shape = Shape {
        name: "tau",
        unit: "s",
        trials,
        continuous: true,
        distinct: 6.0,
    };
    Variant::shaped(
        "thermal.spindle_growth",
        parameters(),
        shape,
        |rows, tau| {
            vec![rows.machine_column(false, |pose, row| {
                pose.sensitivity.mount[2] * -(-row.time / tau).exp_m1()
            })]
        },
    )
}

#[cfg(test)]
mod tests {
    use crate::specimen::predicts;

    #[test]
    fn the_spindle_grows_towards_its_end() {
        predicts(
            "thermal.spindle_growth",
            &[("g", 4e-5, "m"), ("tau", 30.0, "s")],
            |seen| -seen.normal.z * 4e-5 * (1.0 - (-seen.row.time / 30.0).exp()),
        );
    }
}
