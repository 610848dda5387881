//! The drivers of this crate: one line for each.

use crate::{
    bag::Bag, driver::Driver, external::External, linuxcnc::LinuxCnc, ros2::Ros2,
    simulator::Simulator,
};

/// Every driver.
pub const DRIVERS: &[&dyn Driver] = &[&Simulator, &LinuxCnc, &Ros2, &External, &Bag];
