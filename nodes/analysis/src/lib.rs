//! The node `analysis`: deviations of touches, fitted features with their uncertainty, conformance, and the alignment of the
//! part.
//!
//! | subscribes to | publishes |
//! |---|---|
//! | `inspection_plan`, `measurement_order`, `probe_events`, `reference` | `touch_deviations`, `feature_results`, `part_alignment`, `reference_results` |
//! | | `analysis/faults`: `event_not_usable`, `reference_not_usable` |
//!
//! ```text
//!   probe_events ── nominal chain ── deviation d = n·(c − p) − r ── touch_deviations
//!                        │
//!                        └─ ball centres ── alignment (ISO 5459) ── outliers ── fit ── uncertainty ── conformance
//!                                               │                  (ISO 14405-1, ISO 1101) (GUM)   (ISO 14253-1:2013)
//!                                          part_alignment                                   └── feature_results
//! ```
//!
//! A feature is fitted when each of its points has been tried; one whose touches are missing or unusable is reported INVALID,
//! never as a size. Widths and steps over two planes are reported after their planes. Where the cell file names datums or a
//! best fit (`alignment`), no feature is reported before the part is aligned, and then in the frame of the part as it lies.
//!
//! The size of a bore from four touches that find 4 µm of excess material:
//!
//! ```
//! use analysis::feature::{self, Rules, Sample};
//! use nalgebra::{Point3, Vector3};
//! use probecell_msgs::{InspectionFeature, geometry_msgs};
//!
//! let bore = InspectionFeature {
//!     kind: InspectionFeature::BORE,
//!     axis: geometry_msgs::Vector3 { x: 0.0, y: 0.0, z: 1.0 },
//!     radius: 10e-3,
//!     ..InspectionFeature::default()
//! };
//! let (ball_radius, excess) = (2e-3, 4e-6);
//! let samples = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]].map(|[x, y]| Sample {
//!     centre: Point3::from(Vector3::new(x, y, 0.0) * (10e-3 - ball_radius - excess)),
//!     normal: Vector3::new(-x, -y, 0.0),
//!     deviation: excess,
//! });
//! let fitted = feature::fit(&bore, ball_radius, &samples, &Rules::default(), 0.5e-6)?;
//! assert_eq!(format!("{:.4} mm", fitted.size * 1e3), "19.9920 mm");
//! assert_eq!(format!("u {:.2} µm", fitted.size_uncertainty * 1e6), "u 0.50 µm");
//! # Ok::<(), analysis::feature::FeatureError>(())
//! ```

mod alignment;
mod composed;
mod config;
pub mod feature;
mod ports;
mod reference;
mod result;
mod state;
mod step;
mod tolerance;

pub use config::{
    Alignment, Config, ConfigError, Distribution, Method, RawAlignment, RawConfig, RawContribution,
    RawFit, Width,
};
pub use ports::{AnalysisFault, Input, Output};
pub use reference::ReferenceError;
pub use state::{State, Touch};
pub use tolerance::{Characteristic, Tolerance};

graph::node! {
    /// The node.
    pub struct AnalysisNode { ports: ports, config: Config, state: State, step: step::step }
}
