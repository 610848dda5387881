//! What each maker's machine loads.

mod arm;
mod description;
mod firmware;
mod iso230;
mod klipper;
mod linuxcnc;
mod linuxcnc_hal;
mod linuxcnc_tool;
mod robot;
mod sinumerik;
mod table;

use crate::job::Format;

/// Every format, as typed after `--as`.
pub const FORMATS: &[&Format] = &[
    &linuxcnc::INI,
    &linuxcnc::COMP,
    &linuxcnc_hal::HAL,
    &linuxcnc_tool::TOOL,
    &sinumerik::ENC_COMP,
    &iso230::ISO_230,
    &robot::URDF,
    &robot::UR_KINEMATICS,
    &robot::ROBOT_CALIBRATION,
    &klipper::KLIPPER,
    &firmware::GRBL,
    &firmware::MARLIN,
    &firmware::DUET,
];
