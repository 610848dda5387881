//! Where the part lies: its datum system, or a best fit of its deviations.
//!
//! m and rad, part frame. A pose takes the part as its plan has it to the part as it was touched; what is measured is then
//! told in the frame of the part itself. Datums are associated with their features by those features' own rules and taken
//! in order of precedence (ISO 5459, [`metrology::datum`]); a best fit is least squares of the deviations along the nominal
//! normals (source systems B.3). A datum system is uncertain by the touches of its datums (simulated, GUM S1), a best fit
//! by its normal equations; in both what all touches share moves them together.

use metrology::{
    alignment::{AlignmentError, fit_displacement_along},
    datum::{Datum, datum_frame},
};
use nalgebra::{Isometry3, Matrix6, UnitQuaternion, Vector3, Vector6};
use probecell_msgs::{InspectionFeature, PartAlignment, geometry_msgs};
use rand::SeedableRng;
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;

use crate::{
    config::{Alignment, Config, Method},
    feature::{self, Sample, disturbed},
};

/// Draws of a simulation, and their seed.
const DRAWS: usize = 300;
const SEED: u64 = 2;

/// The part as it was touched.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    /// Touched part from planned part.
    pub(crate) pose: Isometry3<f64>,
    /// 6 x 6 of shift (m) and rotation (rad).
    pub(crate) covariance: Matrix6<f64>,
    /// m; root mean square of what a best fit leaves; 0 with datums.
    rms: f64,
}

impl Placed {
    /// Places the part by the features of `alignment`, in that order, each with the touches that count; an error is a
    /// sentence.
    pub(crate) fn of(
        config: &Config,
        alignment: &Alignment,
        ball_radius: f64,
        features: &[(&InspectionFeature, Vec<Sample>)],
    ) -> Result<Self, String> {
        match alignment.method {
            Method::Datums => Ok(Self {
                pose: by_datums(config, ball_radius, features)?,
                covariance: simulated(config, ball_radius, features),
                rms: 0.0,
            }),
            Method::BestFit => best_fit(config, alignment.free, touches(features)),
        }
    }

    /// As it was told; an error is the sentence that was told instead.
    pub(crate) fn from_message(message: &PartAlignment) -> Result<Self, String> {
        if !message.valid {
            return Err(message.text.clone());
        }
        let own = |v: &geometry_msgs::Vector3| Vector3::new(v.x, v.y, v.z);
        let covariance = message.covariance.iter().copied();
        Ok(Self {
            pose: moved(&own(&message.shift), &own(&message.rotation)),
            covariance: Matrix6::from_iterator(covariance.chain(std::iter::repeat(0.0)).take(36)),
            rms: message.rms,
        })
    }

    /// Fills what was found into the message.
    pub(crate) fn describe(&self, message: &mut PartAlignment) {
        let ros = |v: &Vector3<f64>| geometry_msgs::Vector3 {
            x: v.x,
            y: v.y,
            z: v.z,
        };
        message.valid = true;
        message.shift = ros(&self.pose.translation.vector);
        message.rotation = ros(&self.pose.rotation.scaled_axis());
        message.covariance = self.covariance.iter().copied().collect();
        message.rms = self.rms;
    }
}

fn best_fit(
    config: &Config,
    free: [bool; 6],
    mut touches: Vec<(Vector3<f64>, Vector3<f64>, f64)>,
) -> Result<Placed, String> {
    let fit = |touches: &[_]| {
        fit_displacement_along(touches, &free).map_err(|error: AlignmentError| error.to_string())
    };
    let found = fit(&touches)?;
    let squares: f64 = found.residuals.iter().map(|left| left * left).sum();
    let count = touches.len() as f64;
    for touch in &mut touches {
        touch.2 = config.common_uncertainty;
    }
    let shared = fit(&touches)?;
    let shared = stacked(&shared.shift, &shared.rotation);
    let own = found.cofactor * config.touch_uncertainty.powi(2);
    Ok(Placed {
        pose: moved(&found.shift, &found.rotation),
        covariance: own + shared * shared.transpose(),
        rms: (squares / count).sqrt(),
    })
}

/// The sample in the frame of the part itself.
pub(crate) fn aligned(pose: &Isometry3<f64>, ball_radius: f64, sample: &Sample) -> Sample {
    let centre = pose.inverse_transform_point(&sample.centre);
    // The nominal contact is where the ball would touch the surface without a deviation.
    let contact = sample.centre - sample.normal * (ball_radius + sample.deviation);
    Sample {
        centre,
        normal: sample.normal,
        deviation: sample.normal.dot(&(centre - contact)) - ball_radius,
    }
}

fn touches(
    features: &[(&InspectionFeature, Vec<Sample>)],
) -> Vec<(Vector3<f64>, Vector3<f64>, f64)> {
    let all = features.iter().flat_map(|(_, samples)| samples);
    // At the ball's centre the lever is the same as at the contact: the normal goes through both.
    all.map(|one| (one.centre.coords, one.normal, one.deviation))
        .collect()
}

fn by_datums(
    config: &Config,
    ball_radius: f64,
    features: &[(&InspectionFeature, Vec<Sample>)],
) -> Result<Isometry3<f64>, String> {
    let (mut nominal, mut found) = (Vec::new(), Vec::new());
    for (feature, samples) in features {
        let criterion = config.rules(&feature.id).criterion;
        let located = feature::located(feature, ball_radius, samples, criterion);
        let (point, axis) = located.map_err(|error| format!("datum {}: {error}", feature.id))?;
        let origin = feature::vector_of(&feature.origin);
        nominal.push(datum(feature, origin, feature::direction(feature))?);
        found.push(datum(feature, point.coords, axis)?);
    }
    let frame = |datums: &[Datum]| datum_frame(datums).map_err(|error| error.to_string());
    Ok(frame(&found)? * frame(&nominal)?.inverse())
}

fn datum(
    feature: &InspectionFeature,
    point: Vector3<f64>,
    direction: Vector3<f64>,
) -> Result<Datum, String> {
    match feature.kind {
        InspectionFeature::PLANE => Ok(Datum::Plane {
            point,
            normal: direction,
        }),
        InspectionFeature::CYLINDER | InspectionFeature::BORE => {
            Ok(Datum::Axis { point, direction })
        }
        InspectionFeature::SPHERE => Ok(Datum::Point(point)),
        _ => Err(format!(
            "{} is no datum: planes, cylinders, bores and spheres are",
            feature.id
        )),
    }
}

fn simulated(
    config: &Config,
    ball_radius: f64,
    features: &[(&InspectionFeature, Vec<Sample>)],
) -> Matrix6<f64> {
    let mut random = Pcg64::seed_from_u64(SEED);
    let mut draw = |standard: f64| {
        let unit: f64 = StandardNormal.sample(&mut random);
        unit * standard
    };
    let mut draws = Vec::with_capacity(DRAWS);
    for _ in 0..DRAWS {
        let shared = draw(config.common_uncertainty);
        let disturbed: Vec<_> = features
            .iter()
            .map(|(feature, samples)| {
                let errors: Vec<f64> = samples
                    .iter()
                    .map(|_| shared + draw(config.touch_uncertainty))
                    .collect();
                (*feature, disturbed(samples, &errors))
            })
            .collect();
        if let Ok(pose) = by_datums(config, ball_radius, &disturbed) {
            draws.push(stacked(
                &pose.translation.vector,
                &pose.rotation.scaled_axis(),
            ));
        }
    }
    let count = draws.len() as f64;
    let mean = draws.iter().sum::<Vector6<f64>>() / count;
    let squares = draws
        .iter()
        .map(|draw| (draw - mean) * (draw - mean).transpose());
    squares.sum::<Matrix6<f64>>() / (count - 1.0)
}

fn moved(shift: &Vector3<f64>, rotation: &Vector3<f64>) -> Isometry3<f64> {
    Isometry3::from_parts((*shift).into(), UnitQuaternion::from_scaled_axis(*rotation))
}

fn stacked(shift: &Vector3<f64>, rotation: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(
        shift.x, shift.y, shift.z, rotation.x, rotation.y, rotation.z,
    )
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    /// A plane touched where it is planned, of a part that lies 3 µm higher: aligned it is 3 µm low.
    #[test]
    fn an_aligned_touch_is_told_in_the_frame_of_the_part() {
        let sample = Sample {
            centre: Point3::new(0.02, 0.01, 0.052),
            normal: Vector3::z(),
            deviation: 0.0,
        };
        let pose = moved(&Vector3::new(1e-6, 2e-6, 3e-6), &Vector3::zeros());
        let found = aligned(&pose, 0.002, &sample);
        assert!((found.deviation + 3e-6).abs() < 1e-15);
        assert!((found.centre - Point3::new(0.019_999, 0.009_998, 0.051_997)).norm() < 1e-15);
    }
}
