//! Orthonormal bases, grown column by column.

use crate::evidence::{add_scaled, dot, scale};

/// A column that keeps less than this share of its energy beside a basis is spanned by it.
const SPANNED: f64 = 1e-8;

/// What of `values` a basis does not span.
pub(super) fn without(mut values: Vec<f64>, basis: &[Vec<f64>]) -> Vec<f64> {
    for known in basis {
        let along = dot(known, &values);
        add_scaled(&mut values, -along, known);
    }
    values
}

/// Adds a column to an orthonormal basis unless it is spanned already; says whether it was.
pub(super) fn append(basis: &mut Vec<Vec<f64>>, column: Vec<f64>) -> bool {
    let full = dot(&column, &column);
    // Twice is enough (Parlett): the second pass removes what cancellation left of the first.
    let mut rest = without(without(column, basis), basis);
    let power = dot(&rest, &rest);
    if !(power > SPANNED * full) || power <= 0.0 {
        return false;
    }
    scale(&mut rest, 1.0 / power.sqrt());
    basis.push(rest);
    true
}
