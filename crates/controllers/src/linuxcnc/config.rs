//! Settings of the driver, as written in the cell file and as checked.

use crate::secret::Secret;
use std::{
    cmp::Ordering,
    collections::{BTreeMap, BTreeSet},
    path::PathBuf,
    time::Duration,
};

use serde::Deserialize;

use super::{client::Address, program::Touching};
use crate::axes::{Axis, Letter};

/// As written in the cell file, section `[linuxcnc]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawConfig {
    /// Host and port of `linuxcncrsh`.
    #[serde(default = "default_address")]
    pub address: String,
    /// Password of a session.
    #[serde(default = "default_connect_password")]
    pub connect_password: Secret,
    /// Password of control.
    #[serde(default = "default_enable_password")]
    pub enable_password: Secret,
    /// Longest wait for a connection or a reply.
    #[serde(default = "default_reply_timeout_s")]
    pub reply_timeout_s: f64,
    /// Folder that programs are written to and logs are read from.
    pub program_directory: PathBuf,
    /// The same folder as the controller knows it, where that is another path.
    #[serde(default)]
    pub controller_program_directory: Option<PathBuf>,
    /// Tool table file of the controller.
    pub tool_table: PathBuf,
    /// The machine's axes; positions are reported in this order.
    pub axes: Vec<RawAxis>,
    /// Reset the emergency stop, switch on and home when the driver starts. Never done after a lost connection.
    #[serde(default)]
    pub power_on: bool,
    /// Tool that must be in the spindle to measure.
    #[serde(default)]
    pub probe_tool: Option<u32>,
    /// Tools whose wear the cell corrects.
    #[serde(default)]
    pub tools: Vec<RawTool>,
    /// Largest wear offset that the driver writes, of either sign, whoever asks: its own limit, besides that of the gate.
    #[serde(default = "default_wear_limit_mm")]
    pub wear_limit_mm: f64,
    /// Work offset that the cell corrects: 54 to 59.
    #[serde(default = "default_work_offset")]
    pub work_offset: u8,
    /// Program of each machining operation, as the controller knows its file.
    #[serde(default)]
    pub operations: BTreeMap<String, PathBuf>,
    /// Find the surface at this feed, then touch again at the plan's feed.
    #[serde(default)]
    pub search_feed_mm_per_min: Option<f64>,
    /// Way back between the two touches.
    #[serde(default = "default_back_off_mm")]
    pub back_off_mm: f64,
    /// Rapid moves at the start of each measurement, one after the other: axis name, and position in mm or degrees.
    #[serde(default)]
    pub first_moves: Vec<RawMove>,
    /// Blocks run before the first move, for example to select identity kinematics.
    #[serde(default)]
    pub preamble: Vec<String>,
    /// Period of the controller's position loop.
    #[serde(default = "default_servo_period_ms")]
    pub servo_period_ms: f64,
}

/// An axis as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawAxis {
    /// Joint of the machine model.
    pub name: String,
    /// Letter in programs.
    pub letter: Letter,
    /// Number of the controller's joint.
    pub joint: usize,
    /// Least and greatest position: mm, or degrees for A, B and C.
    #[serde(default)]
    pub limits_mm_or_deg: Option<[f64; 2]>,
}

/// A tool as written.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawTool {
    /// Number of the tool.
    pub number: u32,
    /// Diameter of the tool without wear. LinuxCNC has one register for both: wear is what the table holds beyond this.
    pub diameter_mm: f64,
}

/// A move as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawMove {
    /// Joint of the machine model.
    pub axis: String,
    /// Target: mm, or degrees for A, B and C.
    pub position_mm_or_deg: f64,
}

fn default_address() -> String {
    "127.0.0.1:5007".to_owned()
}

fn default_connect_password() -> Secret {
    Secret::Plain("EMC".to_owned())
}

fn default_enable_password() -> Secret {
    Secret::Plain("EMCTOO".to_owned())
}

fn default_reply_timeout_s() -> f64 {
    2.0
}

fn default_wear_limit_mm() -> f64 {
    1.0
}

fn default_work_offset() -> u8 {
    54
}

fn default_back_off_mm() -> f64 {
    0.5
}

fn default_servo_period_ms() -> f64 {
    1.0
}

/// As checked; lengths in m, angles in rad, times in s.
#[derive(Clone, Debug)]
pub struct Config {
    /// Where the controller listens.
    pub address: Address,
    /// Folder of programs and logs, here.
    pub program_directory: PathBuf,
    /// The same folder, there.
    pub controller_program_directory: PathBuf,
    /// Tool table file.
    pub tool_table: PathBuf,
    /// The machine's axes.
    pub axes: Vec<Axis>,
    /// Switch on and home when the driver starts.
    pub power_on: bool,
    /// Tool that must be in the spindle to measure.
    pub probe_tool: Option<u32>,
    /// Number, and diameter without wear (m), of each tool that is corrected.
    pub tools: Vec<(u32, f64)>,
    /// m; largest wear offset that is written, of either sign.
    pub wear_limit: f64,
    /// Work offset that is corrected, 1 for G54.
    pub work_offset: u8,
    /// Program of each operation.
    pub operations: BTreeMap<String, PathBuf>,
    /// How points are touched.
    pub touching: Touching,
    /// Index of an axis, and its position, of each rapid move at the start.
    pub first_moves: Vec<(usize, f64)>,
    /// Blocks before the first move.
    pub preamble: Vec<String>,
    /// Period of the position loop.
    pub servo_period: f64,
}

/// A setting that cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("linuxcnc.{key}: {reason}")]
pub struct ConfigError {
    key: String,
    reason: String,
}

impl RawConfig {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`ConfigError`] names the key.
    pub fn check(self) -> Result<Config, ConfigError> {
        let reply_timeout = positive("reply_timeout_s", self.reply_timeout_s)?;
        let axes = check_axes(&self.axes)?;
        let first_moves = self
            .first_moves
            .iter()
            .map(|one| {
                let index = axes.iter().position(|axis| axis.name == one.axis);
                let index = index.ok_or_else(|| {
                    refuse("first_moves", &format!("there is no axis {:?}", one.axis))
                })?;
                let position = finite("first_moves.position_mm_or_deg", one.position_mm_or_deg)?;
                Ok((index, axes[index].letter.from_controller(position)))
            })
            .collect::<Result<_, _>>()?;
        if !(54..=59).contains(&self.work_offset) {
            return Err(refuse(
                "work_offset",
                &format!("{} is not 54 to 59", self.work_offset),
            ));
        }
        let mut tools = Vec::new();
        for tool in &self.tools {
            if tools.iter().any(|&(number, _)| number == tool.number) {
                return Err(refuse(
                    "tools",
                    &format!("tool {} is named twice", tool.number),
                ));
            }
            tools.push((
                tool.number,
                positive("tools.diameter_mm", tool.diameter_mm)? * 1e-3,
            ));
        }
        let touching = match self.search_feed_mm_per_min {
            None => Touching::Once,
            Some(feed) => Touching::Twice {
                search_feed: positive("search_feed_mm_per_min", feed)? / 60e3,
                back_off: positive("back_off_mm", self.back_off_mm)? * 1e-3,
            },
        };
        let timeout = Duration::try_from_secs_f64(reply_timeout).map_err(|_too_long| {
            refuse("reply_timeout_s", &format!("{reply_timeout} is too long"))
        })?;
        Ok(Config {
            address: Address {
                host: self.address,
                connect_password: self.connect_password,
                enable_password: self.enable_password,
                connect_timeout: timeout,
                reply_timeout: timeout,
            },
            controller_program_directory: self
                .controller_program_directory
                .unwrap_or_else(|| self.program_directory.clone()),
            program_directory: self.program_directory,
            tool_table: self.tool_table,
            axes,
            power_on: self.power_on,
            probe_tool: self.probe_tool,
            tools,
            wear_limit: positive("wear_limit_mm", self.wear_limit_mm)? * 1e-3,
            work_offset: self.work_offset - 53,
            operations: self.operations,
            touching,
            first_moves,
            preamble: self.preamble,
            servo_period: positive("servo_period_ms", self.servo_period_ms)? * 1e-3,
        })
    }
}

fn check_axes(raw: &[RawAxis]) -> Result<Vec<Axis>, ConfigError> {
    let (mut names, mut letters, mut joints) = (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
    let mut axes = Vec::new();
    for axis in raw {
        if !names.insert(axis.name.as_str())
            || !letters.insert(axis.letter)
            || !joints.insert(axis.joint)
        {
            return Err(refuse(
                "axes",
                &format!("the name, letter or joint of {:?} is used twice", axis.name),
            ));
        }
        if axis.joint > 5 {
            return Err(refuse(
                "axes.joint",
                &format!(
                    "{} is beyond the six joints of the remote shell",
                    axis.joint
                ),
            ));
        }
        let limits = match axis.limits_mm_or_deg {
            Some([lower, upper]) if lower.partial_cmp(&upper) != Some(Ordering::Less) => {
                return Err(refuse(
                    "axes.limits_mm_or_deg",
                    &format!("{lower} is not below {upper}"),
                ));
            }
            limits => limits.map(|both| both.map(|limit| axis.letter.from_controller(limit))),
        };
        axes.push(Axis {
            name: axis.name.clone(),
            letter: axis.letter,
            joint: axis.joint,
            limits,
        });
    }
    if letters.iter().all(|letter| letter.is_rotary()) {
        return Err(refuse("axes", "there is no linear axis to probe with"));
    }
    Ok(axes)
}

fn positive(key: &str, value: f64) -> Result<f64, ConfigError> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(refuse(
            key,
            &format!("{value} is not a positive finite number"),
        ))
    }
}

fn finite(key: &str, value: f64) -> Result<f64, ConfigError> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(refuse(key, &format!("{value} is not a finite number")))
    }
}

fn refuse(key: &str, reason: &str) -> ConfigError {
    ConfigError {
        key: key.to_owned(),
        reason: reason.to_owned(),
    }
}
