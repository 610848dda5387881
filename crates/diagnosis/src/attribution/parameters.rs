//! Parameters of the named effects with their 95 % intervals, from the fitted blocks.
//!
//! Gauss-Newton fit and covariance of all coefficients and of the continuous shapes together, so that the uncertainty of a time
//! constant widens the interval of its amplitude; amplitudes and phases by the delta method (GUM 5.1.2); the coverage factor
//! is Student's t for the residual degrees of freedom (GUM G.3). Beside an unknown cause its process is estimated with them,
//! generalised least squares, so that an interval holds what it may have added; touches that are noisier than others weigh less.
//! Coefficients in m; parameters in the effects' own units.

use std::borrow::Cow;
use std::ops::Range;

use effects::{ParameterEstimate, candidate};
use inference::candidate::Candidate;
use inference::linear::{add_scaled, dot};
use inference::posterior::{Model, ModelPosterior};
use metrology::statistics::coverage_factor;
use nalgebra::{DMatrix, DVector};

use super::candidate_pool::Shapes;
use super::whitening::Whitened;

/// Ridge of the normal equations, relative to their largest diagonal element.
const RIDGE: f64 = 1e-9;
/// Explanations over which parameters are averaged, at most.
const AVERAGED: usize = 8;
/// Coverage factor of 95 % for standard deviations of many degrees of freedom.
pub(crate) const NORMAL_COVERAGE: f64 = 1.96;
/// Steps of the shapes at most.
const STEPS: usize = 6;
/// Shapes that move by less than this share of their standard uncertainty have converged.
const CONVERGED: f64 = 0.05;
/// Singular values below this share of the noise-free solution are taken as zero.
const SINGULAR: f64 = 1e-9;

/// Parameters of each member of a set, in its order, beside the process of an `unknown` cause: its index and its variance over that
/// of the noise.
pub(crate) fn estimates(
    shapes: &Shapes<'_>,
    attribution: &ModelPosterior,
    set: &[usize],
    unknown: Option<(usize, f64)>,
) -> Vec<Vec<ParameterEstimate>> {
    let members: Vec<&Candidate> = set
        .iter()
        .map(|&member| &attribution.candidates[member])
        .collect();
    of_members(shapes, attribution, &members, unknown)
}

/// The same, averaged over the explanations with something unknown in them that hold these members (Hoeting et al. 1999, eq. 3 and
/// 4): where its size and kind, and what else acts, are not sure, an interval holds what they change.
pub(crate) fn averaged(
    shapes: &Shapes<'_>,
    attribution: &ModelPosterior,
    set: &[usize],
    unknown: Option<(usize, f64)>,
) -> Vec<Vec<ParameterEstimate>> {
    let mut estimates = estimates(shapes, attribution, set, unknown);
    if unknown.is_none() {
        return estimates;
    }
    let holds = |model: &&Model| {
        attribution.is_unknown(model) && set.iter().all(|member| model.set.contains(member))
    };
    let models: Vec<&Model> = (attribution.models.iter())
        .filter(holds)
        .take(AVERAGED)
        .collect();
    let of_models: Vec<(f64, Vec<Vec<ParameterEstimate>>)> = (models.iter())
        .map(|model| {
            let mut all = self::estimates(shapes, attribution, &model.set, model.discrepancy);
            let mut own = |member: &usize| {
                let place = model.set.iter().position(|other| other == member);
                place
                    .and_then(|place| all.get_mut(place))
                    .map(std::mem::take)
            };
            let of_set = set.iter().map(|member| own(member).unwrap_or_default());
            (model.probability, of_set.collect())
        })
        .collect();
    for (index, effect) in estimates.iter_mut().enumerate() {
        for parameter in effect {
            let same = |(weight, of): &(f64, Vec<Vec<ParameterEstimate>>)| {
                let mut named = of[index].iter();
                let own = named.find(|other| other.name == parameter.name)?;
                Some((*weight, own.value, own.ci95))
            };
            let all: Vec<(f64, f64, [f64; 2])> = of_models.iter().filter_map(same).collect();
            average(parameter, &all);
        }
    }
    estimates
}

/// Sets a parameter to the mean of some weighted estimates with their intervals, its interval to the spread within and between
/// them. A phase is left where it is: another turn is no other value.
fn average(parameter: &mut ParameterEstimate, all: &[(f64, f64, [f64; 2])]) {
    let total: f64 = all.iter().map(|(weight, ..)| weight).sum();
    if total <= 0.0 || parameter.unit == "rad" && parameter.name == "phase" {
        return;
    }
    let mean = all
        .iter()
        .map(|(weight, value, _)| weight * value)
        .sum::<f64>()
        / total;
    let spread = all.iter().map(|(weight, value, [low, high])| {
        weight * ((0.5 * (high - low)).powi(2) + (NORMAL_COVERAGE * (value - mean)).powi(2))
    });
    let half = (spread.sum::<f64>() / total).sqrt();
    parameter.value = mean;
    parameter.ci95 = [mean - half, mean + half];
}

/// The same for candidates that need not be among those of the attribution; empty lists where they cannot be fitted.
pub(crate) fn of_members(
    shapes: &Shapes<'_>,
    attribution: &ModelPosterior,
    members: &[&Candidate],
    unknown: Option<(usize, f64)>,
) -> Vec<Vec<ParameterEstimate>> {
    let Some((members, fit)) = fitted(shapes, attribution, members, unknown) else {
        return vec![Vec::new(); members.len()];
    };
    let coverage = coverage_factor(0.95, fit.freedom);
    (members.iter().enumerate())
        .map(|(index, candidate)| {
            let span = &fit.spans[index];
            let size = (span.len(), span.len());
            effects::estimates::estimates(
                &shapes.variants[candidate.variant],
                candidate,
                &fit.coefficients.rows(span.start, span.len()).into_owned(),
                &fit.covariance
                    .view((span.start, span.start), size)
                    .into_owned(),
                fit.shape_variance(index),
                coverage,
            )
        })
        .collect()
}

/// Members with their continuous shapes where the fit of all together is best, and that fit; `None` where they cannot be fitted.
///
/// A shape comes from a scan of the deviations, one at a time and beside nothing unknown: of a long travel it lies several
/// standard uncertainties off, and what else acts moves it further.
fn fitted<'m>(
    shapes: &Shapes<'_>,
    attribution: &ModelPosterior,
    members: &[&'m Candidate],
    unknown: Option<(usize, f64)>,
) -> Option<(Vec<Cow<'m, Candidate>>, GaussNewton)> {
    let rows = Whitened::new(shapes, attribution, unknown);
    let mut members: Vec<Cow<'m, Candidate>> = members.iter().copied().map(Cow::Borrowed).collect();
    let mut fit = GaussNewton::new(shapes, &rows, &members)?;
    let mut length = 1.0;
    for _ in 0..STEPS {
        let steps = fit.steps();
        if (steps.iter()).all(|step| step.by.abs() < CONVERGED * step.uncertainty) {
            break;
        }
        let Some(moved) = moved(shapes, &members, &steps, length) else {
            break;
        };
        match GaussNewton::new(shapes, &rows, &moved) {
            Some(better) if better.misfit < fit.misfit => {
                (members, fit, length) = (moved, better, 1.0);
            }
            // Too far for the linearisation.
            _ => length *= 0.5,
        }
    }
    Some((members, fit))
}

/// The members with their shapes moved by a share of the steps; `None` where one leaves the values that are tried.
fn moved<'m>(
    shapes: &Shapes<'_>,
    members: &[Cow<'m, Candidate>],
    steps: &[Step],
    length: f64,
) -> Option<Vec<Cow<'m, Candidate>>> {
    let mut all = members.to_vec();
    for step in steps {
        let own = &members[step.member];
        let tried = &shapes.variants[own.variant].shape.as_ref()?.trials;
        let (first, last) = (tried.first()?, tried.last()?);
        let range = first.min(*last)..=first.max(*last);
        let to = own.shape + length * step.by;
        if !range.contains(&to) {
            return None;
        }
        let made = candidate(shapes.observations, shapes.variants, own.variant, to)?;
        all[step.member] = Cow::Owned(made);
    }
    Some(all)
}

/// By how much the shape of a member is to be moved, and its standard uncertainty, both in its unit.
struct Step {
    member: usize,
    by: f64,
    uncertainty: f64,
}

/// Least squares of the coefficients, linearised in the continuous shapes.
struct GaussNewton {
    /// Coefficients of each member.
    spans: Vec<Range<usize>>,
    coefficients: DVector<f64>,
    shapes: Vec<ShapeDerivative>,
    /// Covariance of the coefficients, m², then of the coefficients of the shapes' derivatives.
    covariance: DMatrix<f64>,
    /// Residual degrees of freedom, at least 1.
    freedom: f64,
    /// Sum of the squares of the whitened residuals, m².
    misfit: f64,
    /// What the residuals have along the derivative of each shape, m.
    along: Vec<f64>,
}

/// How the fitted signature of a member changes with its shape, over the whitened rows.
struct ShapeDerivative {
    member: usize,
    /// Length of the derivative, m over the unit of the shape.
    length: f64,
    /// The derivative over its length.
    column: Vec<f64>,
}

impl GaussNewton {
    /// `None` where the normal equations are singular.
    fn new(shapes: &Shapes<'_>, rows: &Whitened, members: &[Cow<'_, Candidate>]) -> Option<Self> {
        let y = &rows.y;
        let columns: Vec<Vec<f64>> = (members.iter().flat_map(|member| &member.block))
            .map(|column| rows.white(column))
            .collect();
        let linear = DMatrix::from_fn(y.len(), columns.len(), |row, column| columns[column][row]);
        let plausible: Vec<f64> = (members.iter())
            .flat_map(|candidate| candidate.plausible.iter().copied())
            .collect();
        let coefficients = solve(&linear, y, &plausible)?;
        let spans = spans(members);
        let derivatives = derivatives(shapes, rows, members, &spans, &coefficients);
        let jacobian = DMatrix::from_fn(
            y.len(),
            columns.len() + derivatives.len(),
            |row, column| match column.checked_sub(columns.len()) {
                None => linear[(row, column)],
                Some(shape) => derivatives[shape].column[row],
            },
        );
        let freedom = (y.len() as f64 - jacobian.ncols() as f64).max(1.0);
        let residuals = y - &linear * &coefficients;
        let misfit = residuals.norm_squared();
        let variance = misfit / freedom;
        let along = (derivatives.iter())
            .map(|shape| dot(&shape.column, residuals.as_slice()))
            .collect();
        Some(Self {
            covariance: covariance(&jacobian, variance, &plausible)?,
            spans,
            coefficients,
            shapes: derivatives,
            freedom,
            misfit,
            along,
        })
    }

    /// The step of each shape that Gauss and Newton would take: the covariance over the noise variance, times what the residuals
    /// have along the derivatives; along the columns they have nothing that the priors of the coefficients do not hold.
    fn steps(&self) -> Vec<Step> {
        let first = self.coefficients.len();
        let variance = self.misfit / self.freedom;
        (self.shapes.iter().enumerate())
            .map(|(index, shape)| {
                let own = self.covariance.row(first + index);
                let by = (self.along.iter().enumerate())
                    .map(|(other, along)| own[first + other] / variance * along)
                    .sum::<f64>();
                Step {
                    member: shape.member,
                    by: by / shape.length,
                    uncertainty: own[first + index].max(0.0).sqrt() / shape.length,
                }
            })
            .collect()
    }

    /// Variance of a member's continuous shape, in its unit squared; `None` where it has none.
    fn shape_variance(&self, member: usize) -> Option<f64> {
        let index = (self.shapes.iter()).position(|shape| shape.member == member)?;
        let length = self.shapes[index].length;
        let diagonal = self.coefficients.len() + index;
        Some(self.covariance[(diagonal, diagonal)] / (length * length))
    }
}

/// Columns of each member among those of all.
fn spans(members: &[Cow<'_, Candidate>]) -> Vec<Range<usize>> {
    let mut end = 0;
    let span = |member: &Cow<'_, Candidate>| {
        let start = end;
        end += member.block.len();
        start..end
    };
    members.iter().map(span).collect()
}

/// Coefficients, each with a Gaussian prior of its plausible size: what the touches hardly see stays plausible.
fn solve(columns: &DMatrix<f64>, y: &DVector<f64>, plausible: &[f64]) -> Option<DVector<f64>> {
    if columns.ncols() == 0 {
        return Some(DVector::zeros(0));
    }
    // The singular values of the triangle are those of the columns.
    let reduced = columns.clone().qr();
    let mut rotated = y.clone();
    reduced.q_tr_mul(&mut rotated);
    let rotated = rotated.rows(0, columns.ncols().min(y.len())).into_owned();
    let free = reduced.r().svd(true, true).solve(&rotated, SINGULAR).ok()?;
    let variance = (y - columns * free).norm_squared() / y.len() as f64;
    let mut normal = columns.transpose() * columns;
    for (index, size) in plausible.iter().enumerate() {
        normal[(index, index)] += variance / (size * size);
    }
    normal
        .cholesky()
        .map(|factor| factor.solve(&(columns.transpose() * y)))
}

/// Derivatives of the fitted signatures with respect to the continuous shapes.
fn derivatives(
    shapes: &Shapes<'_>,
    rows: &Whitened,
    members: &[Cow<'_, Candidate>],
    spans: &[Range<usize>],
    coefficients: &DVector<f64>,
) -> Vec<ShapeDerivative> {
    (members.iter().zip(spans).enumerate())
        .filter_map(|(member, (candidate, span))| {
            let columns = shapes.slopes(candidate.variant, candidate.shape)?;
            let coefficients = coefficients.rows(span.start, span.len());
            let parameters = &candidate.parameters_from_block * coefficients;
            let mut derivative = vec![0.0; shapes.observations.rows.len()];
            for (column, value) in columns.iter().zip(parameters.iter()) {
                add_scaled(&mut derivative, *value, column);
            }
            let derivative = rows.white(&derivative);
            let length = dot(&derivative, &derivative).sqrt().max(f64::MIN_POSITIVE);
            Some(ShapeDerivative {
                member,
                length,
                column: derivative.into_iter().map(|value| value / length).collect(),
            })
        })
        .collect()
}

/// Covariance of the coefficients of a Jacobian at a noise variance, the first of them with priors of plausible sizes;
/// `None` where it is singular.
fn covariance(jacobian: &DMatrix<f64>, variance: f64, plausible: &[f64]) -> Option<DMatrix<f64>> {
    let mut normal = jacobian.transpose() * jacobian;
    let ridge = RIDGE * normal.diagonal().max();
    for index in 0..normal.nrows() {
        let prior = plausible
            .get(index)
            .map_or(0.0, |size| variance / (size * size));
        normal[(index, index)] += ridge + prior;
    }
    Some(normal.try_inverse()? * variance)
}
