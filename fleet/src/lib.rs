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

/// An error as one sentence; causes that it already contains are left out.
pub fn sentence(error: &anyhow::Error) -> String {
    let mut sentence = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if !sentence.contains(&cause) {
            sentence = if sentence.is_empty() {
                cause
            } else {
                format!("{sentence}: {cause}")
            };
        }
    }
    sentence.replace('\n', " ")
}
