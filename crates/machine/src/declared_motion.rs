//! Section `[motion]` of the cell file: as written, and checked against a machine.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::chain::{Chain, JointKind};
use crate::motion::{AxisLimits, Motion, Program};

/// Section `[motion]` of the cell file, as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawMotion {
    /// Standstill at every target of a positioning move, before and after each touch included.
    pub dwell_s: f64,
    /// Standstill after each touch.
    pub touch_dwell_s: f64,
    /// Delay of the controller before each move.
    pub latency_s: f64,
    /// Speed of rapid moves over the top speeds of the axes.
    pub rapid_override: f64,
    /// Speed of probing moves over the programmed feed.
    pub feed_override: f64,
    /// Share of the shorter of both ramps by which successive positioning moves overlap; 0: exact stop.
    pub blending: f64,
    /// By name of the axis.
    pub axes: BTreeMap<String, RawAxis>,
}

impl Default for RawMotion {
    fn default() -> Self {
        Self {
            dwell_s: 0.0,
            touch_dwell_s: 0.0,
            latency_s: 0.0,
            rapid_override: 1.0,
            feed_override: 1.0,
            blending: 0.0,
            axes: BTreeMap::new(),
        }
    }
}

/// `[motion.axes.NAME]`, as written: a linear axis is limited in mm, a rotary one in degrees.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawAxis {
    /// Of a linear axis; absent: that of the robot description.
    pub velocity_mm_per_s: Option<f64>,
    /// Of a linear axis.
    pub acceleration_mm_per_s2: Option<f64>,
    /// Of a linear axis.
    pub jerk_mm_per_s3: Option<f64>,
    /// Of a rotary axis; absent: that of the robot description.
    pub velocity_deg_per_s: Option<f64>,
    /// Of a rotary axis.
    pub acceleration_deg_per_s2: Option<f64>,
    /// Of a rotary axis.
    pub jerk_deg_per_s3: Option<f64>,
    /// Time to release and to clamp the axis again whenever it moves.
    pub clamping_s: f64,
}

/// A setting of `[motion]` that cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// The machine has no such axis.
    #[error("motion.axes.{0} is not an axis of the machine")]
    Axis(String),
    /// A linear axis with limits of a rotary one, or the reverse.
    #[error("motion.axes.{axis}.{key} limits a {other} axis, but {axis} is a {kind} one")]
    Kind {
        /// The axis.
        axis: String,
        /// The key.
        key: &'static str,
        /// What the key is for.
        other: &'static str,
        /// What the axis is.
        kind: &'static str,
    },
    /// A number out of range.
    #[error("motion.{key} = {value} must be a finite number {bound}")]
    Number {
        /// The key, below `motion`.
        key: String,
        /// Its value.
        value: f64,
        /// What it must be.
        bound: &'static str,
    },
}

impl RawMotion {
    /// The motion of a machine with these limits in addition to its top speeds.
    ///
    /// # Errors
    /// [`MotionError`] names the first setting that cannot be used.
    pub fn check(&self, chain: &Chain) -> Result<Motion, MotionError> {
        let speeds = chain.motion().axes().to_vec();
        let mut motion = Motion::new(speeds, not_negative("dwell_s", self.dwell_s)?);
        motion.program = self.program()?;
        for (name, raw) in &self.axes {
            let index = chain.axis_index(name);
            let index = index.ok_or_else(|| MotionError::Axis(name.clone()))?;
            let rotary = chain.axis(index).kind == JointKind::Revolute;
            let limits = &mut motion.axes_mut()[index];
            *limits = raw.check(name, rotary, *limits)?;
        }
        Ok(motion)
    }

    fn program(&self) -> Result<Program, MotionError> {
        let blending = not_negative("blending", self.blending)?;
        if blending > 1.0 {
            return Err(MotionError::Number {
                key: "blending".to_owned(),
                value: blending,
                bound: "from 0 to 1",
            });
        }
        Ok(Program {
            latency: not_negative("latency_s", self.latency_s)?,
            touch_dwell: not_negative("touch_dwell_s", self.touch_dwell_s)?,
            rapid_override: positive("rapid_override", self.rapid_override)?,
            feed_override: positive("feed_override", self.feed_override)?,
            blending,
        })
    }
}

impl RawAxis {
    /// Limits of an axis; `known` are those of the robot description.
    fn check(
        &self,
        name: &str,
        rotary: bool,
        known: AxisLimits,
    ) -> Result<AxisLimits, MotionError> {
        let limit = |linear: (&'static str, Option<f64>), turning: (&'static str, Option<f64>)| {
            let (own, other) = if rotary {
                (turning, linear)
            } else {
                (linear, turning)
            };
            if other.1.is_some() {
                return Err(MotionError::Kind {
                    axis: name.to_owned(),
                    key: other.0,
                    other: kind(!rotary),
                    kind: kind(rotary),
                });
            }
            let si = |value: f64| {
                if rotary {
                    value.to_radians()
                } else {
                    value * 1e-3
                }
            };
            let checked = |value| positive(&format!("axes.{name}.{}", own.0), value).map(si);
            own.1.map(checked).transpose()
        };
        let velocity = limit(
            ("velocity_mm_per_s", self.velocity_mm_per_s),
            ("velocity_deg_per_s", self.velocity_deg_per_s),
        )?;
        Ok(AxisLimits {
            velocity: velocity.unwrap_or(known.velocity),
            acceleration: limit(
                ("acceleration_mm_per_s2", self.acceleration_mm_per_s2),
                ("acceleration_deg_per_s2", self.acceleration_deg_per_s2),
            )?,
            jerk: limit(
                ("jerk_mm_per_s3", self.jerk_mm_per_s3),
                ("jerk_deg_per_s3", self.jerk_deg_per_s3),
            )?,
            clamping: not_negative(&format!("axes.{name}.clamping_s"), self.clamping_s)?,
        })
    }
}

fn not_negative(key: &str, value: f64) -> Result<f64, MotionError> {
    bounded(key, value, value >= 0.0, "not below 0")
}

fn positive(key: &str, value: f64) -> Result<f64, MotionError> {
    bounded(key, value, value > 0.0, "above 0")
}

fn bounded(key: &str, value: f64, within: bool, bound: &'static str) -> Result<f64, MotionError> {
    let usable = value.is_finite() && within;
    usable.then_some(value).ok_or_else(|| MotionError::Number {
        key: key.to_owned(),
        value,
        bound,
    })
}

fn kind(rotary: bool) -> &'static str {
    if rotary { "rotary" } else { "linear" }
}
