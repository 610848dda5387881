//! Decides, while the cell runs, why a measurement differs from the declared model: the diagnosis of the bag, live.
//!
//! | hears | says |
//! |---|---|
//! | `robot_description`, `inspection_plan`, `probe_events`, `joint_states`, `machine_state`, `reference` | `gap_report` |
//! | | `gap/faults`: `session_not_usable` |
//!
//! It diagnoses when every point of the plan has been tried, again when a reference comes for that plan, and between
//! every so many touches where the cell file asks for it. What it keeps is what the diagnosis looks at: the touches of
//! the plan, and of the streams the samples next to them. So the answer is that of `probecell diagnose` on a recording
//! of the same session. It commands nothing.

mod config;
mod message;
mod step;
mod window;

pub use config::{Config, ConfigError, RawConfig};
pub use step::{GapNode, Input, Output, State};
pub use window::Window;
