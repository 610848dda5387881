//! Uncertainty of a fitted feature by its touches, and what the alignment of the part adds to it.
//!
//! m and rad, part frame. Touches are independent along their normals.
//!
//! | result | method | why |
//! |---|---|---|
//! | size, position, direction of a least-squares fit | linear propagation in closed form, u²·(JᵀJ)⁻¹ (GUM 5.1.2, JCGM 102 6.2) | smooth in the touches |
//! | everything of a minimum zone or mating size; the form of any fit | Monte Carlo until stable (JCGM 101 7.9) | which touches are extreme changes with their errors |
//!
//! An offset much smaller than its own uncertainty is biased high, as the length of any vector is; its uncertainty is along
//! the direction found.

use metrology::uncertainty::{Input, Stability, UncertaintyError, propagate, simulate};
use nalgebra::{DMatrix, Matrix3, Matrix6, Point3, Vector3, Vector6};

use super::{Associated, Sample};

/// Seed of the trials: the same touches have the same uncertainty.
const SEED: u64 = 1;

/// Covariance of the alignment that a result was aligned by: 6 × 6 of shift (m) and rotation (rad) about the part's origin;
/// `None` where the part frame is as programmed.
pub(crate) type AlignmentCovariance<'a> = Option<&'a Matrix6<f64>>;

/// Standard uncertainties of size, form, position along `shift` and direction along `tilt`. `values` gives the same four of
/// disturbed samples.
///
/// # Errors
/// Disturbed samples that too often have no fit.
pub(super) fn by_touches(
    found: &Associated,
    samples: &[Sample],
    [shift, tilt]: [Vector3<f64>; 2],
    touch_uncertainty: f64,
    values: impl Fn(&[Sample]) -> Option<[f64; 4]>,
) -> Result<[f64; 4], UncertaintyError> {
    let Some(cofactors) = &found.cofactors else {
        return simulated(samples, touch_uncertainty, values);
    };
    let form = |disturbed: &[Sample]| values(disturbed).map(|[_, form, ..]| [form]);
    let [form] = simulated(samples, touch_uncertainty, form)?;
    let along = |direction: &Vector3<f64>, cofactor: &Matrix3<f64>| {
        let row = DMatrix::from_row_slice(1, 3, unit(direction).as_slice());
        let cofactor = DMatrix::from_column_slice(3, 3, cofactor.as_slice());
        let covariance = cofactor * touch_uncertainty.powi(2);
        propagate(&row, &covariance).map(|variance| variance[(0, 0)].max(0.0).sqrt())
    };
    Ok([
        cofactors.size.sqrt() * touch_uncertainty,
        form,
        along(&shift, &cofactors.position)?,
        along(&tilt, &cofactors.direction)?,
    ])
}

/// Standard uncertainties of `values` over samples disturbed by errors of standard uncertainty `touch_uncertainty` (m).
fn simulated<const N: usize>(
    samples: &[Sample],
    touch_uncertainty: f64,
    values: impl Fn(&[Sample]) -> Option<[f64; N]>,
) -> Result<[f64; N], UncertaintyError> {
    let touch = Input::exact(touch_uncertainty);
    let simulation = simulate(&Stability::default(), SEED, |random| {
        let errors: Vec<f64> = samples.iter().map(|_| touch.draw(random)).collect();
        values(&disturbed(samples, &errors))
    })?;
    Ok(simulation.standard_uncertainties())
}

/// Direction of an offset; z where there is none.
pub(super) fn unit(offset: &Vector3<f64>) -> Vector3<f64> {
    offset.try_normalize(0.0).unwrap_or_else(Vector3::z)
}

/// The samples moved along their normals by `errors` (m), one for each.
pub(crate) fn disturbed(samples: &[Sample], errors: &[f64]) -> Vec<Sample> {
    let moved = |(sample, error): (&Sample, &f64)| Sample {
        centre: sample.centre + sample.normal * *error,
        normal: sample.normal,
        deviation: sample.deviation + error,
    };
    samples.iter().zip(errors).map(moved).collect()
}

/// Standard uncertainty (m) that the alignment adds to the position of `point` along `direction`.
pub(crate) fn shift_by_alignment(
    alignment: AlignmentCovariance<'_>,
    point: &Point3<f64>,
    direction: &Vector3<f64>,
) -> f64 {
    let direction = unit(direction);
    standard_along(alignment, &direction, &point.coords.cross(&direction))
}

/// Standard uncertainty (rad) that the alignment adds to the direction of `axis` along `direction`.
pub(crate) fn tilt_by_alignment(
    alignment: AlignmentCovariance<'_>,
    axis: &Vector3<f64>,
    direction: &Vector3<f64>,
) -> f64 {
    standard_along(alignment, &Vector3::zeros(), &axis.cross(&unit(direction)))
}

/// √(cᵀVc) of the alignment's covariance V for sensitivities c to shift and rotation; 0 without an alignment.
fn standard_along(
    alignment: AlignmentCovariance<'_>,
    shift: &Vector3<f64>,
    rotation: &Vector3<f64>,
) -> f64 {
    let Some(covariance) = alignment else {
        return 0.0;
    };
    let sensitivity = Vector6::new(
        shift.x, shift.y, shift.z, rotation.x, rotation.y, rotation.z,
    );
    let variance = (covariance * sensitivity).dot(&sensitivity);
    variance.max(0.0).sqrt()
}
