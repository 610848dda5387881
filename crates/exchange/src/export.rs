//! What goes out: the sizes and touches of a session, as tables, and for the formats of other systems (`neighbours/formats`). Nothing is
//! computed here; a number is the recording's.

pub mod table;

use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{
    FeatureResult, InspectionFeature, InspectionPlan, ProbeEvent, ToolOffsets, TouchDeviation,
    Verdict, geometrical,
};

/// What a session found, to be given to other systems.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// Name of the recording.
    pub name: String,
    /// Name of the cell.
    pub cell: String,
    /// Version of the program that exports it.
    pub version: String,
    /// Plans, each as it was measured.
    pub plans: Vec<InspectionPlan>,
    /// Sizes, the last of each plan and feature.
    pub sizes: Vec<Size>,
    /// Touches.
    pub events: Vec<ProbeEvent>,
    /// Deviations of the touches.
    pub touches: Vec<TouchDeviation>,
    /// Offsets that the controller holds, the last.
    pub offsets: Option<ToolOffsets>,
}

/// A size with what was decided of it.
#[derive(Clone, Debug)]
pub struct Size {
    /// As evaluated.
    pub result: FeatureResult,
    /// What the cell decided, if it did.
    pub verdict: Option<Verdict>,
    /// Limits of its deviation, m; infinite where open to a side; none without a tolerance.
    pub limits: Option<[f64; 2]>,
    /// A reference contradicts it.
    pub contradicted: bool,
    /// Judgement in words.
    pub text: String,
}

/// Status of a characteristic, in the terms that QIF and MTConnect share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Within its limits, as the decision rule demands.
    Pass,
    /// Outside of them.
    Fail,
    /// Outside, and material is left that can be cut.
    Rework,
    /// Neither is proved, because of the uncertainty.
    Indeterminate,
    /// The measurement is invalid, or contradicted by a reference.
    SystemError,
    /// It has no limits.
    NotAnalyzed,
}

impl Status {
    /// Its name in QIF, which other formats use as well.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pass => "PASS",
            Self::Fail => "FAIL",
            Self::Rework => "REWORK",
            Self::Indeterminate => "INDETERMINATE",
            Self::SystemError => "SYSERROR",
            Self::NotAnalyzed => "NOT_ANALYZED",
        }
    }
}

impl Size {
    /// Status: what the cell decided, else conformity with the limits (ISO 14253-1:2013).
    pub fn status(&self) -> Status {
        let result = &self.result;
        match &self.verdict {
            _ if self.contradicted || result.decision == FeatureResult::INVALID => {
                Status::SystemError
            }
            Some(verdict) => match verdict.verdict {
                Verdict::QUALIFIED => Status::Pass,
                Verdict::COMPENSABLE => Status::Rework,
                Verdict::INDETERMINATE => Status::Indeterminate,
                Verdict::MEASUREMENT_INVALID | Verdict::CONTRADICTED => Status::SystemError,
                _ => Status::Fail,
            },
            None if self.limits.is_none() => Status::NotAnalyzed,
            None => match result.decision {
                FeatureResult::CONFORMS => Status::Pass,
                FeatureResult::DOES_NOT_CONFORM => Status::Fail,
                _ => Status::Indeterminate,
            },
        }
    }

    /// Whether a value was measured.
    pub fn is_valid(&self) -> bool {
        self.result.decision != FeatureResult::INVALID
    }

    /// Term of the geometrical tolerance (ISO 1101) whose zone it is; `None`: a size.
    pub fn tolerance(&self) -> Option<&'static str> {
        geometrical::named(self.result.kind).map(|(_, term)| term)
    }

    /// Whether it is a diameter.
    pub fn is_diameter(&self) -> bool {
        matches!(
            self.result.kind,
            InspectionFeature::CYLINDER | InspectionFeature::BORE | InspectionFeature::SPHERE
        )
    }
}

/// mm of a length in m.
pub fn mm(metres: f64) -> f64 {
    metres * 1e3
}

/// A stamp as `xs:dateTime` in UTC, to the nanosecond.
pub fn date_time(stamp: Time) -> String {
    humantime::format_rfc3339_nanos(stamp.into()).to_string()
}

/// Name of a kind of feature.
fn kind_name(kind: u8) -> &'static str {
    if let Some((_, term)) = geometrical::named(kind) {
        return term;
    }
    let known = crate::import::features::KINDS
        .iter()
        .find(|(_, code)| *code == kind);
    known.map_or("composed", |(name, _)| name)
}
