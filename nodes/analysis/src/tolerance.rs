//! Geometrical tolerances (ISO 1101:2017) of features, related to datums (ISO 5459:2011): the width or diameter of the smallest
//! zone that holds what was touched, its uncertainty, and conformity with the tolerance (ISO 14253-1:2017).
//!
//! m, part frame. The zone of a form is associated by minimum zone; a derived axis is that of the least-squares cylinder over
//! the touched length. Datums are associated by the rules of their own features.
//!
//! | tolerance | of | value |
//! |---|---|---|
//! | flatness | plane | distance of the closest two parallel planes that hold it |
//! | roundness | cylinder, bore | largest over the touched sections: distance of the closest two concentric circles |
//! | cylindricity | cylinder, bore | distance of the closest two coaxial cylinders |
//! | parallelism, perpendicularity | plane | distance of two parallel planes, in that orientation to the datum |
//! | the same | axis of a cylinder or bore | diameter of the cylinder (or distance of the planes) in that orientation |
//! | position | axis, centre of a sphere | diameter about the theoretically exact place, over the touched length |
//! | position, profile | plane, any surface | twice the largest deviation from the theoretically exact surface |
//! | circular run-out | cylinder, bore | largest over the touched sections: range of the distances from the datum axis |
//! | total run-out | cylinder, bore, plane | range of the distances from the datum axis, or along it |
//!
//! *Uncertainty.* s by Monte Carlo (JCGM 101): touches of feature and datum are disturbed, with what all touches share and the
//! alignment of the part where that matters. Errors of touches widen a zone, so a value is too large rather than too small, by at
//! most the mean zone m of a perfect part touched with the same errors, since the zone of a sum is at most the sum of the zones.
//! A second disturbance widens the value by b; where the width grows as the root of the variance at the most, the first has widened
//! it by at most (1 + √2)·b. The bias is not corrected: U = k·s + B (GUM F.2.4.5) with B = min((1 + √2)·b, m), or m where the value
//! does not tell the part from a perfect one; U/k is stated as the standard uncertainty.

mod zone;

use std::collections::BTreeSet;

use metrology::uncertainty::{Input, Stability, simulate};
use nalgebra::{Matrix6, Vector3, Vector6};
use probecell_msgs::{FeatureResult, InspectionFeature, InspectionPlan, geometrical, std_msgs};
use serde::Deserialize;

use crate::{
    alignment::{Placement, aligned},
    config::Config,
    feature::{self as fitted, Sample},
    result::decide,
    state::{State, all_usable},
};

/// Seed of the trials: the same touches have the same uncertainty.
const SEED: u64 = 3;
/// A zone that a perfect part would exceed in more than this share of measurements does not show that the part is not perfect.
const PERFECT: f64 = 0.01;

/// A geometrical tolerance, as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tolerance {
    /// Its name.
    pub id: String,
    /// The toleranced feature.
    pub feature: String,
    /// Which characteristic.
    pub kind: Characteristic,
    /// Width or diameter of the tolerance zone.
    pub tolerance_um: f64,
    /// Datums, in order of precedence.
    #[serde(default)]
    pub datums: Vec<String>,
    /// Passes of the cycle in which it decides; none: all.
    #[serde(default)]
    pub passes: Vec<String>,
}

/// Geometrical characteristics of ISO 1101.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Characteristic {
    /// Flatness.
    Flatness,
    /// Roundness.
    Roundness,
    /// Cylindricity.
    Cylindricity,
    /// Parallelism.
    Parallelism,
    /// Perpendicularity.
    Perpendicularity,
    /// Position.
    Position,
    /// Profile of a surface.
    Profile,
    /// Circular run-out.
    CircularRunOut,
    /// Total run-out.
    TotalRunOut,
}

impl Characteristic {
    /// Its constant in `FeatureResult`.
    fn code(self) -> u8 {
        match self {
            Self::Roundness => FeatureResult::ROUNDNESS,
            Self::Cylindricity => FeatureResult::CYLINDRICITY,
            Self::Flatness => FeatureResult::FLATNESS,
            Self::Parallelism => FeatureResult::PARALLELISM,
            Self::Perpendicularity => FeatureResult::PERPENDICULARITY,
            Self::Position => FeatureResult::POSITION,
            Self::Profile => FeatureResult::PROFILE,
            Self::CircularRunOut => FeatureResult::CIRCULAR_RUN_OUT,
            Self::TotalRunOut => FeatureResult::TOTAL_RUN_OUT,
        }
    }

    /// It is judged in the datum system that places the part.
    fn needs_place(self) -> bool {
        matches!(self, Self::Position | Self::Profile)
    }

    fn is_form(self) -> bool {
        matches!(self, Self::Flatness | Self::Roundness | Self::Cylindricity)
    }
}

impl Tolerance {
    /// Checks it against the features of the part and the datums that place the part. `kind_of` gives the kind of a feature
    /// ([`InspectionFeature`]). An error is a sentence.
    ///
    /// # Errors
    /// A feature that is unknown or has no such characteristic, datums that do not belong to it, a number out of range.
    pub fn check(
        &self,
        kind_of: impl Fn(&str) -> Option<u8>,
        placed_by: &[String],
    ) -> Result<(), String> {
        let id = &self.id;
        let (_, term) = geometrical::named(self.kind.code()).unwrap_or_default();
        if !(self.tolerance_um.is_finite() && self.tolerance_um > 0.0) {
            return Err(format!(
                "analysis.tolerances: {id:?}: tolerance_um = {} must be a finite number above 0",
                self.tolerance_um
            ));
        }
        let named = [&self.feature].into_iter().chain(&self.datums);
        for name in named {
            if kind_of(name).is_none() {
                return Err(format!(
                    "analysis.tolerances: {id:?} names {name:?}, which is not a feature of the part"
                ));
            }
        }
        if self.datums.contains(&self.feature) {
            return Err(format!(
                "analysis.tolerances: {id:?}: the toleranced feature is its own datum"
            ));
        }
        let kind = kind_of(&self.feature).unwrap_or_default();
        let round = [InspectionFeature::CYLINDER, InspectionFeature::BORE].contains(&kind);
        let plane = kind == InspectionFeature::PLANE;
        let possible = match self.kind {
            Characteristic::Flatness => plane,
            Characteristic::Roundness
            | Characteristic::Cylindricity
            | Characteristic::CircularRunOut => round,
            Characteristic::Parallelism
            | Characteristic::Perpendicularity
            | Characteristic::TotalRunOut => round || plane,
            Characteristic::Position => round || plane || kind == InspectionFeature::SPHERE,
            Characteristic::Profile => true,
        };
        if !possible {
            return Err(format!(
                "analysis.tolerances: {id:?}: feature {:?} has no {term}",
                self.feature
            ));
        }
        self.check_datums(term, kind_of, placed_by)
    }

    fn check_datums(
        &self,
        term: &str,
        kind_of: impl Fn(&str) -> Option<u8>,
        placed_by: &[String],
    ) -> Result<(), String> {
        let id = &self.id;
        if self.kind.is_form() && !self.datums.is_empty() {
            return Err(format!("analysis.tolerances: {id:?}: {term} has no datum"));
        }
        if self.kind.needs_place() {
            return if self.datums.as_slice() == placed_by {
                Ok(())
            } else {
                Err(format!(
                    "analysis.tolerances: {id:?}: datums of a {term} are those that place the part, analysis.alignment.datums = {placed_by:?}"
                ))
            };
        }
        if self.kind.is_form() {
            return Ok(());
        }
        let [datum] = self.datums.as_slice() else {
            return Err(format!(
                "analysis.tolerances: {id:?}: {term} needs one datum"
            ));
        };
        let of = kind_of(datum).unwrap_or_default();
        let axis = [InspectionFeature::CYLINDER, InspectionFeature::BORE].contains(&of);
        let run_out = matches!(
            self.kind,
            Characteristic::CircularRunOut | Characteristic::TotalRunOut
        );
        if axis || (of == InspectionFeature::PLANE && !run_out) {
            Ok(())
        } else {
            Err(format!(
                "analysis.tolerances: {id:?}: {datum:?} is no datum of a {term}"
            ))
        }
    }
}

/// A feature and the touches of it that count.
#[derive(Clone)]
pub(crate) struct Touched<'a> {
    pub(crate) feature: &'a InspectionFeature,
    pub(crate) samples: Vec<Sample>,
}

/// The result of a tolerance, once its feature and datums are reported for this plan.
pub(crate) fn tolerance_result(
    config: &Config,
    state: &State,
    plan: &InspectionPlan,
    header: &std_msgs::Header,
    tolerance: &Tolerance,
) -> Option<FeatureResult> {
    let reported = state.reported.get(&tolerance.feature)?;
    if tolerance
        .datums
        .iter()
        .any(|datum| !state.reported.contains_key(datum))
    {
        return None;
    }
    let mut result = FeatureResult {
        header: header.clone(),
        plan_id: plan.plan_id.clone(),
        part_id: plan.part_id.clone(),
        feature_id: tolerance.id.clone(),
        kind: tolerance.kind.code(),
        decision: FeatureResult::INVALID,
        criterion: if tolerance.kind.is_form() {
            FeatureResult::MINIMUM_ZONE
        } else {
            FeatureResult::LEAST_SQUARES
        },
        aligned_to: tolerance.datums.clone(),
        touches: reported.touches,
        sequences: reported.sequences.clone(),
        left_out: reported.left_out.clone(),
        origin: reported.origin,
        axis: reported.axis,
        coverage_factor: config.coverage_factor,
        repeat_spread: reported.repeat_spread,
        ..FeatureResult::default()
    };
    if let Err(text) = evaluate(config, state, plan, tolerance, &mut result) {
        result.text = text;
    }
    Some(result)
}

fn evaluate(
    config: &Config,
    state: &State,
    plan: &InspectionPlan,
    tolerance: &Tolerance,
    result: &mut FeatureResult,
) -> Result<(), String> {
    let placement = state.alignment.as_ref().map(Placement::from_message);
    let placement = placement.transpose();
    let placement = placement.map_err(|text| format!("the part could not be aligned: {text}"))?;
    let radius = plan.stylus.ball_radius;
    let take = |id: &String| touched(config, state, plan, placement.as_ref(), id);
    let own = take(&tolerance.feature)?;
    let datum = match tolerance.kind.needs_place() {
        true => None,
        false => tolerance.datums.first().map(take).transpose()?,
    };
    let zone = |own: &Touched<'_>, datum: Option<&Touched<'_>>| {
        let rules = datum.map(|datum| config.rules(&datum.feature.id).criterion);
        zone::value(tolerance.kind, own, datum.zip(rules), radius)
    };
    let value = zone(&own, datum.as_ref())?;
    let place = placement.filter(|_| tolerance.kind.needs_place());
    let place = place.map(|placement| root(&placement.covariance));
    let [touch, common, unit] =
        [config.touch_uncertainty, config.common_uncertainty, 1.0].map(Input::exact);
    let simulated = |own: &Touched<'_>, datum: Option<&Touched<'_>>| {
        let simulation = simulate(&Stability::default(), SEED, |random| {
            let shared = common.draw(random);
            let displaced = place.map(|root| root * Vector6::from_fn(|_, _| unit.draw(random)));
            let mut disturbed = |feature, samples: &[Sample]| {
                let errors: Vec<f64> = samples
                    .iter()
                    .map(|_| shared + touch.draw(random))
                    .collect();
                let mut samples = fitted::disturbed(samples, &errors);
                if let Some(by) = displaced {
                    samples.iter_mut().for_each(|sample| displace(sample, &by));
                }
                Touched { feature, samples }
            };
            let own = disturbed(own.feature, &own.samples);
            let datum = datum.map(|datum| disturbed(datum.feature, &datum.samples));
            zone(&own, datum.as_ref()).ok().map(|value| [value])
        });
        simulation.map_err(|error| error.to_string())
    };
    let found = simulated(&own, datum.as_ref())?;
    let perfect = simulated(&nominal(&own), datum.as_ref().map(nominal).as_ref())?;
    let [scatter] = found.standard_uncertainties();
    let grown = (1.0 + f64::sqrt(2.0)) * (found.mean[0] - value).max(0.0);
    let beyond = perfect
        .values
        .iter()
        .filter(|[of_perfect]| *of_perfect > value)
        .count();
    let bias = if beyond as f64 > PERFECT * perfect.values.len() as f64 {
        perfect.mean[0]
    } else {
        grown.min(perfect.mean[0])
    };
    let stated = config
        .stated(scatter, 0.0)
        .map_err(|error| error.to_string())?;
    result.size = value;
    result.size_deviation = value;
    result.coverage_factor = stated.factor;
    result.standard_uncertainty = stated.standard + bias / stated.factor;
    decide(result, f64::NEG_INFINITY, tolerance.tolerance_um * 1e-6);
    Ok(())
}

/// The touches of a feature that count, as aligned.
fn touched<'a>(
    config: &Config,
    state: &State,
    plan: &'a InspectionPlan,
    placement: Option<&Placement>,
    id: &str,
) -> Result<Touched<'a>, String> {
    let index = plan.features.iter().position(|feature| feature.id == id);
    let index = index.ok_or_else(|| format!("the plan has no feature {id:?}"))?;
    let feature = &plan.features[index];
    let points: BTreeSet<u32> = state
        .complete(plan, index as u32)
        .ok_or_else(|| format!("{id}: not all points have been tried"))?;
    let samples =
        all_usable(&state.touched(plan, &points)).map_err(|text| format!("{id}: {text}"))?;
    let samples: Vec<Sample> = match placement {
        None => samples,
        Some(placement) => {
            let radius = plan.stylus.ball_radius;
            samples
                .iter()
                .map(|sample| aligned(&placement.pose, radius, sample))
                .collect()
        }
    };
    let rules = config.rules(id);
    let kept = fitted::without_outliers(feature, &samples, &rules, config.touch_uncertainty);
    let (samples, _) = kept.map_err(|error| format!("{id}: {error}"))?;
    Ok(Touched { feature, samples })
}

/// A square root of a covariance of shift (m) and rotation (rad).
fn root(covariance: &Matrix6<f64>) -> Matrix6<f64> {
    let eigen = covariance.symmetric_eigen();
    let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    eigen.eigenvectors * Matrix6::from_diagonal(&roots)
}

/// The same touches on the nominal surface.
fn nominal<'a>(touched: &Touched<'a>) -> Touched<'a> {
    let samples = touched.samples.iter().map(|sample| Sample {
        centre: sample.centre - sample.normal * sample.deviation,
        deviation: 0.0,
        ..*sample
    });
    Touched {
        feature: touched.feature,
        samples: samples.collect(),
    }
}

/// Moves a touch by shift and rotation about the part's origin.
fn displace(sample: &mut Sample, by: &Vector6<f64>) {
    let shift = Vector3::new(by[0], by[1], by[2]);
    let turn = Vector3::new(by[3], by[4], by[5]);
    let step = shift + turn.cross(&sample.centre.coords);
    sample.centre += step;
    sample.deviation += sample.normal.dot(&step);
}
