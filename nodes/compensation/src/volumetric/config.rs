//! Settings of `[compensation.volumetric]`.

use machine::{Chain, LinkError, LinkNameError};
use machining::location_errors::{Limits, Probe};
use serde::Deserialize;

use crate::passes::Passes;

/// As written in the cell file, section `[compensation.volumetric]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawVolumetric {
    /// Its name in verdicts and corrections.
    #[serde(default = "default_id")]
    pub id: String,
    /// Location errors that are estimated and written, by ISO 230-1 name (`EX0C`, `EA0B`).
    pub links: Vec<String>,
    /// Largest displacement of the tip that the errors found may make.
    pub tolerance_mm: f64,
    /// No entry that is a length is proposed beyond this, either sign.
    pub limit_um: f64,
    /// No entry that is an angle is proposed beyond this, either sign.
    pub limit_urad: f64,
    /// An entry that is a length counts as determined when its standard uncertainty is at most this.
    #[serde(default = "default_uncertainty_um")]
    pub uncertainty_um: f64,
    /// An entry that is an angle counts as determined when its standard uncertainty is at most this.
    #[serde(default = "default_uncertainty_urad")]
    pub uncertainty_urad: f64,
    /// No table is proposed that displaces the tip by more over the poses measured.
    #[serde(default = "default_displacement_limit")]
    pub displacement_limit_mm: f64,
    /// Effects of the probe that are estimated together with the links, so that they are not taken for them.
    #[serde(default, alias = "beside")]
    pub probe_effects: Vec<ProbeEffect>,
    /// Passes of the cycle in which it decides; none: all.
    #[serde(default)]
    pub passes: Vec<String>,
}

/// An effect of the probe, by its name in the effect vocabulary.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum ProbeEffect {
    /// The ball's centre across the mount's z.
    #[serde(rename = "probe.stylus_offset")]
    StylusOffset,
    /// The ball's centre along the mount's z.
    #[serde(rename = "probe.stylus_length")]
    StylusLength,
    /// The effective radius of the ball.
    #[serde(rename = "probe.ball_radius")]
    BallRadius,
}

fn default_id() -> String {
    "volumetric table".to_owned()
}

fn default_uncertainty_um() -> f64 {
    2.0
}

fn default_uncertainty_urad() -> f64 {
    5.0
}

fn default_displacement_limit() -> f64 {
    0.5
}

/// As checked: m, rad.
#[derive(Clone, Debug)]
pub struct Volumetric {
    /// Its name in verdicts and corrections.
    pub id: String,
    /// Kinematic chain of the machine.
    pub chain: Chain,
    /// The entries.
    pub links: Vec<LinkError>,
    /// Their names.
    pub names: Vec<String>,
    /// Effects of the probe that are estimated together with them.
    pub probe: Probe,
    /// m; largest displacement that qualifies.
    pub tolerance: f64,
    /// Largest values proposed, either sign.
    pub bounds: Limits,
    /// Largest standard uncertainties with which entries count as determined.
    pub uncertainty_limits: Limits,
    /// m; largest displacement by a table that is proposed.
    pub displacement_limit: f64,
    /// Passes in which it decides.
    pub passes: Passes,
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum VolumetricError {
    /// Nothing to estimate.
    #[error("compensation.volumetric.links is empty: no entry of the table is estimated")]
    NoLinks,
    /// A name that is no location error of this machine.
    #[error("compensation.volumetric.links: {0}")]
    Link(#[from] LinkNameError),
    /// A name listed twice.
    #[error("compensation.volumetric.links: {0:?} is listed twice")]
    Twice(String),
}

impl RawVolumetric {
    /// The numbers that must be above 0, by key.
    pub(crate) fn numbers(&self) -> [(String, f64); 6] {
        [
            ("tolerance_mm", self.tolerance_mm),
            ("limit_um", self.limit_um),
            ("limit_urad", self.limit_urad),
            ("uncertainty_um", self.uncertainty_um),
            ("uncertainty_urad", self.uncertainty_urad),
            ("displacement_limit_mm", self.displacement_limit_mm),
        ]
        .map(|(key, value)| (format!("volumetric.{key}"), value))
    }

    /// Checks the settings against the machine; `passes` are those in which it decides.
    pub(crate) fn check(
        &self,
        chain: &Chain,
        passes: Passes,
    ) -> Result<Volumetric, VolumetricError> {
        if self.links.is_empty() {
            return Err(VolumetricError::NoLinks);
        }
        let mut links = Vec::new();
        for (index, name) in self.links.iter().enumerate() {
            if self.links[..index].contains(name) {
                return Err(VolumetricError::Twice(name.clone()));
            }
            links.push(LinkError::named(chain, name, 0.0)?);
        }
        Ok(Volumetric {
            id: self.id.clone(),
            chain: chain.clone(),
            links,
            names: self.links.clone(),
            probe: Probe {
                stylus_offset: self.probe_effects.contains(&ProbeEffect::StylusOffset),
                stylus_length: self.probe_effects.contains(&ProbeEffect::StylusLength),
                ball_radius: self.probe_effects.contains(&ProbeEffect::BallRadius),
            },
            tolerance: self.tolerance_mm * 1e-3,
            bounds: Limits {
                shift: self.limit_um * 1e-6,
                turn: self.limit_urad * 1e-6,
            },
            uncertainty_limits: Limits {
                shift: self.uncertainty_um * 1e-6,
                turn: self.uncertainty_urad * 1e-6,
            },
            displacement_limit: self.displacement_limit_mm * 1e-3,
            passes,
        })
    }
}
