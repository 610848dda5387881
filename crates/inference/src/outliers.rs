//! Outliers: touches that no smooth explanation predicts, suspected before any effect is named.
//!
//! Each touch is predicted from all others by a ridge on the whole library; those whose standardised leave-one-out residual
//! (Belsley, Kuh and Welsch 1980) exceeds many robust standard deviations are suspects, the worst first. Evidence decides
//! whether they are rejected: an outlier is uniform over a wide range instead of normal around the model.

use metrology::statistics::MAD_FACTOR;

use crate::linear::{cholesky, dot, forward, solve_cholesky};

/// Standardised residuals beyond this are suspect.
const SUSPECT: f64 = 5.0;
/// Rows with at least this share of the worst residual are suspect with it.
const ALIKE: f64 = 0.8;
/// Largest share of the touches that may be outliers.
const MOST: f64 = 0.12;
/// Prior probability that a touch is an outlier.
const OUTLIER: f64 = 0.005;
/// Width of the uniform distribution of outliers, m: half a millimetre.
const WIDTH: f64 = 5e-4;

/// Log evidence that a number of outliers adds to that of the other touches.
pub fn log_evidence(outliers: usize) -> f64 {
    outliers as f64 * (OUTLIER.ln() - WIDTH.ln())
}

/// Largest number of outliers among the touches of a session.
pub fn most_outliers(touches: usize) -> usize {
    ((touches as f64 * MOST) as usize).max(1)
}

/// Rows that the columns of `blocks`, fitted to the others, do not predict.
pub fn suspects(blocks: &[&[Vec<f64>]], y: &[f64]) -> Vec<usize> {
    let columns: Vec<&Vec<f64>> = blocks.iter().copied().flatten().collect();
    let mut active = vec![true; y.len()];
    let most = most_outliers(y.len());
    let mut found = Vec::new();
    while found.len() < most {
        let Some(standardised_residuals) = standardised_residuals(&columns, y, &active) else {
            break;
        };
        let worst = (0..y.len())
            .filter(|&row| active[row])
            .map(|row| standardised_residuals[row])
            .fold(0.0, f64::max);
        if worst <= SUSPECT {
            break;
        }
        // Those nearly as far off as the worst are suspect with it.
        for row in 0..y.len() {
            if active[row] && standardised_residuals[row] > SUSPECT.max(ALIKE * worst) {
                active[row] = false;
                found.push(row);
            }
        }
    }
    found
}

/// Standardised leave-one-out residuals of a ridge whose strength maximises the evidence.
fn standardised_residuals(columns: &[&Vec<f64>], y: &[f64], active: &[bool]) -> Option<Vec<f64>> {
    let n = columns.len();
    let used: Vec<usize> = (0..y.len()).filter(|&row| active[row]).collect();
    let yy: f64 = used.iter().map(|&row| y[row] * y[row]).sum();
    let mask = |column: &[f64]| -> Vec<f64> { used.iter().map(|&row| column[row]).collect() };
    let thin: Vec<Vec<f64>> = columns.iter().map(|column| mask(column)).collect();
    let target = mask(y);
    let mut gram = vec![0.0; n * n];
    for i in 0..n {
        for k in 0..=i {
            gram[i * n + k] = dot(&thin[i], &thin[k]);
            gram[k * n + i] = gram[i * n + k];
        }
    }
    let right: Vec<f64> = thin.iter().map(|column| dot(column, &target)).collect();
    let mut best: Option<(f64, Vec<f64>, Vec<f64>)> = None;
    for power in [1.0, 10.0, 100.0, 1e3, 1e4] {
        let mut factor = gram.clone();
        for i in 0..n {
            factor[i * n + i] += 1.0 / power;
        }
        let log_determinant = cholesky(&mut factor, n)?;
        let mut mean = right.clone();
        solve_cholesky(&factor, n, &mut mean);
        let residual = (yy - dot(&right, &mean)).max(1e-30);
        let evidence = -0.5 * used.len() as f64 * residual.ln()
            - 0.5 * (log_determinant + n as f64 * f64::ln(power));
        if best.as_ref().is_none_or(|(known, _, _)| evidence > *known) {
            best = Some((evidence, factor, mean));
        }
    }
    best.map(|(_, factor, mean)| standardised(&thin, &target, &mean, &factor, &used, y.len()))
}

/// Leave-one-out residuals of the rows in use over their robust standard deviation, from a Cholesky factor of the ridge.
fn standardised(
    columns: &[Vec<f64>],
    target: &[f64],
    mean: &[f64],
    factor: &[f64],
    used: &[usize],
    rows: usize,
) -> Vec<f64> {
    let n = columns.len();
    let mut residuals = vec![0.0; rows];
    let mut size = Vec::with_capacity(used.len());
    let mut row_values = vec![0.0; n];
    for (index, &row) in used.iter().enumerate() {
        for (value, column) in row_values.iter_mut().zip(columns) {
            *value = column[index];
        }
        let predicted = dot(&row_values, mean);
        forward(factor, n, &mut row_values);
        let leverage = dot(&row_values, &row_values);
        residuals[row] = (target[index] - predicted) / (1.0 - leverage).max(1e-3).sqrt();
        size.push(residuals[row].abs());
    }
    size.sort_by(f64::total_cmp);
    let deviation = MAD_FACTOR * size[size.len() / 2].max(1e-12);
    residuals
        .iter()
        .map(|residual| residual.abs() / deviation)
        .collect()
}
