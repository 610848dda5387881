//! Parameters of the named effects with their 95 % intervals, from the fitted blocks.
//!
//! Gauss-Newton covariance of all coefficients and of the continuous shapes together, so that the uncertainty of a time
//! constant widens the interval of its amplitude; amplitudes and phases by the delta method (GUM 5.1.2); the coverage factor
//! is Student's t for the residual degrees of freedom (GUM G.3). Coefficients in m; parameters in the effects' own units.

use std::ops::Range;

use effects::ParameterEstimate;
use inference::candidate::Candidate;
use inference::columns::Rows;
use inference::linear::{add_scaled, dot};
use inference::posterior::Attribution;
use metrology::statistics::coverage_factor;
use nalgebra::{DMatrix, DVector};

use super::candidate_pool::Shapes;

/// Ridge of the normal equations, relative to their largest diagonal element.
const RIDGE: f64 = 1e-9;
/// Singular values below this share of the noise-free solution are taken as zero.
const SINGULAR: f64 = 1e-9;

/// Parameters of each member of a set, in its order.
pub(crate) fn estimates(
    shapes: &Shapes<'_>,
    attribution: &Attribution,
    set: &[usize],
) -> Vec<Vec<ParameterEstimate>> {
    let members: Vec<&Candidate> = set
        .iter()
        .map(|&member| &attribution.candidates[member])
        .collect();
    of_members(shapes, attribution, &members)
}

/// The same for candidates that need not be among those of the attribution; empty lists where they cannot be fitted.
pub(crate) fn of_members(
    shapes: &Shapes<'_>,
    attribution: &Attribution,
    members: &[&Candidate],
) -> Vec<Vec<ParameterEstimate>> {
    let Some(fit) = GaussNewton::new(shapes, attribution, members) else {
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
    fn new(shapes: &Shapes<'_>, attribution: &Attribution, members: &[&Candidate]) -> Option<Self> {
        let rows = Rows {
            active: attribution.active.clone(),
            touches: shapes.observations.touches(),
            lag1_correlation: attribution.lag1_correlation,
        };
        let y = DVector::from_vec(rows.white(&attribution.y));
        let columns: Vec<Vec<f64>> = (members.iter().flat_map(|member| &member.block))
            .map(|column| rows.white(column))
            .collect();
        let linear = DMatrix::from_fn(y.len(), columns.len(), |row, column| columns[column][row]);
        let plausible: Vec<f64> = (members.iter())
            .flat_map(|candidate| candidate.plausible.iter().copied())
            .collect();
        let coefficients = solve(&linear, &y, &plausible)?;
        let spans = spans(members);
        let derivatives = derivatives(shapes, &rows, members, &spans, &coefficients);
        let jacobian = DMatrix::from_fn(
            y.len(),
            columns.len() + derivatives.len(),
            |row, column| match column.checked_sub(columns.len()) {
                None => linear[(row, column)],
                Some(shape) => derivatives[shape].column[row],
            },
        );
        let freedom = (y.len() as f64 - jacobian.ncols() as f64).max(1.0);
        let variance = (&y - &linear * &coefficients).norm_squared() / freedom;
        Some(Self {
            covariance: covariance(&jacobian, variance, &plausible)?,
            spans,
            coefficients,
            shapes: derivatives,
            freedom,
        })
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
fn spans(members: &[&Candidate]) -> Vec<Range<usize>> {
    let mut end = 0;
    let span = |member: &&Candidate| {
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
    rows: &Rows,
    members: &[&Candidate],
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
