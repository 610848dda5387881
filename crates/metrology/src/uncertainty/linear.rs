//! Linear propagation: covariances through sensitivities, and sensitivities of a model that has no derivatives.

use nalgebra::{Const, DMatrix, Dyn, OMatrix};

use super::UncertaintyError;

/// Covariance of m values with sensitivities `jacobian` (m × n) to n inputs of `covariance` (n × n): J V Jᵀ, the
/// matrix form of GUM 5.2.2 (JCGM 102 6.2.1.3).
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

/// Contribution of each independent input to each of N values (N × inputs), found from the model itself:
/// Z_i = ½·[f(x + uᵢ) − f(x − uᵢ)] (GUM 5.1.3 note 2). Z·Zᵀ is the covariance of the values.
///
/// `model` takes the deviations of all inputs from their estimates; `standard` are their standard uncertainties. It is
/// called twice for each input whose uncertainty is not 0. Right where the model is smooth within the uncertainties; where
/// the extremes of the inputs decide, see [`super::simulate`].
///
/// # Errors
/// A standard uncertainty that is negative or not finite, or an input within whose uncertainty the model has no finite
/// value.
pub fn contributions<const N: usize>(
    standard: &[f64],
    mut model: impl FnMut(&[f64]) -> Option<[f64; N]>,
) -> Result<OMatrix<f64, Const<N>, Dyn>, UncertaintyError> {
    let mut deviations = vec![0.0; standard.len()];
    let mut contributions = OMatrix::<f64, Const<N>, Dyn>::zeros(standard.len());
    for (index, &u) in standard.iter().enumerate() {
        if !(u.is_finite() && u >= 0.0) {
            return Err(UncertaintyError::Standard(format!("input {index}"), u));
        }
        if u == 0.0 {
            continue;
        }
        let mut at = |deviation: f64| {
            deviations[index] = deviation;
            let values = model(&deviations).filter(|values| values.iter().all(|v| v.is_finite()));
            deviations[index] = 0.0;
            values.ok_or(UncertaintyError::Undefined(index))
        };
        let (above, below) = (at(u)?, at(-u)?);
        for (value, (above, below)) in above.into_iter().zip(below).enumerate() {
            contributions[(value, index)] = 0.5 * (above - below);
        }
    }
    Ok(contributions)
}
