//! A measurement that is decided on, and what its sizes were judged to be.

use std::collections::BTreeMap;

use metrology::decision::{self, Action};
use probecell_msgs::FeatureResult;
use serde::{Deserialize, Serialize};

use crate::config::Characteristic;

/// A measurement whose results are complete.
pub(crate) struct Measurement {
    pub(crate) plan_id: String,
    pub(crate) part_id: String,
    /// Index of the pass.
    pub(crate) pass: u32,
    pub(crate) results: BTreeMap<String, FeatureResult>,
}

/// What follows from one size.
pub(crate) struct SizeJudgement<'a> {
    pub(crate) characteristic: &'a Characteristic,
    pub(crate) verdict: decision::Verdict,
    pub(crate) action: Action,
}

/// A size that was judged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Judged {
    /// Its result.
    pub result: FeatureResult,
    /// Number of the pass.
    pub pass: u32,
    /// m; half width of its tolerance.
    pub tolerance: f64,
    /// It was qualified.
    pub qualified: bool,
}
