//! Candidates of the inference from variants of effects and the rows of a session.

use inference::candidate::{Candidate, SecondOrder};
use nalgebra::{DMatrix, Vector3};

use crate::observation::{Column, Observations};
use crate::variant::Variant;

/// The block of the variant at `index` of the library at a value of its nonlinear parameter; `None` where this session
/// cannot see it at all.
pub fn candidate(
    observations: &Observations,
    variants: &[Variant],
    index: usize,
    shape: f64,
) -> Option<Candidate> {
    let columns = variants[index].columns(observations, shape);
    from_columns(observations, variants, (index, shape), &columns, false)
}

/// The candidate of a variant without a nonlinear parameter, and the same with the second order of what cannot be seen to
/// first order, where there is such a thing.
pub fn candidates(
    observations: &Observations,
    variants: &[Variant],
    index: usize,
) -> (Option<Candidate>, Option<Candidate>) {
    let columns = variants[index].columns(observations, 0.0);
    let of = |second| from_columns(observations, variants, (index, 0.0), &columns, second);
    let second_order = columns.iter().all(|column| !column.shifts.is_empty());
    (of(false), if second_order { of(true) } else { None })
}

/// The candidate of a variant with the second order of what cannot be seen to first order; `None` where there is no such
/// thing.
pub fn second_order_candidate(
    observations: &Observations,
    variants: &[Variant],
    index: usize,
    shape: f64,
) -> Option<Candidate> {
    let columns = variants[index].columns(observations, shape);
    from_columns(observations, variants, (index, shape), &columns, true)
}

fn from_columns(
    observations: &Observations,
    variants: &[Variant],
    (index, shape): (usize, f64),
    columns: &[Column],
    second_order: bool,
) -> Option<Candidate> {
    let variant = &variants[index];
    let rows = observations.rows.len();
    let sizes: Vec<f64> = variant
        .parameters
        .iter()
        .map(|parameter| parameter.plausible)
        .collect();
    let scaled = DMatrix::from_fn(rows, columns.len(), |row, column| {
        columns[column].signature[row] * sizes[column] * observations.rows[row].weight
    });
    let shapes = variant
        .shape
        .as_ref()
        .map_or(0.0, |shape| shape.distinct.max(1.0).ln());
    if let Some(factor) = &variant.prior {
        return Candidate::from_correlated((index, shape), &scaled, &sizes, factor, -shapes);
    }
    let curved = |shares: &[f64]| curvature(observations, columns, shares);
    let curved: Option<&SecondOrder<'_>> = if second_order { Some(&curved) } else { None };
    Candidate::from_scaled((index, shape), &scaled, &sizes, -shapes, curved)
}

/// Weighted second order, over the rows, of the displacement that the columns make at parameters `shares`.
fn curvature(observations: &Observations, columns: &[Column], shares: &[f64]) -> Option<Vec<f64>> {
    if columns.iter().any(|column| column.shifts.is_empty()) {
        return None;
    }
    let shifts: Vec<Vector3<f64>> = (0..observations.rows.len())
        .map(|row| {
            columns
                .iter()
                .zip(shares)
                .map(|(column, share)| column.shifts[row] * *share)
                .sum()
        })
        .collect();
    let weighted = (observations.curvature(&shifts).iter())
        .zip(&observations.rows)
        .map(|(value, row)| value * row.weight)
        .collect();
    Some(weighted)
}
