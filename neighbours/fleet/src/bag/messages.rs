//! Touches, features, decisions, corrections and faults of a recording.

use std::collections::BTreeMap;

use probecell_msgs::{
    Correction, CorrectionAcknowledgement, Fault, FeatureResult, InspectionPlan, ProbeEvent,
    TouchDeviation, Verdict,
};

use super::words::{
    ACKNOWLEDGEMENTS, APPROVALS, CORRECTIONS, DECISIONS, FEATURES, OUTCOMES, SEVERITIES, VERDICTS,
    word,
};
use super::{Source, micros};
use crate::lake::Rows;
use crate::lake::rows::Value;
use crate::lake::schema::{
    CORRECTIONS as CORRECTION_TABLE, EVENTS, FAULTS, FEATURES as FEATURE_TABLE, TOUCHES,
    VERDICTS as VERDICT_TABLE,
};

/// Rows of all of them.
pub(super) fn rows(source: &mut Source<'_>, rows: &mut Rows) -> anyhow::Result<()> {
    let plans: BTreeMap<String, InspectionPlan> = source
        .read::<InspectionPlan>("inspection_plan")?
        .into_iter()
        .map(|plan| (plan.message.plan_id.clone(), plan.message))
        .collect();
    touches(source, &plans, rows)?;
    features(source, "feature_results", &plans, rows)?;
    features(source, "reference_results", &plans, rows)?;
    decisions(source, rows)?;
    faults(source, rows)
}

fn touches(
    source: &mut Source<'_>,
    plans: &BTreeMap<String, InspectionPlan>,
    rows: &mut Rows,
) -> anyhow::Result<()> {
    let deviations: BTreeMap<(String, u64), [f64; 2]> = source
        .read::<TouchDeviation>("touch_deviations")?
        .into_iter()
        .map(|one| one.message)
        .map(|one| {
            (
                (one.plan_id, one.sequence),
                [one.deviation, one.standard_uncertainty],
            )
        })
        .collect();
    for event in source.read::<ProbeEvent>("probe_events")? {
        let event = event.message;
        let plan = plans.get(&event.plan_id);
        let point = plan.and_then(|plan| plan.points.get(event.point_index as usize));
        let feature = point.and_then(|point| plan?.features.get(point.feature as usize));
        let deviation = deviations.get(&(event.plan_id.clone(), event.sequence));
        let row = source.row(
            micros(event.header.stamp),
            [
                event.plan_id.into(),
                plan.map(|plan| plan.part_id.clone()).into(),
                event.sequence.into(),
                event.point_index.into(),
                feature.map(|feature| feature.id.clone()).into(),
                word(OUTCOMES, event.outcome).into(),
                event.feed.into(),
                event.tip.x.into(),
                event.tip.y.into(),
                event.tip.z.into(),
                deviation.map(|[value, _]| *value).into(),
                deviation.map(|[_, uncertainty]| *uncertainty).into(),
                event.axis_names.into(),
                event.axis_positions.into(),
            ],
        );
        rows.push(&TOUCHES, row);
    }
    Ok(())
}

/// The last result of each feature of each plan.
fn features(
    source: &mut Source<'_>,
    topic: &str,
    plans: &BTreeMap<String, InspectionPlan>,
    rows: &mut Rows,
) -> anyhow::Result<()> {
    let results: BTreeMap<(String, String), FeatureResult> = source
        .read::<FeatureResult>(topic)?
        .into_iter()
        .map(|one| {
            (
                (one.message.plan_id.clone(), one.message.feature_id.clone()),
                one.message,
            )
        })
        .collect();
    for result in results.into_values() {
        let plan = plans.get(&result.plan_id);
        let nominal = plan.and_then(|plan| {
            plan.features
                .iter()
                .find(|feature| feature.id == result.feature_id)
        });
        // Both limits 0: the feature has no tolerance of size.
        let limits = nominal
            .map(|nominal| [nominal.lower_tolerance, nominal.upper_tolerance])
            .filter(|limits| limits[0] < limits[1]);
        let determined = |value: f64, uncertainty: f64| {
            [value, uncertainty].map(|one| (uncertainty > 0.0).then_some(one))
        };
        let [position, position_uncertainty] =
            determined(result.position, result.position_uncertainty);
        let [orientation, orientation_uncertainty] =
            determined(result.orientation, result.orientation_uncertainty);
        let row = source.row(
            micros(result.header.stamp),
            [
                result.plan_id.into(),
                result.part_id.into(),
                result.feature_id.into(),
                word(FEATURES, result.kind).into(),
                word(DECISIONS, result.decision).into(),
                (topic == "reference_results").into(),
                result.touches.into(),
                result.size.into(),
                result.nominal_size.into(),
                result.size_deviation.into(),
                result.standard_uncertainty.into(),
                result.coverage_factor.into(),
                (result.coverage_factor * result.standard_uncertainty).into(),
                limits.map(|limits| limits[0]).into(),
                limits.map(|limits| limits[1]).into(),
                result.form.into(),
                result.form_uncertainty.into(),
                position.into(),
                position_uncertainty.into(),
                orientation.into(),
                orientation_uncertainty.into(),
            ],
        );
        rows.push(&FEATURE_TABLE, row);
    }
    Ok(())
}

fn decisions(source: &mut Source<'_>, rows: &mut Rows) -> anyhow::Result<()> {
    let mut verdicts: Vec<Verdict> = Vec::new();
    for verdict in source.read::<Verdict>("verdicts")? {
        if !verdicts.contains(&verdict.message) {
            verdicts.push(verdict.message);
        }
    }
    // A correction is published again with its approval: the last state counts.
    let corrections: BTreeMap<String, Correction> = source
        .read::<Correction>("corrections")?
        .into_iter()
        .map(|one| (one.message.correction_id.clone(), one.message))
        .collect();
    // A repeated request is answered as already applied: the first answer counts.
    let mut answers: BTreeMap<String, CorrectionAcknowledgement> = BTreeMap::new();
    for answer in source.read::<CorrectionAcknowledgement>("correction_acknowledgements")? {
        answers
            .entry(answer.message.correction_id.clone())
            .or_insert(answer.message);
    }
    for correction in corrections.into_values() {
        let answer = answers.get(&correction.correction_id);
        let applied = answer.filter(|answer| answer.outcome == CorrectionAcknowledgement::APPLIED);
        if let Some(applied) = applied {
            let text = format!(
                "{} {}",
                word(CORRECTIONS, correction.kind),
                correction.correction_id
            );
            let row = source.row(
                micros(applied.header.stamp),
                ["correction".into(), text.into()],
            );
            rows.push(&EVENTS, row);
        }
        let row = correction_row(source, &correction, answer, &verdicts);
        rows.push(&CORRECTION_TABLE, row);
    }
    for verdict in verdicts {
        let row = source.row(
            micros(verdict.header.stamp),
            [
                verdict.plan_id.into(),
                verdict.part_id.into(),
                verdict.feature_id.into(),
                verdict.pass_number.into(),
                word(VERDICTS, verdict.verdict).into(),
                verdict.size.into(),
                verdict.error.into(),
                verdict.tolerance.into(),
                verdict.tool_wear.into(),
                verdict.text.into(),
            ],
        );
        rows.push(&VERDICT_TABLE, row);
    }
    Ok(())
}

fn correction_row(
    source: &Source<'_>,
    correction: &Correction,
    answer: Option<&CorrectionAcknowledgement>,
    verdicts: &[Verdict],
) -> Vec<Value> {
    let applied = answer.filter(|answer| answer.outcome == CorrectionAcknowledgement::APPLIED);
    let after = applied.and_then(|applied| {
        let since = micros(applied.header.stamp);
        let next = verdicts.iter().filter(|verdict| {
            micros(verdict.header.stamp) > since
                && correction.feature_ids.contains(&verdict.feature_id)
        });
        next.min_by_key(|verdict| micros(verdict.header.stamp))
    });
    let unit =
        if correction.kind == Correction::VOLUMETRIC || correction.kind == Correction::TOOL_PATH {
            "m"
        } else {
            "m or rad"
        };
    source.row(
        micros(correction.header.stamp),
        [
            correction.correction_id.as_str().into(),
            word(CORRECTIONS, correction.kind).into(),
            correction.plan_id.as_str().into(),
            correction.feature_ids.clone().into(),
            correction.tool_number.into(),
            correction.axis.as_str().into(),
            if correction.kind == Correction::TOOL_WEAR {
                "m"
            } else {
                unit
            }
            .into(),
            correction.previous_value.into(),
            correction.new_value.into(),
            correction.lower_bound.into(),
            correction.upper_bound.into(),
            correction.measured_error.into(),
            correction.standard_uncertainty.into(),
            after.map(|verdict| verdict.error).into(),
            word(APPROVALS, correction.approval).into(),
            correction.approved_by.as_str().into(),
            answer
                .map(|answer| word(ACKNOWLEDGEMENTS, answer.outcome))
                .into(),
            answer.map(|answer| answer.value_before).into(),
            answer.map(|answer| answer.value_after).into(),
            answer.map(|answer| answer.text.clone()).into(),
        ],
    )
}

fn faults(source: &mut Source<'_>, rows: &mut Rows) -> anyhow::Result<()> {
    let own = format!("{}/", source.namespace);
    let topics: Vec<String> = source
        .bag
        .channels()
        .iter()
        .filter_map(|channel| channel.topic.strip_prefix(&own))
        .filter(|topic| topic.ends_with("/faults"))
        .map(ToOwned::to_owned)
        .collect();
    for topic in topics {
        for fault in source.read::<Fault>(&topic)? {
            let fault = fault.message;
            let row = source.row(
                micros(fault.header.stamp),
                [
                    fault.node.into(),
                    word(SEVERITIES, fault.severity).into(),
                    fault.code.into(),
                    fault.text.into(),
                ],
            );
            rows.push(&FAULTS, row);
        }
    }
    Ok(())
}
