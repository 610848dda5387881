//! Alignment of the part: its datum system, or a best fit of its deviations.
//!
//! m and rad, part frame. A placement takes the part as planned to the part as touched; features are then reported in the
//! frame of the part itself. Datums are associated with their features by those features' own rules and taken in order of
//! precedence (ISO 5459, [`metrology::datum`]); a best fit is least squares of the deviations along the nominal normals
//! (`docs/source_systems.md`, B.3).
//!
//! | alignment | uncertainty | inputs |
//! |---|---|---|
//! | datums by least squares | linear propagation with numerical sensitivities (GUM 5.1.3 note 2) | touches of the datums, and what all touches share |
//! | datums by a minimum zone or mating size | Monte Carlo until stable (JCGM 101 7.9) | the same |
//! | best fit | linear propagation in closed form | the same |

use std::collections::BTreeSet;

use metrology::{
    alignment::{AlignmentError, fit_displacement},
    datum::{Datum, datum_frame},
    statistics::rms,
    uncertainty::{Input, Stability, contributions, simulate},
};
use nalgebra::{Isometry3, Matrix6, UnitQuaternion, Vector3, Vector6};
use probecell_msgs::{InspectionFeature, InspectionPlan, PartAlignment, geometry_msgs, std_msgs};

use crate::{
    config::{Alignment, Config, Method},
    feature::{self, Criterion, Sample, disturbed},
    state::{State, all_usable},
};

/// A point (m) and a unit direction, part frame.
type PointAndDirection = (Vector3<f64>, Vector3<f64>);

/// Seed of the trials: the same touches have the same uncertainty.
const SEED: u64 = 2;

/// The samples of a feature that count.
type Counted<'a> = (&'a InspectionFeature, Vec<Sample>);

/// The message that says where the part lies, once all points of the features that align it have been tried.
pub(crate) fn part_alignment(
    config: &Config,
    alignment: &Alignment,
    state: &State,
    plan: &InspectionPlan,
    header: &std_msgs::Header,
) -> Option<PartAlignment> {
    let mut message = PartAlignment {
        header: header.clone(),
        plan_id: plan.plan_id.clone(),
        part_id: plan.part_id.clone(),
        method: match alignment.method {
            Method::Datums => PartAlignment::DATUMS,
            Method::BestFit => PartAlignment::BEST_FIT,
        },
        feature_ids: alignment.features.clone(),
        ..PartAlignment::default()
    };
    let mut features = Vec::new();
    for id in &alignment.features {
        // The cell file's names are those of its part.
        let index = plan.features.iter().position(|feature| feature.id == *id)?;
        let points: BTreeSet<u32> = state.complete(plan, index as u32)?;
        let touched = state.touched(plan, &points);
        let sequences = touched.iter().map(|(sequence, _)| *sequence);
        message.sequences.extend(sequences);
        let feature = &plan.features[index];
        let counted = all_usable(&touched).and_then(|samples| {
            let rules = config.rules(&feature.id);
            feature::without_outliers(feature, &samples, &rules, config.touch_uncertainty)
                .map(|(kept, _)| (feature, kept))
                .map_err(|error| error.to_string())
        });
        features.push(counted.map_err(|text| format!("{}: {text}", feature.id)));
    }
    let features: Result<Vec<Counted<'_>>, String> = features.into_iter().collect();
    let placement = features
        .and_then(|features| Placement::new(config, alignment, plan.stylus.ball_radius, &features));
    match placement {
        Ok(placement) => placement.describe(&mut message),
        Err(text) => message.text = text,
    }
    Some(message)
}

/// Where the part lies.
#[derive(Clone, Debug)]
pub(crate) struct Placement {
    /// Touched part from planned part.
    pub(crate) pose: Isometry3<f64>,
    /// 6 × 6 of shift (m) and rotation (rad).
    pub(crate) covariance: Matrix6<f64>,
    /// m; root mean square residual of a best fit; 0 with datums.
    rms: f64,
}

impl Placement {
    /// Aligns the part by these features, in order of precedence; an error is a sentence.
    fn new(
        config: &Config,
        alignment: &Alignment,
        ball_radius: f64,
        features: &[Counted<'_>],
    ) -> Result<Self, String> {
        match alignment.method {
            Method::Datums => DatumFeatures::new(config, ball_radius, features)?.placement(config),
            Method::BestFit => best_fit(config, alignment.free, touches(features)),
        }
    }

    /// From the message that reported it; an error is the message's text.
    pub(crate) fn from_message(message: &PartAlignment) -> Result<Self, String> {
        if !message.valid {
            return Err(message.text.clone());
        }
        let vector = |v: &geometry_msgs::Vector3| Vector3::new(v.x, v.y, v.z);
        let covariance = message.covariance.iter().copied();
        Ok(Self {
            pose: isometry(&vector(&message.shift), &vector(&message.rotation)),
            covariance: Matrix6::from_iterator(covariance.chain(std::iter::repeat(0.0)).take(36)),
            rms: message.rms,
        })
    }

    /// Fills the message.
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

/// Best fit of `(point, normal, deviation)`, m.
fn best_fit(
    config: &Config,
    free: [bool; 6],
    mut touches: Vec<(Vector3<f64>, Vector3<f64>, f64)>,
) -> Result<Placement, String> {
    let fit = |touches: &[_]| {
        fit_displacement(touches, &free).map_err(|error: AlignmentError| error.to_string())
    };
    let found = fit(&touches)?;
    for (_, _, deviation) in &mut touches {
        *deviation = config.common_uncertainty;
    }
    let common = fit(&touches)?;
    let common = stacked(&common.shift, &common.rotation);
    let by_touches = found.cofactor * config.touch_uncertainty.powi(2);
    Ok(Placement {
        pose: isometry(&found.shift, &found.rotation),
        covariance: by_touches + common * common.transpose(),
        rms: rms(&found.residuals),
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

/// Point (m), normal and deviation (m) of all samples.
fn touches(features: &[Counted<'_>]) -> Vec<(Vector3<f64>, Vector3<f64>, f64)> {
    let all = features.iter().flat_map(|(_, samples)| samples);
    // At the ball's centre the lever is the same as at the contact: the normal goes through both.
    all.map(|sample| (sample.centre.coords, sample.normal, sample.deviation))
        .collect()
}

/// Features whose associated shapes are the datums.
struct DatumFeatures<'a> {
    /// m.
    ball_radius: f64,
    features: &'a [Counted<'a>],
    /// Criterion of each feature.
    criteria: Vec<Criterion>,
    nominal: Vec<Datum>,
    /// Directions found, next to which disturbed samples are fitted.
    axes: Vec<Vector3<f64>>,
    pose: Isometry3<f64>,
}

impl<'a> DatumFeatures<'a> {
    fn new(config: &Config, ball_radius: f64, features: &'a [Counted<'a>]) -> Result<Self, String> {
        let criterion = |(feature, _): &Counted<'_>| config.rules(&feature.id).criterion;
        let nominal = features.iter().map(|(feature, _)| {
            let origin = feature::vector_of(&feature.origin);
            datum(feature, origin, feature::direction(feature))
        });
        let mut system = Self {
            ball_radius,
            features,
            criteria: features.iter().map(criterion).collect(),
            nominal: nominal.collect::<Result<_, _>>()?,
            axes: Vec::new(),
            pose: Isometry3::identity(),
        };
        let samples: Vec<&[Sample]> = features.iter().map(|(_, samples)| &samples[..]).collect();
        let found = system.associated(&samples)?;
        system.pose = system.pose_of(&found)?;
        system.axes = found.into_iter().map(|(_, axis)| axis).collect();
        Ok(system)
    }

    /// Point and direction of each datum feature.
    fn associated(&self, samples: &[&[Sample]]) -> Result<Vec<PointAndDirection>, String> {
        let features = self.features.iter().zip(samples).zip(&self.criteria);
        let located = features
            .enumerate()
            .map(|(index, (((feature, _), samples), criterion))| {
                let near = self.axes.get(index);
                let located =
                    feature::located(feature, self.ball_radius, samples, *criterion, near);
                let (point, axis) =
                    located.map_err(|error| format!("datum {}: {error}", feature.id))?;
                Ok((point.coords, axis))
            });
        located.collect()
    }

    /// Touched part from planned part.
    fn pose_of(&self, found: &[(Vector3<f64>, Vector3<f64>)]) -> Result<Isometry3<f64>, String> {
        let features = self.features.iter().zip(found);
        let found: Vec<Datum> = features
            .map(|((feature, _), (point, axis))| datum(feature, *point, *axis))
            .collect::<Result<_, _>>()?;
        let frame = |datums: &[Datum]| datum_frame(datums).map_err(|error| error.to_string());
        Ok(frame(&found)? * frame(&self.nominal)?.inverse())
    }

    /// Shift and rotation where all touches err by `errors[0]` and each by one more of them.
    fn disturbed(&self, errors: &[f64]) -> Option<[f64; 6]> {
        let (common, mut errors) = errors.split_first()?;
        let mut all = Vec::with_capacity(self.features.len());
        for (_, samples) in self.features {
            let (own, rest) = errors.split_at(samples.len());
            let own: Vec<f64> = own.iter().map(|error| common + error).collect();
            all.push(disturbed(samples, &own));
            errors = rest;
        }
        let samples: Vec<&[Sample]> = all.iter().map(Vec::as_slice).collect();
        let pose = self.pose_of(&self.associated(&samples).ok()?).ok()?;
        let rotation = pose.rotation.scaled_axis();
        Some(stacked(&pose.translation.vector, &rotation).into())
    }

    fn placement(&self, config: &Config) -> Result<Placement, String> {
        let count: usize = self.features.iter().map(|(_, samples)| samples.len()).sum();
        let mut standard = vec![config.touch_uncertainty; count + 1];
        standard[0] = config.common_uncertainty;
        let is_smooth = |criterion: &Criterion| *criterion == Criterion::LeastSquares;
        let covariance = if self.criteria.iter().all(is_smooth) {
            contributions(&standard, |errors| self.disturbed(errors))
                .map(|contributions| &contributions * contributions.transpose())
        } else {
            simulate(&Stability::default(), SEED, |random| {
                let errors = standard.iter().map(|u| Input::exact(*u).draw(random));
                self.disturbed(&errors.collect::<Vec<f64>>())
            })
            .map(|simulation| simulation.covariance)
        };
        Ok(Placement {
            pose: self.pose,
            covariance: covariance.map_err(|error| error.to_string())?,
            rms: 0.0,
        })
    }
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

fn isometry(shift: &Vector3<f64>, rotation: &Vector3<f64>) -> Isometry3<f64> {
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
    fn an_aligned_touch_is_reported_in_the_frame_of_the_part() {
        let sample = Sample {
            centre: Point3::new(0.02, 0.01, 0.052),
            normal: Vector3::z(),
            deviation: 0.0,
        };
        let pose = isometry(&Vector3::new(1e-6, 2e-6, 3e-6), &Vector3::zeros());
        let found = aligned(&pose, 0.002, &sample);
        assert!((found.deviation + 3e-6).abs() < 1e-15);
        assert!((found.centre - Point3::new(0.019_999, 0.009_998, 0.051_997)).norm() < 1e-15);
    }
}
