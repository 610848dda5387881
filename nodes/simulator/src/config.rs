//! Settings of the simulated turn-mill.

use std::collections::BTreeMap;

use machine::Chain;
use serde::{Deserialize, Serialize};

use crate::probe;

/// As written in the cell file, section `[simulator]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawConfig {
    /// Seed of all randomness.
    pub seed: u64,
    /// Axis positions at the start, by axis name.
    #[serde(default)]
    pub home: BTreeMap<String, HomePosition>,
    /// The true probe.
    pub probe: RawProbe,
    /// How tools cut.
    pub plant: RawPlant,
    /// The tools.
    pub tools: Vec<RawTool>,
    /// The sizes of the part.
    pub sizes: Vec<RawSize>,
    /// The operations that cut them.
    pub operations: Vec<RawOperation>,
    /// The reference instrument that measures each measured part again; none if absent.
    pub cmm: Option<RawCmm>,
    /// Something that goes wrong.
    pub fault: Option<RawFault>,
}

/// A home position in the unit of its axis.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, untagged)]
pub enum HomePosition {
    /// Of a linear axis.
    Linear {
        /// Position.
        position_mm: f64,
    },
    /// Of a rotary axis.
    Rotary {
        /// Position.
        position_deg: f64,
    },
}

/// The true probe against what the controller has stored of it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawProbe {
    /// True ball centre less the stored one, in `probe_mount`.
    pub center_error_um: [f64; 3],
    /// True ball radius less the stored one.
    pub radius_error_um: f64,
    /// Standard deviation of one touch.
    pub touch_sd_um: f64,
    /// Run the calibration cycle (source systems A.5) at the start.
    #[serde(default)]
    pub calibrated: bool,
    /// Error of the diameter of the gauge that the calibration trusts.
    #[serde(default)]
    pub gauge_error_um: f64,
}

/// How tools cut (source systems A.4, plant).
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawPlant {
    /// Share of the depth of cut that springs back.
    pub spring_back: f64,
    /// Standard deviation of a size cut.
    pub cut_sd_um: f64,
    /// Error of the diameter near the chuck and at the free end after rough turning (source systems A.6).
    #[serde(default)]
    pub deflection_um: [f64; 2],
    /// Length over which it grows, from the part's origin.
    #[serde(default = "default_length")]
    pub deflection_length_mm: f64,
    /// Share of that error that a finishing cut leaves.
    #[serde(default = "default_finish_share")]
    pub finish_share: f64,
}

fn default_length() -> f64 {
    90.0
}

fn default_finish_share() -> f64 {
    0.1
}

/// A tool: what it leaves too much, and the wear offset that the controller starts with.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawTool {
    /// Its number.
    pub number: u32,
    /// Material that it leaves on a size when its offsets are right.
    pub error_um: f64,
    /// Wear offset at the start (on the size).
    #[serde(default)]
    pub wear_um: f64,
}

/// A size of the part.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawSize {
    /// Its name.
    pub id: String,
    /// The features that carry it: one round one, or the two planes of a width.
    pub features: Vec<String>,
    /// Drawing size.
    pub nominal_mm: f64,
    /// Size before machining.
    pub stock_mm: f64,
    /// What the reference instrument finds too much on this size alone: the residuals of the source's Tables 3 and 4,
    /// which lie within its repeatability.
    #[serde(default)]
    pub cmm_residual_um: f64,
}

/// An operation.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawOperation {
    /// Its name.
    pub id: String,
    /// Tool that cuts.
    pub tool_number: u32,
    /// Sizes that it cuts.
    pub sizes: Vec<String>,
    /// Allowance that it leaves.
    #[serde(default)]
    pub allowance_mm: f64,
    /// It turns a part that is held at one end: the part bends away.
    #[serde(default)]
    pub turning: bool,
    /// It is a finishing cut.
    #[serde(default)]
    pub finish: bool,
    /// How long it takes.
    pub duration_s: f64,
    /// Spindle speed.
    pub spindle_rpm: f64,
}

/// The reference instrument.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawCmm {
    /// Its name.
    pub instrument: String,
    /// Standard uncertainty of a deviation, as it declares it.
    pub standard_uncertainty_um: f64,
    /// Standard deviation of its single touches; what else it errs is common to a size.
    #[serde(default)]
    pub touch_sd_um: f64,
}

/// Something that goes wrong after some touches.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawFault {
    /// What.
    pub kind: Injected,
    /// Touches of the session before it does.
    #[serde(default)]
    pub after_touches: u32,
}

/// What can go wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Injected {
    /// The probe does not trigger.
    DeadProbe,
    /// The probe stays triggered.
    StuckProbe,
    /// The probe triggers in a move that is not a probing move.
    UnplannedTouch,
    /// Somebody presses the button.
    Estop,
    /// The controller says nothing more.
    Silence,
}

/// As checked: m, rad, s.
#[derive(Clone, Debug)]
pub struct Config {
    /// The machine, from its URDF.
    pub chain: Chain,
    /// Axis positions at the start, in the order of the chain's axes.
    pub home: Vec<f64>,
    /// m; true ball centre less the stored one in `probe_mount`, after the calibration if there is one.
    pub center_error: [f64; 3],
    /// m; true radius of the stylus ball less the stored one, after the calibration if there is one.
    pub radius_error: f64,
    /// As written, lengths still in the units of their names.
    pub raw: RawConfig,
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// A number out of range.
    #[error("simulator.{0}")]
    Number(String),
    /// A home position of an axis that the machine lacks, or in the unit of the other kind of axis.
    #[error(
        "simulator.home.{0}: not an axis of the machine, or mm for a rotary or deg for a linear axis"
    )]
    Home(String),
    /// A name that is not defined.
    #[error("simulator.{place}: {kind} {name:?} is not defined")]
    Unknown {
        /// Where.
        place: String,
        /// Kind of thing.
        kind: &'static str,
        /// Its name.
        name: String,
    },
}

impl RawConfig {
    /// Checks the settings against the machine and the radius of the stylus ball as the plan has it (m).
    pub fn check(&self, chain: Chain, stylus_radius: f64) -> Result<Config, ConfigError> {
        let mut home: Vec<f64> = (0..chain.axes().len())
            .map(|index| {
                chain
                    .axis(index)
                    .limits
                    .map_or(0.0, |(lower, upper)| 0.0_f64.clamp(lower, upper))
            })
            .collect();
        for (name, position) in &self.home {
            let bad = || ConfigError::Home(name.clone());
            let index = chain.axis_index(name).ok_or_else(bad)?;
            home[index] = match (position, chain.axis(index).kind) {
                (HomePosition::Linear { position_mm }, machine::JointKind::Prismatic) => {
                    position_mm * 1e-3
                }
                (HomePosition::Rotary { position_deg }, machine::JointKind::Revolute) => {
                    position_deg.to_radians()
                }
                _ => return Err(bad()),
            };
        }
        self.check_numbers()?;
        self.check_names()?;
        let ball_radius = stylus_radius + self.probe.radius_error_um * 1e-6;
        let (center_error, radius_error) = probe::stored(self, ball_radius);
        Ok(Config {
            chain,
            home,
            center_error,
            radius_error,
            raw: self.clone(),
        })
    }

    fn check_numbers(&self) -> Result<(), ConfigError> {
        let not_negative = [
            ("probe.touch_sd_um", self.probe.touch_sd_um),
            ("plant.cut_sd_um", self.plant.cut_sd_um),
            (
                "cmm.standard_uncertainty_um",
                self.cmm
                    .as_ref()
                    .map_or(0.0, |cmm| cmm.standard_uncertainty_um),
            ),
            (
                "cmm.touch_sd_um",
                self.cmm.as_ref().map_or(0.0, |cmm| cmm.touch_sd_um),
            ),
        ];
        for (key, value) in not_negative {
            if !(value.is_finite() && value >= 0.0) {
                return Err(ConfigError::Number(format!(
                    "{key} = {value} must be a finite number that is not negative"
                )));
            }
        }
        if !(0.0..1.0).contains(&self.plant.spring_back) {
            let value = self.plant.spring_back;
            return Err(ConfigError::Number(format!(
                "plant.spring_back = {value} must be at least 0 and below 1"
            )));
        }
        for operation in &self.operations {
            if !(operation.duration_s.is_finite() && operation.duration_s > 0.0) {
                let (id, value) = (&operation.id, operation.duration_s);
                return Err(ConfigError::Number(format!(
                    "operations.{id}.duration_s = {value} must be above 0"
                )));
            }
        }
        Ok(())
    }

    fn check_names(&self) -> Result<(), ConfigError> {
        for operation in &self.operations {
            let place = format!("operations.{}", operation.id);
            if !self
                .tools
                .iter()
                .any(|tool| tool.number == operation.tool_number)
            {
                return Err(ConfigError::Unknown {
                    place,
                    kind: "tool",
                    name: operation.tool_number.to_string(),
                });
            }
            for size in &operation.sizes {
                if !self.sizes.iter().any(|known| known.id == *size) {
                    return Err(ConfigError::Unknown {
                        place,
                        kind: "size",
                        name: size.clone(),
                    });
                }
            }
        }
        Ok(())
    }
}
