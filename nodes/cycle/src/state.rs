//! The state of `cycle`: the part that is being made, and how far it is.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use probecell_msgs::{PassDecision, PlanId, RunId};
use serde::{Deserialize, Serialize};

/// The state of `cycle`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// The part that is being made.
    pub run: Option<Run>,
    /// The last part, where it ended with a measurement that can be resumed: nothing was cut or corrected since.
    pub last: Option<Run>,
    /// Number of the next operation request.
    pub next_request: u64,
    /// Outcome and text of each correction of this part that the machine has acknowledged.
    pub acknowledged: BTreeMap<String, (u8, String)>,
    /// Parts reported as qualified, the latest last: the run of the deciding measurement, the part and its passes.
    pub qualified: VecDeque<(RunId, String, u32)>,
    /// Why no further part is made: what a reference measurement refutes.
    pub refuted: Option<String>,
}

/// A part that is being made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// The part.
    pub part_id: String,
    /// Index of the pass.
    pub pass: u32,
    /// Measurements of this pass so far.
    pub attempt: u32,
    /// Machining passes made, recuts counted.
    pub cuts: u32,
    /// What the machine does.
    pub stage: Stage,
}

/// What the machine does for a part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Stage {
    /// The machine cuts operation `index` of the pass.
    Cutting {
        /// Index of the operation.
        index: usize,
        /// Number of the request.
        request_id: u64,
    },
    /// The machine measures.
    Measuring {
        /// The plan.
        plan_id: PlanId,
        /// Number of the request.
        request_id: u64,
        /// The machine has finished; the decision is awaited.
        done: bool,
        /// The decision, where it arrives before the machine has finished: it waits until the probe is out of the way.
        decision: Option<PassDecision>,
    },
    /// The machine measures; no decision follows.
    OnlyMeasuring {
        /// The plan.
        plan_id: PlanId,
        /// Number of the request.
        request_id: u64,
    },
    /// Acknowledgements of corrections are awaited before the pass is cut again.
    Correcting {
        /// The plan whose decision requested them.
        plan_id: PlanId,
        /// Corrections not acknowledged yet.
        awaited: BTreeSet<String>,
    },
}

impl Stage {
    /// The plan that is measured.
    pub(crate) fn plan_id(&self) -> Option<&PlanId> {
        match self {
            Self::Measuring { plan_id, .. } | Self::OnlyMeasuring { plan_id, .. } => Some(plan_id),
            Self::Cutting { .. } | Self::Correcting { .. } => None,
        }
    }
}
