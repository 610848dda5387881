//! The touches of a measurement, by which the volumetric table and the position of the part are judged.

use std::collections::BTreeMap;

use probecell_msgs::{InspectionPlan, ProbeEvent, TouchDeviation};
use serde::{Deserialize, Serialize};

/// Plan, probing events and uncertainties of a measurement.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Touches {
    /// The latest plan.
    pub plan: Option<InspectionPlan>,
    /// Probing events, by sequence number.
    pub events: BTreeMap<u64, ProbeEvent>,
    /// Plan and standard uncertainty (m) of each touch, by sequence number.
    pub uncertainties: BTreeMap<u64, (String, f64)>,
}

impl Touches {
    /// Adds the uncertainty of a touch.
    pub(crate) fn add_deviation(&mut self, touch: &TouchDeviation) {
        let uncertainty = (touch.plan_id.clone(), touch.standard_uncertainty);
        self.uncertainties.insert(touch.sequence, uncertainty);
    }

    /// Drops the touches of other plans.
    pub(crate) fn retain(&mut self, plan_id: &str) {
        self.events.retain(|_, event| event.plan_id == plan_id);
        self.uncertainties.retain(|_, (plan, _)| plan == plan_id);
    }
}
