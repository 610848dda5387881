//! Run-out of a fluted cutter: the radius that a tool, clamped off its axis and leaning, sweeps at each height.
//!
//! Metres and radians. `docs/source_systems.md, E.2`: ΔR(Z) = b0 + max_k [ρ cos(θ_k(Z) − λ) + τ(h0 − Z) cos(θ_k(Z) −
//! ψ)], θ_k = 2πk/N − Z tan β/R. Between heights where another flute reaches farthest it has kinks.

use serde::{Deserialize, Serialize};

/// Heights of the planar test, 15 of them, 3 mm apart, m (E.1).
pub fn test_heights() -> Vec<f64> {
    (1..=15).map(|i| 3e-3 * f64::from(i)).collect()
}

/// How a tool runs out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Runout {
    /// R: nominal radius, m.
    pub radius: f64,
    /// N: flutes.
    pub flutes: u32,
    /// β: helix angle, rad.
    pub helix: f64,
    /// ρ: distance of the tool's axis from the spindle's at h0, m.
    pub offset: f64,
    /// λ: direction of that offset, rad.
    pub offset_direction: f64,
    /// τ: lean of the tool's axis, rad.
    pub lean: f64,
    /// ψ: direction of the lean, rad.
    pub lean_direction: f64,
    /// h0: height of the clamping over the tip, m.
    pub clamped_at: f64,
    /// b0: what the radius itself is off, m.
    pub constant: f64,
}

impl Default for Runout {
    /// The tool of E.2: Ø20, three flutes, 45°.
    fn default() -> Self {
        Self {
            radius: 0.010,
            flutes: 3,
            helix: std::f64::consts::FRAC_PI_4,
            offset: 9e-6,
            offset_direction: 0.6,
            lean: 9e-5,
            lean_direction: 2.0,
            clamped_at: 0.080,
            constant: 4e-6,
        }
    }
}

impl Runout {
    /// ΔR at a height over the tip, both m.
    pub fn radius_error(&self, height: f64) -> f64 {
        let flutes = self.flutes.max(1);
        let reach = |flute: u32| {
            let angle = std::f64::consts::TAU * f64::from(flute) / f64::from(flutes)
                - height * self.helix.tan() / self.radius;
            self.offset * (angle - self.offset_direction).cos()
                + self.lean * (self.clamped_at - height) * (angle - self.lean_direction).cos()
        };
        self.constant + (0..flutes).map(reach).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Height after which the flutes repeat: 2πR/(N tan β), m.
    pub fn period(&self) -> f64 {
        std::f64::consts::TAU * self.radius / (f64::from(self.flutes.max(1)) * self.helix.tan())
    }
}
