//! Linear algebra on slices: inner products, whitening, orthonormal bases and small Cholesky factors.
//!
//! Matrices of up to some hundred columns are row-major slices, so that the search over sets factorises millions of them
//! without an allocation; longer ones are `nalgebra`'s. Nothing here knows what the numbers mean.

/// Diagonal of the inverse from a Cholesky factor; `scratch` holds at least n² values.
pub fn inverse_diagonal(factor: &[f64], n: usize, scratch: &mut [f64]) -> Vec<f64> {
    // Column by column the inverse of the factor; the inverse's diagonal is the sum of its squares.
    let mut diagonal = vec![0.0; n];
    for column in 0..n {
        for row in column..n {
            let unit = if row == column { 1.0 } else { 0.0 };
            let known = dot(
                &factor[row * n + column..row * n + row],
                &scratch[column * n + column..column * n + row],
            );
            let value = (unit - known) / factor[row * n + row];
            scratch[column * n + row] = value;
            diagonal[column] += value * value;
        }
    }
    diagonal
}

/// The values of the rows in use, whitened for AR(1) noise over the first `touches` rows in the order of time.
///
/// Each value is replaced by its innovation, scaled so that the noise keeps its variance (Prais and Winsten 1954).
pub fn whitened(
    values: &[f64],
    active: &[bool],
    touches: usize,
    lag1_correlation: f64,
) -> Vec<f64> {
    let mut picked = pick(values, active);
    let touched = active.iter().take(touches).filter(|&&used| used).count();
    whiten(&mut picked[..touched], lag1_correlation);
    picked
}

/// Whitens values in the order of time for AR(1) noise, in place.
pub fn whiten(values: &mut [f64], lag1_correlation: f64) {
    if lag1_correlation == 0.0 {
        return;
    }
    let fresh = 1.0 / (1.0 - lag1_correlation * lag1_correlation).sqrt();
    for index in (1..values.len()).rev() {
        values[index] = (values[index] - lag1_correlation * values[index - 1]) * fresh;
    }
}

/// Undoes [`whiten`], in place.
pub fn unwhiten(values: &mut [f64], lag1_correlation: f64) {
    if lag1_correlation == 0.0 {
        return;
    }
    let fresh = (1.0 - lag1_correlation * lag1_correlation).sqrt();
    for index in 1..values.len() {
        values[index] = values[index] * fresh + lag1_correlation * values[index - 1];
    }
}

fn pick(values: &[f64], active: &[bool]) -> Vec<f64> {
    values
        .iter()
        .zip(active)
        .filter(|&(_, &used)| used)
        .map(|(&value, _)| value)
        .collect()
}

/// Inner product.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Eight independent sums, since a single one waits for each addition.
    let mut sums = [0.0; 8];
    let (left, right) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = (left.remainder().iter().zip(right.remainder()))
        .map(|(x, y)| x * y)
        .sum();
    if left.len() == 0 {
        return rest;
    }
    for (x, y) in left.zip(right) {
        for (sum, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *sum += x * y;
        }
    }
    let [a, b, c, d, e, f, g, h] = sums;
    rest + (((a + e) + (c + g)) + ((b + f) + (d + h)))
}

/// Adds `factor` times `column` to `values`.
pub fn add_scaled(values: &mut [f64], factor: f64, column: &[f64]) {
    for (value, part) in values.iter_mut().zip(column) {
        *value += factor * part;
    }
}

/// Multiplies `values` by `factor`.
pub fn scale(values: &mut [f64], factor: f64) {
    for value in values {
        *value *= factor;
    }
}

/// Cholesky factor in the lower triangle of a row-major matrix; gives its log-determinant.
pub fn cholesky(matrix: &mut [f64], n: usize) -> Option<f64> {
    // One logarithm for many pivots, as long as their product keeps its precision.
    let (mut log_determinant, mut pivots) = (0.0, 1.0_f64);
    for i in 0..n {
        let (above, row) = matrix.split_at_mut(i * n);
        let row = &mut row[..=i];
        for j in 0..i {
            let known = &above[j * n..=j * n + j];
            let sum = row[j] - dot(&row[..j], &known[..j]);
            row[j] = sum / known[j];
        }
        let sum = row[i] - dot(&row[..i], &row[..i]);
        if !(sum > 0.0) {
            return None;
        }
        pivots *= sum;
        if !(1e-150..1e150).contains(&pivots) {
            log_determinant += pivots.ln();
            pivots = 1.0;
        }
        row[i] = sum.sqrt();
    }
    Some(log_determinant + pivots.ln())
}

/// Solves in place with the lower triangle only.
pub fn forward(factor: &[f64], n: usize, right: &mut [f64]) {
    for i in 0..n {
        let row = &factor[i * n..=i * n + i];
        let sum = right[i] - dot(&row[..i], &right[..i]);
        right[i] = sum / row[i];
    }
}

/// Solves in place with a Cholesky factor.
pub fn solve_cholesky(factor: &[f64], n: usize, right: &mut [f64]) {
    forward(factor, n, right);
    for i in (0..n).rev() {
        let (before, own) = right.split_at_mut(i);
        own[0] /= factor[i * n + i];
        add_scaled(before, -own[0], &factor[i * n..i * n + i]);
    }
}

/// Inverse from a Cholesky factor.
pub fn invert(factor: &[f64], n: usize, inverse: &mut [f64]) {
    let mut unit = vec![0.0; n];
    for column in 0..n {
        unit.fill(0.0);
        unit[column] = 1.0;
        solve_cholesky(factor, n, &mut unit);
        for row in 0..n {
            inverse[row * n + column] = unit[row];
        }
    }
}

/// A column that keeps less than this share of its power beside those before it is spanned by them.
pub const SPANNED: f64 = 1e-10;

/// Orthonormal basis of columns; those that keep at most the share `least` of their power beside the others are left out.
pub fn orthonormal(columns: impl Iterator<Item = Vec<f64>>, least: f64) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for column in columns {
        append(&mut basis, column, least);
    }
    basis
}

/// Adds a column to an orthonormal basis unless it is spanned already; true where it was added.
pub fn append(basis: &mut Vec<Vec<f64>>, mut column: Vec<f64>, least: f64) -> bool {
    let full = dot(&column, &column);
    // Twice is enough (Parlett): the second pass removes what cancellation left of the first.
    project_out(&mut column, basis);
    project_out(&mut column, basis);
    let power = dot(&column, &column);
    if !(power > least * full) || power <= 0.0 {
        return false;
    }
    scale(&mut column, 1.0 / power.sqrt());
    basis.push(column);
    true
}

/// Subtracts the projection onto an orthonormal basis.
pub fn project_out(values: &mut [f64], basis: &[Vec<f64>]) {
    for known in basis {
        let along = dot(known, values);
        add_scaled(values, -along, known);
    }
}

/// Values less their projection onto an orthonormal basis.
pub fn projected_out(mut values: Vec<f64>, basis: &[Vec<f64>]) -> Vec<f64> {
    project_out(&mut values, basis);
    values
}
