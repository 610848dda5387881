//! The result of one feature: its touches selected and fitted, its uncertainty stated, its conformance decided.
//!
//! m and rad, part frame. A feature is invalid, with a sentence that says why, where a probing move gave no usable touch,
//! where the part could not be aligned, where repeated touches of one point scatter too much, and where its touches do not
//! determine it.

use std::collections::{BTreeMap, BTreeSet};

use metrology::{
    conformance::{Conformance, Tolerance, conformance},
    uncertainty::UncertaintyError,
};
use nalgebra::Vector3;
use probecell_msgs::{FeatureResult, InspectionFeature, InspectionPlan, geometry_msgs, std_msgs};

use crate::{
    alignment::{self, Placement},
    config::Config,
    feature::{self, AlignmentCovariance, Fitted, Sample},
    state::{State, Touched, all_usable},
};

/// The result of a feature whose points have all been tried.
pub(crate) fn feature_result(
    config: &Config,
    state: &State,
    plan: &InspectionPlan,
    nominal: &InspectionFeature,
    header: &std_msgs::Header,
    points: &BTreeSet<u32>,
) -> FeatureResult {
    let touched = state.touched(plan, points);
    let ball_radius = plan.stylus.ball_radius;
    let result = FeatureResult {
        header: header.clone(),
        plan_id: plan.plan_id.clone(),
        part_id: plan.part_id.clone(),
        feature_id: nominal.id.clone(),
        kind: nominal.kind,
        decision: FeatureResult::INVALID,
        criterion: config.rules(&nominal.id).criterion.code(),
        touches: touched
            .iter()
            .filter(|(_, sample)| sample.is_some())
            .count() as u32,
        sequences: touched.iter().map(|(sequence, _)| *sequence).collect(),
        coverage_factor: config.coverage_factor,
        ..FeatureResult::default()
    };
    let placement = state.alignment.as_ref().map(Placement::from_message);
    let placement = placement.transpose();
    let placement = placement.map_err(|text| format!("the part could not be aligned: {text}"));
    let input = all_usable(&touched).and_then(|samples| Ok((samples, placement?)));
    let (samples, placement) = match input {
        Err(text) => return FeatureResult { text, ..result },
        Ok((samples, None)) => (samples, None),
        Ok((samples, Some(placement))) => {
            let aligned = samples
                .iter()
                .map(|sample| alignment::aligned(&placement.pose, ball_radius, sample));
            (aligned.collect(), Some(placement))
        }
    };
    let of_point: Vec<u32> = points
        .iter()
        .flat_map(|point| vec![*point; state.touches[point].len()])
        .collect();
    let measurement = Measurement {
        nominal,
        ball_radius,
        touched,
        of_point,
        samples,
        placement,
    };
    measurement.evaluate(config, result)
}

/// The usable touches of one feature, as aligned.
struct Measurement<'a> {
    nominal: &'a InspectionFeature,
    /// m.
    ball_radius: f64,
    touched: Touched,
    /// Point of each sample.
    of_point: Vec<u32>,
    samples: Vec<Sample>,
    placement: Option<Placement>,
}

impl Measurement<'_> {
    /// Completes `result`: fits the samples without outliers, and decides.
    fn evaluate(&self, config: &Config, mut result: FeatureResult) -> FeatureResult {
        if let Some(alignment) = &config.alignment {
            result.aligned_to.clone_from(&alignment.features);
        }
        let rules = config.rules(&self.nominal.id);
        let touch_uncertainty = config.touch_uncertainty;
        let fitted = feature::fit(
            self.nominal,
            self.ball_radius,
            &self.samples,
            &rules,
            touch_uncertainty,
        );
        let outliers = fitted.as_ref().map_or(&[][..], |fitted| &fitted.left_out);
        let used: Vec<usize> = (0..self.samples.len())
            .filter(|index| !outliers.contains(index))
            .collect();
        let deviations: Vec<(u32, f64)> = used
            .iter()
            .map(|&index| (self.of_point[index], self.samples[index].deviation))
            .collect();
        let sequences = |indices: &[usize]| indices.iter().map(|&i| self.touched[i].0).collect();
        result.touches = used.len() as u32;
        result.left_out = sequences(outliers);
        result.sequences = sequences(&used);
        result.repeat_spread = repeat_spread(&deviations);
        let decided = within_repeat_limit(config, result.repeat_spread)
            .and_then(|()| fitted.map_err(|error| error.to_string()))
            .and_then(|fitted| self.state(config, &mut result, &fitted, &deviations));
        if let Err(text) = decided {
            result.text = text;
        }
        result
    }

    /// Fills what the fit found, and decides on the size.
    fn state(
        &self,
        config: &Config,
        result: &mut FeatureResult,
        fitted: &Fitted,
        deviations: &[(u32, f64)],
    ) -> Result<(), String> {
        let alignment = self.placement.as_ref();
        let alignment = alignment.map(|placement| &placement.covariance);
        describe(result, config, self.nominal, fitted, alignment)
            .map_err(|error| error.to_string())?;
        if !fitted.left_out.is_empty() {
            let text = outlier_text(&fitted.left_out, &self.of_point);
            result.text = if result.text.is_empty() {
                text
            } else {
                format!("{}; {text}", result.text)
            };
        }
        let free_form = [InspectionFeature::PROFILE, InspectionFeature::SURFACE];
        if free_form.contains(&self.nominal.kind) {
            result.deviations = mean_deviations(deviations);
        }
        let (lower, upper) = (self.nominal.lower_tolerance, self.nominal.upper_tolerance);
        decide(result, lower, upper);
        Ok(())
    }
}

fn within_repeat_limit(config: &Config, spread: f64) -> Result<(), String> {
    if spread > config.repeat_limit {
        let (spread, limit) = (spread * 1e6, config.repeat_limit * 1e6);
        return Err(format!(
            "repeated touches of one point differ by {spread:.1} µm, more than {limit:.1} µm"
        ));
    }
    Ok(())
}

/// Fills the measured part of a result.
///
/// # Errors
/// An uncertainty that is not finite.
fn describe(
    result: &mut FeatureResult,
    config: &Config,
    nominal: &InspectionFeature,
    fitted: &Fitted,
    alignment: AlignmentCovariance<'_>,
) -> Result<(), UncertaintyError> {
    result.size = fitted.size;
    result.nominal_size = fitted.nominal_size;
    result.size_deviation = fitted.size - fitted.nominal_size;
    result.form = fitted.form;
    result.form_uncertainty = fitted.form_uncertainty;
    result.origin = geometry_msgs::Point {
        x: fitted.origin.x,
        y: fitted.origin.y,
        z: fitted.origin.z,
    };
    result.axis = geometry_msgs::Vector3 {
        x: fitted.axis.x,
        y: fitted.axis.y,
        z: fitted.axis.z,
    };
    let shift_by_alignment =
        |along: &Vector3<f64>| feature::shift_by_alignment(alignment, &fitted.origin, along);
    let diameter = [
        InspectionFeature::CYLINDER,
        InspectionFeature::BORE,
        InspectionFeature::SPHERE,
    ];
    // A shift of the part changes a distance from its origin, not a diameter.
    let by_alignment = if diameter.contains(&nominal.kind) {
        0.0
    } else {
        shift_by_alignment(&feature::direction(nominal))
    };
    let by_touches = fitted.size_uncertainty.hypot(by_alignment);
    let stated = config.stated(
        by_touches,
        feature::common_sensitivity(nominal.kind, nominal.half_angle),
    )?;
    result.standard_uncertainty = stated.standard;
    result.coverage_factor = stated.factor;
    if let Some((offset, uncertainty)) = fitted.position {
        result.position = offset.norm();
        let common = if nominal.kind == InspectionFeature::PLANE {
            config.common_uncertainty
        } else {
            0.0
        };
        result.position_uncertainty =
            (uncertainty.hypot(common)).hypot(shift_by_alignment(&offset));
    }
    if let Some((offset, uncertainty)) = fitted.orientation {
        result.orientation = offset.norm().min(1.0).asin();
        let by_alignment = feature::tilt_by_alignment(alignment, &fitted.axis, &offset);
        result.orientation_uncertainty = uncertainty.hypot(by_alignment);
    }
    fitted.note.clone_into(&mut result.text);
    Ok(())
}

/// Mean deviation at each point, m; each has at least one value.
fn mean_deviations(values: &[(u32, f64)]) -> Vec<f64> {
    let mut of_point: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
    for (point, deviation) in values {
        let (sum, count) = of_point.entry(*point).or_default();
        *sum += deviation;
        *count += 1.0;
    }
    of_point.values().map(|(sum, count)| sum / count).collect()
}

/// Largest range of the deviations of one point, m.
fn repeat_spread(values: &[(u32, f64)]) -> f64 {
    let mut ranges: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
    for &(point, deviation) in values {
        let range = ranges.entry(point).or_insert((deviation, deviation));
        *range = (range.0.min(deviation), range.1.max(deviation));
    }
    let range = ranges.values().map(|(lowest, highest)| highest - lowest);
    range.fold(0.0, f64::max)
}

/// Names the outliers. Where a point was touched each time alike it is the surface, or what lies on it, that differs; where
/// other touches of the same point contradict one, that touch (`docs/source_systems.md`, C.5: persistent, transient).
fn outlier_text(outliers: &[usize], of_point: &[u32]) -> String {
    let points: BTreeSet<u32> = outliers.iter().map(|&index| of_point[index]).collect();
    let named = points.into_iter().map(|point| {
        let all = of_point.iter().filter(|of| **of == point).count();
        let out = outliers.iter().filter(|&&index| of_point[index] == point);
        match (out.count(), all) {
            (1, 1) => format!("point {point}"),
            (out, all) if out == all => format!("point {point} all {all} times"),
            (out, all) => format!("point {point} {out} of {all} times"),
        }
    });
    let named: Vec<String> = named.collect();
    format!("outliers left out: {}", named.join(", "))
}

/// ISO 14253-1:2013: conforms only when the whole expanded uncertainty lies inside the limits.
pub(crate) fn decide(result: &mut FeatureResult, lower: f64, upper: f64) {
    let expanded = result.expanded_uncertainty();
    match conformance(result.size_deviation, expanded, &Tolerance { lower, upper }) {
        Ok(Conformance::Conforms) => result.decision = FeatureResult::CONFORMS,
        Ok(Conformance::DoesNotConform) => result.decision = FeatureResult::DOES_NOT_CONFORM,
        Ok(Conformance::Indeterminate) => result.decision = FeatureResult::INDETERMINATE,
        Err(error) => result.text = error.to_string(),
    }
}
