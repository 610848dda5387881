//! A proposal of further touches, as a report states it.

use probecell_msgs::InspectionPlan;
use serde::de::IgnoredAny;
use serde::{Deserialize, Deserializer, Serialize};

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
    #[serde(
        skip_serializing_if = "Option::is_none",
        default,
        deserialize_with = "plan_of_numbers"
    )]
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

/// A plan as JSON holds it; none where a limit of it is open, for which JSON has no number.
fn plan_of_numbers<'de, D: Deserializer<'de>>(
    written: D,
) -> Result<Option<InspectionPlan>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Written {
        Numbers(Box<InspectionPlan>),
        Open(IgnoredAny),
    }
    Ok(match Option::deserialize(written)? {
        Some(Written::Numbers(plan)) => Some(*plan),
        Some(Written::Open(_)) | None => None,
    })
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

#[cfg(test)]
mod tests {
    use super::*;

    /// JSON has `null` for a number that is not finite.
    #[test]
    fn a_proposal_with_an_open_limit_is_read_without_its_plan() {
        let mut proposal = NextMeasurement {
            separates: vec!["axis.X.scale".to_owned()],
            points: Vec::new(),
            plan: Some(InspectionPlan::default()),
            explanations: Vec::new(),
            chance: 0.5,
            inseparable: Vec::new(),
        };
        let read = |text: &str| serde_json::from_str::<NextMeasurement>(text).unwrap();
        let text = serde_json::to_string(&proposal).unwrap();
        assert_eq!(read(&text), proposal);
        let open = text.replacen("\"x\":0.0", "\"x\":null", 1);
        assert_ne!(open, text);
        proposal.plan = None;
        assert_eq!(read(&open), proposal);
    }
}
