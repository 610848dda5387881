//! What `path_planning` remembers.

use std::collections::BTreeSet;

use probecell_msgs::{InspectionPlan, MeasurementOrder, OperationRequest};
use serde::{Deserialize, Serialize};

use crate::{job::Job, resume::Measurement};

/// The memory of `path_planning`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// The pass that was cut or measured last: it determines the allowance left on the surfaces.
    pub pass: Option<u32>,
    /// Further touches of the part as it is now, not measured yet, and their order.
    pub further: Option<(InspectionPlan, MeasurementOrder)>,
    /// Plans of this session's measurements.
    pub measured: BTreeSet<String>,
    /// The measurement that was requested last; `None` once something is cut, or another plan is published.
    pub measurement: Option<Measurement>,
    /// The last request of the cycle: a repeated one is taken once.
    pub taken: Option<OperationRequest>,
    /// The measurement that the machine makes now: number of its request, and its plan.
    pub running: Option<(u64, String)>,
    /// Where the axes stand, in the order of the chain's axes: m, rad.
    pub here: Option<Vec<f64>>,
    /// The order in the making.
    pub job: Option<Job>,
    /// Jobs started so far: each has a timer of its own.
    pub jobs: u32,
}
