//! Import from and export to other systems, by tables: text in, messages of the contract out, and the reverse.
//!
//! ```text
//! CSV of touches, of a CMM (reference) --+
//! ROS 2: positions and contacts ---------+--> import::Imported --> a session (written by the command)
//! ISO 230-2, circular test, R-test ------+
//!
//! a session's record --> export::Record --> CSV
//! ```
//!
//! `neighbours/formats` has QIF, DMIS, AQDEF and MTConnect, in the types of this crate.
//!
//! Nothing is guessed and nothing is lost silently: units are named by the caller, a value that is wrong is named with line and
//! column, and rows that are read and refused are counted. Lengths are m, angles rad, times s in every type of this crate.
//!
//! ```
//! use exchange::units::{Quantity, Units};
//!
//! let units = Units::parse("length=mm,angle=deg")?;
//! assert_eq!(units.of(Quantity::Length)?, ("mm", 1e-3)); // m
//! assert_eq!(units.of(Quantity::Deviation)?, ("mm", 1e-3)); // as the length, where it is not named
//! let unknown = units.of(Quantity::Temperature).unwrap_err();
//! assert!(unknown.to_string().starts_with("the unit of temperature is not known"));
//! # Ok::<(), exchange::ImportError>(())
//! ```

mod error;
pub mod export;
pub mod import;
pub mod table;
pub mod text;
pub mod units;

pub use error::ImportError;
