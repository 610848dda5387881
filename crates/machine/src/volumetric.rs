//! Volumetric compensation: what to add to the linear axes so that the tip is where a perfect machine would have it.
//!
//! Metres and radians. The errors are those of the chain (`machine::ChainErrors`), known from a calibration. Rotary
//! axes stay: the tool keeps the small lean that the errors give it. `docs/source_systems.md, D.2`, for any chain:
//! with e the first-order error of the tip and J its derivatives by the linear axes, J Δ = −e.
//! [`Volumetric::corrections`] continues to the exact solution by Newton's method on the composed errors. It bounds
//! nothing and commands nothing.

use nalgebra::{DMatrix, DVector, Isometry3, Point3, Vector3};

use crate::chain::{Chain, JointKind};
use crate::kinematics::{ChainErrors, PositionError};

/// Newton steps; each squares the remaining share, which begins at the size of the angles.
const STEPS: usize = 4;
/// Directions that the linear axes move less than this (m per m) are none they can correct.
const RANK: f64 = 1e-9;

/// Corrections of one pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Correction {
    /// What to add to each of [`Chain::axes`], m; 0 for rotary axes.
    pub axes: Vec<f64>,
    /// Error of the tip that the linear axes cannot remove, part frame, m.
    pub left: Vector3<f64>,
}

/// A machine with known errors, and the tip that is to be kept in place.
#[derive(Debug, Clone)]
pub struct Volumetric {
    chain: Chain,
    part_pose: Isometry3<f64>,
    tip: Point3<f64>,
    errors: ChainErrors,
    linear: Vec<usize>,
}

impl Volumetric {
    /// `part_pose` is workpiece from part; `tip` the tool tip or ball centre in the probe mount (m).
    ///
    /// # Errors
    /// Errors that do not fit the joints of the chain.
    pub fn new(
        chain: Chain,
        part_pose: Isometry3<f64>,
        tip: Point3<f64>,
        errors: ChainErrors,
    ) -> Result<Self, PositionError> {
        let joints = chain.joints().len();
        for values in [errors.location.len(), errors.motion.len()] {
            if values != joints {
                return Err(PositionError::Length {
                    names: joints,
                    values,
                });
            }
        }
        let linear = (0..chain.axes().len())
            .filter(|&axis| chain.axis(axis).kind == JointKind::Prismatic)
            .collect();
        Ok(Self {
            chain,
            part_pose,
            tip,
            errors,
            linear,
        })
    }

    /// First-order corrections at positions in the order of [`Chain::axes`] (D.2); `left` is to first order as well.
    ///
    /// # Errors
    /// Positions that are not finite or not one per axis.
    pub fn first_order(&self, positions: &[f64]) -> Result<Correction, PositionError> {
        self.check(positions)?;
        let sensitivity = self
            .chain
            .sensitivity(positions, &self.part_pose, &self.tip);
        let mut error = Vector3::zeros();
        let joints = [
            (&self.errors.location, &sensitivity.location),
            (&self.errors.motion, &sensitivity.motion),
        ];
        for (twists, columns) in joints {
            for (twist, columns) in twists.iter().zip(columns) {
                for (size, column) in twist.iter().zip(columns) {
                    error += column * *size;
                }
            }
        }
        for (size, column) in self.errors.part.iter().zip(&sensitivity.part) {
            error += column * *size;
        }
        for (size, column) in self.errors.ball.iter().zip(&sensitivity.mount) {
            error += column * *size;
        }
        let (axes, left) = self.solve(positions, &error);
        Ok(Correction { axes, left })
    }

    /// Corrections at positions in the order of [`Chain::axes`] that put the tip where the nominal chain has it.
    ///
    /// # Errors
    /// Positions that are not finite or not one per axis.
    pub fn corrections(&self, positions: &[f64]) -> Result<Correction, PositionError> {
        self.check(positions)?;
        let mut axes = vec![0.0; positions.len()];
        let mut moved = positions.to_vec();
        for _ in 0..STEPS {
            let (step, _) = self.solve(positions, &self.error(positions, &moved));
            for ((axis, moved), step) in axes.iter_mut().zip(&mut moved).zip(step) {
                *axis += step;
                *moved += step;
            }
        }
        let left = self.error(positions, &moved);
        Ok(Correction { axes, left })
    }

    /// How far the tip of the erring machine at `moved` is from that of the nominal one at `wanted`, part frame.
    fn error(&self, wanted: &[f64], moved: &[f64]) -> Vector3<f64> {
        let (part, tip) = (&self.part_pose, &self.tip);
        self.chain.ball_in_part_with(moved, part, tip, &self.errors)
            - self.chain.ball_in_part(wanted, part, tip)
    }

    /// The smallest steps of the linear axes that move the tip by −`error`, and what of it remains.
    fn solve(&self, positions: &[f64], error: &Vector3<f64>) -> (Vec<f64>, Vector3<f64>) {
        let mut axes = vec![0.0; positions.len()];
        if self.linear.is_empty() {
            return (axes, *error);
        }
        let sensitivity = self
            .chain
            .sensitivity(positions, &self.part_pose, &self.tip);
        let columns: Vec<_> = self
            .linear
            .iter()
            .map(|&axis| sensitivity.axes[axis])
            .collect();
        let jacobian = DMatrix::from_fn(3, columns.len(), |row, column| columns[column][row]);
        let right = DVector::from_column_slice((-error).as_slice());
        let Ok(steps) = jacobian.clone().svd(true, true).solve(&right, RANK) else {
            return (axes, *error);
        };
        let rest = right - jacobian * &steps;
        for (&axis, &step) in self.linear.iter().zip(steps.iter()) {
            axes[axis] = step;
        }
        (axes, -Vector3::new(rest[0], rest[1], rest[2]))
    }

    fn check(&self, positions: &[f64]) -> Result<(), PositionError> {
        let names = self.chain.axes().len();
        if positions.len() != names {
            return Err(PositionError::Length {
                names,
                values: positions.len(),
            });
        }
        match positions.iter().position(|value| !value.is_finite()) {
            Some(axis) => Err(PositionError::NotFinite(self.chain.axis(axis).name.clone())),
            None => Ok(()),
        }
    }
}
