//! What `compensation` remembers between its inputs.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use graph::Early;
use probecell_msgs::{
    Correction, FeatureResult, OperationRequest, OperatorKeys, PartAlignment, RunId, ToolOffsets,
};
use serde::{Deserialize, Serialize};

use crate::{
    measurement::{Judged, Measurement},
    path::Paths,
    touches::Touches,
};

/// State of `compensation`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// The measurement that is decided on: plan and pass.
    pub measurement: Option<(String, u32)>,
    /// The request for it: a repeated one is taken once.
    pub taken: Option<OperationRequest>,
    /// Its results so far.
    pub results: BTreeMap<String, FeatureResult>,
    /// The latest plan by its id, and the features that it touches: a measurement that is broken off lacks results of some, and
    /// nothing is decided on it.
    pub features: Option<(String, BTreeSet<String>)>,
    /// Features of the measurement of which a result has arrived.
    pub measured: BTreeSet<String>,
    /// Results that arrived before the request for their measurement.
    pub early: Early<FeatureResult>,
    /// Wear offsets and the driver's session.
    pub offsets: Option<ToolOffsets>,
    /// Corrections made in the current pass.
    pub corrections: u32,
    /// The current pass was cut again with unchanged offsets.
    pub recut_unchanged: bool,
    /// Run and pass that the corrections are counted for.
    pub counted_for: Option<(RunId, u32)>,
    /// Corrections that wait for an operator, with their passes.
    pub proposed: BTreeMap<String, (Correction, u32)>,
    /// Corrections of the last measurement that were withdrawn, and why.
    pub withdrawn: BTreeMap<String, String>,
    /// The operators' keys in force.
    pub keys: Option<OperatorKeys>,
    /// Offsets of the tool paths that were asked for in this session of the driver.
    pub paths: Paths,
    /// The touches that the volumetric table and the position of the part are judged by.
    pub touches: Touches,
    /// The latest alignment of the part.
    pub alignment: Option<PartAlignment>,
    /// Sizes that were judged, the latest last.
    pub judged: VecDeque<Judged>,
    /// Features as measured by an independent instrument, the latest last.
    pub references: VecDeque<FeatureResult>,
}

impl State {
    /// Takes the measurement and its results.
    pub(crate) fn take_measurement(&mut self) -> Option<Measurement> {
        let (plan_id, pass) = self.measurement.take()?;
        let results = std::mem::take(&mut self.results);
        let part_id = results.values().next().map(|result| result.part_id.clone());
        Some(Measurement {
            plan_id,
            part_id: part_id.unwrap_or_default(),
            pass,
            results,
        })
    }

    /// Every feature that the plan touches has a result; a plan that is not known holds nothing up.
    pub(crate) fn is_measured(&self, plan_id: &str) -> bool {
        let known = self.features.as_ref().filter(|(plan, _)| plan == plan_id);
        known.is_none_or(|(_, features)| features.is_subset(&self.measured))
    }

    /// Counts corrections anew where the run or the pass is another.
    pub(crate) fn count_corrections_of(&mut self, run: RunId, pass: u32) {
        let counted_for = Some((run, pass));
        if self.counted_for != counted_for {
            self.counted_for = counted_for;
            self.corrections = 0;
            self.recut_unchanged = false;
        }
    }

    /// Wear offset of a tool, m; `None` where the controller has not reported it.
    pub(crate) fn wear_of(&self, tool: u32) -> Option<f64> {
        let offsets = self.offsets.as_ref()?;
        let mut numbers = offsets.tool_numbers.iter();
        let index = numbers.position(|&number| number == tool)?;
        let wear = offsets.wear.get(index).copied();
        wear.filter(|wear| wear.is_finite())
    }

    /// Session of the driver that the offsets are of; empty where it has not reported any.
    pub(crate) fn session(&self) -> &str {
        self.offsets
            .as_ref()
            .map_or("", |offsets| offsets.session.as_str())
    }
}
