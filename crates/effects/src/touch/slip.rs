//! `process.slip`: from some instant on everything is displaced by a step.
//!
//! The probe's slide slips in the foundation, the clamped part in its own frame, or the reading itself jumps (a scale
//! that lost counts along the approach); the instant is any gap between two touches. Typical 5–100 µm.

use machine::Chain;
use nalgebra::Vector3;

use crate::effect::{ActsOn, Definition, Effect, Instance, Subject};
use crate::observation::{Column, Observations, Pose, Row};
use crate::variant::{Parameter, Shape, Variant};

/// Instants tried; in longer sessions not every gap is.
const FINEST: usize = 400;

/// Fewest touches on either side of the step: fewer are stray touches.
const FEWEST: usize = 4;

pub(super) struct Slip;

impl Effect for Slip {
    fn definition(&self) -> Definition {
        Definition {
            id: "process.slip",
            name: "slip: from some instant on everything is displaced",
            remedy: "check the clamping of part and probe, and measure the part again",
            parameters: &[],
            acts_on: ActsOn::of(Subject::Session),
        }
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        parameters(&["step", "x", "y", "z"])
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        variants(rows)
    }

    fn undeclarable(&self) -> Option<&'static str> {
        Some("it is an event of one session, not a property of the cell")
    }
}

fn parameters(names: &[&str]) -> Vec<Parameter> {
    let of = |&name: &&str| Parameter::new(name, "m", 1e-3);
    names.iter().map(of).collect()
}

/// A step of the reading, of the probe's slide and of the part, at every gap that is tried.
fn variants(rows: &Observations) -> Vec<Variant> {
    let touches = rows.touches();
    let times: Vec<f64> = rows.rows.iter().take(touches).map(|row| row.time).collect();
    // In a table without times all touches are of the first instant, before which nothing can have slipped.
    let first = times.iter().copied().fold(f64::INFINITY, f64::min);
    let trials: Vec<f64> = (FEWEST..(touches + 1).saturating_sub(FEWEST))
        .step_by(touches.div_ceil(FINEST).max(1))
        .filter(|index| times[*index] > first)
        .map(|index| index as f64)
        .collect();
    if trials.is_empty() {
        return Vec::new();
    }
    let mut variants = Vec::new();
    let distinct = trials.len() as f64;
    let shape = Shape {
        name: "index",
        unit: "1",
        trials,
        continuous: false,
        distinct,
    };
    let after =
        move |row: &Row, index: f64| row.pose.is_some() && row.time >= times[index as usize];
    let jumps = after.clone();
    variants.push(Variant::shaped(
        "process.slip",
        parameters(&["step"]),
        shape.clone(),
        move |rows, index| vec![rows.reading_column(|row| f64::from(u8::from(jumps(row, index))))],
    ));
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
            parameters(&["x", "y", "z"]),
            shape.clone(),
            move |rows, index| {
                let column = |k| {
                    rows.machine_column(false, |pose, row| {
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
        variants.push(slipped.with_sweep(move |rows, instants| {
            let whole = [0, 1, 2].map(|k| rows.machine_column(false, |pose, _| step(pose, k)));
            let from = |&index: &f64| {
                let of = |column: &Column| {
                    let of_row = column.signature.iter().zip(&rows.rows);
                    of_row
                        .map(|(part, row)| if since(row, index) { *part } else { 0.0 })
                        .collect()
                };
                whole.iter().map(of).collect()
            };
            instants.iter().map(from).collect()
        }));
    }
    variants
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_session::session;

    #[test]
    fn without_times_nothing_slips() {
        let mut rows = crate::observe(&session()).expect("rows");
        for row in &mut rows.rows {
            row.time = 0.0;
        }
        assert!(Slip.offer(&rows).is_empty());
    }

    /// From the instant on the part lies elsewhere; before it nothing has happened.
    #[test]
    fn what_slips_stays_displaced() {
        let rows = crate::observe(&session()).expect("rows");
        let variants = Slip.offer(&rows);
        let part = &variants[2];
        let columns = part.columns(&rows, 10.0);
        for (index, row) in rows.rows.iter().enumerate() {
            for (k, column) in columns.iter().enumerate() {
                let expected = if index < 10 { 0.0 } else { row.normal[k] };
                assert!((column.signature[index] - expected).abs() < 1e-12);
            }
        }
        let swept = part.signatures(&rows);
        let trials = &part.shape.as_ref().expect("an instant").trials;
        for (instant, swept) in trials.iter().zip(&swept) {
            for (column, swept) in part.columns(&rows, *instant).iter().zip(swept) {
                assert_eq!(&column.signature, swept);
            }
        }
    }
}
