//! The position of the part, judged by its alignment and followed by the controller's work offsets.
//!
//! m and rad, part frame. `analysis` aligns the part by its datums or a best fit ([`PartAlignment`]). A point p of it is
//! displaced by u = shift + rotation × p; the programme follows by changes Δ of the work offsets of linear axes with
//! J Δ = u, J being the derivatives of the ball's position by these axes at the touches, in least squares over all of them.
//! An arm has no linear axes; its work offsets X, Y, Z shift the frame of its programme along the axes of the part frame
//! ([`machine::frame`]). Neither rotates anything: what remains of u is reported, and where it exceeds the tolerance the part has to be clamped
//! again. The offsets are absolute; they start from those that the controller reports.

use std::collections::BTreeMap;

use machine::Nominal;
use metrology::decision::Verdict;
use nalgebra::{DMatrix, DVector, Matrix3x6, Matrix6, Vector3};
use probecell_msgs::{
    FeatureResult, InspectionPlan, PartAlignment, ToolOffsets, geometry_msgs, offset::to_resolution,
};

use crate::{
    config::{Config, WorkOffset},
    correction::{Change, MeasurementSource, Proposal},
    judgement::{self, Judgement},
    touches::Touches,
};

/// Directions in which the axes move the ball by less than this (m per m) are none that they can follow.
const RANK: f64 = 1e-6;

/// The displacement of the part, and how work offsets follow it.
struct Displacement {
    /// m; largest displacement of a touched point, and its standard uncertainty.
    largest: (f64, f64),
    /// m; change of the work offset of each axis.
    follow: Vec<f64>,
    /// m; largest displacement that remains then.
    remaining: f64,
    /// rad; rotation of the part.
    rotation: f64,
}

/// True once everything has arrived that the position of the part is judged by. An alignment is published with the features
/// that align the part, so one of an earlier measurement of the same plan is known by its stamp.
pub(crate) fn is_complete(
    alignment: Option<&PartAlignment>,
    plan_id: &str,
    touches: &Touches,
    results: &BTreeMap<String, FeatureResult>,
) -> bool {
    let is_measured = |plan: &InspectionPlan| plan.plan_id == plan_id;
    let Some(alignment) = alignment.filter(|alignment| alignment.plan_id == plan_id) else {
        return false;
    };
    let is_of_alignment = |id: &String| {
        let result = results.get(id);
        result.is_some_and(|result| result.header.stamp == alignment.header.stamp)
    };
    touches.plan.as_ref().is_some_and(is_measured)
        && alignment.feature_ids.iter().all(is_of_alignment)
        && (alignment.sequences.iter()).all(|sequence| touches.events.contains_key(sequence))
}

/// Judges the position of the part by its alignment.
pub(crate) fn judge(
    config: &Config,
    rules: &WorkOffset,
    touches: &Touches,
    alignment: &PartAlignment,
    offsets: Option<&ToolOffsets>,
    corrections: u32,
) -> Judgement {
    let found = offsets_held(rules, offsets)
        .and_then(|held| Ok((held, displacement(rules, touches, alignment)?)));
    match found {
        Err(text) => Judgement {
            id: rules.id.clone(),
            tolerance: rules.tolerance,
            verdict: Verdict::MeasurementInvalid,
            error: f64::NAN,
            text,
            proposals: None,
        },
        Ok((held, found)) => decide(config, rules, &held, &found, alignment, corrections),
    }
}

/// m; work offset of each axis in force.
fn offsets_held(rules: &WorkOffset, offsets: Option<&ToolOffsets>) -> Result<Vec<f64>, String> {
    let offsets = offsets.ok_or("the controller has reported no offsets")?;
    let held = |name: &String| {
        let index = offsets
            .work_offset_axes
            .iter()
            .position(|axis| axis == name);
        let value = index
            .and_then(|index| offsets.work_offsets.get(index))
            .copied();
        value
            .filter(|value| value.is_finite())
            .ok_or_else(|| format!("the controller reports no work offset of axis {name}"))
    };
    rules.axes.iter().map(held).collect()
}

/// Displacement of the touched points by the alignment, and the least-squares change of the work offsets that follows it.
fn displacement(
    rules: &WorkOffset,
    touches: &Touches,
    alignment: &PartAlignment,
) -> Result<Displacement, String> {
    if !alignment.valid {
        return Err(alignment.text.clone());
    }
    let plan = touches.plan.as_ref().ok_or("no plan has arrived")?;
    let vector = |v: &geometry_msgs::Vector3| Vector3::new(v.x, v.y, v.z);
    let (shift, rotation) = (vector(&alignment.shift), vector(&alignment.rotation));
    let covariance = alignment.covariance.iter().copied();
    let covariance = Matrix6::from_iterator(covariance.chain(std::iter::repeat(0.0)).take(36));
    let nominal = Nominal::from_plan(plan).map_err(|error| error.to_string())?;
    let axes: Vec<machine::WorkOffset> = rules
        .axes
        .iter()
        .filter_map(|name| rules.chain.work_offset(name))
        .collect();
    let (mut rows, mut displaced, mut points) = (Vec::new(), Vec::new(), Vec::new());
    let events = alignment.sequences.iter();
    for event in events.filter_map(|sequence| touches.events.get(sequence)) {
        let Some((point, _)) = nominal.points.get(event.point_index as usize) else {
            continue;
        };
        let positions = rules
            .chain
            .positions(&event.axis_names, &event.axis_positions)
            .map_err(|error| format!("touch {}: {error}", event.sequence))?;
        let sensitivity = rules
            .chain
            .sensitivity(&positions, &nominal.part_pose, &nominal.ball);
        rows.push(
            axes.iter()
                .map(|&moved| match moved {
                    machine::WorkOffset::Axis(axis) => sensitivity.axes[axis],
                    machine::WorkOffset::Frame(along) => Vector3::ith(along, 1.0),
                })
                .collect::<Vec<_>>(),
        );
        displaced.push(shift + rotation.cross(&point.coords));
        points.push(point.coords);
    }
    let worst = (0..points.len())
        .max_by(|&a, &b| displaced[a].norm().total_cmp(&displaced[b].norm()))
        .ok_or("no touch of the features that align the part has arrived")?;
    let jacobian = DMatrix::from_fn(3 * rows.len(), axes.len(), |row, axis| {
        rows[row / 3][axis][row % 3]
    });
    let wanted = DVector::from_fn(3 * rows.len(), |row, _| displaced[row / 3][row % 3]);
    let follow = jacobian
        .clone()
        .svd(true, true)
        .solve(&wanted, RANK)
        .map_err(ToOwned::to_owned)?;
    let remaining = wanted - jacobian * &follow;
    let remaining = (0..rows.len()).map(|row| remaining.fixed_rows::<3>(3 * row).norm());
    // Uncertainty of the largest displacement along itself: the sensitivities to shift and rotation are I and −[p]×.
    let along = displaced[worst]
        .try_normalize(0.0)
        .unwrap_or_else(Vector3::z);
    let mut sensitivity = Matrix3x6::zeros();
    sensitivity
        .fixed_view_mut::<3, 3>(0, 0)
        .fill_with_identity();
    let lever = -points[worst].cross_matrix();
    sensitivity.fixed_view_mut::<3, 3>(0, 3).copy_from(&lever);
    let variance = (sensitivity * covariance * sensitivity.transpose() * along).dot(&along);
    Ok(Displacement {
        largest: (displaced[worst].norm(), variance.max(0.0).sqrt()),
        follow: follow.iter().copied().collect(),
        remaining: remaining.fold(0.0, f64::max),
        rotation: rotation.norm(),
    })
}

/// The verdict, with the offsets that follow the part where they can.
fn decide(
    config: &Config,
    rules: &WorkOffset,
    held: &[f64],
    found: &Displacement,
    alignment: &PartAlignment,
    corrections: u32,
) -> Judgement {
    let (error, uncertainty) = found.largest;
    let judged = judgement::Found {
        id: &rules.id,
        subject: "the position of the part",
        tolerance: rules.tolerance,
        displacement: found.largest,
        summary: format!(
            "aligned by {} the part is displaced by at most {:.1} µm (u {:.1})",
            alignment.feature_ids.join(", "),
            error * 1e6,
            uncertainty * 1e6
        ),
        corrections: (corrections, config.max_corrections),
    };
    judged.judge(|| {
        if found.remaining > rules.tolerance {
            return Err(format!(
                "{:.1} µm would remain with work offsets of {}, because it is rotated by {:.0} µrad: clamp it again",
                found.remaining * 1e6,
                rules.axes.join(", "),
                found.rotation * 1e6
            ));
        }
        let evidence = MeasurementSource {
            feature_ids: alignment.feature_ids.clone(),
            sequences: alignment.sequences.clone(),
            error,
            uncertainty,
        };
        proposals(rules, held, &found.follow, &evidence)
    })
}

/// One proposal for each axis whose offset changes; the error names the first that would break its bound.
fn proposals(
    rules: &WorkOffset,
    held: &[f64],
    follow: &[f64],
    evidence: &MeasurementSource,
) -> Result<Vec<Proposal>, String> {
    let mut proposals = Vec::new();
    for ((axis, &held), follow) in rules.axes.iter().zip(held).zip(follow) {
        let wanted = to_resolution(held + follow);
        if !(wanted.abs() <= rules.limit) {
            return Err(format!(
                "the work offset of {axis} would be {:.1} µm, beyond ±{:.1} µm",
                wanted * 1e6,
                rules.limit * 1e6
            ));
        }
        if held != wanted {
            let change = Change::WorkOffset {
                axis: axis.clone(),
                held,
                wanted,
                limit: rules.limit,
            };
            let evidence = evidence.clone();
            proposals.push(Proposal { change, evidence });
        }
    }
    Ok(proposals)
}
