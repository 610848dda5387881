//! The normal equations of all linear effects of a session.
//!
//! Which effects a diagnosis names varies from session to session where they resemble one another, and an estimate beside those
//! that are named varies with them. From the normal equations any set of effects is estimated jointly, and the same set in
//! every session, without the recording. Nonlinear effects that the diagnosis names there are eliminated (Schur complement).

use nalgebra::{DMatrix, DVector};

use super::Source;
use super::effects::Design;
use crate::lake::Rows;
use crate::lake::rows::Value;
use crate::lake::schema::INFORMATION;

/// Rows of a session that began at `time`.
pub(super) fn rows(source: &Source<'_>, time: i64, design: &Design<'_>, rows: &mut Rows) {
    let linear = design.linear.iter();
    let columns: Vec<&Vec<f64>> = linear.flat_map(|one| &one.columns).collect();
    let beside = design.named.iter().filter(|(named, _)| {
        let known = |one: &super::effects::Linear| one.effect == named.effect;
        !design.linear.iter().any(known)
    });
    let beside: Vec<&Vec<f64>> = beside.flat_map(|(_, columns)| columns).collect();
    let matrix = |columns: &[&Vec<f64>]| {
        DMatrix::from_fn(design.kept.len(), columns.len(), |row, column| {
            columns[column][design.kept[row]]
        })
    };
    let mut columns = matrix(&columns);
    let mut deviations = DVector::from_fn(design.kept.len(), |row, _| {
        design.deviations[design.kept[row]]
    });
    let beside = matrix(&beside);
    let eliminated = beside.ncols() as f64;
    if beside.ncols() > 0 {
        // Products of what is orthogonal to these columns are those of the Schur complement.
        let basis = beside.qr().q();
        columns -= &basis * (basis.transpose() * &columns);
        deviations -= &basis * (basis.transpose() * &deviations);
    }
    let information = columns.transpose() * &columns;
    let gradient = columns.transpose() * &deviations;
    let freedom = design.kept.len() as f64 - eliminated;
    let mut number = 0;
    for one in &design.linear {
        for (name, unit) in &one.names {
            let row: Vec<f64> = information
                .row(number)
                .iter()
                .copied()
                .take(number + 1)
                .collect();
            let values: [Value; 8] = [
                one.effect.as_str().into(),
                name.as_str().into(),
                number.into(),
                (*unit).into(),
                gradient[number].into(),
                row.into(),
                deviations.norm_squared().into(),
                freedom.into(),
            ];
            rows.push(&INFORMATION, source.row(time, values));
            number += 1;
        }
    }
}
