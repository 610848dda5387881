//! Decides what the touches say about the part: deviations, fitted features, sizes with uncertainty.
//!
//! | hears | says |
//! |---|---|
//! | `inspection_plan`, `probe_events` | `touch_deviations`, `feature_results` |
//! | | `analysis/faults`: `event_not_usable` |
//!
//! The deviation of a touch is the contract's: d = n·(c − p) − r by the nominal chain. A feature is fitted when each of
//! its points has been tried; one whose touches are missing or unusable is reported INVALID, never as a size. Widths over
//! several planes are reported after their planes.

mod config;
pub mod feature;
mod step;

pub use config::{Config, ConfigError, RawConfig, Width};
pub use step::{AnalysisNode, Input, Output, State, Touch};
