//! The state of `probe_events`.

use graph::Early;
use probecell_msgs::{InspectionPlan, ProbeTrigger};
use serde::{Deserialize, Serialize};

/// The state of `probe_events`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// The last plan received.
    pub plan: Option<InspectionPlan>,
    /// Triggers whose plan has not arrived yet.
    pub waiting: Early<ProbeTrigger>,
    /// Consecutive moves that ended without contact.
    pub misses: u32,
    /// Session of the driver and number of the last trigger received: numbers rise in a session.
    pub last: Option<(String, u64)>,
}
