//! What goes out: the sizes and touches of a session in the formats of other systems. Nothing is computed here; a number is the
//! recording's, in the unit that a format asks for.

pub mod aqdef;
pub mod dmis;
mod live;
pub mod mtconnect;
pub mod opcua;
pub mod qif;
pub mod sparkplug;
pub mod table;
mod uuid;
mod xml;

use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{
    FeatureResult, GapReport, InspectionFeature, InspectionPlan, ProbeEvent, ToolOffsets,
    TouchDeviation, Verdict, geometrical,
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
    /// Its name in QIF, which tables and AQDEF use as well.
    pub(crate) fn name(self) -> &'static str {
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
    fn tolerance(&self) -> Option<&'static str> {
        geometrical::named(self.result.kind).map(|(_, term)| term)
    }

    /// Whether it is a diameter.
    fn is_diameter(&self) -> bool {
        matches!(
            self.result.kind,
            InspectionFeature::CYLINDER | InspectionFeature::BORE | InspectionFeature::SPHERE
        )
    }
}

/// mm of a length in m.
fn mm(metres: f64) -> f64 {
    metres * 1e3
}

/// A stamp as `xs:dateTime` in UTC, to the nanosecond.
fn date_time(stamp: Time) -> String {
    let seconds = u64::try_from(stamp.sec).unwrap_or(0);
    let since = std::time::Duration::new(seconds, stamp.nanosec.min(999_999_999));
    humantime::format_rfc3339_nanos(std::time::UNIX_EPOCH + since).to_string()
}

/// Name of the verdict of a gap report.
fn gap_verdict(verdict: u8) -> &'static str {
    match verdict {
        GapReport::NO_GAP => "NO_GAP",
        GapReport::EXPLAINED => "EXPLAINED",
        GapReport::PARTLY_EXPLAINED => "PARTLY_EXPLAINED",
        _ => "UNEXPLAINED",
    }
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
