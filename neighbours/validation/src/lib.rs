//! Validation: sessions whose cause is known, and what the diagnosis makes of them. `probecell-validation` prints both
//! (`probecell blind`, `probecell scenario`).
//!
//! - [`blind`]: a plant that shares no code with the signatures makes sessions from a seed and seals their truth; a
//!   scorecard and a trial of further touches judge what is found.
//! - [`scenarios`]: the register of known gaps between a cell and its model, each run in a simulated cell and judged.
//!
//! ```text
//!   seed --> blind: machine, part, plan, causes --> Session --> diagnosis --> Report
//!                             |                                                 |
//!                             +--> Truth, sealed ------> card: found, coverage, calibration of probabilities
//!   register of known gaps --> scenarios: one effect in a simulated cell --> figures against the source's
//! ```
//!
//! ```
//! use diagnosis::{Options, diagnose};
//! use validation::blind::{Content, session};
//!
//! let (session, truth) = session(3, Content::Known(1));
//! let report = diagnose(&session, &Options::default())?;
//! println!("hidden: {:?}\n{report}", truth.effects);
//! # Ok::<(), diagnosis::SessionError>(())
//! ```

pub mod blind;
pub mod scenarios;
