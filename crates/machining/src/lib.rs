//! What a cutter leaves on the part: prediction of machined surfaces, and tests that a machine cuts and measures itself.
//!
//! Metres and radians, part frame; a deviation is positive where material is left. Source systems D
//! ([`mismatch`]: five-axis validation by surface mismatch; [`calibration`]: the link errors themselves, by touches of
//! balls) and E ([`flank`]: accuracy of flank milling). Chains and
//! their errors come from `machine`. No cutting forces, no messages, no files; what is random starts from a seed.

pub mod calibration;
pub mod flank;
pub mod mismatch;

/// Root mean square; 0 of nothing.
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}
