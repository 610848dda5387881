//! Decides what follows from the measured sizes: verdicts, corrections, and whether the part goes on.
//!
//! | hears | says |
//! |---|---|
//! | `feature_results`, `operation_requests` | `verdicts`, `pass_decisions` |
//! | `tool_offsets`, `approvals`, `part_reports` | `corrections`, `approval_replies` |
//! | for the volumetric table: `inspection_plan`, `probe_events`, `touch_deviations` | |
//! | for work offsets: `inspection_plan`, `probe_events`, `part_alignment` | |
//! | | `compensation/faults`: `approval_overdue` |
//!
//! The decision table is that of the turn-mill system (source systems A.4). Characteristics cut by one tool share its wear
//! offset: the correction is made for their mean error, and bounded so that no characteristic is cut below size. A
//! correction is proposed; it is approved by the cell file's policy or by an operator, never by itself. One that nobody
//! answers in time is withdrawn, with all that was proposed beside it, and the part stops; a part that ends otherwise takes
//! its proposals with it.
//!
//! The machine itself is judged beside the sizes, by touches of balls ([`Volumetric`]), and so is the place of the part, by
//! its datums ([`WorkOffset`]). Where its volumetric table can be corrected nothing else is: sizes measured before and after
//! are those of two machines; then work offsets alone; then sizes. The gravest verdict decides.

mod config;
mod judged;
mod path;
mod step;
mod volumetric;
mod work_offset;

pub use config::{
    Characteristic, Config, ConfigError, PathCorrection, RawCharacteristic, RawConfig,
};
pub use path::Paths;
pub use step::{CompensationNode, Input, Output, State};
pub use volumetric::{Beside, Memory, RawVolumetric, Volumetric, VolumetricError};
pub use work_offset::{RawWorkOffset, WorkOffset, WorkOffsetError};
