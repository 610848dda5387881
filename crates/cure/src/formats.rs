//! What each maker's machine loads.

mod firmware;
mod klipper;
mod linuxcnc;
mod linuxcnc_hal;
mod origin;
mod robot;
mod table;

use crate::job::Format;

/// Every format, as typed after `--as`.
pub const FORMATS: &[&Format] = &[
    &linuxcnc::INI,
    &linuxcnc::COMP,
    &linuxcnc_hal::HAL,
    &robot::URDF,
    &robot::UR_KINEMATICS,
    &robot::ROBOT_CALIBRATION,
    &klipper::KLIPPER,
    &firmware::GRBL,
    &firmware::MARLIN,
    &firmware::DUET,
];
