//! The node `compensation`: verdicts on measured sizes, on the volumetric table and on the position of the part; corrections of
//! the controller's offsets; and what the cell does next.
//!
//! | subscribes to | publishes |
//! |---|---|
//! | `feature_results`, `reference_results`, `operation_requests` | `verdicts`, `pass_decisions` |
//! | `tool_offsets`, `approvals`, `operator_keys`, `part_reports` | `corrections`, `approval_replies` |
//! | `inspection_plan`: nothing is decided before all its features are measured | |
//! | for the volumetric table: `inspection_plan`, `probe_events`, `touch_deviations` | |
//! | for work offsets: `inspection_plan`, `probe_events`, `part_alignment` | |
//! | | `compensation/faults`: `approval_overdue`, `approval_unsigned` |
//!
//! ```text
//!   sizes ──────────── wear, path ───┐                          ┌─ next pass
//!   touches of balls ─ volumetric ───┼─ decide: the gravest ────┼─ recut ── propose ── policy | operator ── corrections
//!   alignment ──────── work_offset ──┘  verdict decides         └─ stop, scrap
//! ```
//!
//! The decision table is that of the turn-mill system (`docs/source_systems.md`, A.4). Characteristics cut by one tool share
//! its wear offset: the correction is made for their mean error, and bounded so that no characteristic is cut below size. A
//! correction is proposed; the cell file's policy or an operator approves it. One that is not answered in time is withdrawn
//! with everything else that was proposed, and the part stops; the end of a part withdraws its proposals too.
//!
//! Where the volumetric table can be corrected nothing else is, since sizes measured before and after are those of two
//! machines; then the work offsets alone; then wear offsets and tool paths.
//!
//! A shaft of 19.8 mm that came out 11 µm too large:
//!
//! ```
//! use compensation::{CompensationNode, Input, Output, RawConfig};
//! use graph::{Node, Outbox, Stamp};
//! use machine::{Chain, models::WCBXFZYST};
//! use probecell_msgs::{FeatureResult, OperationRequest, PassDecision, ToolOffsets};
//!
//! let raw: RawConfig = serde_json::from_str(
//!     r#"{ "characteristics": [{ "id": "D1", "tolerance_mm": 0.010, "tool_number": 2 }],
//!          "wear_limit_mm": 0.110, "max_corrections": 5, "automatic_approval": true }"#,
//! )?;
//! let config = raw.check(&Chain::from_urdf(WCBXFZYST)?, &["finish"], false)?;
//! let mut state = CompensationNode::start(&config);
//! let mut out = Outbox::default();
//! let offsets = ToolOffsets { tool_numbers: vec![2], wear: vec![0.0], ..ToolOffsets::default() };
//! let request = OperationRequest {
//!     kind: OperationRequest::MEASURE,
//!     plan_id: "run/1".to_owned(),
//!     ..OperationRequest::default()
//! };
//! let size = FeatureResult {
//!     plan_id: "run/1".to_owned(),
//!     feature_id: "D1".to_owned(),
//!     size: 19.811e-3,
//!     nominal_size: 19.8e-3,
//!     size_deviation: 11e-6,
//!     ..FeatureResult::default()
//! };
//! for input in [Input::Offsets(offsets), Input::Request(request), Input::Feature(size)] {
//!     CompensationNode::step(&config, &mut state, Stamp(0), input, &mut out);
//! }
//! let [Output::Verdict(_), Output::Correction(correction), Output::Decision(decision)] = out.messages() else {
//!     panic!("a verdict, a correction and a decision");
//! };
//! assert_eq!(correction.new_value, -11e-6);
//! assert_eq!(decision.decision, PassDecision::RECUT);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod approval;
mod config;
mod correction;
mod decide;
mod judgement;
mod measurement;
mod passes;
mod path;
mod ports;
mod propose;
mod reference;
mod rule;
mod state;
mod step;
mod touches;
mod volumetric;
mod wear;
mod work_offset;

pub use config::{
    Characteristic, Config, ConfigError, PathCorrection, RawCharacteristic, RawConfig,
    RawDecisionRule, RawWorkOffset, WorkOffset, WorkOffsetError,
};
pub use passes::{Passes, UnknownPass};
pub use path::Paths;
pub use ports::{CompensationFault, Input, Output};
pub use state::State;
pub use touches::Touches;
pub use volumetric::{ProbeEffect, RawVolumetric, Volumetric, VolumetricError};

graph::node! {
    /// The node.
    pub struct CompensationNode { ports: ports, config: Config, state: State, step: step::step }
}
