//! `axis.<A>.cyclic`: a linear axis errs with the pitch of its screw or scale.
//!
//! δq = a·sin(2πq/period + phase), the period profiled over 1–40 mm. Typical 0.5–5 µm. Points spaced by a pitch cannot
//! see it.

use std::f64::consts::TAU;

use machine::JointKind;

use super::{Form, Parameter, Shape, Variant, linspace};
use crate::observation::Observations;

/// Longest and shortest period that a screw or a scale has, m.
const PERIODS: (f64, f64) = (0.04, 0.001);
/// Trials in one resolvable step of the frequency.
const OVERSAMPLED: f64 = 4.0;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    for axis in 0..observations.chain.axes().len() {
        let joint = observations.chain.axis(axis);
        let (low, high) = observations.travel(axis);
        let range = high - low;
        if joint.kind != JointKind::Prismatic || range < PERIODS.0 / 4.0 {
            continue;
        }
        let slowest = (1.0 / PERIODS.0).max(0.5 / range);
        let steps = (1.0 / PERIODS.1 - slowest) * range;
        let trials = linspace(
            slowest,
            1.0 / PERIODS.1,
            ((steps * OVERSAMPLED) as usize).clamp(2, 4000),
        );
        let shape = Shape {
            name: "period",
            unit: "m",
            trials: trials
                .iter()
                .rev()
                .map(|frequency| 1.0 / frequency)
                .collect(),
            continuous: true,
            distinct: steps.max(1.0),
        };
        variants.push(
            Variant::shaped(
                format!("axis.{}.cyclic", joint.name),
                vec![
                    Parameter::new("sin", "m", 5e-5),
                    Parameter::new("cos", "m", 5e-5),
                ],
                shape,
                move |observations, period| {
                    let column = |wave: fn(f64) -> f64| {
                        observations.machine_column(true, |pose, _| {
                            pose.sensitivity.axes[axis] * wave(TAU * pose.positions[axis] / period)
                        })
                    };
                    vec![column(f64::sin), column(f64::cos)]
                },
            )
            .reported(Form::Sine),
        );
    }
}
