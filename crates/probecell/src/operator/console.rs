//! What a person reads while a part is made.

use probecell_msgs::{
    Correction, CorrectionAcknowledgement, Fault, PartReport, PassDecision, Verdict,
};

use crate::output;

/// A fault of a node.
pub(super) fn print_fault(fault: &Fault) {
    output::remark(&format!(
        "fault {} of {}: {}",
        fault.code, fault.node, fault.text
    ));
}

/// Sizes, deviations and verdicts of one measurement, and what follows.
pub(super) fn print_measurement(decision: &PassDecision, verdicts: &[Verdict]) {
    output::line(&decision.plan_id);
    for verdict in verdicts {
        let (size, error) = (verdict.size * 1e3, verdict.error * 1e6);
        let word = Verdict::word(verdict.verdict);
        let note = if verdict.text.is_empty() {
            String::new()
        } else {
            format!("  {}", verdict.text)
        };
        output::line(&format!(
            "  {:<8} {size:9.4} mm  {error:+7.1} µm  {word}{note}",
            verdict.feature_id
        ));
    }
    let next = match decision.decision {
        PassDecision::NEXT => "next pass",
        PassDecision::RECUT => "correct and repeat the pass",
        PassDecision::SCRAP => "scrap",
        PassDecision::REVOKED => "revoked",
        _ => "stop",
    };
    output::line(&format!("  {}: {next}", decision.text));
}

/// What a correction changes.
fn target(correction: &Correction) -> String {
    match correction.kind {
        Correction::TOOL_PATH => format!("tool path of {}", correction.feature_ids.join(", ")),
        Correction::VOLUMETRIC => "volumetric table, largest displacement".to_owned(),
        Correction::WORK_OFFSET => format!("the work offset of {}", correction.axis),
        _ => format!("tool {}", correction.tool_number),
    }
}

/// One line that says what an operator approves or rejects: what is changed, within which bounds, and why.
pub(crate) fn described(correction: &Correction) -> String {
    let um = |value: f64| value * 1e6;
    let table = ::report::table_entries(correction);
    let table: Vec<String> = table
        .iter()
        .map(|[name, from, to, ..]| format!("{name} {from} -> {to}"))
        .collect();
    format!(
        "{}: {} from {:+.1} to {:+.1} µm (bounds {:+.1} to {:+.1} µm){}{}, for an error of {:+.1} µm (u {:.1} µm) of {} in {}",
        correction.correction_id,
        target(correction),
        um(correction.previous_value),
        um(correction.new_value),
        um(correction.lower_bound),
        um(correction.upper_bound),
        if table.is_empty() { "" } else { "; " },
        table.join(", "),
        um(correction.measured_error),
        um(correction.standard_uncertainty),
        correction.feature_ids.join(", "),
        correction.plan_id,
    )
}

/// `file`: the cell file, for the command that the operator is to type.
pub(super) fn print_correction(correction: &Correction, file: &str) {
    let (from, to) = (correction.previous_value * 1e6, correction.new_value * 1e6);
    let who = match correction.approval {
        Correction::APPROVAL_NONE => format!(
            "waits for approval: probecell approve {} --operator NAME --cell {file}",
            correction.correction_id
        ),
        Correction::APPROVAL_REJECTED => format!("rejected by {}", correction.approved_by),
        _ => format!("approved by {}", correction.approved_by),
    };
    output::line(&format!(
        "  correction of {}: {from:+.1} -> {to:+.1} µm, {who}",
        target(correction)
    ));
    for entry in ::report::table_entries(correction) {
        let [name, from, to, bound, u] = entry;
        output::line(&format!(
            "    {name}: {from} -> {to} (u {u}, bound {bound})"
        ));
    }
}

/// What the controller did with a correction.
pub(super) fn print_acknowledgement(answer: &CorrectionAcknowledgement) {
    let (before, after) = (answer.value_before * 1e6, answer.value_after * 1e6);
    let word = match answer.outcome {
        CorrectionAcknowledgement::APPLIED => {
            format!("applied: the controller read {before:+.1}, now reads {after:+.1} µm")
        }
        CorrectionAcknowledgement::ALREADY_APPLIED => "applied before".to_owned(),
        _ => format!("refused: {}", answer.text),
    };
    output::line(&format!("  {}: {word}", answer.correction_id));
}

/// How a part ended.
pub(super) fn print_part(part: &PartReport) {
    if part.verdict == PartReport::MEASURED {
        output::line(&format!("plan {}: {}", part.plan_id, part.text));
        return;
    }
    let word = PartReport::word(part.verdict);
    let passes = if part.passes == 1 { "pass" } else { "passes" };
    output::line(&format!(
        "part {}: {word} after {} machining {passes}: {}",
        part.part_id, part.passes, part.text
    ));
}
