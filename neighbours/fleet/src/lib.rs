//! The sessions of many machines: kept as Parquet, diagnosed again, and watched over months.
//!
//! ```text
//!   recordings --> bag (rows: touches, features, decisions, effects ...) --> lake (Parquet by month) --> any reader
//!                                                                              |         |
//!                                                                              |        sql: questions, with diagnosis and trends as functions
//!                                       trend: since when an effect has changed, and when it leaves its limit
//!   cluster: new diagnoses of the sessions of a lake on many computers
//!   worker: names of recordings in, diagnoses out, as Arrow IPC
//! ```
//!
//! Metres, radians, seconds; instants are µs since 1970, UTC.

mod answer;
mod bag;
#[cfg(feature = "cluster")]
pub mod cluster;
pub mod diagnose;
pub mod lake;
mod parallel;
pub mod sql;
pub mod trend;
pub mod worker;
pub mod year;

pub use terminal::sentence;
