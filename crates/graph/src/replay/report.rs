//! What a replay found.

use serde::Serialize;

use crate::Stamp;

/// The outcome of a replay.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Everything that was recorded was recomputed, and equal.
    Equal,
    /// Something recomputed differs from what was recorded.
    Different,
    /// Nothing differs, but some messages could not be compared: they, or inputs of their node, were not recorded.
    Incomplete,
}

/// One node in a replay.
#[derive(Clone, Debug, Serialize)]
pub struct NodeReport {
    /// The node.
    pub node: String,
    /// Steps recomputed.
    pub steps: u64,
    /// Steps that the journal lists but that could not be repeated.
    pub steps_left: u64,
    /// Timers in the journal that the recomputed node had not requested.
    pub timers_not_asked_for: u64,
    /// The missing input, where steps remain.
    pub waits_for: Option<String>,
}

/// One topic of a replayed node.
#[derive(Clone, Debug, Serialize)]
pub struct TopicReport {
    /// The topic.
    pub topic: String,
    /// The node that publishes it.
    pub node: String,
    /// Messages recorded.
    pub recorded: u64,
    /// Messages equal byte for byte.
    pub equal: u64,
    /// Messages that differ.
    pub different: u64,
    /// Recorded, but not recomputed.
    pub not_recomputed: u64,
    /// Recomputed, but not recorded.
    pub not_recorded: u64,
}

/// The first message that differs, by order of recomputation.
#[derive(Clone, Debug, Serialize)]
pub struct Difference {
    /// The topic.
    pub topic: String,
    /// The publication's number on it.
    pub sequence: u64,
    /// Instant of the step that published it.
    pub at: Stamp,
    /// CDR bytes recorded.
    #[serde(skip)]
    pub recorded: Vec<u8>,
    /// CDR bytes recomputed.
    #[serde(skip)]
    pub recomputed: Vec<u8>,
}

/// The result of a replay.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The outcome.
    pub verdict: Verdict,
    /// Each node.
    pub nodes: Vec<NodeReport>,
    /// Each topic of a replayed node.
    pub topics: Vec<TopicReport>,
    /// The first difference.
    pub first_difference: Option<Difference>,
    /// Instant of the first and of the last step.
    pub span: Option<(Stamp, Stamp)>,
}
