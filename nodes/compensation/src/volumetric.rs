//! The controller's volumetric table, judged and corrected by touches of balls.
//!
//! ```text
//!   touches of balls ── machining::location_errors ── link errors ── largest displacement of the tip ── verdict
//!   table in force ──────────────────────────────── + ─────────── whole new table, each entry within its bound
//! ```
//!
//! m and rad, part frame. The link errors found are those that the controller does not compensate yet: latched positions are
//! programme positions, so the new value of an entry is the one in force plus the estimate. The largest displacement of the
//! tip that they make over the poses measured decides. All entries are written together; where these touches do not
//! determine one, nothing is proposed, and the verdict names it and, where there are such, indexations that would determine
//! it. Only spheres that were not cut on this machine are used: what the machine has cut has its errors. No size is used and
//! nothing is moved.

mod config;

pub use config::{ProbeEffect, RawVolumetric, Volumetric, VolumetricError};

use std::collections::BTreeMap;

use graph::Stamp;
use machine::{LinkError, Nominal};
use machining::location_errors::{Ball, BallCalibration, BallTouch, Estimate, Indexation};
use metrology::decision::Verdict;
use nalgebra::{DMatrix, Point3};
use probecell_msgs::{
    FeatureResult, InspectionFeature, InspectionPlan, ToolOffsets, offset::to_resolution,
};

use crate::{
    config::Config,
    correction::{Change, MeasurementSource, Proposal},
    judgement::{self, Judgement},
    touches::Touches,
};

/// m; features whose centres and radii differ by less are one ball, touched at several indexations.
const SAME_BALL: f64 = 1e-9;

/// True once everything has arrived that the table is judged by.
pub(crate) fn is_complete(
    touches: &Touches,
    plan_id: &str,
    results: &BTreeMap<String, FeatureResult>,
) -> bool {
    let Some(plan) = touches.plan.as_ref().filter(|plan| plan.plan_id == plan_id) else {
        return false;
    };
    let has_arrived = |sequence: &u64| {
        let event = touches.events.get(sequence);
        let uncertainty = touches.uncertainties.get(sequence);
        event.is_some_and(|event| event.plan_id == plan_id)
            && uncertainty.is_some_and(|(plan, _)| plan == plan_id)
    };
    balls(plan).all(|(_, ball)| {
        results.get(&ball.id).is_some_and(|result| {
            result.decision == FeatureResult::INVALID || result.sequences.iter().all(has_arrived)
        })
    })
}

/// The spheres of a plan that were not cut on this machine, with their indices.
fn balls(plan: &InspectionPlan) -> impl Iterator<Item = (usize, &InspectionFeature)> {
    let features = plan.features.iter().enumerate();
    features.filter(|(index, feature)| {
        let mut points = (plan.points.iter()).filter(|point| point.feature as usize == *index);
        feature.kind == InspectionFeature::SPHERE && points.all(|point| point.operation < 0)
    })
}

/// Judges the table by a complete measurement.
pub(crate) fn judge(
    config: &Config,
    rules: &Volumetric,
    touches: &Touches,
    results: &BTreeMap<String, FeatureResult>,
    offsets: Option<&ToolOffsets>,
    corrections: u32,
) -> Judgement {
    match estimated(rules, touches, results, offsets) {
        Err(text) => Judgement {
            id: rules.id.clone(),
            tolerance: rules.tolerance,
            verdict: Verdict::MeasurementInvalid,
            error: f64::NAN,
            text,
            proposals: None,
        },
        Ok(found) => decide(config, rules, &found, corrections),
    }
}

/// The link errors by the touches, and what they rest on.
struct Found<'a> {
    balls: BallMeasurement,
    estimate: Estimate,
    /// m; largest displacement and its standard uncertainty.
    displacement: (f64, f64),
    offsets: &'a ToolOffsets,
}

/// Touches of all balls, ready for the estimate.
struct BallMeasurement {
    calibration: BallCalibration,
    touches: Vec<BallTouch>,
    feature_ids: Vec<String>,
    /// Probing event of each touch.
    sequences: Vec<u64>,
    /// Stamp of the first.
    first: Stamp,
}

/// Estimates the link errors; an error is a sentence.
fn estimated<'a>(
    rules: &Volumetric,
    touches: &Touches,
    results: &BTreeMap<String, FeatureResult>,
    offsets: Option<&'a ToolOffsets>,
) -> Result<Found<'a>, String> {
    let offsets = table_in_force(rules, offsets)?;
    let plan = touches.plan.as_ref().ok_or("no plan has arrived")?;
    let balls = ball_measurement(rules, plan, touches, results)?;
    if Stamp::from(&offsets.header.stamp) > balls.first {
        return Err("the controller's offsets have changed since the first touch".to_owned());
    }
    let (calibration, touches) = (&balls.calibration, &balls.touches);
    let estimate = calibration
        .estimate(touches)
        .map_err(|error| error.to_string())?;
    let undetermined = estimate.undetermined(&rules.uncertainty_limits);
    if !undetermined.is_empty() {
        return Err(undetermined_text(
            rules,
            plan,
            &balls,
            &estimate,
            &undetermined,
        ));
    }
    let values: Vec<f64> = estimate.links.iter().map(|link| link.value).collect();
    let displacement = calibration.largest_displacement(&values, &estimate.covariance, touches);
    Ok(Found {
        balls,
        estimate,
        displacement,
        offsets,
    })
}

/// The controller's offsets, whose table has all entries that are estimated and is finite.
fn table_in_force<'a>(
    rules: &Volumetric,
    offsets: Option<&'a ToolOffsets>,
) -> Result<&'a ToolOffsets, String> {
    let offsets = offsets.filter(|offsets| !offsets.volumetric_entries.is_empty());
    let offsets = offsets.ok_or("the controller has reported no volumetric table")?;
    let entries = &offsets.volumetric_entries;
    if let Some(name) = (rules.names.iter()).find(|name| !entries.contains(name)) {
        return Err(format!("the controller's table has no entry {name}"));
    }
    let values = &offsets.volumetric_values;
    if values.len() != entries.len() || !values.iter().all(|value| value.is_finite()) {
        return Err("the controller's table has an entry without a finite value".to_owned());
    }
    Ok(offsets)
}

/// Collects the touches of all balls of a plan.
fn ball_measurement(
    rules: &Volumetric,
    plan: &InspectionPlan,
    touches: &Touches,
    results: &BTreeMap<String, FeatureResult>,
) -> Result<BallMeasurement, String> {
    let nominal = Nominal::from_plan(plan).map_err(|error| error.to_string())?;
    let mut calibration = BallCalibration {
        chain: rules.chain.clone(),
        part_pose: nominal.part_pose,
        stylus: nominal.ball,
        stylus_radius: nominal.ball_radius,
        balls: Vec::new(),
        links: rules.links.clone(),
        probe: rules.probe,
    };
    let (mut ball_touches, mut sequences, mut feature_ids) = (Vec::new(), Vec::new(), Vec::new());
    let mut first: Option<Stamp> = None;
    for (_, feature) in balls(plan) {
        let Some(result) = results.get(&feature.id) else {
            return Err(format!("{} was not measured", feature.id));
        };
        if result.decision == FeatureResult::INVALID {
            return Err(format!("{}: {}", feature.id, result.text));
        }
        let ball = ball_index(&mut calibration.balls, feature);
        feature_ids.push(feature.id.clone());
        for sequence in &result.sequences {
            let (Some(event), Some((_, uncertainty))) = (
                touches.events.get(sequence),
                touches.uncertainties.get(sequence),
            ) else {
                continue;
            };
            let at = Stamp::from(&event.header.stamp);
            first = Some(first.map_or(at, |first| first.min(at)));
            let positions = rules
                .chain
                .positions(&event.axis_names, &event.axis_positions);
            ball_touches.push(BallTouch {
                ball,
                positions: positions.map_err(|error| format!("touch {sequence}: {error}"))?,
                uncertainty: *uncertainty,
            });
            sequences.push(*sequence);
        }
    }
    Ok(BallMeasurement {
        calibration,
        touches: ball_touches,
        feature_ids,
        sequences,
        first: first.ok_or("the plan has no ball that was not cut on this machine")?,
    })
}

/// Index of the ball that a feature is; one ball may be several features, one for each indexation.
fn ball_index(balls: &mut Vec<Ball>, feature: &InspectionFeature) -> usize {
    let centre = Point3::new(feature.origin.x, feature.origin.y, feature.origin.z);
    let radius = feature.radius;
    let same = |ball: &Ball| {
        (ball.centre - centre).norm() < SAME_BALL && (ball.radius - radius).abs() < SAME_BALL
    };
    balls.iter().position(same).unwrap_or_else(|| {
        balls.push(Ball { centre, radius });
        balls.len() - 1
    })
}

/// Names the entries that the touches do not determine, and the indexations that would.
fn undetermined_text(
    rules: &Volumetric,
    plan: &InspectionPlan,
    balls: &BallMeasurement,
    estimate: &Estimate,
    undetermined: &[usize],
) -> String {
    let uncertainties = estimate.uncertainties();
    let named = undetermined.iter().map(|&index| {
        let (link, name) = (&rules.links[index], &rules.names[index]);
        let limit = shown(link, rules.uncertainty_limits.of(link));
        let u = uncertainties[index];
        // An uncertainty of a thousandth of a radian or a millimetre is no determination.
        if u < 1e-3 {
            format!("{name} (u {}, at most {limit})", shown(link, u))
        } else {
            format!("{name} (u infinite, at most {limit})")
        }
    });
    let named = named.collect::<Vec<_>>().join(", ");
    let names = plan.rotary_names.iter();
    let rotary: Vec<usize> = names
        .filter_map(|name| rules.chain.axis_index(name))
        .collect();
    let limits = &rules.uncertainty_limits;
    let further = (balls.calibration).further(&balls.touches, estimate, limits, &rotary);
    let remedy = further.map_or_else(
        || "no few further indexations of these balls would".to_owned(),
        |further| {
            let at = further.iter().map(|one| indexation(plan, one));
            format!(
                "touch them at {} as well",
                at.collect::<Vec<_>>().join(", ")
            )
        },
    );
    format!(
        "the touches of the balls do not determine {named}; their residuals are {:.1} µm rms; {remedy}",
        estimate.residual * 1e6
    )
}

/// An indexation in degrees: `B -45 C 90`.
fn indexation(plan: &InspectionPlan, one: &Indexation) -> String {
    let axes = plan.rotary_names.iter().zip(&one.0);
    let axes = axes.map(|(name, angle)| format!("{name} {:.0}", angle.to_degrees()));
    axes.collect::<Vec<_>>().join(" ")
}

/// A value of a link in µm or µrad.
fn shown(link: &LinkError, value: f64) -> String {
    let unit = if link.turns() { "µrad" } else { "µm" };
    format!("{:.1} {unit}", value * 1e6)
}

/// The verdict, with the table that corrects the errors where it can.
fn decide(config: &Config, rules: &Volumetric, found: &Found<'_>, corrections: u32) -> Judgement {
    let judged = judgement::Found {
        id: &rules.id,
        subject: "the displacement",
        tolerance: rules.tolerance,
        displacement: found.displacement,
        summary: summary(rules, found),
        corrections: (corrections, config.max_corrections),
    };
    judged.judge(|| Ok(vec![proposal(rules, found)?]))
}

/// What was found, in a sentence.
fn summary(rules: &Volumetric, found: &Found<'_>) -> String {
    let links = rules.names.iter().zip(&found.estimate.links);
    let links = links
        .zip(found.estimate.uncertainties())
        .map(|((name, link), u)| format!("{name} {} (u {:.1})", shown(link, link.value), u * 1e6));
    let (error, uncertainty) = found.displacement;
    let outliers = match found.estimate.outliers.len() {
        0 => String::new(),
        count => format!(", {count} outliers left out"),
    };
    format!(
        "the tip is displaced by at most {:.1} µm (u {:.1}) in {} touches of {} balls{outliers}, residuals {:.1} µm rms: {}",
        error * 1e6,
        uncertainty * 1e6,
        found.balls.touches.len(),
        found.balls.calibration.balls.len(),
        found.estimate.residual * 1e6,
        links.collect::<Vec<_>>().join(", ")
    )
}

/// The whole table with the estimates added to what is in force; the error says which bound it would break.
fn proposal(rules: &Volumetric, found: &Found<'_>) -> Result<Proposal, String> {
    let entries = found.offsets.volumetric_entries.clone();
    let held = found.offsets.volumetric_values.clone();
    let mut wanted = held.clone();
    let mut limits = Vec::new();
    let mut uncertainties = vec![0.0; entries.len()];
    let estimated = found.estimate.uncertainties();
    let mut table = found.balls.calibration.clone();
    table.links.clear();
    for (entry, name) in entries.iter().enumerate() {
        let link = LinkError::named(&rules.chain, name, 0.0).map_err(|error| error.to_string())?;
        table.links.push(link);
        limits.push(rules.bounds.of(&link));
        if let Some(index) = rules.names.iter().position(|known| known == name) {
            wanted[entry] = to_resolution(held[entry] + found.estimate.links[index].value);
            uncertainties[entry] = estimated[index];
        }
        if !(wanted[entry].abs() <= limits[entry]) {
            return Err(format!(
                "{name} would be {}, beyond ±{}",
                shown(&link, wanted[entry]),
                shown(&link, limits[entry])
            ));
        }
    }
    let exact = DMatrix::zeros(entries.len(), entries.len());
    let touches = &found.balls.touches;
    let by = |values: &[f64]| table.largest_displacement(values, &exact, touches).0;
    let displacement = (by(&held), by(&wanted));
    if !(displacement.1 <= rules.displacement_limit) {
        return Err(format!(
            "the table would displace the tip by {:.1} µm, beyond {:.1} µm",
            displacement.1 * 1e6,
            rules.displacement_limit * 1e6
        ));
    }
    let used = (found.balls.sequences.iter().enumerate())
        .filter(|(index, _)| !found.estimate.outliers.contains(index));
    let (error, uncertainty) = found.displacement;
    Ok(Proposal {
        change: Change::VolumetricTable {
            entries,
            held,
            wanted,
            limits,
            uncertainties,
            displacement,
            limit: rules.displacement_limit,
        },
        evidence: MeasurementSource {
            feature_ids: found.balls.feature_ids.clone(),
            sequences: used.map(|(_, sequence)| *sequence).collect(),
            error,
            uncertainty,
        },
    })
}
