//! Separates the form of a part from the straightness of the guideway that measured it.
//!
//! Lengths in m, samples at equal spacing. `docs/source_systems.md, C.3 and C.4`: pass j reads
//! `K_j(z) = R(z + m_j·spacing) + S(z)`, R the part's form, S the guideway seen by the probe, the part moved by m_j
//! samples. The printed equations (4) and (5) are defective; the consistent set is used.
//!
//! What no method here can know, and none claims:
//! - a constant, and once the height of a later pass is unknown also a line: judge straightness after
//!   [`without_line`];
//! - a parabola, once the tilt of a later pass is unknown, whatever the number of shifts: a tilt φ of pass 2 bows the
//!   result by φL²/(8σ) ([`tilt_bow`]); only [`reversal`] is immune;
//! - waves whose period divides every shift; near those the noise is amplified by 1/|e^{i2πσ/λ} − 1|.

mod polynomial;

pub use polynomial::{PolynomialSeparation, polynomial};

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// One pass of the probe over the part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pass {
    /// m: how many samples the part is moved against the first pass.
    pub shift: usize,
    /// K at the N samples of the guideway, m.
    pub readings: Vec<f64>,
}

/// What a shift leaves undetermined between passes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum SetUp {
    /// Every pass has the height and tilt of the first.
    #[default]
    Exact,
    /// Each later pass has an unknown height.
    Height,
    /// Each later pass has an unknown height and tilt.
    HeightAndTilt,
}

/// Part and guideway, separated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Separation {
    /// R at the samples of the part, N plus the largest shift, m.
    pub part: Vec<f64>,
    /// S at the N samples of the guideway, m.
    pub guideway: Vec<f64>,
    /// Independent shapes that the passes leave undetermined; the result holds none of them.
    pub undetermined: usize,
}

/// Passes that cannot be separated.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SeparationError {
    /// Passes of different or too small length.
    #[error("passes need equally many samples, at least {needed}; one has {given}")]
    Length {
        /// Smallest admissible, or the first pass's, number.
        needed: usize,
        /// Number given.
        given: usize,
    },
    /// A reading is NaN or infinite.
    #[error("sample {sample} of pass {pass} is not a number")]
    NotFinite {
        /// Index of the pass.
        pass: usize,
        /// Index of the sample.
        sample: usize,
    },
    /// Fewer than two different shifts.
    #[error("two passes at different shifts are needed")]
    NoShift,
    /// The shifts have a common divisor, so the samples fall into chains without connection (C.4, 4).
    #[error(
        "all shifts are multiples of {0} samples, which leaves {0} chains of samples unconnected"
    )]
    Chains(usize),
    /// The order of the polynomial is 0 or not below the number of samples.
    #[error("a polynomial of order {0} cannot be determined")]
    Order(usize),
    /// The sample spacing is not positive.
    #[error("the sample spacing is {0} m")]
    Spacing(f64),
}

fn check(passes: &[&[f64]], needed: usize) -> Result<(), SeparationError> {
    let n = passes.first().map_or(0, |p| p.len());
    for (pass, readings) in passes.iter().enumerate() {
        let given = readings.len();
        if given < needed || given != n {
            return Err(SeparationError::Length {
                needed: n.max(needed),
                given,
            });
        }
        if let Some(sample) = readings.iter().position(|k| !k.is_finite()) {
            return Err(SeparationError::NotFinite { pass, sample });
        }
    }
    Ok(())
}

/// Equations (3)–(6): S_k = S_{k−1} − (K1_{k−1} − K0_k), S_0 = 0, for a part moved by exactly one sample.
///
/// Exact without noise; with noise a random walk whose standard deviation grows as σ√(2k) (C.4, 5).
///
/// # Errors
/// See [`SeparationError`].
pub fn recursion(first: &[f64], shifted: &[f64]) -> Result<Separation, SeparationError> {
    check(&[first, shifted], 2)?;
    let mut guideway = vec![0.0; first.len()];
    for k in 1..first.len() {
        guideway[k] = guideway[k - 1] - (shifted[k - 1] - first[k]);
    }
    let mut part: Vec<f64> = first.iter().zip(&guideway).map(|(k, s)| k - s).collect();
    let last = guideway.len() - 1;
    part.push(shifted[last] - guideway[last]);
    Ok(Separation {
        part,
        guideway,
        undetermined: 1,
    })
}

/// Part *and* probe turned to the opposite side for the second pass: S = (K0 − K1)/2, R = (K0 + K1)/2.
///
/// Immune to height and tilt of the second pass up to a constant and a line.
///
/// # Errors
/// See [`SeparationError`].
pub fn reversal(first: &[f64], reversed: &[f64]) -> Result<Separation, SeparationError> {
    check(&[first, reversed], 2)?;
    let pairs = || first.iter().zip(reversed);
    Ok(Separation {
        part: pairs().map(|(a, b)| f64::midpoint(*a, *b)).collect(),
        guideway: pairs().map(|(a, b)| (a - b) / 2.0).collect(),
        undetermined: 0,
    })
}

/// Design matrix of passes at `shifts` over `samples` points: unknowns S (N), R (N + largest shift), then heights and
/// tilts of the later passes as `set_up` asks; one row per reading, pass by pass.
fn design(samples: usize, shifts: &[usize], set_up: SetUp) -> DMatrix<f64> {
    let reach = shifts.iter().copied().max().unwrap_or(0);
    let nuisances = match set_up {
        SetUp::Exact => 0,
        SetUp::Height => 1,
        SetUp::HeightAndTilt => 2,
    };
    let shapes = 2 * samples + reach;
    let columns = shapes + nuisances * shifts.len().saturating_sub(1);
    let mut matrix = DMatrix::zeros(samples * shifts.len(), columns);
    for (pass, shift) in shifts.iter().enumerate() {
        for i in 0..samples {
            let row = pass * samples + i;
            matrix[(row, i)] = 1.0;
            matrix[(row, samples + i + shift)] = 1.0;
            if pass > 0 {
                let at = shapes + nuisances * (pass - 1);
                let powers = [1.0, (i as f64 + 0.5) / samples as f64 - 0.5];
                for (power, value) in powers.iter().take(nuisances).enumerate() {
                    matrix[(row, at + power)] = *value;
                }
            }
        }
    }
    matrix
}

/// Relative size under which a singular value of the design counts as zero; the true ones are of order one.
const RANK: f64 = 1e-9;

/// Number of independent shapes of part and guideway that passes at `shifts` over `samples` points cannot separate.
pub fn undetermined(samples: usize, shifts: &[usize], set_up: SetUp) -> usize {
    let matrix = design(samples, shifts, set_up);
    let columns = matrix.ncols();
    let values = matrix.svd(false, false).singular_values;
    let largest = values.iter().copied().fold(0.0, f64::max);
    columns - values.iter().filter(|v| **v > RANK * largest).count()
}

/// Least squares over any number of passes at different shifts; the shortest of the equally good solutions.
///
/// # Errors
/// See [`SeparationError`].
pub fn least_squares(passes: &[Pass], set_up: SetUp) -> Result<Separation, SeparationError> {
    let readings: Vec<&[f64]> = passes.iter().map(|p| p.readings.as_slice()).collect();
    check(&readings, 3)?;
    let shifts: Vec<usize> = passes.iter().map(|p| p.shift).collect();
    let base = shifts.first().copied().ok_or(SeparationError::NoShift)?;
    let divisor = shifts.iter().fold(0, |d, shift| {
        greatest_common_divisor(d, shift.abs_diff(base))
    });
    match divisor {
        0 => return Err(SeparationError::NoShift),
        1 => {}
        chains => return Err(SeparationError::Chains(chains)),
    }
    let samples = readings[0].len();
    let least = shifts.iter().copied().min().unwrap_or(0);
    let shifts: Vec<usize> = shifts.iter().map(|shift| shift - least).collect();
    let reach = shifts.iter().copied().max().unwrap_or(0);
    let matrix = design(samples, &shifts, set_up);
    let right = DVector::from_iterator(
        samples * passes.len(),
        readings.iter().flat_map(|r| r.iter().copied()),
    );
    let svd = matrix.svd(true, true);
    let largest = svd.singular_values.max();
    let rank = svd
        .singular_values
        .iter()
        .filter(|v| **v > RANK * largest)
        .count();
    let columns = svd.v_t.as_ref().map_or(0, DMatrix::ncols);
    // Both factors were asked for above, so this cannot fail; an empty solution would say so.
    let solution = svd
        .solve(&right, RANK * largest)
        .unwrap_or_else(|_| DVector::zeros(columns));
    Ok(Separation {
        guideway: solution.rows(0, samples).iter().copied().collect(),
        part: solution
            .rows(samples, samples + reach)
            .iter()
            .copied()
            .collect(),
        undetermined: columns - rank,
    })
}

fn greatest_common_divisor(a: usize, b: usize) -> usize {
    if b == 0 {
        a
    } else {
        greatest_common_divisor(b, a % b)
    }
}

/// Values (m) at equal spacing, less their least-squares line: what straightness is judged on.
pub fn without_line(values: &[f64]) -> Vec<f64> {
    let n = values.len() as f64;
    let middle = (n - 1.0) / 2.0;
    let mean = values.iter().sum::<f64>() / n;
    let (mut moment, mut square) = (0.0, 0.0);
    for (i, value) in values.iter().enumerate() {
        let z = i as f64 - middle;
        moment += z * (value - mean);
        square += z * z;
    }
    let slope = if square > 0.0 { moment / square } else { 0.0 };
    let line = |i: usize| mean + slope * (i as f64 - middle);
    let rest = values.iter().enumerate().map(|(i, value)| value - line(i));
    rest.collect()
}

/// Height in m of the bow over `length` (m) by which a tilt of `tilt` rad in a pass shifted by `shift` (m) falsifies the
/// result: φL²/(8σ) (C.4, 2).
pub fn tilt_bow(tilt: f64, length: f64, shift: f64) -> f64 {
    tilt * length * length / (8.0 * shift)
}
