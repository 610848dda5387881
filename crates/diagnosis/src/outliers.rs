//! Stray touches: which ones no smooth explanation could reach, decided before anything is named.
//!
//! Each touch is predicted from all others by a ridge on the whole library; those that miss by many robust standard
//! deviations are set aside, the worst first. Whether setting them aside pays is decided by evidence: a stray touch is
//! drawn evenly from a wide range instead of around the model.

use crate::candidate::Candidate;
use crate::evidence::{cholesky, dot, forward, solve_cholesky};

/// Standardised misses beyond this are suspected.
const SUSPECT: f64 = 5.0;
/// Rows that miss by this share of the worst are set aside with it.
const ALIKE: f64 = 0.8;
/// At most this share of the touches may be stray.
const MOST: f64 = 0.12;
/// Prior probability that a touch is stray.
const STRAY: f64 = 0.005;
/// Width over which a stray touch may lie, m: half a millimetre.
const WIDTH: f64 = 5e-4;

/// Log evidence that a number of stray touches adds to that of the others.
pub fn log_evidence(stray: usize) -> f64 {
    stray as f64 * (STRAY.ln() - WIDTH.ln())
}

/// Most touches of a session that may be stray.
pub(crate) fn most(touches: usize) -> usize {
    ((touches as f64 * MOST) as usize).max(1)
}

/// Rows that miss what the library predicts for them from the others.
pub fn suspects(candidates: &[&Candidate], y: &[f64]) -> Vec<usize> {
    let columns: Vec<&Vec<f64>> = candidates
        .iter()
        .flat_map(|candidate| &candidate.block)
        .collect();
    let mut active = vec![true; y.len()];
    let most = most(y.len());
    let mut found = Vec::new();
    while found.len() < most {
        let Some(misses) = misses(&columns, y, &active) else {
            break;
        };
        let worst = (0..y.len())
            .filter(|&row| active[row])
            .map(|row| misses[row])
            .fold(0.0, f64::max);
        if worst <= SUSPECT {
            break;
        }
        // Those nearly as far out as the worst go with it.
        for row in 0..y.len() {
            if active[row] && misses[row] > SUSPECT.max(ALIKE * worst) {
                active[row] = false;
                found.push(row);
            }
        }
    }
    found
}

/// Standardised leave-one-out residuals of a ridge whose strength maximises the evidence.
fn misses(columns: &[&Vec<f64>], y: &[f64], active: &[bool]) -> Option<Vec<f64>> {
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
        let left = (yy - dot(&right, &mean)).max(1e-30);
        let evidence = -0.5 * used.len() as f64 * left.ln()
            - 0.5 * (log_determinant + n as f64 * f64::ln(power));
        if best.as_ref().is_none_or(|(known, _, _)| evidence > *known) {
            best = Some((evidence, factor, mean));
        }
    }
    best.map(|(_, factor, mean)| standardised(&thin, &target, &mean, &factor, &used, y.len()))
}

/// Residuals of rows in use over what they would be in the mean, from a Cholesky factor of the ridge.
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
    let mut own = vec![0.0; n];
    for (place, &row) in used.iter().enumerate() {
        for (own, column) in own.iter_mut().zip(columns) {
            *own = column[place];
        }
        let predicted = dot(&own, mean);
        forward(factor, n, &mut own);
        let leverage = dot(&own, &own);
        residuals[row] = (target[place] - predicted) / (1.0 - leverage).max(1e-3).sqrt();
        size.push(residuals[row].abs());
    }
    size.sort_by(f64::total_cmp);
    let deviation = 1.4826 * size[size.len() / 2].max(1e-12);
    residuals
        .iter()
        .map(|residual| residual.abs() / deviation)
        .collect()
}
