//! The state of `visualization`.

use graph::Stamp;
use probecell_msgs::MeasurementOrder;
use serde::{Deserialize, Serialize};

use crate::markers::Scene;

/// The state of `visualization`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// What is drawn, once there is a plan.
    pub scene: Option<Scene>,
    /// An order whose plan has not arrived yet.
    pub early: Option<MeasurementOrder>,
    /// Stamp of the last joint state that was shown.
    pub shown: Option<Stamp>,
    /// The state of the joints could not be shown, which was reported.
    pub is_reported: bool,
    /// When the markers were published last.
    pub drawn: Option<Stamp>,
    /// Markers will be published by a timer that is set.
    pub is_due: bool,
}
