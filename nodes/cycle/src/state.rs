//! The state of `cycle`: the part that is being made, and how far it is.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use graph::Stamp;
use probecell_msgs::{
    OperationRequest, OperatorReply, OperatorRequest, OrderRequest, Orders, PassDecision, PlanId,
    RunId,
};
use serde::{Deserialize, Serialize};

/// Why no part is begun after a reference has refuted a measurement; a further measurement is made.
pub(crate) const REFUTED: &str =
    "no part is made until the cause is found and the cell started again";

/// The state of `cycle`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// The part that is being made.
    pub run: Option<Run>,
    /// The last part, where it ended with a measurement that can be resumed: nothing was cut or corrected since.
    pub last: Option<Run>,
    /// Why the last measurement cannot be resumed, where a fault has voided it since a part was last begun.
    pub void: Option<String>,
    /// Runs in this session of the cell so far, as far as they are known.
    pub runs: u64,
    /// `machine_state` has published which runs there were before this process.
    pub informed: bool,
    /// Identities of the runs of this process.
    pub used: BTreeSet<String>,
    /// A check of the part is under way.
    pub ticking: bool,
    /// Number of the next operation request.
    pub next_request: u64,
    /// Outcome and text of each correction of this part that the machine has acknowledged.
    pub acknowledged: BTreeMap<String, (u8, String)>,
    /// Parts reported as qualified, the latest last: the run of the deciding measurement, the part and its passes.
    pub qualified: VecDeque<(RunId, String, u32)>,
    /// Requests of operators that have not expired: each is taken once.
    pub recent: Vec<OperatorRequest>,
    /// Why no further part is made: what a reference measurement refutes.
    pub refuted: Option<String>,
    /// The orders.
    pub book: OrderBook,
}

/// The orders of the cell.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OrderBook {
    /// As published last.
    pub list: Orders,
    /// Revision that is on disk; none before the launcher has reported which orders there are.
    pub kept: Option<u64>,
    /// Answers to operators, each with the revision that has to be on disk before.
    pub replies: Vec<(u64, OperatorReply)>,
    /// Requests that have not expired: each is taken once.
    pub recent: Vec<OrderRequest>,
}

/// A part that is being made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Its name; several parts may have the same.
    pub part_id: String,
    /// Identity of the run, unique in the session of the cell.
    pub run_id: String,
    /// Number of the run in the session of the cell, from 1.
    pub number: u64,
    /// Number of the order whose part it makes; 0: of none.
    pub order_id: u64,
    /// Start of the stage.
    pub since: Stamp,
    /// What was requested last of the machine.
    pub asked: Option<PendingRequest>,
    /// When the status was published last.
    pub told: Stamp,
    /// Index of the pass.
    pub pass: u32,
    /// Measurements of this pass so far.
    pub attempt: u32,
    /// Machining passes made, recuts counted.
    pub cuts: u32,
    /// What the machine does.
    pub stage: Stage,
    /// The machine has been commanded to stop: the part ends when that is confirmed.
    pub stopping: Option<Stopping>,
}

/// A part that is being stopped.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stopping {
    /// Number of the request to stop.
    pub request_id: u64,
    /// Why.
    pub text: String,
    /// A process has lost its state, or the axes may have another origin: the measurement cannot be resumed.
    pub void: bool,
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

/// A request to the machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PendingRequest {
    /// The request, repeated as it is until it is taken.
    pub request: OperationRequest,
    /// It has been taken.
    pub taken: bool,
    /// When the machine said something of it last, or when it was sent first.
    pub heard: Stamp,
    /// When it was sent last.
    pub sent: Stamp,
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
