//! What codes of messages are called where a person reads, in one place.

use crate::{FeatureResult, Order, PartReport, PartStatus, RecordingStatus, Verdict};

impl Verdict {
    /// What the code of a verdict ([`Verdict::verdict`]) means.
    pub fn word(code: u8) -> &'static str {
        match code {
            Self::QUALIFIED => "qualified",
            Self::COMPENSABLE => "can be corrected",
            Self::OVERCUT_NOT_COMPENSABLE => "overcut",
            Self::TOOL_WORN => "tool worn",
            Self::NOT_CONVERGED => "not converged",
            Self::MEASUREMENT_INVALID => "measurement invalid",
            Self::INDETERMINATE => "indeterminate",
            Self::CONTRADICTED => "contradicted by the reference",
            _ => "unknown verdict",
        }
    }

    /// What the text of a verdict says of its rule, as far as it does: the name of the rule, where it accepts, the probability that
    /// the true size is out of tolerance, and the largest that it accepts.
    pub fn reasons(&self) -> Reasons<'_> {
        let (rule, rest) = self.text.split_once(", U = ").unwrap_or((&self.text, ""));
        let between = |from: &str, to: &str| {
            let (_, rest) = rest.split_once(from)?;
            Some(rest.split_once(to).map_or(rest, |(found, _)| found))
        };
        Reasons {
            rule,
            accepted: between("): ", ";").unwrap_or_default(),
            risk: between("out of tolerance is ", ", at the limit").map(uncertain),
            largest_risk: between("at the limit of acceptance ", ";"),
        }
    }
}

/// A probability in per cent without the certainty that rounding makes of it.
fn uncertain(risk: &str) -> &str {
    if risk == "100.0 %" {
        "above 99.9 %"
    } else {
        risk
    }
}

/// The parts of a verdict's text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reasons<'a> {
    /// Name of the decision rule; all of a text that names none.
    pub rule: &'a str,
    /// Where it accepts; empty where the text does not say.
    pub accepted: &'a str,
    /// Probability that the true size is out of tolerance, in per cent; never 100 % by rounding.
    pub risk: Option<&'a str>,
    /// That probability of a size at the limit of acceptance.
    pub largest_risk: Option<&'a str>,
}

impl PartStatus {
    /// What the part that is being made is at ([`PartStatus::stage`]).
    pub fn word(stage: u8) -> &'static str {
        match stage {
            Self::CUTTING => "cutting",
            Self::MEASURING => "measuring",
            Self::DECIDING => "deciding",
            Self::CORRECTING => "correcting",
            Self::STOPPING => "stopping",
            _ => "no part",
        }
    }
}

impl RecordingStatus {
    /// There is a recording, and its disk does not answer: not recorded, and yet the folder is named.
    pub fn hangs(&self) -> bool {
        self.state == Self::STOPPED && !self.uri.is_empty()
    }

    /// Whether the cell is recorded.
    pub fn word(&self) -> &'static str {
        match self.state {
            Self::RECORDING => "recording",
            Self::WAIVED => "waived by the operator",
            _ if self.hangs() => "the disk does not answer",
            _ => "stopped",
        }
    }
}

impl Order {
    /// What an order is at ([`Order::state`]).
    pub fn word(state: u8) -> &'static str {
        match state {
            Self::WAITING => "waits",
            Self::UNDERWAY => "under way",
            Self::INTERRUPTED => "interrupted",
            _ => "unknown state",
        }
    }
}

impl PartReport {
    /// How a part ended ([`PartReport::verdict`]).
    pub fn word(verdict: u8) -> &'static str {
        match verdict {
            Self::QUALIFIED => "qualified",
            Self::SCRAP => "scrap",
            Self::MEASURED => "measured only",
            _ => "stopped",
        }
    }

    /// It says that a part which was qualified before is not any more: a reference has contradicted the readings.
    pub fn is_revocation(&self) -> bool {
        self.verdict == Self::STOPPED && self.text.starts_with("not qualified any more")
    }

    /// How this part ended: that of a revocation is not the end of a part that was stopped.
    pub fn end(&self) -> &'static str {
        if self.is_revocation() {
            "not qualified any more"
        } else {
            Self::word(self.verdict)
        }
    }
}

impl FeatureResult {
    /// What the code of a decision ([`FeatureResult::decision`]) means.
    pub fn word(decision: u8) -> &'static str {
        match decision {
            Self::CONFORMS => "conforms",
            Self::DOES_NOT_CONFORM => "does not conform",
            Self::INDETERMINATE => "indeterminate",
            _ => "not measurable",
        }
    }
}
