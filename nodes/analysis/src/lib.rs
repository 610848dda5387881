//! Decides what the touches say about the part: deviations, fitted features, sizes with uncertainty.
//!
//! | hears | says |
//! |---|---|
//! | `inspection_plan`, `probe_events` | `touch_deviations`, `feature_results`, `part_alignment` |
//! | | `analysis/faults`: `event_not_usable` |
//!
//! The deviation of a touch is the contract's: d = n·(c − p) − r by the nominal chain. A feature is fitted when each of
//! its points has been tried; one whose touches are missing or unusable is reported INVALID, never as a size. Widths over
//! several planes are reported after their planes. Where the cell file names datums or a best fit (`alignment`), nothing
//! is said of a feature before the part is placed, and everything then in the frame of the part as it lies.

mod alignment;
mod config;
pub mod feature;
mod step;

pub use config::{Alignment, Config, ConfigError, Method, RawAlignment, RawConfig, RawFit, Width};
pub use step::{AnalysisNode, Input, Output, State, Touch};
