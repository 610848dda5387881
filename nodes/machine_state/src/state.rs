//! Everything the node remembers.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use graph::Stamp;
use probecell_msgs::{ControllerStatus, Correction, OperationRequest};
use serde::{Deserialize, Serialize};

/// The memory of `machine_state`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// The driver that runs now, and its last sample.
    pub controller: Option<Controller>,
    /// Number of the next command to this driver.
    pub next_command: u64,
    /// The operation that the machine works on.
    pub operation: Option<Operation>,
    /// A measurement that waits for its order.
    pub awaited: Option<Awaited>,
    /// The last measuring order: plan and indices of points.
    pub order: Option<(String, Vec<u32>)>,
    /// Plans that this driver was told to measure to decide from them, and when the cycle asked for each.
    pub measured: BTreeMap<String, Stamp>,
    /// When the last part ended that was not qualified: what was measured before must not be corrected from any more.
    pub ended: Option<Stamp>,
    /// Corrections written to the controller and not yet answered, by command number.
    pub writing: BTreeMap<u64, Writing>,
    /// Approved corrections that wait until the machine stands still and the one before is written, in order of arrival.
    pub deferred: VecDeque<Correction>,
    /// Corrections that the controller has, with what was read before and after.
    pub applied: BTreeMap<String, ReadBack>,
    /// Largest offset of each feature's tool path that was written in this session, m.
    pub paths: BTreeMap<String, f64>,
    /// Codes of faults that stand now, each told once.
    pub standing: BTreeSet<String>,
}

/// What the controller held before a correction was written, and what was read back after it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReadBack {
    /// m or rad; of a volumetric table what the correction says of it.
    pub before: f64,
    /// The same after it; NaN where it is not known.
    pub after: f64,
    /// Entries of a volumetric table, m or rad.
    pub values_before: Vec<f64>,
    /// The same after it.
    pub values_after: Vec<f64>,
}

/// A driver and what it said last.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Controller {
    /// Its last sample.
    pub status: ControllerStatus,
    /// When that came.
    pub at: Stamp,
    /// It has been silent for too long.
    pub lost: bool,
}

/// An operation under way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Operation {
    /// Request of the cycle.
    pub request_id: u64,
    /// Command to the driver.
    pub command_id: u64,
    /// Since when the controller has been idle without an answer to the command.
    pub idle: Option<Stamp>,
}

/// A correction that the driver was told to write.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Writing {
    /// The correction.
    pub correction: Correction,
    /// When it is given up.
    pub until: Stamp,
}

/// A measurement that waits for its order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Awaited {
    /// The request.
    pub request: OperationRequest,
    /// When it is given up.
    pub until: Stamp,
}
