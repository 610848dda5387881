//! What a person reads while a part is made.

use probecell_msgs::{
    Correction, CorrectionAcknowledgement, Fault, PartReport, PassDecision, Verdict,
};

use crate::output::{self, Colour};

/// A fault of a node.
pub(super) fn print_fault(fault: &Fault) {
    output::remark(&format!(
        "fault {} of {}: {}",
        fault.code, fault.node, fault.text
    ));
}

/// The rule by which a verdict was found, for the line above its table, and the expanded uncertainty, as its text says both.
fn rule(verdict: &Verdict) -> Option<(String, &str)> {
    let reasons = verdict.reasons();
    let (_, rest) = verdict.text.split_once(", U = ")?;
    let (expanded, rest) = rest.split_once(" µm (k = ")?;
    let (factor, _) = rest.split_once(')')?;
    let limit = reasons.largest_risk?;
    let rule = format!(
        "{}, k = {factor}, risk of nonconformity at the limit {limit}",
        reasons.rule
    );
    Some((rule, expanded))
}

/// What a text says besides rule and risk.
fn besides(verdict: &Verdict) -> &str {
    if rule(verdict).is_none() {
        return &verdict.text;
    }
    let (_, more) = (verdict.text)
        .split_once("at the limit of acceptance ")
        .unwrap_or_default();
    more.split_once("; ").map_or("", |(_, more)| more)
}

/// Whether a verdict is good, to be looked at, or bad.
fn colour(verdict: u8) -> Colour {
    match verdict {
        Verdict::QUALIFIED => Colour::Green,
        Verdict::COMPENSABLE | Verdict::INDETERMINATE => Colour::Yellow,
        _ => Colour::Red,
    }
}

/// Sizes, deviations and verdicts of one measurement, and what follows. `verbose`: with the whole text of each verdict.
pub(super) fn print_measurement(decision: &PassDecision, verdicts: &[Verdict], verbose: bool) {
    output::line(&decision.plan_id);
    let ruled = |one: &Verdict| rule(one).map(|(rule, _)| rule);
    let first_word = "size";
    let width = verdicts.iter().map(|one| one.feature_id.chars().count());
    let width = width.max().unwrap_or(0).max(first_word.len());
    for together in verdicts.chunk_by(|one, next| ruled(one) == ruled(next)) {
        if let Some(rule) = ruled(&together[0]) {
            output::line(&format!("  by {rule}"));
        }
        output::line(&format!(
            "  {first_word:<width$}  {:>12}  {:>16}  {:>10}  {:<12}  verdict",
            "measured", "deviation ± U", "limits", "risk"
        ));
        for verdict in together {
            let expanded = rule(verdict).map(|(_, expanded)| expanded);
            let spread = expanded.map_or(String::new(), |expanded| format!(" ± {expanded}"));
            let deviation = format!("{:+.1}{spread} µm", verdict.error * 1e6);
            let limits = format!("± {:.1} µm", verdict.tolerance * 1e6);
            let row = format!(
                "  {:<width$}  {:>9.4} mm  {deviation:>16}  {limits:>10}  {:<12}  ",
                verdict.feature_id,
                verdict.size * 1e3,
                verdict.reasons().risk.unwrap_or("")
            );
            let word = Verdict::word(verdict.verdict);
            output::coloured(&row, word, colour(verdict.verdict));
            let more = if verbose {
                &verdict.text
            } else {
                besides(verdict)
            };
            if !more.is_empty() {
                output::wrapped("    ", 4, more);
            }
        }
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
            "\n    waits for approval: probecell approve {} --operator NAME --cell {file}",
            correction.correction_id
        ),
        Correction::APPROVAL_REJECTED => format!(", rejected by {}", correction.approved_by),
        _ => format!(", approved by {}", correction.approved_by),
    };
    output::line(&format!(
        "  correction of {}: {from:+.1} -> {to:+.1} µm{who}",
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
