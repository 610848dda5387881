//! Explains, while the cell runs, why a measurement differs from the declared model: the diagnosis of a bag, live.
//!
//! ```text
//!  robot_description  inspection_plan ──> what was to be measured ─┐
//!  probe_events  measurement_order  reference ──> what came of it ─┼─> diagnosis::diagnose ──> gap_report
//!  joint_states  machine_state ──> samples next to the touches ────┘
//! ```
//!
//! | subscribes to | publishes |
//! |---|---|
//! | `robot_description`, `inspection_plan`, `measurement_order`, `probe_events`, `reference` | `gap_report`, `gap_findings` |
//! | `joint_states`, `machine_state`, `correction_acknowledgements` | `gap/faults`: `session_not_usable` |
//!
//! It diagnoses when every point of the plan has been tried, again when a reference measurement of that plan arrives, and
//! every N touches where the cell file asks for it. It keeps what the diagnosis reads: the touches of the plan, and of
//! the streams the samples next to them ([`Window`]). So its answer equals that of `probecell diagnose` on a recording of
//! the same session. Parts of one plan are compared with one another as well (`diagnosis::onset`): where the gap changes, a
//! finding names the part and the instant since when, the effects that explain it, and the touches that would discriminate them
//! (`further`). They are not made automatically: an operator passes them to the service `plan`. A correction restarts the
//! comparison. A supplement of a plan is diagnosed together with that plan. This node commands nothing.

mod config;
mod message;
mod ports;
mod state;
mod step;
mod window;

pub use config::{Config, ConfigError, RawConfig};
pub use ports::{GapFault, Input, Output};
pub use state::State;
pub use window::Window;

graph::node! {
    /// The node.
    pub struct GapNode { ports: ports, config: Config, state: State, step: step::step }
}
