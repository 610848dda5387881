//! `probe.pretravel_lobing`: the trigger's travel varies with the direction in the mount's x–y plane (ISO 230-10).
//!
//! d = sinθ·a·cos(k(φ − phase)), θ from the mount's z, φ about it, k = 3 for a kinematic seat of three rollers (k = 2, 4
//! are tried as well). Typical 0.25–5 µm.

use machine::Chain;

use crate::effect::{ActsOn, Constants, Coordinate, Effect, Instance, Subject};
use crate::library::{Form, Parameter, Variant};
use crate::observation::{Observations, Row};

pub(super) struct PretravelLobing;

impl Effect for PretravelLobing {
    fn id(&self) -> &'static str {
        "probe.pretravel_lobing"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "pretravel that varies with the direction of the touch (lobing)".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "qualify the probe in every direction that is used, or orient the spindle to the direction of the touch"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        parameters()
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn {
            triggered: true,
            smooth_in: &[Coordinate::Direction],
            ..ActsOn::of(Subject::Probe)
        }
    }

    fn offer(&self, _: &Observations) -> Vec<Variant> {
        LOBES.map(way).into()
    }

    fn declared(&self, _: &Chain, _: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        LOBES.map(way).into()
    }
}

/// Lobes that are tried, the usual number first.
const LOBES: [f64; 3] = [3.0, 2.0, 4.0];

fn parameters() -> Vec<Parameter> {
    vec![
        Parameter::new("cos", "m", 1e-4),
        Parameter::new("sin", "m", 1e-4),
    ]
}

fn way(lobes: f64) -> Variant {
    Variant::linear("probe.pretravel_lobing", parameters(), move |rows| {
        vec![
            rows.reading_column(|row| lobe(row, |phi| (lobes * phi).cos())),
            rows.reading_column(|row| lobe(row, |phi| (lobes * phi).sin())),
        ]
    })
    .with_form(Form::Lobes(lobes))
    .with_constants(&[("lobes", lobes, "1")])
}

fn lobe(row: &Row, wave: impl Fn(f64) -> f64) -> f64 {
    let Some(pose) = &row.pose else { return 0.0 };
    let [x, y, _] = pose
        .sensitivity
        .mount
        .map(|direction| direction.dot(&row.normal));
    x.hypot(y) * wave(y.atan2(x))
}

#[cfg(test)]
mod tests {
    use crate::specimen::predicts;

    #[test]
    fn three_lobes_turn_with_the_probe() {
        predicts(
            "probe.pretravel_lobing",
            &[("a", 2e-6, "m"), ("phase", 0.3, "rad"), ("lobes", 3.0, "1")],
            |seen| {
                let about = seen.normal.y.atan2(seen.normal.x) - seen.position("S");
                let across = seen.normal.x.hypot(seen.normal.y);
                across * 2e-6 * (3.0 * (about - 0.3)).cos()
            },
        );
    }
}
