//! Faults of single joints: they yield under the weight that they carry, and have lost motion.
//!
//! A joint that yields stands off its reading by compliance × effort of gravity ([`machine::Chain::gravity_efforts`], from
//! the masses of the robot description): an arm sags. Lost motion is half of it behind the reading on either side, by the
//! direction in which the joint moves while the probe touches (ISO 230-2, reversal). m and N of a linear axis, rad and N m
//! of a rotary one.

use machine::{Chain, JointKind};
use serde::Deserialize;

/// As written, `[[simulator.machine.joints]]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawJoint {
    /// Name of the axis.
    pub axis: String,
    /// How far a rotary axis yields to the moment of the weight that it carries.
    pub compliance_urad_per_nm: f64,
    /// How far a linear axis yields to that weight.
    pub compliance_um_per_n: f64,
    /// Lost motion of a rotary axis.
    pub backlash_urad: f64,
    /// Lost motion of a linear axis.
    pub backlash_um: f64,
}

/// A joint that cannot be as it is written.
#[derive(Debug, thiserror::Error)]
pub enum JointError {
    /// A joint that the machine lacks, or that is listed twice.
    #[error("machine.joints: {0:?} is not an axis of this machine, or it is listed twice")]
    Unknown(String),
    /// A joint with values of the other kind of axis, or out of range.
    #[error(
        "machine.joints: {0}: values are _urad of a rotary and _um of a linear axis, from 0 to 10000"
    )]
    Value(String),
}

/// As checked: m or rad, per N or N m.
#[derive(Clone, Copy, Debug, Default)]
pub struct Joint {
    compliance: f64,
    backlash: f64,
}

/// Slower than this share of the fastest a joint stands, so that rounding does not say which way it moves.
const STANDS: f64 = 1e-9;

impl Joint {
    /// One for each axis of the chain.
    pub(crate) fn of_chain(raw: &[RawJoint], chain: &Chain) -> Result<Vec<Self>, JointError> {
        let mut joints = vec![Self::default(); chain.axes().len()];
        for (index, one) in raw.iter().enumerate() {
            let twice = raw[..index].iter().any(|known| known.axis == one.axis);
            let axis = chain.axis_index(&one.axis).filter(|_| !twice);
            let axis = axis.ok_or_else(|| JointError::Unknown(one.axis.clone()))?;
            let turns = chain.axis(axis).kind == JointKind::Revolute;
            let (own, other) = if turns {
                (
                    [one.compliance_urad_per_nm, one.backlash_urad],
                    [one.compliance_um_per_n, one.backlash_um],
                )
            } else {
                (
                    [one.compliance_um_per_n, one.backlash_um],
                    [one.compliance_urad_per_nm, one.backlash_urad],
                )
            };
            let usable = own.iter().all(|value| (0.0..=1e4).contains(value));
            if !usable || other != [0.0, 0.0] {
                return Err(JointError::Value(one.axis.clone()));
            }
            let [compliance, backlash] = own.map(|value| value * 1e-6);
            joints[axis] = Self {
                compliance,
                backlash,
            };
        }
        Ok(joints)
    }

    /// How far each joint stands off its reading (m, rad) at positions, on a move along `direction` (any unit; 0 stands).
    pub(crate) fn errors(
        joints: &[Self],
        chain: &Chain,
        positions: &[f64],
        direction: &[f64],
    ) -> Vec<f64> {
        let yields = joints.iter().any(|joint| joint.compliance != 0.0);
        let efforts = if yields {
            chain.gravity_efforts(positions)
        } else {
            vec![0.0; joints.len()]
        };
        let fastest = direction
            .iter()
            .fold(0.0, |most: f64, one| most.max(one.abs()));
        let joints = joints.iter().zip(efforts.iter().zip(direction));
        joints
            .map(|(joint, (effort, moves))| {
                let side = if moves.abs() > STANDS * fastest {
                    moves.signum()
                } else {
                    0.0
                };
                joint.compliance * effort - 0.5 * joint.backlash * side
            })
            .collect()
    }
}
