//! The true errors of the machine: geometric errors of its axes, a slip of the part, and its volumetric table.
//!
//! Errors are named as ISO 230-1 names them: `EX0C` is the location error of axis C in X, `EYZ` the straightness error of Z in
//! Y, `EAX` the roll of X. A location error acts right after the joint's origin, a motion error in the
//! moved frame. m, rad. The cell knows nothing of this section but the entries of the table that the controller
//! reports.

use machine::{Chain, ChainErrors, PositionError, Volumetric};
use nalgebra::{Isometry3, Point3, Vector3};
use serde::Deserialize;

use crate::joint::RawJoint;

/// Travel (m or rad) of an axis whose robot description gives none.
const UNKNOWN_TRAVEL: f64 = 1.0;

/// As written in the cell file, section `[simulator.machine]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawMachine {
    /// Geometric errors of the axes.
    pub errors: Vec<RawError>,
    /// The same errors as the volumetric table of the controller has them at the start; its location errors are the entries
    /// that can be written.
    pub table: Vec<RawError>,
    /// The table is enabled from the start, not only in operations that use it or once it is written.
    pub volumetric: bool,
    /// The part slips after some touches.
    pub slip: Option<RawSlip>,
    /// The machine warms up.
    pub warming: Option<RawWarming>,
    /// Error of the clamping, present from the start.
    pub clamping: RawClamping,
    /// Joints that yield under weight or have lost motion.
    pub joints: Vec<RawJoint>,
    /// Linear axes whose work offset the controller reports and accepts; of an arm X, Y, Z of its programme's frame.
    pub work_offset_axes: Vec<String>,
}

/// The true position of the clamped part.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawClamping {
    /// Translation from its nominal position, along the axes of the part frame.
    pub shift_um: [f64; 3],
    /// Rotation about them.
    pub turn_urad: [f64; 3],
}

impl RawClamping {
    /// Displacement of the part in its nominal frame: m along, rad about.
    pub(crate) fn displacement(&self) -> [f64; 6] {
        let [x, y, z] = self.shift_um;
        let [a, b, c] = self.turn_urad;
        [x, y, z, a, b, c].map(|value| value * 1e-6)
    }
}

/// An error of an axis; for one about an axis (A, B, C) the values are `_urad`, for one along an axis `_um`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawError {
    /// `E`, the direction or rotation, `0` for a location error, the axis.
    pub name: String,
    /// Constant part, along.
    pub value_um: f64,
    /// Constant part, about.
    pub value_urad: f64,
    /// Of a motion error: sagitta over the whole travel, along.
    pub bow_um: f64,
    /// Of a motion error: amplitude of a wave, along.
    pub wave_um: f64,
    /// Length of that wave; of a rotary axis the turns' share is not asked for.
    pub wave_length_mm: f64,
    /// Phase of that wave at position 0.
    pub wave_phase_deg: f64,
    /// Of a motion error: growth with the position, along.
    pub slope_um_per_m: f64,
}

/// A slip of the part.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawSlip {
    /// Touches of the session before it.
    pub after_touches: u32,
    /// How far, in the part frame.
    pub shift_um: [f64; 3],
}

/// A machine that warms up: the part moves towards a displacement from the probe.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawWarming {
    /// How far, in the part frame.
    pub shift_um: [f64; 3],
    /// After which all but 1/e of it is reached.
    pub time_constant_s: f64,
}

impl RawWarming {
    /// Displacement (m) so many seconds after the start.
    pub(crate) fn shift(&self, seconds: f64) -> Vector3<f64> {
        let reached = -(-seconds / self.time_constant_s).exp_m1();
        Vector3::from(self.shift_um) * 1e-6 * reached
    }
}

/// One checked error.
#[derive(Clone, Debug)]
struct Term {
    name: String,
    joint: usize,
    axis: usize,
    component: usize,
    location: bool,
    constant: f64,
    slope: f64,
    bow: f64,
    middle: f64,
    half: f64,
    wave: f64,
    wave_number: f64,
    phase: f64,
}

/// Errors of the axes of one machine.
#[derive(Clone, Debug, Default)]
pub struct Truth {
    terms: Vec<Term>,
}

/// An error that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TruthError {
    /// A name that is not that of an error.
    #[error(
        "machine.errors: {0:?} is not an error of an axis of this machine (such as \"EX0C\" or \"EYZ\")"
    )]
    Name(String),
    /// An entry that the table lists twice.
    #[error("machine.table: {0:?} is listed twice")]
    Twice(String),
    /// A value in the wrong unit, or beyond the approximation of small errors.
    #[error("machine.errors: {name}: {key} {problem}")]
    Value {
        /// The error.
        name: String,
        /// The key.
        key: &'static str,
        /// What is wrong.
        problem: &'static str,
    },
}

impl Truth {
    /// Checks a volumetric table against the machine: each entry stands there once.
    ///
    /// # Errors
    /// [`TruthError`] names the entry.
    pub fn table(raw: &[RawError], chain: &Chain) -> Result<Self, TruthError> {
        for (index, entry) in raw.iter().enumerate() {
            if raw[..index].iter().any(|known| known.name == entry.name) {
                return Err(TruthError::Twice(entry.name.clone()));
            }
        }
        Self::new(raw, chain)
    }

    /// Checks errors against the machine.
    ///
    /// # Errors
    /// [`TruthError`] names the entry.
    pub fn new(raw: &[RawError], chain: &Chain) -> Result<Self, TruthError> {
        let terms = raw.iter().map(|raw| Term::new(raw, chain));
        Ok(Self {
            terms: terms.collect::<Result<_, _>>()?,
        })
    }

    /// Names and values (m or rad) of its location errors, each once.
    pub fn entries(&self) -> impl Iterator<Item = (&str, f64)> {
        let entries = self.terms.iter().filter(|term| term.location);
        entries.map(|term| (term.name.as_str(), term.constant))
    }

    /// The same with other values (m or rad) of its location errors, in their order.
    #[must_use]
    pub fn with_entries(&self, values: &[f64]) -> Self {
        let mut with = self.clone();
        let entries = with.terms.iter_mut().filter(|term| term.location);
        for (term, value) in entries.zip(values) {
            term.constant = *value;
        }
        with
    }

    /// The errors at axis positions (m, rad, in the order of the chain's axes).
    pub fn at(&self, chain: &Chain, positions: &[f64]) -> ChainErrors {
        let mut errors = ChainErrors::none(chain.joints().len());
        for term in &self.terms {
            let twists = if term.location {
                &mut errors.location
            } else {
                &mut errors.motion
            };
            twists[term.joint][term.component] += term.value(positions[term.axis]);
        }
        errors
    }

    /// Axis positions to which a controller with these errors in its volumetric table corrects `positions`.
    ///
    /// # Errors
    /// Positions that the machine does not have.
    pub fn corrected(
        &self,
        chain: &Chain,
        positions: &[f64],
        part_pose: &Isometry3<f64>,
        ball: &Point3<f64>,
    ) -> Result<Vec<f64>, PositionError> {
        let errors = self.at(chain, positions);
        let table = Volumetric::new(chain.clone(), *part_pose, *ball, errors)?;
        let correction = table.corrections(positions)?;
        let moved = positions.iter().zip(&correction.axes);
        Ok(moved.map(|(position, change)| position + change).collect())
    }
}

impl Term {
    fn new(raw: &RawError, chain: &Chain) -> Result<Self, TruthError> {
        let unknown = || TruthError::Name(raw.name.clone());
        let mut letters = raw.name.strip_prefix('E').ok_or_else(unknown)?.chars();
        let component = "XYZABC"
            .find(letters.next().ok_or_else(unknown)?)
            .ok_or_else(unknown)?;
        let rest = letters.as_str();
        let location = rest.starts_with('0');
        let axis = chain
            .axis_index(rest.strip_prefix('0').unwrap_or(rest))
            .ok_or_else(unknown)?;
        let refused = |key, problem| TruthError::Value {
            name: raw.name.clone(),
            key,
            problem,
        };
        let about = component >= 3;
        if about && raw.value_um != 0.0 || !about && raw.value_urad != 0.0 {
            return Err(refused("value", "is _urad for A, B, C and _um for X, Y, Z"));
        }
        let shaped = [raw.bow_um, raw.wave_um, raw.slope_um_per_m];
        if (location || about) && shaped.iter().any(|&value| value != 0.0) {
            return Err(refused(
                "shape",
                "belongs to a motion error along X, Y or Z",
            ));
        }
        if raw.wave_um != 0.0 && raw.wave_length_mm <= 0.0 {
            return Err(refused("wave_length_mm", "must be above 0"));
        }
        let values = [
            raw.value_um,
            raw.value_urad,
            raw.bow_um,
            raw.wave_um,
            raw.slope_um_per_m,
        ];
        if values
            .iter()
            .any(|value| value.is_nan() || value.abs() > 1e4)
        {
            return Err(refused("value", "must lie within ±10000 of its unit"));
        }
        let joint = chain.axis(axis);
        let (lower, upper) = joint
            .limits
            .unwrap_or((-0.5 * UNKNOWN_TRAVEL, 0.5 * UNKNOWN_TRAVEL));
        Ok(Self {
            name: raw.name.clone(),
            joint: chain.axes()[axis],
            axis,
            component,
            location,
            constant: (raw.value_um + raw.value_urad) * 1e-6,
            slope: raw.slope_um_per_m * 1e-6,
            bow: raw.bow_um * 1e-6,
            middle: f64::midpoint(lower, upper),
            half: (0.5 * (upper - lower)).max(1e-9),
            wave: raw.wave_um * 1e-6,
            wave_number: if raw.wave_length_mm > 0.0 {
                std::f64::consts::TAU / (raw.wave_length_mm * 1e-3)
            } else {
                0.0
            },
            phase: raw.wave_phase_deg.to_radians(),
        })
    }

    fn value(&self, position: f64) -> f64 {
        let u = (position - self.middle) / self.half;
        self.constant
            + self.slope * position
            + self.bow * (1.0 - u * u)
            + self.wave * (self.wave_number * position + self.phase).sin()
    }
}

impl RawSlip {
    /// Displacement of the part after some touches, m, part frame.
    pub fn shift(&self, touches: u32) -> Vector3<f64> {
        if touches > self.after_touches {
            Vector3::from(self.shift_um) * 1e-6
        } else {
            Vector3::zeros()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_warms_up_to_its_displacement() {
        let warming = RawWarming {
            shift_um: [10.0, 0.0, -20.0],
            time_constant_s: 600.0,
        };
        for (seconds, share) in [(0.0, 0.0), (600.0, 0.632_121), (1800.0, 0.950_213)] {
            let shift = warming.shift(seconds) * 1e6;
            let expected = Vector3::new(10.0, 0.0, -20.0) * share;
            assert!((shift - expected).norm() < 1e-4, "{seconds} s: {shift}");
        }
    }
}
