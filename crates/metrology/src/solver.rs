//! Nonlinear least squares: minimises `Σ rᵢ(x)²` over a vector of parameters.
//!
//! Levenberg–Marquardt with Marquardt's column scaling and the trust-region update of Nielsen (1999), each
//! linear step by a QR factorisation of the Jacobian (never of the normal equations), closed by undamped
//! Gauss–Newton steps for as long as these still shrink, so that the result is limited by the arithmetic and not by
//! a tolerance. It reaches nine certified digits on NIST's reference regressions from both published starts.
//!
//! Units are those of the caller. The solver finds the minimum in whose basin it starts; it does no global search.

use nalgebra::{DMatrix, DVector};
use thiserror::Error;

/// What is minimised: residuals and their derivatives at a parameter vector.
pub trait Residuals {
    /// The residuals (length n) at `parameters` (length p); `None` outside the model's domain, where the solver
    /// will then not go.
    fn residuals(&self, parameters: &DVector<f64>) -> Option<DVector<f64>>;

    /// The n × p matrix of `∂rᵢ/∂xⱼ` at `parameters`; `None` outside the model's domain.
    fn jacobian(&self, parameters: &DVector<f64>) -> Option<DMatrix<f64>>;
}

/// When to stop, and how far the first step may go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverOptions {
    /// Largest number of Jacobians evaluated in one descent.
    pub max_iterations: usize,
    /// First damping relative to the squared column norms; small means close to Gauss–Newton.
    pub initial_damping: f64,
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self {
            max_iterations: 8000,
            initial_damping: 1e-4,
        }
    }
}

/// A minimum and the local shape of the sum of squares there.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// The minimiser, length p.
    pub parameters: DVector<f64>,
    /// Residuals there, length n.
    pub residuals: DVector<f64>,
    /// `Σ rᵢ²` there.
    pub sum_of_squares: f64,
    /// `(JᵀJ)⁻¹` there: the covariance of the parameters for unit variance of the observations.
    pub cofactor: DMatrix<f64>,
    /// Jacobians evaluated.
    pub iterations: usize,
}

impl Solution {
    /// Residual variance `Σ r² / (n − p)`; `None` without degrees of freedom.
    pub fn variance(&self) -> Option<f64> {
        let freedom = self.residuals.len().checked_sub(self.parameters.len())?;
        (freedom > 0).then(|| self.sum_of_squares / freedom as f64)
    }
}

/// Why no minimum was returned.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SolverError {
    /// The start is outside the model's domain or gives residuals that are not finite.
    #[error("the model cannot be evaluated at the starting parameters")]
    InvalidStart,
    /// Fewer residuals than parameters.
    #[error("{residuals} residuals cannot determine {parameters} parameters")]
    TooFewResiduals {
        /// Number of residuals n.
        residuals: usize,
        /// Number of parameters p.
        parameters: usize,
    },
    /// The Jacobian at the minimum has dependent columns.
    #[error("the data leave a combination of the parameters undetermined")]
    Singular,
    /// The iteration limit was reached first.
    #[error("no minimum found within {0} iterations")]
    NotConverged(usize),
}

/// Triangular factor of the scaled Jacobian and the residuals turned into its range.
#[derive(Clone)]
struct Linearisation {
    /// Column norms of the Jacobian, length p; 1 where a column vanishes.
    scale: DVector<f64>,
    /// R of `J·diag(1/scale)`, p × p upper triangular.
    r: DMatrix<f64>,
    /// First p entries of `Qᵀ·residuals`.
    qt_residuals: DVector<f64>,
}

impl Linearisation {
    fn new(jacobian: DMatrix<f64>, residuals: &DVector<f64>) -> Self {
        let p = jacobian.ncols();
        let mut scaled = jacobian;
        let scale = DVector::from_iterator(
            p,
            scaled.column_iter().map(|c| {
                let norm = c.norm();
                if norm > 0.0 { norm } else { 1.0 }
            }),
        );
        for (mut column, s) in scaled.column_iter_mut().zip(scale.iter()) {
            column /= *s;
        }
        let qr = scaled.qr();
        let mut turned = residuals.clone();
        qr.q_tr_mul(&mut turned);
        Self {
            scale,
            r: qr.unpack_r(),
            qt_residuals: turned.rows(0, p).into_owned(),
        }
    }

    /// Scaled step that minimises `‖R y + Qᵀr‖² + damping·Σ (yⱼ·reachⱼ/scaleⱼ)²`.
    fn step(&self, damping: f64, reach: &DVector<f64>) -> Option<DVector<f64>> {
        let p = self.r.ncols();
        if damping == 0.0 {
            return self.r.solve_upper_triangular(&(-&self.qt_residuals));
        }
        let mut stacked = DMatrix::zeros(2 * p, p);
        stacked.rows_mut(0, p).copy_from(&self.r);
        for j in 0..p {
            stacked[(p + j, j)] = damping.sqrt() * reach[j] / self.scale[j];
        }
        let mut right = DVector::zeros(2 * p);
        right.rows_mut(0, p).copy_from(&(-&self.qt_residuals));
        let qr = stacked.qr();
        qr.q_tr_mul(&mut right);
        qr.unpack_r()
            .solve_upper_triangular(&right.rows(0, p).into_owned())
    }

    fn unscaled(&self, step: &DVector<f64>) -> DVector<f64> {
        step.component_div(&self.scale)
    }

    /// Decrease of `½‖r‖²` the linear model promises for a scaled step.
    fn predicted_decrease(&self, step: &DVector<f64>) -> f64 {
        let moved = &self.r * step;
        -(moved.dot(&self.qt_residuals) + 0.5 * moved.norm_squared())
    }

    fn cofactor(&self) -> Option<DMatrix<f64>> {
        let p = self.r.ncols();
        let inverse = self
            .r
            .solve_upper_triangular(&DMatrix::<f64>::identity(p, p))?;
        let mut cofactor = &inverse * inverse.transpose();
        for i in 0..p {
            for j in 0..p {
                cofactor[(i, j)] /= self.scale[i] * self.scale[j];
            }
        }
        cofactor.iter().all(|v| v.is_finite()).then_some(cofactor)
    }

    /// True where the smallest pivot is lost in the rounding of the largest, or a column in that of its largest.
    fn is_singular(&self, reach: &DVector<f64>) -> bool {
        let pivots = self.r.diagonal().abs();
        pivots.min() <= f64::EPSILON * pivots.max()
            || (0..reach.len()).any(|j| self.scale[j] <= f64::EPSILON * reach[j])
    }
}

/// Minimises the sum of squares of `problem` from `start` (length p).
///
/// A run that ends on a plateau, where the Jacobian has lost rank, or that creeps along a valley until the limit, is
/// begun again from `start` with shorter first steps and the other rule of scaling.
///
/// # Errors
/// See [`SolverError`].
pub fn least_squares(
    problem: &impl Residuals,
    start: &DVector<f64>,
    options: &SolverOptions,
) -> Result<Solution, SolverError> {
    let mut outcome = descend(problem, start, options, 1.0, Scaling::Largest);
    for (factor, scaling) in [
        (1e4, Scaling::Current),
        (1e6, Scaling::Current),
        (1e4, Scaling::Largest),
        (1e6, Scaling::Largest),
    ] {
        match outcome {
            Err(SolverError::Singular | SolverError::NotConverged(_)) => {
                outcome = descend(problem, start, options, factor, scaling);
            }
            decided => return decided,
        }
    }
    outcome
}

/// Which column norms the damping is measured in.
#[derive(Clone, Copy, PartialEq)]
enum Scaling {
    /// The largest met so far: parameters whose influence fades do not run away (Moré 1978).
    Largest,
    /// Those of the current Jacobian (Marquardt 1963).
    Current,
}

fn descend(
    problem: &impl Residuals,
    start: &DVector<f64>,
    options: &SolverOptions,
    damping_factor: f64,
    scaling: Scaling,
) -> Result<Solution, SolverError> {
    let finite = |v: &DVector<f64>| v.iter().all(|e| e.is_finite());
    let evaluate = |x: &DVector<f64>| problem.residuals(x).filter(&finite);
    let differentiate = |x: &DVector<f64>| {
        problem
            .jacobian(x)
            .filter(|j| j.iter().all(|e| e.is_finite()))
    };
    let mut x = start.clone();
    let mut damping = options.initial_damping * damping_factor;
    let mut residuals = evaluate(&x).ok_or(SolverError::InvalidStart)?;
    if residuals.len() < x.len() {
        return Err(SolverError::TooFewResiduals {
            residuals: residuals.len(),
            parameters: x.len(),
        });
    }
    let mut linear = Linearisation::new(
        differentiate(&x).ok_or(SolverError::InvalidStart)?,
        &residuals,
    );
    let mut reach = linear.scale.clone();
    let mut growth = 2.0;
    let mut iterations = 1;
    let mut converged = false;
    while !converged {
        let half = 0.5 * residuals.norm_squared();
        let Some(scaled_step) = linear.step(damping, &reach) else {
            return Err(SolverError::Singular);
        };
        let predicted = linear.predicted_decrease(&scaled_step);
        let step = linear.unscaled(&scaled_step);
        let still = step
            .iter()
            .zip(x.iter())
            .all(|(s, v)| s.abs() <= f64::EPSILON * v.abs());
        if still || predicted <= f64::EPSILON * half {
            converged = true;
            continue;
        }
        let trial = &x + &step;
        let accepted = evaluate(&trial).and_then(|r| {
            let gain = (half - 0.5 * r.norm_squared()) / predicted;
            (gain > 1e-3).then_some((r, gain))
        });
        let next = accepted
            .and_then(|(r, gain)| differentiate(&trial).map(|jacobian| (r, gain, jacobian)));
        if let Some((r, gain, jacobian)) = next {
            x = trial;
            residuals = r;
            linear = Linearisation::new(jacobian, &residuals);
            reach = match scaling {
                Scaling::Largest => reach.sup(&linear.scale),
                Scaling::Current => linear.scale.clone(),
            };
            damping *= (1.0 - (2.0 * gain - 1.0).powi(3)).max(1.0 / 3.0);
            growth = 2.0;
            iterations += 1;
            if iterations > options.max_iterations {
                return Err(SolverError::NotConverged(options.max_iterations));
            }
        } else {
            damping *= growth;
            growth *= 2.0;
            // Beyond this no representable step is left: the rounding of the sum of squares is the floor.
            converged = damping > 1e40;
        }
    }
    polish(
        problem,
        &mut x,
        &mut residuals,
        &mut linear,
        &mut iterations,
    );
    if linear.is_singular(&reach) {
        return Err(SolverError::Singular);
    }
    let cofactor = linear.cofactor().ok_or(SolverError::Singular)?;
    Ok(Solution {
        sum_of_squares: residuals.norm_squared(),
        parameters: x,
        residuals,
        cofactor,
        iterations,
    })
}

/// Undamped Gauss–Newton steps until three in a row bring no shorter one; keeps the point whose next step is shortest.
fn polish(
    problem: &impl Residuals,
    x: &mut DVector<f64>,
    residuals: &mut DVector<f64>,
    linear: &mut Linearisation,
    iterations: &mut usize,
) {
    let ceiling = residuals.norm_squared() * (1.0 + 1e-9);
    let undamped = |linear: &Linearisation| {
        linear
            .step(0.0, &linear.scale)
            .filter(|step| step.iter().all(|e| e.is_finite()))
    };
    let Some(mut step) = undamped(linear) else {
        return;
    };
    let mut best = step.norm();
    let mut trial = x.clone();
    let mut from = linear.clone();
    let mut fruitless = 0;
    while fruitless < 3 && best > 0.0 {
        trial += from.unscaled(&step);
        let (Some(r), Some(jacobian)) = (problem.residuals(&trial), problem.jacobian(&trial))
        else {
            return;
        };
        let sound = r.norm_squared() <= ceiling && jacobian.iter().all(|e| e.is_finite());
        if !sound {
            return;
        }
        *iterations += 1;
        from = Linearisation::new(jacobian, &r);
        let Some(next) = undamped(&from) else {
            return;
        };
        step = next;
        if step.norm() < best {
            best = step.norm();
            fruitless = 0;
            x.copy_from(&trial);
            *residuals = r;
            *linear = from.clone();
        } else {
            fruitless += 1;
        }
    }
}
