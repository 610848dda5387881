//! How surely touches tell a feature: in closed form for least squares (GUM 5.1.2), by simulation (GUM S1) where the
//! extreme touches decide; and what an alignment of the part adds.
//!
//! m and rad. Touches err independently along their normals. An offset much smaller than its own uncertainty is told too
//! large, as any length of a vector; its uncertainty is along the direction found.

use nalgebra::{Matrix6, Point3, Vector3, Vector6};
use rand::SeedableRng;
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;

use super::{Associated, Placed, Sample};

/// Draws of a simulation: the standard deviation is then good to 4 %.
const DRAWS: usize = 300;
/// Seed of the draws: the same touches have the same uncertainty.
const SEED: u64 = 1;

/// Standard uncertainties of size, form, position along `moved` and direction along `turned`.
pub(super) fn doubt(
    found: &Associated,
    [moved, turned]: [Vector3<f64>; 2],
    touch_uncertainty: f64,
    simulated: impl FnOnce() -> [f64; 4],
) -> [f64; 4] {
    let Some(spread) = &found.spread else {
        return simulated();
    };
    let [moved, turned] = [unit(&moved), unit(&turned)];
    [
        spread.size,
        spread.form,
        (spread.position * moved).dot(&moved),
        (spread.tilt * turned).dot(&turned),
    ]
    .map(|variance| variance.max(0.0).sqrt() * touch_uncertainty)
}

/// Direction of an offset; of none z.
pub(super) fn unit(way: &Vector3<f64>) -> Vector3<f64> {
    way.try_normalize(0.0).unwrap_or_else(Vector3::z)
}

/// The touches with another error each, along their normals: `[i]` scales that of sample i (m).
pub(crate) fn disturbed(samples: &[Sample], errors: &[f64]) -> Vec<Sample> {
    let one = |(sample, error): (&Sample, &f64)| Sample {
        centre: sample.centre + sample.normal * *error,
        normal: sample.normal,
        deviation: sample.deviation + error,
    };
    samples.iter().zip(errors).map(one).collect()
}

/// Standard deviations of what `value` says of disturbed touches; draws of which it says nothing are not counted.
pub(super) fn simulate<const N: usize>(
    samples: &[Sample],
    touch_uncertainty: f64,
    value: impl Fn(&[Sample]) -> Option<[f64; N]>,
) -> [f64; N] {
    let mut random = Pcg64::seed_from_u64(SEED);
    let mut draws: Vec<[f64; N]> = Vec::with_capacity(DRAWS);
    for _ in 0..DRAWS {
        let errors: Vec<f64> = samples
            .iter()
            .map(|_| {
                let unit: f64 = StandardNormal.sample(&mut random);
                unit * touch_uncertainty
            })
            .collect();
        draws.extend(value(&disturbed(samples, &errors)));
    }
    let count = draws.len() as f64;
    std::array::from_fn(|which| {
        let mean = draws.iter().map(|draw| draw[which]).sum::<f64>() / count;
        let squares = draws.iter().map(|draw| (draw[which] - mean).powi(2));
        (squares.sum::<f64>() / (count - 1.0)).sqrt()
    })
}

/// Standard uncertainty (m) that the alignment leaves in the place of `point` along `way`.
pub(super) fn of_shift(placed: Placed<'_>, point: &Point3<f64>, way: &Vector3<f64>) -> f64 {
    let way = unit(way);
    through(placed, &way, &point.coords.cross(&way))
}

/// Standard uncertainty (rad) that the alignment leaves in the direction `axis` along `way`.
pub(super) fn of_turn(placed: Placed<'_>, axis: &Vector3<f64>, way: &Vector3<f64>) -> f64 {
    through(placed, &Vector3::zeros(), &axis.cross(&unit(way)))
}

fn through(placed: Placed<'_>, shift: &Vector3<f64>, rotation: &Vector3<f64>) -> f64 {
    let Some(covariance) = placed else { return 0.0 };
    let way = Vector6::new(
        shift.x, shift.y, shift.z, rotation.x, rotation.y, rotation.z,
    );
    let covariance: &Matrix6<f64> = covariance;
    (covariance * way).dot(&way).max(0.0).sqrt()
}
