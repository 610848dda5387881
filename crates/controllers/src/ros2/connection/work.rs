//! What is under way at the robot.

use std::time::Instant;

use probecell_msgs::ControllerCommand;

use crate::ros2::{calls::Pending, measuring::Measurement, program::Cut};

/// What is under way.
pub(super) enum Work {
    Measure(Box<Measurement>),
    Cut(Box<Cut>),
    Stop(Box<Stopping>),
}

/// A stop: what is cancelled, and what it ends.
pub(super) struct Stopping {
    /// None where nobody supervises any more.
    pub(super) command: Option<ControllerCommand>,
    /// What was under way, and what is said of it.
    pub(super) interrupted: Option<(ControllerCommand, String)>,
    pub(super) calls: Vec<Pending>,
    /// A goal that was sent before and is not answered yet: it may begin after it was cancelled.
    pub(super) goal: Option<Pending>,
    /// Samples of a robot that stands have come later.
    pub(super) since: Instant,
    pub(super) failure: Option<String>,
}
