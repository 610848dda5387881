//! Settings of `path_planning`, as written and as checked.

use machine::Chain;
use serde::Deserialize;

use crate::{
    part::{Part, PartError, RawPart},
    rules::{Attitudes, MotionRules},
};

/// Most postures that each touch may be made at.
const MAX_POSTURES: usize = 32;

/// As written in the cell file, section `[path_planning]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawConfig {
    /// Axis that is moved clear of the part before the others move; empty: none is needed.
    pub clearance_axis: String,
    /// Position of that axis which is clear, when it is linear.
    pub clearance_mm: f64,
    /// Search effort: kicks of the local search.
    pub kicks: u64,
    /// How far a probing move continues behind the nominal contact before it gives up.
    pub overtravel_mm: f64,
    /// Of an arm: postures and turns that each touch may be made at, chosen from all that are possible.
    pub postures: usize,
}

impl Default for RawConfig {
    fn default() -> Self {
        Self {
            clearance_axis: String::new(),
            clearance_mm: 0.0,
            kicks: 20_000,
            overtravel_mm: 2.0,
            postures: 6,
        }
    }
}

/// As checked.
#[derive(Clone, Debug)]
pub struct Config {
    /// The machine, from its URDF.
    pub chain: Chain,
    /// The part to measure.
    pub part: Part,
    /// m; allowance left on the sizes by each pass.
    pub allowances: Vec<f64>,
    /// Index of the axis that is moved clear first (in the chain's axes), and its clear position (m).
    pub clearance: Option<(usize, f64)>,
    /// How an arm may hold the probe.
    pub attitudes: Option<Attitudes>,
    /// Kicks of the local search.
    pub kicks: u64,
    /// m; how far a probing move continues behind the nominal contact.
    pub overtravel: f64,
}

impl Config {
    /// What orders are made by.
    pub fn rules(&self) -> MotionRules<'_> {
        MotionRules {
            chain: &self.chain,
            clearance: self.clearance,
            attitudes: self.attitudes.as_ref(),
            overtravel: self.overtravel,
            kicks: self.kicks,
        }
    }
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The clearance axis is not in the machine.
    #[error("path_planning.clearance_axis = {0:?} is not an axis of the machine")]
    ClearanceAxis(String),
    /// A number out of range.
    #[error("path_planning.{key} = {value} must be a finite number{more}")]
    Number {
        /// The key.
        key: &'static str,
        /// Its value.
        value: f64,
        /// What else it must be.
        more: &'static str,
    },
    /// The part cannot be used.
    #[error(transparent)]
    Part(#[from] PartError),
}

impl RawConfig {
    /// Checks the settings against the machine and the part.
    ///
    /// # Errors
    /// [`ConfigError`] names the key.
    pub fn check(
        &self,
        chain: Chain,
        part: &RawPart,
        allowances: Vec<f64>,
    ) -> Result<Config, ConfigError> {
        let clearance = if self.clearance_axis.is_empty() {
            None
        } else {
            let index = chain
                .axis_index(&self.clearance_axis)
                .ok_or_else(|| ConfigError::ClearanceAxis(self.clearance_axis.clone()))?;
            if !self.clearance_mm.is_finite() {
                return Err(ConfigError::Number {
                    key: "clearance_mm",
                    value: self.clearance_mm,
                    more: "",
                });
            }
            Some((index, self.clearance_mm * 1e-3))
        };
        if !(self.overtravel_mm.is_finite() && self.overtravel_mm > 0.0) {
            return Err(ConfigError::Number {
                key: "overtravel_mm",
                value: self.overtravel_mm,
                more: " above 0",
            });
        }
        if !(1..=MAX_POSTURES).contains(&self.postures) {
            return Err(ConfigError::Number {
                key: "postures",
                value: self.postures as f64,
                more: " from 1 to 32",
            });
        }
        let held = part.held(&chain)?;
        let attitudes = held.map(|features| Attitudes {
            features,
            kept: self.postures,
        });
        let part = part.check(&chain)?;
        let overtravel = self.overtravel_mm * 1e-3;
        Ok(Config {
            chain,
            part,
            allowances,
            clearance,
            attitudes,
            kicks: self.kicks,
            overtravel,
        })
    }
}
