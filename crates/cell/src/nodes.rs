//! The registry of nodes: one entry makes a node part of every cell.
//!
//! An entry of [`cell_file!`] names the section of the cell file, its settings as written, the node, and how the settings
//! are checked. From it derive the field of [`Cell`](crate::Cell), the list [`NODES`](crate::NODES), and how the node is
//! made. A node that lives outside this workspace joins a cell by [`Cell::with_node`](crate::Cell::with_node).

use std::collections::BTreeMap;

use graph::Instance;
use machine::Chain;
use signatures::{Signer, Trust};

use crate::Cell;

/// What the settings of a node are checked against.
pub struct Site<'a> {
    /// The whole cell file.
    pub cell: &'a Cell,
    /// The kinematic chain of its robot description.
    pub chain: Chain,
    /// The graph runs on a recording: nothing may reach a machine.
    pub replayed: bool,
}

impl Site<'_> {
    /// Change of each size of the part by one standard uncertainty of what all touches share, m; empty where the sections
    /// that say so are wrong, which their own nodes report.
    pub fn common_components(&self) -> BTreeMap<String, f64> {
        let plan = self.cell.part.check(&self.chain).map(|part| part.plan(0.0));
        let analysis = self.analysis();
        let (Ok(plan), Ok(analysis)) = (plan, analysis) else {
            return BTreeMap::new();
        };
        analysis.common_components(&plan)
    }

    /// Settings of `analysis`, with what the driver's time of a contact adds to the uncertainty of a touch.
    pub(crate) fn analysis(&self) -> Result<analysis::Config, analysis::ConfigError> {
        let config = self.cell.analysis.check(self.chain.clone())?;
        Ok(config.with_touch_contribution(self.cell.contact_uncertainty(&self.chain)))
    }

    /// Settings of `compensation`, with the geometrical tolerances as characteristics that no offset corrects.
    pub(crate) fn with_tolerances(&self, raw: &compensation::RawConfig) -> compensation::RawConfig {
        let tolerances = self.cell.analysis.tolerances.iter();
        let judged = tolerances.map(|one| compensation::RawCharacteristic {
            id: one.id.clone(),
            tolerance_mm: one.tolerance_um * 1e-3,
            tool_number: None,
            inner: false,
            passes: one.passes.clone(),
        });
        let mut raw = raw.clone();
        raw.characteristics.extend(judged);
        raw
    }

    /// Whose approvals of corrections count.
    pub(crate) fn trust(&self) -> Trust {
        Trust {
            cell: self.cell.trusted.key,
            automatic: self.cell.compensation.automatic_approval,
            unsigned_operators: self.cell.approvals.unsigned_operators,
        }
    }

    /// What signs for the policy.
    pub(crate) fn signer(&self) -> Signer {
        self.cell.trusted.signer.clone()
    }

    /// Text of the robot description, URDF.
    pub fn robot_description(&self) -> String {
        self.cell.text.robot_description.clone()
    }

    /// Allowance that each machining pass leaves on the sizes, m.
    pub(crate) fn allowances(&self) -> Vec<f64> {
        let passes = self.cell.cycle.passes.iter();
        passes.map(|pass| pass.allowance_mm * 1e-3).collect()
    }

    /// Names of the machining passes.
    pub(crate) fn passes(&self) -> Vec<&str> {
        let passes = self.cell.cycle.passes.iter();
        passes.map(|pass| pass.name.as_str()).collect()
    }
}

/// A node that a cell can have.
#[derive(Clone, Copy, Debug)]
pub struct NodeEntry {
    /// Its name: the process, the ROS node and the section of the cell file.
    pub name: &'static str,
    /// Checks its settings and makes it, at its start. The error is one sentence that begins with the setting's key.
    pub make: fn(&Site<'_>) -> Result<Box<dyn Instance>, String>,
}

/// Defines the cell file: the sections of its nodes, one entry each in the order of the data flow, and the others.
macro_rules! cell_file {
    (
        $(#[$meta:meta])*
        pub struct $cell:ident {
            nodes {
                $($(#[$attribute:meta])* $section:ident: $settings:ty => $node:ty,
                    |$raw:ident, $site:ident| $check:expr;)*
            }
            $($others:tt)*
        }
    ) => {
        $(#[$meta])*
        pub struct $cell {
            $(
                #[doc = concat!("Settings of `", stringify!($section), "`.")]
                $(#[$attribute])*
                pub $section: $settings,
            )*
            $($others)*
        }

        /// Names of the nodes that every cell has, in the order of the data flow.
        pub const NODES: &[&str] = &[$(<$node as graph::Node>::NAME),*];

        /// Their entries.
        const ENTRIES: &[$crate::nodes::NodeEntry] = &[$($crate::nodes::NodeEntry {
            name: <$node as graph::Node>::NAME,
            make: |$site| {
                let $raw = &$site.cell.$section;
                let config = $check.map_err(|error| error.to_string())?;
                Ok(Box::new(graph::Running::<$node>::new(config)))
            },
        }),*];
    };
}

pub(crate) use cell_file;
