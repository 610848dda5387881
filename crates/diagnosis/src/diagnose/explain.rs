//! The attribution of a session of touches: outliers are rejected, curved surfaces corrected to second order. Metres.

use effects::Variant;
use effects::finite_displacement::FiniteErrors;
use effects::observation::{Column, Observations};
use effects::variant::ChainError;
use inference::linear::add_scaled;
use inference::outliers;
use inference::posterior::{Model, ModelPosterior};
use metrology::statistics::MAD_FACTOR;
use nalgebra::{DMatrix, DVector, Vector3};

use crate::attribution::attribute_with;
use crate::attribution::candidate_pool::Shapes;
use crate::report::localisation;

/// Second-order corrections below this share of the noise are not made.
const STRAIGHT: f64 = 0.05;
/// A part turned by less than this has no second order that shows, rad.
const TURNED: f64 = 1e-3;
/// Share of the sum of squares that the pose of the part may leave where it makes most of the gap.
const MAX_OF_GAP: f64 = 0.25;
/// Rounds of second order and of outlier rejection.
const ROUNDS: usize = 3;

/// An attribution together with the outliers that were rejected before.
pub(super) struct Explained {
    pub(super) attribution: ModelPosterior,
    /// Rows that were rejected as outliers.
    pub(super) rejected: Vec<usize>,
    /// Log posterior of the best model, the outliers included.
    log_posterior: f64,
}

impl Explained {
    /// Residuals of the touches in use, m.
    pub(super) fn residuals(&self) -> Vec<f64> {
        let all = residuals(&self.attribution, &self.attribution.models[0]);
        all.into_iter()
            .zip(&self.attribution.active)
            .filter(|&(_, &used)| used)
            .map(|(value, _)| value)
            .collect()
    }
}

/// The model posterior of a session without its outliers: suspects, then those beside the best models, as long as the posterior
/// rises.
pub(super) fn explain(shapes: &Shapes<'_>) -> Explained {
    let all = vec![true; shapes.observations.rows.len()];
    let suspects = outliers::suspects(
        &shapes.default_blocks(),
        &weighted(
            shapes.observations,
            &part_turned(shapes.observations, shapes.variants, &all),
        ),
    );
    let mut best = straightened(shapes, &[]);
    let mut tried: Vec<Vec<usize>> = vec![Vec::new()];
    if !suspects.is_empty() {
        let other = straightened(shapes, &suspects);
        if other.log_posterior > best.log_posterior {
            best = other;
        }
        tried.push(suspects);
    }
    for _ in 0..ROUNDS {
        let mut better: Option<Explained> = None;
        for rejected in suspected_outliers(&best) {
            if tried.contains(&rejected)
                || rejected.len() > outliers::most_outliers(best.attribution.y.len())
            {
                continue;
            }
            let other = straightened(shapes, &rejected);
            if other.log_posterior
                > better
                    .as_ref()
                    .map_or(best.log_posterior, |known| known.log_posterior)
            {
                better = Some(other);
            }
            tried.push(rejected);
        }
        match better {
            Some(other) => best = other,
            None => break,
        }
    }
    best
}

/// Touches that may be outliers: beside the best model, beside the best one without an unknown cause, since a discrepancy
/// can follow a few outliers, and beside the best one with even noise, since a few outliers look like the noise of their kind
/// of touches.
fn suspected_outliers(explained: &Explained) -> Vec<Vec<usize>> {
    let attribution = &explained.attribution;
    let best = attribution.models.first();
    let known = (attribution.models.iter()).find(|model| !attribution.is_unknown(model));
    let even = (attribution.models.iter()).find(|model| model.discrepancy.is_none());
    (best.into_iter().chain(known).chain(even))
        .map(|model| outliers_beside(attribution, model))
        .collect()
}

/// The model posterior with the second order of curved surfaces taken into account.
fn straightened(shapes: &Shapes<'_>, rejected: &[usize]) -> Explained {
    let (observations, variants) = (shapes.observations, shapes.variants);
    let mut active = vec![true; observations.rows.len()];
    for &row in rejected {
        active[row] = false;
    }
    let mut correction = part_turned(observations, variants, &active);
    let mut attribution =
        attribute_with(shapes, &weighted(observations, &correction), &active, None);
    for _ in 0..ROUNDS {
        let model = &attribution.models[0];
        let Some(fit) = attribution.fit(model) else {
            break;
        };
        let (linear, finite) = shifts(observations, variants, &attribution, model);
        let second: Vec<f64> = observations.second_order(&linear, &finite);
        let change =
            |(row, new): (usize, &f64)| (new - correction.get(row).copied().unwrap_or(0.0)).abs();
        let largest = second.iter().enumerate().map(change).fold(0.0, f64::max);
        if largest < STRAIGHT * fit.variance.sqrt() {
            break;
        }
        correction = second;
        let y = weighted(observations, &correction);
        attribution = attribute_with(shapes, &y, &active, Some(&attribution));
    }
    let log_posterior =
        attribution.models[0].log_posterior + outliers::log_evidence(rejected.len());
    Explained {
        attribution,
        rejected: rejected.to_vec(),
        log_posterior,
    }
}

/// Weighted deviations less a correction.
fn weighted(observations: &Observations, correction: &[f64]) -> Vec<f64> {
    let correction = correction.iter().copied().chain(std::iter::repeat(0.0));
    let values = observations
        .deviations
        .iter()
        .zip(&observations.rows)
        .zip(correction);
    values
        .map(|((deviation, row), correction)| (deviation - correction) * row.weight)
        .collect()
}

/// Displacements of the ball under a model, row by row, to first order and at finite size, without the effects whose second
/// order is a column of its own.
fn shifts(
    observations: &Observations,
    variants: &[Variant],
    attribution: &ModelPosterior,
    model: &Model,
) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    let mut shifts = Shifts::none(observations);
    let Some(fit) = attribution.fit(model) else {
        return (shifts.linear, shifts.others);
    };
    for (_, candidate, coefficients) in attribution.members(model, &fit) {
        if candidate.second_order {
            continue;
        }
        let values =
            &candidate.parameters_from_block * nalgebra::DVector::from_column_slice(coefficients);
        let variant = &variants[candidate.variant];
        let columns = variant.columns(observations, candidate.shape);
        shifts.add(variant, &columns, values.as_slice());
    }
    shifts.of_both_orders(observations)
}

/// Displacements of the ball in every row, m.
struct Shifts {
    /// To first order.
    linear: Vec<Vector3<f64>>,
    /// Those that are no errors of the chain.
    others: Vec<Vector3<f64>>,
    /// The errors of the chain.
    errors: FiniteErrors,
}

impl Shifts {
    fn none(observations: &Observations) -> Self {
        let none = vec![Vector3::zeros(); observations.rows.len()];
        Self {
            linear: none.clone(),
            others: none,
            errors: FiniteErrors::none(&observations.chain),
        }
    }

    /// Adds a variant at definite parameters.
    fn add(&mut self, variant: &Variant, columns: &[Column], values: &[f64]) {
        let of_chain = self.errors.add(variant, values);
        for (column, value) in columns.iter().zip(values) {
            for (row, part) in column.shifts.iter().enumerate() {
                self.linear[row] += part * *value;
                if !of_chain {
                    self.others[row] += part * *value;
                }
            }
        }
    }

    /// To first order and at finite size.
    fn of_both_orders(self, observations: &Observations) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
        let finite = (self.others.iter().zip(self.errors.shifts(observations)))
            .map(|(other, finite)| other + finite);
        (self.linear, finite.collect())
    }
}

/// The second order of a part that lies turned by more than a derivative carries, where its pose makes most of the gap, by
/// least squares; empty elsewhere.
///
/// Only a start: what acts is decided by the attribution, whose model gives the second order from then on.
fn part_turned(observations: &Observations, variants: &[Variant], active: &[bool]) -> Vec<f64> {
    let poses: Vec<&Variant> = (variants.iter())
        .filter(|variant| matches!(variant.errors.first(), Some(ChainError::Part(_))))
        .collect();
    let columns: Vec<Vec<Column>> = (poses.iter())
        .map(|variant| variant.columns(observations, 0.0))
        .collect();
    let sizes: Vec<f64> = (poses.iter().flat_map(|variant| &variant.parameters))
        .map(|parameter| parameter.plausible)
        .collect();
    if sizes.is_empty() {
        return Vec::new();
    }
    let mut left = observations.deviations.clone();
    let used = |row: usize| {
        if active[row] {
            observations.rows[row].weight
        } else {
            0.0
        }
    };
    let matrix = DMatrix::from_fn(left.len(), sizes.len(), |row, number| {
        let column = columns.iter().flatten().nth(number);
        column.map_or(0.0, |column| column.signature[row]) * sizes[number] * used(row)
    });
    let energy = |values: &[f64]| -> f64 {
        let rows = values.iter().enumerate();
        rows.map(|(row, value)| (value * used(row)).powi(2)).sum()
    };
    let before = energy(&left);
    let mut correction = Vec::new();
    for _ in 0..ROUNDS {
        let weighted = left
            .iter()
            .enumerate()
            .map(|(row, value)| value * used(row));
        let weighted = DVector::from_iterator(left.len(), weighted);
        // A millionth of a metre is noise: directions that hardly show stay plausible.
        let normal = matrix.tr_mul(&matrix) + DMatrix::identity(sizes.len(), sizes.len()) * 1e-12;
        let Some(factor) = normal.cholesky() else {
            return Vec::new();
        };
        let found = factor.solve(&matrix.tr_mul(&weighted));
        let remaining = (weighted - &matrix * &found).norm_squared();
        let values: Vec<f64> = found
            .iter()
            .zip(&sizes)
            .map(|(value, size)| value * size)
            .collect();
        let turned = (poses
            .iter()
            .flat_map(|variant| &variant.errors)
            .zip(&values))
        .filter(|(error, _)| matches!(error, ChainError::Part(3..)))
        .fold(0.0, |sum: f64, (_, value)| sum.hypot(*value));
        if turned < TURNED || remaining > MAX_OF_GAP * before {
            return correction;
        }
        let mut shifts = Shifts::none(observations);
        let mut rest = values.as_slice();
        for (variant, columns) in poses.iter().zip(&columns) {
            let (own, others) = rest.split_at(columns.len());
            shifts.add(variant, columns, own);
            rest = others;
        }
        let (linear, finite) = shifts.of_both_orders(observations);
        correction = observations.second_order(&linear, &finite);
        left.clone_from(&observations.deviations);
        add_scaled(&mut left, -1.0, &correction);
    }
    correction
}

/// Weighted residuals of a model, less the posterior mean of its discrepancy; where touches are noisier than others, in
/// units of the others.
pub(super) fn residuals(attribution: &ModelPosterior, model: &Model) -> Vec<f64> {
    let mut residuals = attribution
        .residuals(model)
        .unwrap_or_else(|| attribution.y.clone());
    if let Some(widening) = attribution.widening(model) {
        let used = residuals.iter_mut().zip(&attribution.active);
        let used = used
            .filter(|(_, used)| **used)
            .map(|(residual, _)| residual);
        for (residual, wider) in used.zip(widening) {
            *residual /= wider;
        }
        return residuals;
    }
    let index = attribution
        .models
        .iter()
        .position(|known| std::ptr::eq(known, model));
    if let Some((_, part)) =
        index.and_then(|index| localisation::discrepancy_part(attribution, index))
    {
        add_scaled(&mut residuals, -1.0, &part);
    }
    residuals
}

/// Touches whose residual exceeds the outlier threshold of a model.
fn outliers_beside(attribution: &ModelPosterior, model: &Model) -> Vec<usize> {
    let residuals = residuals(attribution, model);
    let mut sizes: Vec<f64> = residuals
        .iter()
        .zip(&attribution.active)
        .filter(|&(_, &used)| used)
        .map(|(value, _)| value.abs())
        .collect();
    sizes.sort_by(f64::total_cmp);
    let noise = (MAD_FACTOR * sizes[sizes.len() / 2]).max(1e-9);
    let density = -(noise * std::f64::consts::TAU.sqrt()).ln();
    let bound = (2.0 * (density - outliers::log_evidence(1)))
        .max(9.0)
        .sqrt();
    (0..residuals.len())
        .filter(|&row| residuals[row].abs() > bound * noise)
        .collect()
}
