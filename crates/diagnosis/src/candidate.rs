//! Candidates: variants of effects at definite shapes, as orthonormal blocks over the rows of a session.
//!
//! A block spans what a variant can do to the weighted deviations; its columns are orthonormal, so that prior sizes are
//! sizes of the signature and not of a parametrisation. Directions that would not show even at a thousand times the
//! largest plausible size are left out. Metres.

use nalgebra::{DMatrix, Vector3};

use crate::effects::Variant;
use crate::evidence::{add_scaled, scale};
use crate::observation::{Column, Observations};

/// Directions whose signature stays below this rms at a thousand times the plausible size are unobservable, m.
const INVISIBLE: f64 = 2e-7;
/// What does not show to first order may be so many times as large as is plausible: nobody sees it.
const UNSEEN: f64 = 2.0;
/// A thousand times.
const FAR: f64 = 1000.0;

/// A variant at a definite shape.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Place of the variant in the library.
    pub variant: usize,
    /// Value of its nonlinear constant; 0 where it has none.
    pub shape: f64,
    /// Orthonormal columns over the weighted rows.
    pub block: Vec<Vec<f64>>,
    /// Largest plausible coefficient of each column, m.
    pub plausible: Vec<f64>,
    /// Parameters (in their units) from block coefficients.
    pub parameters_from_block: DMatrix<f64>,
    /// Natural logarithm of the prior probability of this variant and shape within its effect.
    pub log_prior: f64,
    /// True where the last block column is the second order of a sideways displacement on a curved surface: a square, so
    /// that its coefficient is not negative.
    pub bends: bool,
}

/// A variant at a definite shape that spans what a candidate of another effect spans.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alias {
    /// Place of the variant in the library.
    pub variant: usize,
    /// Value of its nonlinear constant; 0 where it has none.
    pub shape: f64,
    /// True where the second order of a sideways displacement belongs to it.
    pub bends: bool,
}

impl Candidate {
    /// The block of a variant; `None` where this session cannot see it at all.
    pub fn new(
        observations: &Observations,
        variants: &[Variant],
        variant: usize,
        shape: f64,
    ) -> Option<Self> {
        let columns = variants[variant].columns(observations, shape);
        Self::from_columns(
            observations,
            &variants[variant],
            variant,
            shape,
            &columns,
            false,
        )
    }

    /// The same with the second order of what cannot be seen to first order; `None` where there is no such thing.
    pub fn bent(
        observations: &Observations,
        variants: &[Variant],
        variant: usize,
        shape: f64,
    ) -> Option<Self> {
        let columns = variants[variant].columns(observations, shape);
        Self::from_columns(
            observations,
            &variants[variant],
            variant,
            shape,
            &columns,
            true,
        )
    }

    /// [`Self::new`] and [`Self::bent`] of a variant without a shape.
    pub(crate) fn both(
        observations: &Observations,
        variants: &[Variant],
        place: usize,
    ) -> (Option<Self>, Option<Self>) {
        let columns = variants[place].columns(observations, 0.0);
        let of =
            |bent| Self::from_columns(observations, &variants[place], place, 0.0, &columns, bent);
        let bends = columns.iter().all(|column| !column.shifts.is_empty());
        (of(false), if bends { of(true) } else { None })
    }

    fn from_columns(
        observations: &Observations,
        variant: &Variant,
        place: usize,
        shape: f64,
        columns: &[Column],
        bent: bool,
    ) -> Option<Self> {
        let rows = observations.rows.len();
        let sizes: Vec<f64> = variant
            .parameters
            .iter()
            .map(|parameter| parameter.plausible)
            .collect();
        let scaled = DMatrix::from_fn(rows, columns.len(), |row, column| {
            columns[column].signature[row] * sizes[column] * observations.rows[row].weight
        });
        let eigen = (scaled.transpose() * &scaled).symmetric_eigen();
        let least = (INVISIBLE / FAR).powi(2) * rows as f64;
        let mut kept: Vec<usize> = (0..columns.len()).collect();
        kept.sort_by(|&one, &other| eigen.eigenvalues[other].total_cmp(&eigen.eigenvalues[one]));
        let largest = kept.first().map_or(0.0, |&index| eigen.eigenvalues[index]);
        let (seen, unseen): (Vec<usize>, Vec<usize>) = kept.into_iter().partition(|&index| {
            eigen.eigenvalues[index] > least && eigen.eigenvalues[index] > 1e-12 * largest
        });
        let mut block: Vec<Vec<f64>> = Vec::new();
        let mut back: Vec<Vec<f64>> = Vec::new();
        let mut plausible: Vec<f64> = Vec::new();
        for &index in &seen {
            let length = eigen.eigenvalues[index].sqrt();
            let direction = eigen.eigenvectors.column(index);
            plausible.push(length);
            block.push((&scaled * direction / length).iter().copied().collect());
            back.push(
                direction
                    .iter()
                    .zip(&sizes)
                    .map(|(part, size)| part * size / length)
                    .collect(),
            );
        }
        if bent {
            let bend = unseen.iter().find_map(|&index| {
                let direction = eigen.eigenvectors.column(index);
                let shares: Vec<f64> = direction
                    .iter()
                    .zip(&sizes)
                    .map(|(part, size)| part * size)
                    .collect();
                bend(observations, columns, &shares, &block)
            })?;
            // The bend was made orthonormal: what it lost to the linear columns belongs to their parameters.
            let own = bend.along.iter().zip(&back).fold(
                vec![0.0; columns.len()],
                |mut sum, (along, back)| {
                    add_scaled(&mut sum, -along, back);
                    sum
                },
            );
            block.push(bend.column);
            plausible.push(UNSEEN * UNSEEN * bend.length);
            back.push(own);
        }
        if block.is_empty() {
            return None;
        }
        let parameters_from_block =
            DMatrix::from_fn(columns.len(), block.len(), |row, column| back[column][row]);
        let shapes = variant
            .shape
            .as_ref()
            .map_or(0.0, |shape| shape.distinct.max(1.0).ln());
        Some(Self {
            variant: place,
            shape,
            block,
            plausible,
            parameters_from_block,
            log_prior: -shapes - if bent { std::f64::consts::LN_2 } else { 0.0 },
            bends: bent,
        })
    }
}

/// A second-order column and its products with the linear ones over its own length.
struct Bend {
    column: Vec<f64>,
    /// Its coefficient at the largest plausible displacement, m.
    length: f64,
    along: Vec<f64>,
}

/// Second order of the sideways displacement `shares` (a combination of columns), made orthonormal to `block`.
fn bend(
    observations: &Observations,
    columns: &[Column],
    shares: &[f64],
    block: &[Vec<f64>],
) -> Option<Bend> {
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
    let mut column: Vec<f64> = observations
        .curvature(&shifts)
        .iter()
        .zip(&observations.rows)
        .map(|(value, row)| value * row.weight)
        .collect();
    let rms = |values: &[f64]| {
        (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
    };
    if rms(&column) < INVISIBLE {
        return None;
    }
    let mut along = Vec::with_capacity(block.len());
    for known in block {
        let product: f64 = known.iter().zip(&column).map(|(a, b)| a * b).sum();
        add_scaled(&mut column, -product, known);
        along.push(product);
    }
    let left = rms(&column);
    if left < 0.5 * INVISIBLE {
        return None;
    }
    let length = left * (column.len() as f64).sqrt();
    scale(&mut column, 1.0 / length);
    scale(&mut along, 1.0 / length);
    Some(Bend {
        column,
        length,
        along,
    })
}
