//! Uncertainty of a value: GUM budget, coverage, and propagation of distributions.
//!
//! Units are those of the quantities. JCGM 100 (GUM) clauses 5 and G.4 for the budget, JCGM 101 (GUM S1) clauses 5–7
//! for Monte Carlo. Correlations enter through a covariance matrix in [`propagate`]; a budget takes its contributions
//! as independent.

use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution as _, StandardNormal, StudentT};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::statistics::student_quantile;

/// How one input quantity is distributed about its estimate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Input {
    /// Type A: mean of `count` ≥ 2 readings whose sample standard deviation is `deviation` (GUM 4.2).
    Readings {
        /// Sample standard deviation of one reading.
        deviation: f64,
        /// Number of readings the estimate is the mean of.
        count: u32,
    },
    /// A normal distribution known from elsewhere, with its degrees of freedom (infinite if well known).
    Normal {
        /// Standard uncertainty.
        standard: f64,
        /// Degrees of freedom; see [`freedom_of_doubt`].
        freedom: f64,
    },
    /// Anything within ±`half_width` alike (GUM 4.3.7): a resolution, a catalogue limit.
    Rectangular {
        /// Half of the full width.
        half_width: f64,
    },
    /// Triangular within ±`half_width` (GUM 4.3.9).
    Triangular {
        /// Half of the full width.
        half_width: f64,
    },
    /// Oscillating within ±`half_width` (GUM S1 6.4.6): a temperature under control.
    Arcsine {
        /// Amplitude.
        half_width: f64,
    },
}

impl Input {
    /// Standard uncertainty.
    pub fn standard(&self) -> f64 {
        match *self {
            Self::Readings { deviation, count } => deviation / f64::from(count).sqrt(),
            Self::Normal { standard, .. } => standard,
            Self::Rectangular { half_width } => half_width / 3.0_f64.sqrt(),
            Self::Triangular { half_width } => half_width / 6.0_f64.sqrt(),
            Self::Arcsine { half_width } => half_width / 2.0_f64.sqrt(),
        }
    }

    /// Degrees of freedom of the standard uncertainty.
    pub fn freedom(&self) -> f64 {
        match *self {
            Self::Readings { count, .. } => f64::from(count) - 1.0,
            Self::Normal { freedom, .. } => freedom,
            Self::Rectangular { .. } | Self::Triangular { .. } | Self::Arcsine { .. } => {
                f64::INFINITY
            }
        }
    }

    /// A deviation from the estimate drawn from this distribution (GUM S1 6.4; readings and normal distributions of
    /// finite freedom from Student's t, 6.4.9).
    fn draw(&self, random: &mut impl Rng) -> f64 {
        match *self {
            Self::Readings { .. } | Self::Normal { .. } => {
                let unit = if self.freedom().is_finite() {
                    // The constructor refuses only freedoms that `check` has refused before.
                    StudentT::new(self.freedom()).map_or(f64::NAN, |t| t.sample(random))
                } else {
                    StandardNormal.sample(random)
                };
                self.standard() * unit
            }
            Self::Rectangular { half_width } => half_width * random.random_range(-1.0..=1.0),
            Self::Triangular { half_width } => {
                half_width * (random.random::<f64>() - random.random::<f64>())
            }
            Self::Arcsine { half_width } => {
                half_width * (std::f64::consts::TAU * random.random::<f64>()).sin()
            }
        }
    }

    fn check(&self, name: &str) -> Result<(), UncertaintyError> {
        let standard = self.standard();
        if !(standard.is_finite() && standard >= 0.0) {
            return Err(UncertaintyError::Standard(name.into(), standard));
        }
        let freedom = self.freedom();
        if freedom.is_nan() || freedom <= 0.0 {
            return Err(UncertaintyError::Freedom(name.into(), freedom));
        }
        Ok(())
    }
}

/// Degrees of freedom of a standard uncertainty believed to be right within the relative `doubt` (GUM G.4.2):
/// ½·doubt⁻².
pub fn freedom_of_doubt(doubt: f64) -> f64 {
    0.5 / (doubt * doubt)
}

/// One line of a budget.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contribution {
    /// What it comes from.
    pub name: String,
    /// Its distribution, in its own unit.
    pub input: Input,
    /// ∂(value)/∂(input): unit of the value per unit of the input.
    pub sensitivity: f64,
}

impl Contribution {
    /// |c|·u in the unit of the value.
    pub fn share(&self) -> f64 {
        self.sensitivity.abs() * self.input.standard()
    }
}

/// Contributions to the uncertainty of one value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Budget {
    /// The lines, in any order.
    pub contributions: Vec<Contribution>,
}

/// A value's uncertainty, ready to be stated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Uncertainty {
    /// u_c: combined standard uncertainty, unit of the value.
    pub standard: f64,
    /// ν_eff: effective degrees of freedom, possibly infinite.
    pub freedom: f64,
    /// Coverage probability asked for.
    pub probability: f64,
    /// k: coverage factor.
    pub factor: f64,
    /// U = k·u_c, unit of the value.
    pub expanded: f64,
}

/// Budgets and propagations that make no statement.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum UncertaintyError {
    /// A standard uncertainty is negative or not finite.
    #[error("the standard uncertainty of {0} is {1}")]
    Standard(String, f64),
    /// Degrees of freedom are not positive.
    #[error("the degrees of freedom of {0} are {1}")]
    Freedom(String, f64),
    /// A sensitivity is NaN or infinite.
    #[error("the sensitivity to {0} is not a number")]
    Sensitivity(String),
    /// The coverage probability is outside (0, 1).
    #[error("the coverage probability is {0}")]
    Probability(f64),
    /// Matrix sizes do not fit, or a covariance is no covariance.
    #[error("a covariance of {rows} × {columns} does not fit {inputs} inputs")]
    Shape {
        /// Rows given.
        rows: usize,
        /// Columns given.
        columns: usize,
        /// Inputs of the model.
        inputs: usize,
    },
    /// Too few trials for the quantiles asked for.
    #[error("{0} trials are too few for the coverage asked for")]
    TooFewTrials(usize),
    /// The model gave NaN or infinity for a draw.
    #[error("the model has no finite value for trial {0}")]
    Model(usize),
}

impl Budget {
    /// Adds a line.
    pub fn with(mut self, name: impl Into<String>, input: Input, sensitivity: f64) -> Self {
        self.contributions.push(Contribution {
            name: name.into(),
            input,
            sensitivity,
        });
        self
    }

    /// Combines the lines (GUM 5.1.2), with effective degrees of freedom by Welch–Satterthwaite (G.4.1) and the
    /// coverage factor from Student's t for `probability` (G.3.2), ν_eff not rounded down.
    ///
    /// # Errors
    /// See [`UncertaintyError`].
    pub fn combine(&self, probability: f64) -> Result<Uncertainty, UncertaintyError> {
        self.check()?;
        if !(probability > 0.0 && probability < 1.0) {
            return Err(UncertaintyError::Probability(probability));
        }
        let (mut variance, mut denominator) = (0.0, 0.0);
        for line in &self.contributions {
            let square = line.share().powi(2);
            variance += square;
            denominator += square * square / line.input.freedom();
        }
        let freedom = if denominator > 0.0 {
            variance * variance / denominator
        } else {
            f64::INFINITY
        };
        let factor = student_quantile(f64::midpoint(1.0, probability), freedom);
        let standard = variance.sqrt();
        Ok(Uncertainty {
            standard,
            freedom,
            probability,
            factor,
            expanded: factor * standard,
        })
    }

    /// Propagates the lines' distributions instead of their moments (GUM S1), with the value linear in the inputs:
    /// deviations of the value from its estimate over `trials` draws from `seed`.
    ///
    /// # Errors
    /// See [`UncertaintyError`].
    pub fn simulate(
        &self,
        trials: usize,
        probability: f64,
        seed: u64,
    ) -> Result<Propagated, UncertaintyError> {
        self.check()?;
        let inputs: Vec<(f64, Input)> = self
            .contributions
            .iter()
            .map(|line| (0.0, line.input))
            .collect();
        monte_carlo(&inputs, trials, probability, seed, |deviations| {
            let lines = self.contributions.iter().zip(deviations);
            lines.map(|(line, d)| line.sensitivity * d).sum()
        })
    }

    fn check(&self) -> Result<(), UncertaintyError> {
        for line in &self.contributions {
            line.input.check(&line.name)?;
            if !line.sensitivity.is_finite() {
                return Err(UncertaintyError::Sensitivity(line.name.clone()));
            }
        }
        Ok(())
    }
}

/// Covariance of m values with sensitivities `jacobian` (m × n) to n inputs of `covariance` (n × n): J V Jᵀ, the
/// matrix form of GUM 5.2.2.
///
/// # Errors
/// Sizes that do not fit, or a negative or non-finite variance.
pub fn propagate(
    jacobian: &DMatrix<f64>,
    covariance: &DMatrix<f64>,
) -> Result<DMatrix<f64>, UncertaintyError> {
    if covariance.shape() != (jacobian.ncols(), jacobian.ncols()) {
        return Err(UncertaintyError::Shape {
            rows: covariance.nrows(),
            columns: covariance.ncols(),
            inputs: jacobian.ncols(),
        });
    }
    for (index, variance) in covariance.diagonal().iter().enumerate() {
        if !(variance.is_finite() && *variance >= 0.0) {
            return Err(UncertaintyError::Standard(
                format!("input {index}"),
                variance.sqrt(),
            ));
        }
    }
    Ok(jacobian * covariance * jacobian.transpose())
}

/// A value obtained in two ways or more, combined.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Combined {
    /// Mean weighted by 1/u².
    pub value: f64,
    /// Its standard uncertainty from the stated ones.
    pub standard: f64,
    /// √(χ²/(n−1)): well above 1 where the values contradict their uncertainties.
    pub birge_ratio: f64,
}

/// Weighted mean of independent `(value, standard uncertainty)` pairs, all uncertainties positive.
///
/// # Errors
/// No pair, or an uncertainty that is not positive and finite.
pub fn combine_values(values: &[(f64, f64)]) -> Result<Combined, UncertaintyError> {
    for (index, (value, standard)) in values.iter().enumerate() {
        if !(value.is_finite() && standard.is_finite() && *standard > 0.0) {
            return Err(UncertaintyError::Standard(
                format!("value {index}"),
                *standard,
            ));
        }
    }
    if values.is_empty() {
        return Err(UncertaintyError::TooFewTrials(0));
    }
    let weight: f64 = values.iter().map(|(_, u)| 1.0 / (u * u)).sum();
    let value = values.iter().map(|(v, u)| v / (u * u)).sum::<f64>() / weight;
    let chi: f64 = values.iter().map(|(v, u)| ((v - value) / u).powi(2)).sum();
    let freedom = values.len() as f64 - 1.0;
    Ok(Combined {
        value,
        standard: weight.sqrt().recip(),
        birge_ratio: if freedom > 0.0 {
            (chi / freedom).sqrt()
        } else {
            1.0
        },
    })
}

/// Result of a propagation of distributions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Propagated {
    /// Mean of the trials.
    pub mean: f64,
    /// Standard deviation of the trials.
    pub standard: f64,
    /// Shortest interval that holds the coverage probability (GUM S1 5.3.4): lower and upper end.
    pub interval: (f64, f64),
}

/// GUM S1: draws every `(estimate, distribution)` of `inputs` independently, `trials` times, from `seed`, and
/// summarises `model` of the draws.
///
/// # Errors
/// See [`UncertaintyError`]; the smallest admissible number of trials is 10/(1 − probability) (S1 7.2.1 asks for a
/// thousand times more for two digits).
pub fn monte_carlo(
    inputs: &[(f64, Input)],
    trials: usize,
    probability: f64,
    seed: u64,
    model: impl Fn(&[f64]) -> f64,
) -> Result<Propagated, UncertaintyError> {
    for (index, (estimate, input)) in inputs.iter().enumerate() {
        input.check(&format!("input {index}"))?;
        if !estimate.is_finite() {
            return Err(UncertaintyError::Standard(
                format!("input {index}"),
                *estimate,
            ));
        }
    }
    let mut random = Pcg64::seed_from_u64(seed);
    let mut draws = vec![0.0; inputs.len()];
    summarise(trials, probability, || {
        for (draw, (estimate, input)) in draws.iter_mut().zip(inputs) {
            *draw = estimate + input.draw(&mut random);
        }
        model(&draws)
    })
}

/// GUM S1 6.4.8: as [`monte_carlo`] for jointly normal inputs with `estimates` (n) and `covariance` (n × n).
///
/// # Errors
/// See [`UncertaintyError`].
pub fn monte_carlo_joint(
    estimates: &DVector<f64>,
    covariance: &DMatrix<f64>,
    trials: usize,
    probability: f64,
    seed: u64,
    model: impl Fn(&[f64]) -> f64,
) -> Result<Propagated, UncertaintyError> {
    let n = estimates.len();
    let shape = UncertaintyError::Shape {
        rows: covariance.nrows(),
        columns: covariance.ncols(),
        inputs: n,
    };
    if covariance.shape() != (n, n) || !covariance.iter().all(|v| v.is_finite()) {
        return Err(shape);
    }
    // The eigenvectors also serve covariances that are only semidefinite, as of a sum that is known exactly.
    let eigen = covariance.clone().symmetric_eigen();
    let largest = eigen.eigenvalues.max().max(0.0);
    if eigen.eigenvalues.min() < -1e-9 * largest {
        return Err(shape);
    }
    let roots = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
    let factor = &eigen.eigenvectors * DMatrix::from_diagonal(&roots);
    let mut random = Pcg64::seed_from_u64(seed);
    summarise(trials, probability, || {
        let unit = DVector::from_fn(n, |_, _| StandardNormal.sample(&mut random));
        model((estimates + &factor * unit).as_slice())
    })
}

fn summarise(
    trials: usize,
    probability: f64,
    mut value: impl FnMut() -> f64,
) -> Result<Propagated, UncertaintyError> {
    if !(probability > 0.0 && probability < 1.0) {
        return Err(UncertaintyError::Probability(probability));
    }
    if (trials as f64) * (1.0 - probability) < 10.0 {
        return Err(UncertaintyError::TooFewTrials(trials));
    }
    let mut values: Vec<f64> = (0..trials).map(|_| value()).collect();
    if let Some(trial) = values.iter().position(|v| !v.is_finite()) {
        return Err(UncertaintyError::Model(trial));
    }
    let n = trials as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    values.sort_by(f64::total_cmp);
    // S1 7.7: q values inside, the shortest of all such intervals.
    let inside = (probability * n + 0.5).floor() as usize;
    let start = (0..trials - inside)
        .min_by(|&a, &b| {
            (values[a + inside] - values[a]).total_cmp(&(values[b + inside] - values[b]))
        })
        .unwrap_or(0);
    Ok(Propagated {
        mean,
        standard: (squares / (n - 1.0)).sqrt(),
        interval: (values[start], values[start + inside]),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn normal(standard: f64, freedom: f64) -> Input {
        Input::Normal { standard, freedom }
    }

    /// GUM H.1, the end gauge: u_c = 32 nm, ν_eff = 16, U₉₉ = 93 nm.
    #[test]
    fn the_gums_end_gauge_example_is_reproduced() {
        let budget = Budget::default()
            .with("calibration of the standard", normal(25e-9, 18.0), 1.0)
            .with("repeated observations", normal(5.8e-9, 24.0), 1.0)
            .with("random effects of the comparator", normal(3.9e-9, 5.0), 1.0)
            .with(
                "systematic effects of the comparator",
                normal(6.7e-9, 8.0),
                1.0,
            )
            .with(
                "difference of the expansion coefficients",
                normal(0.58e-6, 50.0),
                -0.05 * 0.1,
            )
            .with(
                "difference of the temperatures",
                normal(0.029, 2.0),
                -0.05 * 11.5e-6,
            );
        let result = budget.combine(0.99).unwrap();
        assert!((result.standard - 32e-9).abs() < 0.5e-9, "{result:?}");
        assert!(result.freedom.floor() == 16.0, "{result:?}");
        // The GUM rounds 16.7 down to 16 before it takes k = 2.92.
        assert!((result.factor - 2.92).abs() < 0.025, "{result:?}");
        assert!((result.expanded - 93e-9).abs() < 1.5e-9, "{result:?}");
    }

    #[test]
    fn standard_uncertainties_of_the_distributions_are_those_of_their_draws() {
        for input in [
            normal(2.0, f64::INFINITY),
            Input::Rectangular { half_width: 2.0 },
            Input::Triangular { half_width: 2.0 },
            Input::Arcsine { half_width: 2.0 },
        ] {
            let result = monte_carlo(&[(5.0, input)], 200_000, 0.95, 7, |x| x[0]).unwrap();
            assert!(
                (result.standard / input.standard() - 1.0).abs() < 0.01,
                "{input:?}"
            );
            assert!((result.mean - 5.0).abs() < 0.02);
        }
        let readings = Input::Readings {
            deviation: 3.0,
            count: 9,
        };
        assert_eq!((readings.standard(), readings.freedom()), (1.0, 8.0));
    }

    /// GUM S1 9.2.3: four rectangular inputs of unit variance; the shortest 95 % interval is ±3.88, where the GUM's
    /// own formula gives ±3.92.
    #[test]
    fn four_rectangular_inputs_give_the_interval_of_the_supplement() {
        let width = Input::Rectangular {
            half_width: 3.0_f64.sqrt(),
        };
        let budget = (0..4).fold(Budget::default(), |b, i| {
            b.with(format!("x{i}"), width, 1.0)
        });
        let result = budget.simulate(400_000, 0.95, 2).unwrap();
        assert!((result.standard - 2.0).abs() < 0.01);
        assert!((result.interval.0 + 3.88).abs() < 0.03, "{result:?}");
        assert!((result.interval.1 - 3.88).abs() < 0.03, "{result:?}");
        assert!((budget.combine(0.95).unwrap().expanded - 3.92).abs() < 0.005);
    }

    #[test]
    fn equal_seeds_give_equal_results_and_others_do_not() {
        let run = |seed| {
            let inputs = [(1.0, normal(0.1, 6.0)), (2.0, normal(0.2, 4.0))];
            monte_carlo(&inputs, 1000, 0.95, seed, |x| x[0] * x[1]).unwrap()
        };
        assert_eq!(run(3), run(3));
        assert_ne!(run(3), run(4));
    }

    #[test]
    fn correlated_inputs_propagate_alike_by_matrix_and_by_draws() {
        let covariance = DMatrix::from_row_slice(2, 2, &[4.0, -1.5, -1.5, 1.0]);
        let jacobian = DMatrix::from_row_slice(1, 2, &[2.0, 3.0]);
        let linear = propagate(&jacobian, &covariance).unwrap()[(0, 0)];
        assert!((linear - (16.0 + 9.0 - 18.0)).abs() < 1e-12);
        let estimates = DVector::from_vec(vec![1.0, -1.0]);
        let drawn = monte_carlo_joint(&estimates, &covariance, 200_000, 0.95, 5, |x| {
            2.0 * x[0] + 3.0 * x[1]
        })
        .unwrap();
        assert!((drawn.standard / linear.sqrt() - 1.0).abs() < 0.01);
        let no_covariance = DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0]);
        assert!(monte_carlo_joint(&estimates, &no_covariance, 1000, 0.9, 1, |x| x[0]).is_err());
    }

    #[test]
    fn a_contradiction_between_values_shows_in_the_birge_ratio() {
        let agreeing = combine_values(&[(10.0, 1.0), (11.0, 2.0)]).unwrap();
        assert!((agreeing.value - 10.2).abs() < 1e-12);
        assert!((agreeing.standard - (1.0 / 1.25f64).sqrt()).abs() < 1e-12);
        assert!(agreeing.birge_ratio < 1.0);
        assert!(
            combine_values(&[(10.0, 0.1), (11.0, 0.1)])
                .unwrap()
                .birge_ratio
                > 5.0
        );
        assert!(combine_values(&[]).is_err() && combine_values(&[(1.0, 0.0)]).is_err());
    }

    #[test]
    fn senseless_budgets_are_refused() {
        let budget = |input, c| Budget::default().with("x", input, c).combine(0.95);
        assert!(budget(normal(-1.0, 5.0), 1.0).is_err());
        assert!(budget(normal(1.0, 0.0), 1.0).is_err());
        assert!(budget(normal(1.0, 5.0), f64::NAN).is_err());
        assert!(Budget::default().combine(1.0).is_err());
        let one = Input::Readings {
            deviation: 1.0,
            count: 1,
        };
        assert!(budget(one, 1.0).is_err());
        let sure = Budget::default().combine(0.95).unwrap();
        assert_eq!((sure.standard, sure.expanded), (0.0, 0.0));
        assert!(monte_carlo(&[], 100, 0.95, 1, |_| 0.0).is_err());
        assert!(monte_carlo(&[], 1000, 0.95, 1, |_| f64::NAN).is_err());
    }

    #[test]
    fn a_quarter_of_doubt_leaves_eight_degrees_of_freedom() {
        assert_eq!(freedom_of_doubt(0.25), 8.0);
    }
}
