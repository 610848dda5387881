//! The dialects of this crate: one line for each.

use crate::{
    dialect::Dialect, fanuc::Fanuc, inspection::Inspection, linuxcnc::LinuxCnc,
    sinumerik::Sinumerik,
};

/// Every dialect. A result file is read by the first format that recognises it, in this order.
pub const DIALECTS: &[&dyn Dialect] = &[&Fanuc, &Inspection, &LinuxCnc, &Sinumerik];
