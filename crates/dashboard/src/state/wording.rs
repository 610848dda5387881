//! What codes and lengths are called by people.

use probecell_msgs::{
    Correction, CorrectionAcknowledgement, GapReport, MachineState, PassDecision,
};

/// A length in µm with its sign, to a tenth.
pub(crate) fn micrometres(metres: f64) -> String {
    if !metres.is_finite() {
        return "no value".to_owned();
    }
    // Avoids a negative zero.
    let value = (metres * 1e7).round() / 10.0 + 0.0;
    format!(
        "{}{:.1} µm",
        if value < 0.0 { "−" } else { "" },
        value.abs()
    )
}

/// A difference or a position in µm: with its sign, plus as well as minus.
pub(crate) fn signed_micrometres(metres: f64) -> String {
    let text = micrometres(metres);
    let positive = text.starts_with(|first: char| first.is_ascii_digit()) && text != "0.0 µm";
    if positive { format!("+{text}") } else { text }
}

/// State of the machine.
pub(crate) fn execution(code: u8) -> &'static str {
    match code {
        MachineState::EXECUTION_IDLE => "idle",
        MachineState::EXECUTION_RUNNING => "running",
        MachineState::EXECUTION_HOLD => "feed hold",
        MachineState::EXECUTION_ALARM => "alarm",
        _ => "emergency stop",
    }
}

/// The decision on a pass.
pub(crate) fn decision(code: u8) -> &'static str {
    match code {
        PassDecision::NEXT => "continue",
        PassDecision::RECUT => "correct and cut again",
        PassDecision::STOP => "stop: somebody must intervene",
        PassDecision::SCRAP => "scrap",
        _ => "revoked by the reference",
    }
}

/// Who has approved a correction.
pub(crate) fn approval(correction: &Correction) -> String {
    match correction.approval {
        Correction::APPROVAL_NONE => "waits for approval".to_owned(),
        Correction::APPROVAL_POLICY => format!("approved by the {}", correction.approved_by),
        Correction::APPROVAL_OPERATOR => format!("approved by {}", correction.approved_by),
        _ => format!("rejected by {}", correction.approved_by),
    }
}

/// What the machine answered to a correction.
pub(crate) fn outcome(code: u8) -> &'static str {
    match code {
        CorrectionAcknowledgement::APPLIED => "applied",
        CorrectionAcknowledgement::ALREADY_APPLIED => "already applied",
        CorrectionAcknowledgement::REFUSED_NOT_APPROVED => "refused: not approved",
        CorrectionAcknowledgement::REFUSED_STALE => "refused: out of date",
        CorrectionAcknowledgement::REFUSED_OUT_OF_BOUNDS => "refused: out of bounds",
        CorrectionAcknowledgement::REFUSED_REPLAY => "refused: from a recording",
        CorrectionAcknowledgement::REFUSED_NO_SOURCE => "refused: no source measurement",
        _ => "failed",
    }
}

/// Verdict of a gap report.
pub(crate) fn gap(code: u8) -> &'static str {
    match code {
        GapReport::NO_GAP => "no gap",
        GapReport::EXPLAINED => "explained",
        GapReport::PARTLY_EXPLAINED => "partly explained",
        _ => "not explained",
    }
}

/// The first of what a remedy asks for: what stands before its alternatives and explanations.
pub(crate) fn in_short(remedy: &str) -> &str {
    let ends = [", ", "; ", ": ", " or ", " ("];
    let end = ends.iter().filter_map(|end| remedy.find(end)).min();
    end.and_then(|end| remedy.get(..end)).unwrap_or(remedy)
}
