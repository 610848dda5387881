//! The sessions of many machines: kept as Parquet, diagnosed again, and watched over months.
//!
//! ```text
//!   recordings --> bag (rows: touches, features, decisions, effects ...) --> lake (Parquet by month) --> any reader
//!                                                                              |
//!                                       trend: since when an effect has changed, and when it leaves its limit
//! ```
//!
//! Metres, radians, seconds; instants are µs since 1970, UTC.

mod bag;
pub mod diagnose;
pub mod lake;
pub mod trend;
pub mod year;

pub use recorded::sentence;
