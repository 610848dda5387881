//! How a milling tool runs out: its effective radius along its axis.
//!
//! `docs/source_systems.md, E.2`: ΔR(Z) = b0 + max_k [ρ cos(θ_k − λ) + τ (h0 − Z) cos(θ_k − ψ)], θ_k = 2πk/N − Z tanβ
//! / R, with Z the height above the tip. m, rad.

use serde::Deserialize;

/// As written in the cell file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawRunout {
    /// Radius of the tool.
    pub radius_mm: f64,
    /// Teeth.
    pub teeth: u32,
    /// Helix angle.
    pub helix_deg: f64,
    /// Constant error of the radius, b0.
    #[serde(default)]
    pub offset_um: f64,
    /// Eccentricity ρ.
    #[serde(default)]
    pub eccentricity_um: f64,
    /// Its direction λ.
    #[serde(default)]
    pub eccentricity_deg: f64,
    /// Tilt τ of the tool against the spindle.
    #[serde(default)]
    pub tilt_urad: f64,
    /// Its direction ψ.
    #[serde(default)]
    pub tilt_deg: f64,
    /// Height h0 above the tip where the tilt does nothing.
    #[serde(default)]
    pub pivot_mm: f64,
}

/// As checked.
#[derive(Clone, Debug)]
pub struct Runout {
    raw: RawRunout,
}

impl RawRunout {
    /// Takes the settings over; a tool without teeth runs true.
    pub(crate) fn check(&self) -> Runout {
        Runout { raw: self.clone() }
    }
}

impl Runout {
    /// Change of the effective radius (m) at a height (m) above the tip.
    pub fn radius_change(&self, height: f64) -> f64 {
        let raw = &self.raw;
        let twist = height * raw.helix_deg.to_radians().tan() / (raw.radius_mm * 1e-3).max(1e-6);
        let tooth = |k: u32| {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(raw.teeth) - twist;
            raw.eccentricity_um * 1e-6 * (angle - raw.eccentricity_deg.to_radians()).cos()
                + raw.tilt_urad
                    * 1e-6
                    * (raw.pivot_mm * 1e-3 - height)
                    * (angle - raw.tilt_deg.to_radians()).cos()
        };
        let longest = (0..raw.teeth).map(tooth).fold(f64::NEG_INFINITY, f64::max);
        raw.offset_um * 1e-6 + if raw.teeth > 0 { longest } else { 0.0 }
    }
}
