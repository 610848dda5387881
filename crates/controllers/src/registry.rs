//! The drivers and dialects of this crate: one line for each.

use crate::{
    bag::Bag, dialect::Dialect, driver::Driver, external::External, fanuc::Fanuc,
    inspection::Inspection, linuxcnc::LinuxCnc, ros2::Ros2, simulator::Simulator,
    sinumerik::Sinumerik,
};

/// Every driver.
pub const DRIVERS: &[&dyn Driver] = &[&Simulator, &LinuxCnc, &Ros2, &External, &Bag];

/// Every dialect. A result file is read by the first format that recognises it, in this order.
pub const DIALECTS: &[&dyn Dialect] = &[&Fanuc, &Inspection, &LinuxCnc, &Sinumerik];
