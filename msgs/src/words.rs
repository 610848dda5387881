//! What codes of messages are called where a person reads, in one place.

use crate::{PartReport, PartStatus, Verdict};

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
}
