//! The state of `gap`.

use std::collections::BTreeSet;

use diagnosis::{Session, onset::ChangeMonitor};
use graph::Early;
use probecell_msgs::{
    InspectionPlan, MachineState, ProbeEvent, ReferenceMeasurement, sensor_msgs::JointState,
};
use serde::{Deserialize, Serialize};

use crate::window::Window;

/// The state of `gap`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// URDF.
    pub robot_description: String,
    /// The last plan received.
    pub plan: Option<InspectionPlan>,
    /// The session that the plan supplements.
    pub earlier: Option<Session>,
    /// Touches of the plan, in the order of arrival.
    pub events: Vec<ProbeEvent>,
    /// Events whose plan has not arrived yet.
    pub waiting: Early<ProbeEvent>,
    /// Points of the plan that have not been tried yet, or are to be touched again.
    pub open: BTreeSet<u32>,
    /// Reference measurements of the plan.
    pub references: Vec<ReferenceMeasurement>,
    /// Axis positions next to the touches.
    pub joints: Window<JointState>,
    /// Machine states next to the touches, and those at which temperatures or the spindle's speed change.
    pub states: Window<MachineState>,
    /// The parts so far.
    pub watch: ChangeMonitor,
    /// A diagnosis is due when the streams have passed this instant, ns since 1970.
    pub due: Option<i64>,
}
