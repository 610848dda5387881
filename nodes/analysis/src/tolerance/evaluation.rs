//! The value of a tolerance, its uncertainty and its conformity, from the touches of feature and datum.

use std::collections::BTreeSet;

use metrology::uncertainty::{Input, Stability, simulate};
use nalgebra::{Matrix6, Vector3, Vector6};
use probecell_msgs::{FeatureResult, InspectionPlan, std_msgs};

use super::Tolerance;
use super::zone::{self, Touched};
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
    let datum = if tolerance.kind.needs_place() {
        None
    } else {
        tolerance.datums.first().map(take).transpose()?
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
                    for sample in &mut samples {
                        displace(sample, &by);
                    }
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
