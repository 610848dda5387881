//! The R/U/C protocol of D.4: process floor, uncompensated, compensated; and the link errors that the mismatches show.
//!
//! R cuts both halves at one index, U at two, C at two with compensation. Noise is one normal deviation per surface.

use machine::{ChainErrors, LinkError, Volumetric};
use nalgebra::{DMatrix, DVector};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::{MismatchError, MismatchTest, RANK};

/// Mismatches of one test, m, in the order of the rows.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// R: both halves at one index.
    pub floor: Vec<f64>,
    /// U: two indices.
    pub uncompensated: Vec<f64>,
    /// C: two indices, compensated.
    pub compensated: Vec<f64>,
}

impl MismatchTest {
    /// One test of a machine with `errors`, compensated by `volumetric`; `noise` (m) is that of one surface.
    ///
    /// # Errors
    /// A compensation of another machine.
    pub fn run(
        &self,
        errors: &ChainErrors,
        volumetric: &Volumetric,
        noise: f64,
        random: &mut impl Rng,
    ) -> Result<Outcome, MismatchError> {
        let mut read = |rows: Vec<f64>| -> Vec<f64> {
            let mut surface = || noise * Distribution::<f64>::sample(&StandardNormal, random);
            rows.iter().map(|row| row + surface() - surface()).collect()
        };
        Ok(Outcome {
            floor: read(vec![0.0; 2 * self.patterns().len()]),
            uncompensated: read(self.exact(errors, None)?),
            compensated: read(self.exact(errors, Some(volumetric))?),
        })
    }
}

/// What a calibration finds of `truth`: each size with a normal error of standard uncertainty `angle` (rad) or
/// `length` (m).
pub fn calibrated(
    truth: &[LinkError],
    angle: f64,
    length: f64,
    random: &mut impl Rng,
) -> Vec<LinkError> {
    truth
        .iter()
        .map(|link| {
            let error: f64 = StandardNormal.sample(random);
            LinkError {
                value: link.value + error * if link.turns() { angle } else { length },
                ..*link
            }
        })
        .collect()
}

/// Link errors estimated from mismatches.
#[derive(Debug, Clone)]
pub struct Identified {
    /// Sizes, m or rad; the smallest that explain the mismatches where these do not determine them.
    pub links: Vec<LinkError>,
    /// Their standard uncertainties (m or rad), infinite where the patterns cannot see the error.
    pub uncertainty: Vec<f64>,
}

/// Least-squares sizes of the errors of `links` from mismatches (m) whose halves have `noise` (m) each.
///
/// # Errors
/// Another number of mismatches than the test has rows.
pub fn identify(
    test: &MismatchTest,
    links: &[LinkError],
    mismatches: &[f64],
    noise: f64,
) -> Result<Identified, MismatchError> {
    let unit: Vec<LinkError> = links
        .iter()
        .map(|link| {
            // Sizes of like effect: a radian moves as much as the part's distance from the axes.
            let value = if link.turns() { 1.0 } else { 0.1 };
            LinkError { value, ..*link }
        })
        .collect();
    let matrix = test.sensitivity(&unit);
    if mismatches.len() != matrix.nrows() {
        return Err(MismatchError::Length {
            given: mismatches.len(),
            expected: matrix.nrows(),
        });
    }
    let (sizes, variance) = solve(&matrix, &DVector::from_column_slice(mismatches));
    let links = unit
        .iter()
        .zip(sizes.iter())
        .map(|(link, size)| LinkError {
            value: size * link.value,
            ..*link
        })
        .collect();
    // A step is the difference of two surfaces.
    let uncertainty = unit
        .iter()
        .zip(variance)
        .map(|(link, variance)| link.value * noise * (2.0 * variance).sqrt())
        .collect();
    Ok(Identified { links, uncertainty })
}

/// Least squares of the smallest norm, and the diagonal of the cofactor matrix, infinite for what is not determined.
fn solve(matrix: &DMatrix<f64>, right: &DVector<f64>) -> (DVector<f64>, Vec<f64>) {
    let columns = matrix.ncols();
    let mut sizes = DVector::zeros(columns);
    let mut variance = vec![0.0; columns];
    let mut seen = vec![0.0; columns];
    let svd = matrix.clone().svd(true, true);
    let (Some(left), Some(directions)) = (&svd.u, &svd.v_t) else {
        return (sizes, vec![f64::INFINITY; columns]);
    };
    let largest = svd.singular_values.max();
    for (index, &value) in svd.singular_values.iter().enumerate() {
        if !(value > RANK * largest) {
            continue;
        }
        let direction = directions.row(index);
        let amount = left.column(index).dot(right) / value;
        for (column, part) in direction.iter().enumerate() {
            sizes[column] += amount * part;
            variance[column] += (part / value).powi(2);
            seen[column] += part * part;
        }
    }
    for (variance, seen) in variance.iter_mut().zip(seen) {
        // What lies outside the directions seen is not determined.
        if seen < 1.0 - 1e-9 {
            *variance = f64::INFINITY;
        }
    }
    (sizes, variance)
}
