//! Uncertainty budgets: independent contributions to the uncertainty of one value (GUM 5.1, annex G).

use serde::{Deserialize, Serialize};

use super::{Input, UncertaintyError};
use crate::statistics::{coverage_factor, student_factor};

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
    pub fn standard(&self) -> f64 {
        self.sensitivity.abs() * self.input.standard()
    }
}

/// Independent contributions to the uncertainty of one value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Budget {
    /// The lines, in any order.
    pub contributions: Vec<Contribution>,
}

/// How much an expanded uncertainty is to cover.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Coverage {
    /// This probability, between 0 and 1.
    Probability(f64),
    /// What this factor covers of a normal distribution: 95.45 % for 2. With infinitely many degrees of freedom the factor
    /// itself is stated.
    NormalFactor(f64),
}

impl Coverage {
    /// Coverage factor by Student's t (GUM G.3.2).
    ///
    /// # Errors
    /// A probability outside (0, 1), or a factor that is not positive and finite.
    pub fn factor(self, degrees_of_freedom: f64) -> Result<f64, UncertaintyError> {
        match self {
            Self::Probability(probability) if probability > 0.0 && probability < 1.0 => {
                Ok(coverage_factor(probability, degrees_of_freedom))
            }
            Self::NormalFactor(factor) if factor > 0.0 && factor.is_finite() => {
                Ok(student_factor(factor, degrees_of_freedom))
            }
            _ => Err(UncertaintyError::Coverage(self)),
        }
    }
}

/// A value's uncertainty, ready to be stated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Uncertainty {
    /// u_c: combined standard uncertainty, unit of the value.
    pub standard: f64,
    /// ν_eff: effective degrees of freedom, possibly infinite.
    pub degrees_of_freedom: f64,
    /// k: coverage factor for the coverage asked for.
    pub factor: f64,
    /// U = k·u_c, unit of the value.
    pub expanded: f64,
}

impl Budget {
    /// Adds a line.
    #[must_use]
    pub fn with(mut self, name: impl Into<String>, input: Input, sensitivity: f64) -> Self {
        self.contributions.push(Contribution {
            name: name.into(),
            input,
            sensitivity,
        });
        self
    }

    /// Combines the lines (GUM 5.1.2), with effective degrees of freedom by Welch–Satterthwaite (G.4.1) and the
    /// coverage factor from Student's t (G.3.2), ν_eff not rounded down. No line: u = 0, exactly known.
    ///
    /// # Errors
    /// A line that is no distribution, a sensitivity that is not finite, a coverage that is none.
    pub fn combine(&self, coverage: Coverage) -> Result<Uncertainty, UncertaintyError> {
        let (mut variance, mut denominator) = (0.0, 0.0);
        for line in &self.contributions {
            line.input.check(&line.name)?;
            if !line.sensitivity.is_finite() {
                return Err(UncertaintyError::Sensitivity(line.name.clone()));
            }
            let square = line.standard().powi(2);
            variance += square;
            denominator += square * square / line.input.degrees_of_freedom();
        }
        let degrees_of_freedom = if denominator > 0.0 {
            variance * variance / denominator
        } else {
            f64::INFINITY
        };
        let factor = coverage.factor(degrees_of_freedom)?;
        let standard = variance.sqrt();
        Ok(Uncertainty {
            standard,
            degrees_of_freedom,
            factor,
            expanded: factor * standard,
        })
    }
}
