//! The sizes of a record: what outside instruments find of them, and all of them as JSON.

use analysis::RawConfig;
use bags::Bag;
use machine::Chain;
use probecell_msgs::{FeatureResult, InspectionPlan, PartReport, ReferenceMeasurement, std_msgs};
use report::{PartSession, size_records};
use serde_json::{Value, json};

use crate::embedded;

/// The features of the plans as the instruments find them, by the fits of the recorded cell file (without one: by least
/// squares), and a sentence for each reference that is of no use.
pub(crate) fn by_reference(
    bag: &Bag,
    machines: &[std_msgs::String],
    plans: &[InspectionPlan],
    references: &[ReferenceMeasurement],
) -> anyhow::Result<(Vec<FeatureResult>, Vec<String>)> {
    if references.is_empty() {
        return Ok((Vec::new(), Vec::new()));
    }
    let config = match (embedded::cell(bag)?, machines.last()) {
        (Some(cell), _) => cell.analysis.check(cell.chain()?)?,
        (None, Some(machine)) => RawConfig::default().check(Chain::from_urdf(&machine.data)?)?,
        (None, None) => {
            let text =
                "a reference was recorded without the robot description that it is evaluated with";
            return Ok((Vec::new(), vec![text.to_owned()]));
        }
    };
    let (mut found, mut unusable) = (Vec::new(), Vec::new());
    let unknown = InspectionPlan::default();
    for reference in references {
        let plan = plans.iter().find(|plan| plan.plan_id == reference.plan_id);
        match config.by_reference(plan.unwrap_or(&unknown), reference) {
            Ok(results) => found.extend(results),
            Err(error) => unusable.push(error.to_string()),
        }
    }
    Ok((found, unusable))
}

/// ISO 14253-1:2013 in a word.
pub fn conformity(result: &FeatureResult) -> &'static str {
    match result.decision {
        FeatureResult::CONFORMS => "conforms",
        FeatureResult::DOES_NOT_CONFORM => "does_not_conform",
        FeatureResult::INDETERMINATE => "indeterminate",
        _ => "invalid",
    }
}

/// Parts and sizes of a session, schema `part-record`; lengths in m.
pub fn json(session: &PartSession) -> Value {
    let sizes: Vec<Value> = size_records(session)
        .iter()
        .map(|one| {
            let result = one.result;
            json!({
                "plan": result.plan_id,
                "feature": result.feature_id,
                "nominal": result.nominal_size,
                "size": result.size,
                "deviation": result.size_deviation,
                "expanded_uncertainty": result.expanded_uncertainty(),
                "coverage_factor": result.coverage_factor,
                "conformity": conformity(result),
                "limits": session.limits(result).map(|limits| limits.map(|one| one.is_finite().then_some(one))),
                "tolerance": one.verdict.map(|verdict| verdict.tolerance),
                "verdict": one.judged(),
                "decision_rule": one.verdict.map(|verdict| verdict.text.clone()),
                "contradicted": one.contradicted,
                "reference": one.reference.map(|found| json!({
                    "instrument": found.text,
                    "deviation": found.size_deviation,
                    "expanded_uncertainty": found.expanded_uncertainty(),
                    "normalised_error": one.score(),
                })),
            })
        })
        .collect();
    let parts = session.parts.iter().map(|part| {
        let prefix = format!("{}/", part.part_id);
        let refuted = size_records(session)
            .iter()
            .any(|one| one.contradicted && one.result.plan_id.starts_with(&prefix));
        json!({
            "part": part.part_id,
            "qualified": part.verdict == PartReport::QUALIFIED && !refuted,
            "contradicted": refuted,
            "text": part.text,
        })
    });
    json!({
        "schema": "probecell/part-record/1",
        "bag": session.name,
        "cell": session.cell,
        "parts": parts.collect::<Vec<_>>(),
        "sizes": sizes,
        "unusable_references": session.unusable_references,
        "damage": session.damage,
    })
}
