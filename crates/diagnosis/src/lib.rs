//! Why a session differs from the declared model of its cell: `bag -> answer`.
//!
//! ```text
//!   bag -- Session ------------------------------------------------------------------------ Report -->
//!             |                                                                               ^
//!        effects::observe      rows: deviation of each touch from the chain                   |
//!             |                                                                               |
//!        attribution           candidates, scans of shapes, beam search, discrepancies:       |
//!             |                a posterior over sets of effects (inference)                   |
//!        diagnose              outliers, second order of curved surfaces                      |
//!             |                                                                               |
//!        diagnose::reporter    named effects, equivalence classes, parameters, cross-validation, next touches
//!
//!   several sessions of touches:  joint   (blocks, forward selection, cross-validation)  -> Report
//!   measurements of one recording:  recording  (equal plans averaged, changes found, then joint)  -> Report
//!   sessions of drives:           drives  (regression over time, cross-validation)       -> Report
//!   arms in motion:               arm     (dynamics of the whole tree, servos simulated)  -> Report
//!   time of the moves:            time     (measured less promised durations, limits of the motion model)  -> Report
//!   part measured by a reference: referenced  (reading less reference, reference less plan, each diagnosed)
//! ```
//!
//! [`diagnose`] names the effects of the vocabulary that explain the difference with their parameters and 95 % intervals
//! (GUM, JCGM 100:2008), the effects that cannot be distinguished from them, and whether an unknown cause remains and where.
//! Metres, radians, seconds. Pure and deterministic: no files, no clock, no randomness.
//!
//! A session that cannot be diagnosed is refused with a sentence that names what is missing:
//!
//! ```
//! use diagnosis::{Options, Session, diagnose};
//!
//! let refusal = diagnose(&Session::default(), &Options::default()).unwrap_err();
//! assert_eq!(refusal.to_string(), "the session has no robot_description");
//! ```
//!
//! A report is plain data; its text is for people:
//!
//! ```
//! assert_eq!(
//!     diagnosis::in_display_units("dx", 3.5e-6, "m", Some([3.4e-6, 3.6e-6])),
//!     "dx = 3.50 ± 0.10 µm"
//! );
//! ```

mod arm;
pub mod attribution;
mod blocks;
pub mod diagnose;
pub mod drives;
mod families;
pub mod joint;
mod nonnegativity;
pub mod onset;
mod options;
pub mod recording;
mod referenced;
pub mod report;
pub mod time;

pub use diagnose::{diagnose, diagnose_with_residuals};
pub use effects::{DeclaredEffect, DeclaredError, Session, SessionError};
pub use joint::diagnose_together_with_residuals;
pub use options::Options;
pub use referenced::{is_of_cutting, reading};
pub use report::numbers::in_display_units;
pub use report::residuals::{self, Residuals};
pub use report::{Report, Verdict};
pub use time::diagnose_time;
