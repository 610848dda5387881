//! Corrections as the domain has them: one of four kinds, and the measurement that each rests on.
//!
//! m and rad. [`Correction`] is their flattened union on the wire; it is filled here and nowhere else.

use graph::Stamp;
use probecell_msgs::Correction;

use crate::config::Config;

/// A change of one offset in the controller, or of one table.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Change {
    /// Wear offset of a tool, m; either sign up to `limit`.
    ToolWear {
        /// Its number.
        tool: u32,
        /// In force.
        held: f64,
        /// Proposed.
        wanted: f64,
        /// Largest allowed.
        limit: f64,
    },
    /// Work offset of a linear axis, m; either sign up to `limit`.
    WorkOffset {
        /// Its joint.
        axis: String,
        /// In force.
        held: f64,
        /// Proposed.
        wanted: f64,
        /// Largest allowed.
        limit: f64,
    },
    /// Offsets of a tool path along the outward normal at each point of a feature, m; either sign up to `limit`.
    ToolPath {
        /// The feature that it cuts.
        feature: String,
        /// Largest offset in force.
        held: f64,
        /// Proposed, in plan order.
        offsets: Vec<f64>,
        /// Largest allowed.
        limit: f64,
    },
    /// The whole volumetric table, m and rad: its entries were estimated together.
    VolumetricTable {
        /// ISO 230-1 names (EX0C, EA0B), all of the controller's.
        entries: Vec<String>,
        /// In force.
        held: Vec<f64>,
        /// Proposed.
        wanted: Vec<f64>,
        /// Largest allowed value of each entry, either sign.
        limits: Vec<f64>,
        /// Standard uncertainty of each proposed value; 0 where it was not estimated.
        uncertainties: Vec<f64>,
        /// m; largest displacement of the tip by the table in force and by the one proposed, over the poses measured.
        displacement: (f64, f64),
        /// m; largest displacement allowed.
        limit: f64,
    },
}

/// The measurement that a correction rests on.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct MeasurementSource {
    /// Features.
    pub(crate) feature_ids: Vec<String>,
    /// Probing events.
    pub(crate) sequences: Vec<u64>,
    /// m; error found.
    pub(crate) error: f64,
    /// m; its standard uncertainty.
    pub(crate) uncertainty: f64,
}

/// A correction that is proposed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Proposal {
    /// What is changed.
    pub(crate) change: Change,
    /// Why.
    pub(crate) evidence: MeasurementSource,
}

/// Largest magnitude, 0 of nothing.
pub(crate) fn largest(values: &[f64]) -> f64 {
    values
        .iter()
        .fold(0.0, |most: f64, value| most.max(value.abs()))
}

impl Proposal {
    /// The message that asks for it; `session` is the run of the driver whose measurement `plan_id` it rests on.
    pub(crate) fn message(
        self,
        config: &Config,
        now: Stamp,
        plan_id: &str,
        session: &str,
    ) -> Correction {
        let MeasurementSource {
            feature_ids,
            sequences,
            error,
            uncertainty,
        } = self.evidence;
        let first = sequences.iter().min().copied().unwrap_or(0);
        let mut message = Correction {
            header: now.header(""),
            session: session.to_owned(),
            replayed: config.replayed,
            plan_id: plan_id.to_owned(),
            feature_ids,
            sequences,
            measured_error: error,
            standard_uncertainty: uncertainty,
            approval: config.approval(),
            approved_by: config.approved_by(),
            expires: now.after_s(config.validity).time(),
            ..Correction::default()
        };
        let id = fill(&mut message, self.change, first);
        message.correction_id = format!("{plan_id}/{id}");
        if config.automatic_approval {
            message.approved_at = now.time();
            message.signature = config.signer.sign(&message);
        }
        message
    }
}

/// Fills the fields of a kind; gives what follows the plan in the correction's identifier. `first` is the first probing
/// event that it rests on.
fn fill(message: &mut Correction, change: Change, first: u64) -> String {
    let symmetric = |message: &mut Correction, limit: f64| {
        message.lower_bound = -limit;
        message.upper_bound = limit;
    };
    match change {
        Change::ToolWear {
            tool,
            held,
            wanted,
            limit,
        } => {
            message.kind = Correction::TOOL_WEAR;
            message.tool_number = tool;
            (message.previous_value, message.new_value) = (held, wanted);
            symmetric(message, limit);
            format!("T{tool}/{first}")
        }
        Change::WorkOffset {
            axis,
            held,
            wanted,
            limit,
        } => {
            message.kind = Correction::WORK_OFFSET;
            (message.previous_value, message.new_value) = (held, wanted);
            symmetric(message, limit);
            let id = format!("work_offset/{axis}");
            message.axis = axis;
            id
        }
        Change::ToolPath {
            feature,
            held,
            offsets,
            limit,
        } => {
            message.kind = Correction::TOOL_PATH;
            (message.previous_value, message.new_value) = (held, largest(&offsets));
            symmetric(message, limit);
            message.path = offsets;
            format!("path/{feature}")
        }
        Change::VolumetricTable {
            entries,
            held,
            wanted,
            limits,
            uncertainties,
            displacement,
            limit,
        } => {
            message.kind = Correction::VOLUMETRIC;
            (message.previous_value, message.new_value) = displacement;
            (message.lower_bound, message.upper_bound) = (0.0, limit);
            message.entries = entries;
            message.previous_values = held;
            message.new_values = wanted;
            message.value_limits = limits;
            message.value_uncertainties = uncertainties;
            "volumetric".to_owned()
        }
    }
}
