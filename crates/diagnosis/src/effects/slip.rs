//! `process.slip`: from some instant on everything is displaced by a step.
//!
//! The probe's slide slips in the foundation, the clamped part in its own frame, or the reading itself jumps (a scale
//! that lost counts along the approach); the instant is any gap between two touches. Typical 5–100 µm.

use nalgebra::Vector3;

use super::{Parameter, Shape, Variant};
use crate::observation::{Column, Observations, Pose, Row};

/// Instants tried; in longer sessions not every gap is.
const FINEST: usize = 400;

/// Fewest touches on either side of the step: fewer are stray touches.
const FEWEST: usize = 4;

pub(super) fn offer(observations: &Observations, variants: &mut Vec<Variant>) {
    let touches = observations.touches();
    let trials: Vec<f64> = (FEWEST..(touches + 1).saturating_sub(FEWEST))
        .step_by(touches.div_ceil(FINEST).max(1))
        .map(|index| index as f64)
        .collect();
    if trials.is_empty() {
        return;
    }
    let distinct = trials.len() as f64;
    let shape = Shape {
        name: "index",
        unit: "1",
        trials,
        continuous: false,
        distinct,
    };
    let times: Vec<f64> = observations
        .rows
        .iter()
        .take(touches)
        .map(|row| row.time)
        .collect();
    let after =
        move |row: &Row, index: f64| row.pose.is_some() && row.time >= times[index as usize];
    let jumps = after.clone();
    variants.push(Variant::shaped(
        "process.slip",
        vec![Parameter::new("step", "m", 1e-3)],
        shape.clone(),
        move |observations, index| {
            vec![observations.reading_column(|row| f64::from(u8::from(jumps(row, index))))]
        },
    ));
    let named = || -> Vec<Parameter> {
        ["x", "y", "z"]
            .map(|name| Parameter::new(name, "m", 1e-3))
            .into()
    };
    for part in [false, true] {
        let (after, since) = (after.clone(), after.clone());
        let step = move |pose: &Pose, k: usize| {
            if part {
                pose.sensitivity.part[k]
            } else {
                pose.sensitivity.foundation[k]
            }
        };
        let slipped = Variant::shaped(
            "process.slip",
            named(),
            shape.clone(),
            move |observations, index| {
                let column = |k| {
                    observations.machine_column(false, |pose, row| {
                        if after(row, index) {
                            step(pose, k)
                        } else {
                            Vector3::zeros()
                        }
                    })
                };
                [0, 1, 2].map(column).into()
            },
        );
        variants.push(slipped.swept(move |observations, instants| {
            let whole =
                [0, 1, 2].map(|k| observations.machine_column(false, |pose, _| step(pose, k)));
            let from = |&index: &f64| {
                let of = |column: &Column| {
                    let rows = column.signature.iter().zip(&observations.rows);
                    rows.map(|(part, row)| if since(row, index) { *part } else { 0.0 })
                        .collect()
                };
                whole.iter().map(of).collect()
            };
            instants.iter().map(from).collect()
        }));
    }
}
