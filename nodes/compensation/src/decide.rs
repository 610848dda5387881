//! The decision on a measurement: a verdict on each size, on the volumetric table and on the position of the part; the
//! gravest decides what the cell does next.
//!
//! ```text
//!   results ── wear::decide, path::decide ──┐
//!   touches ── volumetric::judge ───────────┼─ verdicts ── conclude ── next | recut | stop | scrap
//!   alignment ── work_offset::judge ────────┘                            └─ propose::corrections
//! ```

use graph::Stamp;
use metrology::decision::{self, Action, Policy};
use probecell_msgs::{Correction, FeatureResult, PassDecision, PlanId, Verdict};

use crate::{
    approval::{self, APPROVAL},
    config::{Characteristic, Config},
    judgement::Judgement,
    measurement::{Measurement, SizeJudgement},
    path,
    ports::{Out, Output},
    propose, reference, rule,
    state::State,
    volumetric, wear, work_offset,
};

/// How a pass is cut again.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Recut {
    /// With the offsets as they are: what has sprung back is gone then.
    Unchanged,
    /// With corrected offsets.
    Corrected,
}

/// What the verdicts together ask for.
struct Conclusion {
    /// `PassDecision` constant.
    decision: u8,
    /// The reason, for a person.
    text: String,
    recut: Option<Recut>,
}

/// Decides on the measurement that is complete: publishes its verdicts, its corrections and the decision.
pub(crate) fn decide(config: &Config, state: &mut State, now: Stamp, out: &mut Out) {
    let Some(measurement) = state.take_measurement() else {
        return;
    };
    let run = PlanId::from(&measurement.plan_id).run();
    state.count_corrections_of(run, measurement.pass);
    let sizes = judge_sizes(config, state, now, &measurement, out);
    reference::judged(state, now, &measurement, &sizes, out);
    let judgements = judge_machine(config, state, &measurement);
    for judgement in &judgements {
        out.send(Output::Verdict(judgement_message(
            judgement,
            now,
            &measurement,
        )));
    }
    let conclusion = conclude(config, state, &measurement, &sizes, &judgements);
    let corrections = match conclusion.recut {
        None => Vec::new(),
        Some(Recut::Unchanged) => {
            state.recut_unchanged = true;
            Vec::new()
        }
        Some(Recut::Corrected) => {
            state.corrections += 1;
            propose::corrections(config, state, now, &measurement, &sizes, judgements)
        }
    };
    let correction_ids = corrections.iter().map(|one| one.correction_id.clone());
    let correction_ids = correction_ids.collect();
    for correction in corrections {
        publish(config, state, correction, measurement.pass, out);
    }
    out.send(Output::Decision(PassDecision {
        header: now.header(""),
        plan_id: measurement.plan_id,
        part_id: measurement.part_id,
        pass_number: measurement.pass,
        decision: conclusion.decision,
        correction_ids,
        text: conclusion.text,
    }));
}

/// Publishes a correction; one that nobody has approved yet waits for an operator.
fn publish(config: &Config, state: &mut State, correction: Correction, pass: u32, out: &mut Out) {
    if correction.approval == Correction::APPROVAL_NONE {
        let proposed = (correction.clone(), pass);
        state
            .proposed
            .insert(correction.correction_id.clone(), proposed);
        out.wake_at(approval::due(config, &correction), APPROVAL);
    }
    out.send(Output::Correction(correction));
}

/// Judges each size that decides in the pass, and publishes its verdict.
fn judge_sizes<'a>(
    config: &'a Config,
    state: &State,
    now: Stamp,
    measurement: &Measurement,
    out: &mut Out,
) -> Vec<SizeJudgement<'a>> {
    let judge = |characteristic: &'a Characteristic| {
        let result = &measurement.results[&characteristic.id];
        let wear = characteristic.tool_number.map(|tool| state.wear_of(tool));
        let rule = config.rule_in(characteristic, measurement.pass);
        let guard = &rule::guard_bands(rule, result);
        let corrections = state.corrections;
        let (verdict, action) = match wear {
            Some(wear) => wear::decide(config, characteristic, guard, result, wear, corrections),
            None => path::decide(config, characteristic, guard, result, corrections),
        };
        let text = match (wear, characteristic.tool_number) {
            (Some(None), Some(tool)) => {
                format!("the controller has not reported the wear offset of tool {tool}")
            }
            _ if result.decision == FeatureResult::INVALID => result.text.clone(),
            _ => rule::described(rule, characteristic, result),
        };
        out.send(Output::Verdict(Verdict {
            header: now.header(""),
            plan_id: measurement.plan_id.clone(),
            part_id: measurement.part_id.clone(),
            feature_id: characteristic.id.clone(),
            pass_number: measurement.pass,
            verdict: code(verdict),
            size: result.size,
            error: path::error(result),
            tolerance: characteristic.tolerance,
            tool_wear: wear.flatten().unwrap_or(f64::NAN),
            text,
        }));
        SizeJudgement {
            characteristic,
            verdict,
            action,
        }
    };
    config.deciding(measurement.pass).map(judge).collect()
}

/// Judges the volumetric table and the position of the part, where they decide in the pass: in the order in which they are
/// corrected, each alone, since what was measured with another table, or elsewhere, waits for the next measurement.
fn judge_machine(config: &Config, state: &State, measurement: &Measurement) -> Vec<Judgement> {
    let offsets = state.offsets.as_ref();
    let (touches, corrections) = (&state.touches, state.corrections);
    let table = config.table(measurement.pass).map(|table| {
        let results = &measurement.results;
        volumetric::judge(config, table, touches, results, offsets, corrections)
    });
    let position = config.work_offset(measurement.pass);
    let position = position.zip(state.alignment.as_ref());
    let position = position.map(|(position, alignment)| {
        work_offset::judge(config, position, touches, alignment, offsets, corrections)
    });
    table.into_iter().chain(position).collect()
}

/// What the verdicts together ask for; the gravest decides.
fn conclude(
    config: &Config,
    state: &State,
    measurement: &Measurement,
    sizes: &[SizeJudgement<'_>],
    judgements: &[Judgement],
) -> Conclusion {
    use decision::Verdict::{
        Compensable, Indeterminate, MeasurementInvalid, NotConverged, OvercutNotCompensable,
        Qualified, ToolWorn,
    };
    let verdicts = (sizes.iter().map(|size| size.verdict))
        .chain(judgements.iter().map(|judgement| judgement.verdict));
    let gravest = verdicts.max().unwrap_or(Qualified);
    let names = names(sizes, judgements, gravest);
    // Why the table or the position of the part is the gravest, where it is.
    let reason = (judgements.iter())
        .find(|judgement| judgement.verdict == gravest)
        .map_or(String::new(), |judgement| format!(": {}", judgement.text));
    let conclusion = |decision, text| Conclusion {
        decision,
        text,
        recut: None,
    };
    let stop = |text| conclusion(PassDecision::STOP, text);
    let recut = |how, text| Conclusion {
        recut: Some(how),
        ..conclusion(PassDecision::RECUT, text)
    };
    match gravest {
        Qualified if sizes.is_empty() => {
            conclusion(PassDecision::NEXT, format!("{names} qualified{reason}"))
        }
        Qualified => conclusion(
            PassDecision::NEXT,
            format!("all sizes qualified{}", by_rule(config, measurement, sizes)),
        ),
        Indeterminate => stop(format!(
            "conformity of {names} is neither proved nor refuted{}",
            by_rule(config, measurement, sizes)
        )),
        Compensable if is_stopped_by_policy(config, sizes, judgements) => stop(format!(
            "{names} could be corrected, but the policy is to stop"
        )),
        Compensable if may_have_sprung_back(config, state, sizes) => recut(
            Recut::Unchanged,
            format!("{names} may have sprung back: cut again with unchanged offsets"),
        ),
        Compensable => recut(
            Recut::Corrected,
            format!("{names} can be corrected{reason}"),
        ),
        NotConverged if !reason.is_empty() => stop(format!("{names} cannot be corrected{reason}")),
        NotConverged => stop(format!(
            "{names} still out of tolerance after {} corrections",
            state.corrections
        )),
        ToolWorn => stop(format!("the tool of {names} is worn")),
        OvercutNotCompensable => {
            let by_tools = |size: &SizeJudgement<'_>| size.characteristic.tool_number.is_some();
            let text = if sizes.iter().all(by_tools) {
                format!("{names} cut below size")
            } else {
                format!("{names} out of tolerance, and nothing can correct it")
            };
            conclusion(PassDecision::SCRAP, text)
        }
        MeasurementInvalid => stop(format!("{names} could not be measured{reason}")),
    }
}

/// The decision rule of the sizes and its largest risk, in brackets; nothing in a pass that judges nothing by the drawing.
fn by_rule(config: &Config, measurement: &Measurement, sizes: &[SizeJudgement<'_>]) -> String {
    let by_drawing = |size: &&SizeJudgement<'_>| measurement.pass >= size.characteristic.final_pass;
    let rule = config.decision_rule;
    let risks = sizes.iter().filter(by_drawing).map(|size| {
        let result = &measurement.results[&size.characteristic.id];
        rule.largest_risk(result.coverage_factor)
    });
    risks.reduce(f64::max).map_or_else(String::new, |risk| {
        let risk = rule::percent(risk);
        format!(" ({}, consumer's risk at most {risk})", rule.name())
    })
}

/// Names of what got a verdict, sizes first.
fn names(
    sizes: &[SizeJudgement<'_>],
    judgements: &[Judgement],
    verdict: decision::Verdict,
) -> String {
    let sizes = (sizes.iter())
        .filter(|size| size.verdict == verdict)
        .map(|size| size.characteristic.id.as_str());
    let judgements = (judgements.iter())
        .filter(|judgement| judgement.verdict == verdict)
        .map(|judgement| judgement.id.as_str());
    sizes.chain(judgements).collect::<Vec<_>>().join(", ")
}

/// True where something could be corrected and the policy is to stop instead.
fn is_stopped_by_policy(
    config: &Config,
    sizes: &[SizeJudgement<'_>],
    judgements: &[Judgement],
) -> bool {
    let compensable = decision::Verdict::Compensable;
    let is_stopped =
        |size: &SizeJudgement<'_>| size.verdict == compensable && size.action == Action::Stop;
    let is_compensable = |judgement: &Judgement| judgement.verdict == compensable;
    sizes.iter().any(is_stopped)
        || config.policy == Policy::Literal && judgements.iter().any(is_compensable)
}

/// True where the pass is to be cut again with unchanged offsets first (`docs/source_systems.md`, A.4).
fn may_have_sprung_back(config: &Config, state: &State, sizes: &[SizeJudgement<'_>]) -> bool {
    let compensable = |size: &SizeJudgement<'_>| size.verdict == decision::Verdict::Compensable;
    config.spring_pass && !state.recut_unchanged && sizes.iter().any(compensable)
}

/// The message of a judgement of the table or of the position of the part.
fn judgement_message(judgement: &Judgement, now: Stamp, measurement: &Measurement) -> Verdict {
    Verdict {
        header: now.header(""),
        plan_id: measurement.plan_id.clone(),
        part_id: measurement.part_id.clone(),
        feature_id: judgement.id.clone(),
        pass_number: measurement.pass,
        verdict: code(judgement.verdict),
        size: judgement.error,
        error: judgement.error,
        tolerance: judgement.tolerance,
        tool_wear: f64::NAN,
        text: judgement.text.clone(),
    }
}

/// Constant of the message.
fn code(verdict: decision::Verdict) -> u8 {
    match verdict {
        decision::Verdict::Qualified => Verdict::QUALIFIED,
        decision::Verdict::Compensable => Verdict::COMPENSABLE,
        decision::Verdict::NotConverged => Verdict::NOT_CONVERGED,
        decision::Verdict::Indeterminate => Verdict::INDETERMINATE,
        decision::Verdict::ToolWorn => Verdict::TOOL_WORN,
        decision::Verdict::OvercutNotCompensable => Verdict::OVERCUT_NOT_COMPENSABLE,
        decision::Verdict::MeasurementInvalid => Verdict::MEASUREMENT_INVALID,
    }
}
