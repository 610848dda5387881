//! Formats of other measuring systems: what a cell has measured goes out in them, and plans and results come in. Nothing is computed
//! here; a number is that of the recording or of the file, in the unit that a format asks for.
//!
//! ```text
//! a session's record --> exchange::export::Record --> export::{qif, dmis, aqdef}, connector::mtconnect
//! QIF, DMIS --> import --> a plan, points that an instrument has measured
//! ```

pub mod export;
pub mod import;
