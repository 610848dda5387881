//! Constants of messages as the words of the lake.

use diagnosis::Verdict;

/// The word of a constant: those of a message in their order.
pub(super) fn word(words: &[&'static str], constant: u8) -> &'static str {
    words
        .get(usize::from(constant))
        .copied()
        .unwrap_or("unknown")
}

/// `ProbeEvent.outcome`.
pub(super) const OUTCOMES: &[&str] = &["touched", "no_contact", "early"];
/// `InspectionFeature.kind`.
pub(super) const FEATURES: &[&str] = &[
    "plane", "cylinder", "bore", "sphere", "cone", "profile", "surface",
];
/// `FeatureResult.decision`.
pub(super) const DECISIONS: &[&str] = &["conforms", "does_not_conform", "indeterminate", "invalid"];
/// `Verdict.verdict`.
pub(super) const VERDICTS: &[&str] = &[
    "qualified",
    "compensable",
    "overcut_not_compensable",
    "tool_worn",
    "not_converged",
    "measurement_invalid",
    "indeterminate",
    "contradicted",
];
/// `Correction.kind`.
pub(super) const CORRECTIONS: &[&str] = &["tool_wear", "work_offset", "tool_path", "volumetric"];
/// `Correction.approval`.
pub(super) const APPROVALS: &[&str] = &["none", "policy", "operator", "rejected"];
/// `CorrectionAcknowledgement.outcome`.
pub(super) const ACKNOWLEDGEMENTS: &[&str] = &[
    "applied",
    "already_applied",
    "refused_not_approved",
    "refused_stale",
    "refused_out_of_bounds",
    "refused_replay",
    "refused_no_source",
    "failed",
];
/// `Fault.severity`.
pub(super) const SEVERITIES: &[&str] = &["warning", "error"];

/// The verdict of a gap report.
pub(crate) fn gap(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::NoGap => "no_gap",
        Verdict::Explained => "explained",
        Verdict::PartlyExplained => "partly_explained",
        Verdict::Unexplained => "unexplained",
    }
}

#[cfg(test)]
mod tests {
    use probecell_msgs::{
        Correction, CorrectionAcknowledgement, Fault, FeatureResult, InspectionFeature, ProbeEvent,
        Verdict,
    };

    use super::*;

    #[test]
    fn each_list_ends_with_the_last_constant_of_its_message() {
        assert_eq!(word(OUTCOMES, ProbeEvent::OUTCOME_EARLY), "early");
        assert_eq!(word(FEATURES, InspectionFeature::SURFACE), "surface");
        assert_eq!(word(DECISIONS, FeatureResult::INVALID), "invalid");
        assert_eq!(word(VERDICTS, Verdict::CONTRADICTED), "contradicted");
        assert_eq!(word(CORRECTIONS, Correction::VOLUMETRIC), "volumetric");
        assert_eq!(word(APPROVALS, Correction::APPROVAL_REJECTED), "rejected");
        assert_eq!(
            word(ACKNOWLEDGEMENTS, CorrectionAcknowledgement::FAILED),
            "failed"
        );
        assert_eq!(word(SEVERITIES, Fault::ERROR), "error");
        assert_eq!(word(SEVERITIES, 9), "unknown");
    }
}
