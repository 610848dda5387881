//! The state of `machine_state`.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use graph::Stamp;
use probecell_msgs::{
    ControllerStatus, Correction, OperationReport, OperationRequest, OperatorKeys, PartStatus,
    RecordingStatus,
};
use serde::{Deserialize, Serialize};

/// The state of `machine_state`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// ns since 1970, start of this process; 0 before it.
    pub started: u64,
    /// What distinguishes this process from earlier ones at the driver, ns: its start, or the clock of the driver where that is
    /// ahead: the cell may have been started anew by a wall clock that was set back.
    pub epoch: u64,
    /// Signs of life given so far.
    pub beats: u64,
    /// The driver that runs now, and its last sample.
    pub controller: Option<Controller>,
    /// Drivers whose place it, or another, has taken; the latest last.
    pub former: Vec<Former>,
    /// Number of the next command to this driver.
    pub next_command: u64,
    /// The last request taken, and the last report on it: a repeated request is answered by it.
    pub taken: Option<(u64, Option<OperationReport>)>,
    /// When a request under way was last reported to be.
    pub told: Stamp,
    /// Commands to stop that the driver has not confirmed, by number.
    pub stops: BTreeMap<u64, Stop>,
    /// The part that is being made.
    pub part: Part,
    /// What is known of the recording, and when it arrived.
    pub recording: Option<(RecordingStatus, Stamp)>,
    /// The operation under way.
    pub operation: Option<Operation>,
    /// A measurement that waits for its order.
    pub awaited: Option<Awaited>,
    /// The last measuring order: plan and indices of points.
    pub order: Option<(String, Vec<u32>)>,
    /// Plans that were measured for a decision in this session, and when the cycle requested each.
    pub measured: BTreeMap<String, Stamp>,
    /// End of the last part that was not qualified: measurements before it entitle to no correction.
    pub ended: Option<Stamp>,
    /// Plans of which an operator has rejected a correction: nothing more is corrected from them.
    pub rejected: BTreeSet<String>,
    /// The operators' keys in force.
    pub keys: Option<OperatorKeys>,
    /// Corrections written to the controller and not yet answered, by command number.
    pub writing: BTreeMap<u64, Writing>,
    /// Approved corrections that wait until no program runs and the previous one is written, in order of arrival.
    pub deferred: VecDeque<Correction>,
    /// Corrections applied, with the values read before and after.
    pub applied: BTreeMap<String, ReadBack>,
    /// Largest offset of each feature's tool path that was written in this session, m.
    pub paths: BTreeMap<String, f64>,
    /// Codes of the faults that stand, with the signal where they are of one: each has been reported once.
    pub standing: BTreeSet<String>,
    /// What was heard of each signal.
    pub signals: BTreeMap<String, Heard>,
}

/// What was heard of a signal.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Heard {
    /// Its last valid reading, and when it was read.
    pub last: Option<(f64, Stamp)>,
    /// Why it could not be read since; empty where it could.
    pub failure: String,
}

/// Values that the controller held before a correction was written, and those read back after it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReadBack {
    /// m or rad; of a volumetric table `previous_value` of the correction.
    pub before: f64,
    /// The same after it; NaN where it is not known.
    pub after: f64,
    /// Entries of a volumetric table, m or rad.
    pub values_before: Vec<f64>,
    /// The same after it.
    pub values_after: Vec<f64>,
}

/// The driver that runs, by its last sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Controller {
    /// Its last sample.
    pub status: ControllerStatus,
    /// When it arrived.
    pub at: Stamp,
    /// No sample has arrived for too long.
    pub lost: bool,
}

/// A driver whose place another has taken.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Former {
    /// Its session.
    pub session: String,
    /// Since when the other runs: samples with a later stamp show that this one still does.
    pub until: Stamp,
    /// When such a sample arrived last; none once it has been silent for long enough.
    pub heard: Option<Stamp>,
}

/// An operation under way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Operation {
    /// Request of the cycle.
    pub request_id: u64,
    /// Command to the driver.
    pub command_id: u64,
    /// Since when the controller has been idle without a reply to the command.
    pub idle: Option<Stamp>,
}

/// A correction whose command has been sent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Writing {
    /// The correction.
    pub correction: Correction,
    /// When it fails for want of an answer.
    pub until: Stamp,
}

/// A measurement that waits for its order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Awaited {
    /// The request.
    pub request: OperationRequest,
    /// When it fails for want of an answer.
    pub until: Stamp,
}

/// The part that is being made, as `cycle` reports it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// Its last status; of another part than this only once its end is known.
    pub status: PartStatus,
    /// When it arrived.
    pub at: Stamp,
    /// `cycle` no longer reports it, or another process does.
    pub abandoned: bool,
    /// The run that was being made when an operator stopped the machine: nothing begins for it any more.
    pub stopped: Option<String>,
}

/// A command to stop that the driver has not confirmed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stop {
    /// Who waits for the confirmation.
    pub asked_by: Asker,
    /// When it has failed for want of an answer.
    pub until: Stamp,
}

/// Who has stopped the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Asker {
    /// The gate itself; nobody waits.
    Gate,
    /// `cycle`, with a request of this number.
    Cycle(u64),
    /// An operator, with a request of this number.
    Operator(u64),
}
