//! The radius that a tool has at each height, as a planar test finds it.
//!
//! Metres; R_i = R + ΔR_i. `docs/source_systems.md, E.1`: (9) ΔR_i = −Δy_i, Δy the deviation of the milled face along
//! its outward normal. A set-up offset of that face passes for radius (limit (ii)); milling both sides of a rib
//! removes it. What tilts or shifts both faces alike cancels, what widens the rib does not.

use serde::{Deserialize, Serialize};

/// Why a profile cannot be formed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ProfileError {
    /// Lists that do not belong together.
    #[error("{heights} heights, but {deviations} deviations")]
    Unequal {
        /// Heights given.
        heights: usize,
        /// Deviations given.
        deviations: usize,
    },
    /// Nothing given.
    #[error("a radius profile needs at least one height")]
    Empty,
    /// A number that is not finite.
    #[error("height or deviation {0} is not finite")]
    NotFinite(usize),
    /// Heights out of order.
    #[error("heights must ascend; height {0} does not")]
    Order(usize),
}

/// ΔR over the height of a tool.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RadiusProfile {
    heights: Vec<f64>,
    errors: Vec<f64>,
}

impl RadiusProfile {
    /// ΔR (m) at ascending heights (m).
    ///
    /// # Errors
    /// See [`ProfileError`].
    pub fn new(heights: &[f64], errors: &[f64]) -> Result<Self, ProfileError> {
        if heights.len() != errors.len() {
            return Err(ProfileError::Unequal {
                heights: heights.len(),
                deviations: errors.len(),
            });
        }
        if heights.is_empty() {
            return Err(ProfileError::Empty);
        }
        let finite = |i: &usize| !(heights[*i].is_finite() && errors[*i].is_finite());
        if let Some(place) = (0..heights.len()).find(finite) {
            return Err(ProfileError::NotFinite(place));
        }
        if let Some(place) = (1..heights.len()).find(|&i| heights[i] <= heights[i - 1]) {
            return Err(ProfileError::Order(place));
        }
        Ok(Self {
            heights: heights.to_vec(),
            errors: errors.to_vec(),
        })
    }

    /// (9) from the deviations (m) of one face: takes a set-up offset for radius.
    ///
    /// # Errors
    /// See [`ProfileError`].
    pub fn from_one_face(heights: &[f64], deviations: &[f64]) -> Result<Self, ProfileError> {
        let errors: Vec<f64> = deviations.iter().map(|dy| -dy).collect();
        Self::new(heights, &errors)
    }

    /// ΔR = −(Δy₊ + Δy₋)/2 from both faces of a rib, each along its own outward normal (m).
    ///
    /// # Errors
    /// See [`ProfileError`].
    pub fn from_two_faces(
        heights: &[f64],
        plus: &[f64],
        minus: &[f64],
    ) -> Result<Self, ProfileError> {
        if plus.len() != minus.len() {
            return Err(ProfileError::Unequal {
                heights: plus.len(),
                deviations: minus.len(),
            });
        }
        let errors: Vec<f64> = plus
            .iter()
            .zip(minus)
            .map(|(p, m)| -(p + m) / 2.0)
            .collect();
        Self::new(heights, &errors)
    }

    /// Heights of the profile, m.
    pub fn heights(&self) -> &[f64] {
        &self.heights
    }

    /// ΔR at those heights, m.
    pub fn errors(&self) -> &[f64] {
        &self.errors
    }

    /// ΔR (m) at a height (m): linear between the heights of the profile, constant beyond its ends.
    pub fn at(&self, height: f64) -> f64 {
        let after = self.heights.partition_point(|&known| known < height);
        match (after.checked_sub(1), self.heights.get(after)) {
            (None, _) => self.errors[0],
            (Some(before), None) => self.errors[before],
            (Some(before), Some(&upper)) => {
                let lower = self.heights[before];
                let share = (height - lower) / (upper - lower);
                self.errors[before] + share * (self.errors[after] - self.errors[before])
            }
        }
    }

    /// Offset (m) and lean (rad) of the line a + bZ nearest the profile between two heights; a lean of 0 where fewer
    /// than two heights lie between.
    pub fn line(&self, from: f64, to: f64) -> (f64, f64) {
        let used: Vec<(f64, f64)> = self
            .heights
            .iter()
            .copied()
            .zip(self.errors.iter().copied())
            .filter(|(height, _)| (from..=to).contains(height))
            .collect();
        if used.is_empty() {
            return (self.at(f64::midpoint(from, to)), 0.0);
        }
        let n = used.len() as f64;
        let mean_height = used.iter().map(|(z, _)| z).sum::<f64>() / n;
        let mean_error = used.iter().map(|(_, e)| e).sum::<f64>() / n;
        let spread: f64 = used.iter().map(|(z, _)| (z - mean_height).powi(2)).sum();
        if spread == 0.0 {
            return (mean_error, 0.0);
        }
        let along: f64 = used
            .iter()
            .map(|(z, e)| (z - mean_height) * (e - mean_error))
            .sum();
        let lean = along / spread;
        (mean_error - lean * mean_height, lean)
    }
}
