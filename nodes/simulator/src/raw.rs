//! Settings of the simulated machine as written in the cell file.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::{tool::RawRunout, truth::RawMachine};

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
    /// True errors of the machine, which its robot description does not have.
    #[serde(default)]
    pub machine: RawMachine,
    /// The tools.
    #[serde(default)]
    pub tools: Vec<RawTool>,
    /// The sizes of the part.
    #[serde(default)]
    pub sizes: Vec<RawSize>,
    /// Features whose true surface is given point by point.
    #[serde(default)]
    pub surfaces: Vec<RawSurface>,
    /// The operations that cut them.
    #[serde(default)]
    pub operations: Vec<RawOperation>,
    /// The reference instrument that measures every part after the machine; none if absent.
    pub cmm: Option<RawCmm>,
    /// A fault to inject.
    pub fault: Option<RawFault>,
    /// s that the machine takes to stand after a stop command; only then does the driver confirm it.
    #[serde(default)]
    pub stop_s: f64,
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

/// The true probe against the values that the controller has stored.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawProbe {
    /// True minus stored ball centre, in `probe_mount`.
    pub center_error_um: [f64; 3],
    /// True minus stored ball radius.
    pub radius_error_um: f64,
    /// Standard deviation of one touch.
    pub touch_sd_um: f64,
    /// Run the calibration cycle (`docs/source_systems.md, A.5`) at the start.
    #[serde(default)]
    pub calibrated: bool,
    /// Error of the diameter of the gauge that the calibration trusts.
    #[serde(default)]
    pub gauge_error_um: f64,
}

/// How tools cut (`docs/source_systems.md, A.4`, plant).
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawPlant {
    /// Share of the depth of cut that springs back.
    pub spring_back: f64,
    /// Standard deviation of a size cut.
    pub cut_sd_um: f64,
    /// Error of the diameter near the chuck and at the free end after rough turning (`docs/source_systems.md, A.6`).
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

/// A tool: the material that it leaves in excess, and its wear offset at the start.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawTool {
    /// Its number.
    pub number: u32,
    /// Error of a size that it cuts when its offsets are right; positive leaves material.
    pub error_um: f64,
    /// Wear offset at the start (on the size).
    #[serde(default)]
    pub wear_um: f64,
    /// What each of its cuts adds to its error.
    #[serde(default)]
    pub wear_per_cut_um: f64,
    /// Its edge breaks.
    pub breakage: Option<RawBreakage>,
    /// Its run-out.
    pub runout: Option<RawRunout>,
}

/// An edge that breaks.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawBreakage {
    /// Cuts of the tool before it.
    pub after_cuts: u32,
    /// What it adds to the error of the tool.
    pub error_um: f64,
}

impl RawTool {
    /// Error of a size that it cuts after so many cuts, m.
    pub(crate) fn error(&self, cuts: u32) -> f64 {
        let broken = self.breakage.filter(|breakage| cuts >= breakage.after_cuts);
        let broken = broken.map_or(0.0, |breakage| breakage.error_um);
        (self.error_um + self.wear_per_cut_um * f64::from(cuts) + broken) * 1e-6
    }
}

/// A feature whose true surface is given point by point.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawSurface {
    /// The feature.
    pub feature: String,
    /// Deviation of each touched point along the outward normal, in the order of the plan: of an uncut feature as
    /// delivered, of a cut one what the process leaves in every cut.
    pub deviation_um: Vec<f64>,
}

/// A size of the part.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawSize {
    /// Its name.
    pub id: String,
    /// The features that define it: one round feature, or the two planes of a width.
    pub features: Vec<String>,
    /// Drawing size.
    pub nominal_mm: f64,
    /// Size before machining.
    pub stock_mm: f64,
    /// Error of the reference instrument on this size alone: the residuals of the source's Tables 3 and 4, which lie within
    /// its repeatability.
    #[serde(default)]
    pub cmm_residual_um: f64,
}

/// An operation.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a switch of the cell file"
)]
pub struct RawOperation {
    /// Its name.
    pub id: String,
    /// Tool that cuts.
    pub tool_number: u32,
    /// Sizes that it cuts.
    #[serde(default)]
    pub sizes: Vec<String>,
    /// Features whose surface it generates where the machine, with its errors, leads the tool.
    #[serde(default)]
    pub features: Vec<String>,
    /// Of an arm: direction from the tip of the tool to its shank while it cuts, part frame.
    #[serde(default)]
    pub tool_direction: Option<[f64; 3]>,
    /// Turn of the spindle's housing about that direction.
    #[serde(default)]
    pub tool_turn_deg: f64,
    /// It begins with a new blank: material that an earlier cut removed is there again.
    #[serde(default)]
    pub new_blank: bool,
    /// The volumetric table is enabled in this cut and in the measurement after it.
    #[serde(default)]
    pub volumetric: bool,
    /// Allowance that it leaves.
    #[serde(default)]
    pub allowance_mm: f64,
    /// It turns a part that is clamped at one end, and so deflects it.
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
    /// Standard deviation of its single touches; its other errors are common to a size.
    #[serde(default)]
    pub touch_sd_um: f64,
}

/// A fault that is injected after some touches.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawFault {
    /// The fault.
    pub kind: Injected,
    /// Touches of the session before it.
    #[serde(default)]
    pub after_touches: u32,
    /// Touches that a faulty probe affects; absent: all that follow.
    #[serde(default)]
    pub touches: Option<u32>,
}

/// The faults that can be injected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Injected {
    /// The probe does not trigger.
    DeadProbe,
    /// The probe stays triggered.
    StuckProbe,
    /// The probe triggers in a move that is not a probing move.
    UnplannedTouch,
    /// The emergency stop is pressed.
    Estop,
    /// The controller sends nothing any more.
    Silence,
}
