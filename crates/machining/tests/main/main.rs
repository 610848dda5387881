//! Calibration, flank milling and mismatch against hidden errors and the figures of the sources.
//!
//! - `calibration`: links found from touches of balls, against the hidden errors that made the touches
//! - `flank`: flank milling against the figures of the source and the true envelope
//! - `mismatch`: surface mismatch against the figures of the source and rank theory

mod calibration;
mod flank;
mod mismatch;
