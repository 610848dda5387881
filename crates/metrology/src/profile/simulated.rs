//! The simulated profile of `docs/source_systems.md, B.5`: nominal curve, and deviations with the published extremes
//! and mean.
//!
//! Lengths in m. The control points and the shape of the deviation are assumptions by which a simulator runs.

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use super::{ProfileDeviation, ProfileError, Spline, SplineError};

/// Control points of the nominal profile, mm.
const CONTROL_MM: [[f64; 2]; 15] = [
    [0.0, 0.0],
    [-11.1981, 10.349],
    [-19.2765, 25.8011],
    [-19.133, 43.2366],
    [-7.9342, 58.12],
    [7.9432, 68.041],
    [21.9773, 78.3884],
    [30.9091, 91.8545],
    [30.6271, 107.4465],
    [22.5478, 122.8988],
    [16.312, 137.9255],
    [17.4471, 151.2497],
    [25.5282, 161.0306],
    [36.4435, 166.2748],
    [46.5079, 167.8329],
];

/// Points measured on the profile.
pub const POINTS: usize = 200;

/// The nominal profile: cubic, uniform clamped knots, 213.640 mm long, outward normal left of travel.
///
/// # Errors
/// None in practice; the control points are fixed.
pub fn nominal() -> Result<Spline, SplineError> {
    let control: Vec<Vector2<f64>> = CONTROL_MM
        .iter()
        .map(|[x, y]| Vector2::new(x * 1e-3, y * 1e-3))
        .collect();
    Spline::clamped_uniform(&control)
}

/// Parameters of T = a + b·h(w).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Systematic {
    /// w: where the shape leaves its plateau, in points.
    pub knee: f64,
    /// a, m.
    pub offset: f64,
    /// b, m.
    pub amplitude: f64,
}

/// h at point i = 1…200 for the knee w, dimensionless.
fn shape(i: usize, knee: f64) -> f64 {
    let i = i as f64;
    let rise = 1.0 + (-(i - 6.0) / 4.0).exp();
    let fall = 1.0 + ((i - knee) / 7.0).exp();
    let wave = if i > 120.0 {
        0.10 * (std::f64::consts::TAU * (i - 120.0) / 80.0).sin()
    } else {
        0.0
    };
    -1.0 / (rise * fall) + wave
}

impl Systematic {
    /// T in m at the 200 points.
    pub fn deviations(&self) -> Vec<f64> {
        (1..=POINTS)
            .map(|i| self.offset + self.amplitude * shape(i, self.knee))
            .collect()
    }

    /// The parameters for which T plus `noise` (m, 200 values) has mean, minimum and maximum of `target`.
    ///
    /// # Errors
    /// A noise of another length or not finite, or a target that this shape cannot have.
    pub fn solve(target: &ProfileDeviation, noise: &[f64]) -> Result<Self, ProfileError> {
        if noise.len() != POINTS {
            return Err(ProfileError::TooFewPoints {
                needed: POINTS,
                given: noise.len(),
            });
        }
        ProfileDeviation::of(noise)?;
        let height = target.height();
        let with_knee = |knee: f64| -> (Self, f64) {
            let shapes: Vec<f64> = (1..=POINTS).map(|i| shape(i, knee)).collect();
            let summary = |amplitude: f64| {
                let values = shapes.iter().zip(noise).map(|(h, e)| amplitude * h + e);
                values.fold((f64::INFINITY, f64::NEG_INFINITY, 0.0), |(l, h, s), v| {
                    (v.min(l), v.max(h), s + v / POINTS as f64)
                })
            };
            // The height grows with the amplitude.
            let excess = |amplitude: f64| {
                let (low, high, _) = summary(amplitude);
                high - low - height
            };
            let amplitude = bisect(0.0, 10.0 * height, excess);
            let (low, _, mean) = summary(amplitude);
            let found = Self {
                knee,
                offset: target.min - low,
                amplitude,
            };
            (found, mean + found.offset)
        };
        let miss = |knee: f64| target.mean - with_knee(knee).1;
        // The later the knee, the longer the low plateau and the lower the mean.
        let (early, late) = (20.0, 180.0);
        if miss(early) > 0.0 || miss(late) < 0.0 {
            return Err(ProfileError::Undetermined);
        }
        Ok(with_knee(bisect(early, late, miss)).0)
    }
}

/// Root of an ascending function between `low` and `high`.
fn bisect(mut low: f64, mut high: f64, function: impl Fn(f64) -> f64) -> f64 {
    // Sixty halvings reach the rounding of any of the intervals here.
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if function(middle) > 0.0 {
            high = middle;
        } else {
            low = middle;
        }
    }
    f64::midpoint(low, high)
}
