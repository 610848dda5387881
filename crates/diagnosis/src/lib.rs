//! Why a session differs from the declared model of its cell.
//!
//! [`diagnose`] compares what was measured with what the chain predicts and names the effects of the vocabulary that
//! explain the difference, or says that something unknown remains and where. Metres, radians, seconds. Pure and
//! deterministic: no files, no clock, no randomness.

mod alternatives;
pub mod attribution;
mod beside;
pub mod blind;
pub mod candidate;
mod checks;
mod columns;
pub mod declared;
mod design;
pub mod diagnose;
pub mod drives;
pub mod effects;
pub mod evidence;
pub mod groups;
mod growth;
pub mod identifiability;
pub mod joined;
pub mod joint;
pub mod next;
mod noise;
pub mod observation;
pub mod outliers;
pub mod parameters;
pub mod places;
mod pool;
mod referenced;
pub mod report;
pub mod residuals;
pub mod rivals;
mod scan;
pub mod search;
pub mod session;
pub mod shrinkage;
mod summary;
mod support;
pub mod timing;
pub mod vocabulary;
pub mod words;

pub use declared::{DeclaredEffect, DeclaredError};
pub use diagnose::{Options, diagnose, diagnose_with_residuals};
pub use drives::diagnose_drives;
pub use joint::{diagnose_joint, diagnose_together, diagnose_together_with_residuals};
pub use report::{Report, Verdict};
pub use residuals::Residuals;
pub use session::{DiagnoseError, Session};
pub use summary::in_shop_units;
