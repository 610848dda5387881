//! Settings, as written and as checked.

use crate::quantity::{Angle, Length};
use serde::Deserialize;
use signatures::Trust;

/// What a signal says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// The part is clamped: 1, else 0. Nothing begins without.
    ClampingClosed,
    /// The part is there: 1, else 0. Nothing begins without.
    PartPresent,
    /// A temperature of `machine_state`, degree Celsius.
    Temperature,
    /// A quantity that is watched and recorded.
    Value,
}

impl Role {
    /// The machine may do nothing while it is 0.
    pub fn is_interlock(self) -> bool {
        matches!(self, Self::ClampingClosed | Self::PartPresent)
    }
}

/// A signal, as it is watched here.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// Its name, of a temperature as well that in `machine_state`.
    pub name: String,
    /// What it says.
    pub role: Role,
    /// Unit of its value.
    pub unit: String,
    /// Least value, in that unit.
    pub minimum: Option<f64>,
    /// Largest value, in that unit.
    pub maximum: Option<f64>,
    /// s; without a valid reading for longer it is stale.
    pub timeout: f64,
}

/// As written in the cell file, section `[machine_state]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawConfig {
    /// Name of the machine in `machine_state`; empty: the name of the robot in the URDF.
    pub machine_id: String,
    /// A controller that sends no sample for longer is lost.
    pub silence_limit_s: f64,
    /// A measurement fails when neither its order nor any progress of planning arrives for longer.
    pub order_limit_s: f64,
    /// A correction that the driver does not answer within this time has failed, and so has an operation whose outcome it
    /// does not report for so long while the controller is idle.
    pub reply_limit_s: f64,
    /// A part that `cycle` has not reported for longer is abandoned: the machine is stopped, and nothing is written for it.
    pub part_limit_s: f64,
    /// No wear offset is ever written outside plus or minus this.
    pub wear_limit_mm: f64,
    /// No point of a tool path is ever offset by more.
    pub path_limit_mm: f64,
    /// No work offset is ever written outside plus or minus this.
    pub work_offset_limit_mm: f64,
    /// No entry of the volumetric table that is a length is ever written outside plus or minus this.
    pub volumetric_limit_um: f64,
    /// No entry of the volumetric table that is an angle is ever written outside plus or minus this.
    pub volumetric_limit_urad: f64,
}

impl Default for RawConfig {
    fn default() -> Self {
        Self {
            machine_id: String::new(),
            silence_limit_s: 1.0,
            order_limit_s: 10.0,
            reply_limit_s: 30.0,
            part_limit_s: 3.0,
            wear_limit_mm: 0.5,
            path_limit_mm: 0.5,
            work_offset_limit_mm: 2.0,
            volumetric_limit_um: 200.0,
            volumetric_limit_urad: 500.0,
        }
    }
}

/// As checked.
#[derive(Clone, Debug)]
pub struct Config {
    /// Name of the machine in `machine_state`.
    pub machine_id: String,
    /// URDF text published on `robot_description`.
    pub robot_description: String,
    /// s; a controller that sends no sample for longer is lost.
    pub silence_limit: f64,
    /// s; a measurement fails when neither its order nor any progress of planning arrives for longer.
    pub order_limit: f64,
    /// s; a correction that the driver does not answer within this time has failed, and so has an operation whose outcome
    /// it does not report for so long while the controller is idle.
    pub reply_limit: f64,
    /// s; a part that `cycle` has not reported for longer is abandoned.
    pub part_limit: f64,
    /// No wear offset is written outside plus or minus this.
    pub wear_limit: Length,
    /// No point of a tool path is offset by more.
    pub path_limit: Length,
    /// No work offset is written outside plus or minus this.
    pub work_offset_limit: Length,
    /// No entry of the volumetric table that is a length is written outside plus or minus this.
    pub volumetric_length_limit: Length,
    /// No entry that is an angle is written outside plus or minus this.
    pub volumetric_angle_limit: Angle,
    /// Signals of controllers beside the machine.
    pub signals: Vec<Signal>,
    /// Whose approvals count.
    pub trust: Trust,
    /// This graph runs on a recording: no command may reach a machine.
    pub replayed: bool,
}

impl Config {
    /// The same with those whose approvals count; without, nobody's does.
    #[must_use]
    pub fn with_trust(self, trust: Trust) -> Self {
        Self { trust, ..self }
    }

    /// The same with signals of controllers beside the machine.
    #[must_use]
    pub fn with_signals(self, signals: Vec<Signal>) -> Self {
        Self { signals, ..self }
    }
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("machine_state.{key} = {value} must be a positive finite number")]
pub struct ConfigError {
    key: &'static str,
    value: f64,
}

impl RawConfig {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`ConfigError`] names the key.
    pub fn check(
        &self,
        robot_description: String,
        robot: &str,
        replayed: bool,
    ) -> Result<Config, ConfigError> {
        for (key, value) in [
            ("silence_limit_s", self.silence_limit_s),
            ("order_limit_s", self.order_limit_s),
            ("reply_limit_s", self.reply_limit_s),
            ("part_limit_s", self.part_limit_s),
            ("wear_limit_mm", self.wear_limit_mm),
            ("path_limit_mm", self.path_limit_mm),
            ("work_offset_limit_mm", self.work_offset_limit_mm),
            ("volumetric_limit_um", self.volumetric_limit_um),
            ("volumetric_limit_urad", self.volumetric_limit_urad),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(ConfigError { key, value });
            }
        }
        let machine_id = if self.machine_id.is_empty() {
            robot.to_owned()
        } else {
            self.machine_id.clone()
        };
        Ok(Config {
            machine_id,
            robot_description,
            silence_limit: self.silence_limit_s,
            order_limit: self.order_limit_s,
            reply_limit: self.reply_limit_s,
            part_limit: self.part_limit_s,
            wear_limit: Length::from_mm(self.wear_limit_mm),
            path_limit: Length::from_mm(self.path_limit_mm),
            work_offset_limit: Length::from_mm(self.work_offset_limit_mm),
            volumetric_length_limit: Length::from_um(self.volumetric_limit_um),
            volumetric_angle_limit: Angle::from_urad(self.volumetric_limit_urad),
            signals: Vec::new(),
            trust: Trust::default(),
            replayed,
        })
    }
}
