//! A proposal of further touches, as a report states it.

use probecell_msgs::InspectionPlan;
use serde::{Deserialize, Serialize};

/// An effect that a report names.
#[derive(Debug, Clone, Copy)]
pub struct Named<'a> {
    /// Identifier of the vocabulary.
    pub effect: &'a str,
    /// Effects that are indistinguishable from it in the session.
    pub indistinguishable_from: &'a [String],
}

/// Touches that discriminate the remaining explanations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NextMeasurement {
    /// Effects that the touches discriminate; `unknown` for a cause outside the vocabulary.
    pub separates: Vec<String>,
    /// The touches, most informative first.
    pub points: Vec<NextPoint>,
    /// The same touches as a plan that a cell can run; its points in the order of `points`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub plan: Option<InspectionPlan>,
    /// The most probable explanations now, most probable first.
    #[serde(default)]
    pub explanations: Vec<Explanation>,
    /// Predicted probability that after the touches one explanation has a posterior above 0.95.
    #[serde(default)]
    pub chance: f64,
    /// Pairs of possible effects that no reachable touch distinguishes: they count as one.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub inseparable: Vec<Vec<String>>,
}

/// One of the remaining explanations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Explanation {
    /// Its effects; none for no gap, `unknown` among them where a cause outside the vocabulary acts.
    pub effects: Vec<String>,
    /// Its probability.
    pub probability: f64,
}

/// A touch worth taking.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NextPoint {
    /// Point of the plan whose place (or the place nearest to the new one) and direction are used.
    pub point_index: usize,
    /// Prescribed axis positions, in the order of the plan's rotary_names, rad.
    pub rotary_positions: Vec<f64>,
    /// Speed of approach, m/s.
    pub feed: f64,
    /// Difference between the deviations that the two most probable explanations predict, m.
    pub difference: f64,
    /// Id of the feature.
    #[serde(default)]
    pub feature: String,
    /// Nominal point in the part frame, m.
    #[serde(default)]
    pub position: [f64; 3],
    /// How the touch differs from those of the plan.
    #[serde(default)]
    pub why: String,
}
