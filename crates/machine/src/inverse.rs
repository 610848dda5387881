//! Axis positions that bring the ball to a point of the part: inverse kinematics by damped least squares.
//!
//! Metres and radians, part frame. Levenberg-Marquardt on the analytic derivatives of the chain, inside the travels
//! of the robot description; axes with a prescribed position stay there. A five-axis machine has its rotary axes
//! prescribed and three linear ones free; an arm has all free and the orientation of the probe prescribed.
//! It finds one solution near the start, not all of them ([`crate::postures`] does, for arms), and knows no collisions.

use nalgebra::{DMatrix, DVector, Isometry3, Point3, UnitQuaternion};

use crate::chain::Chain;

/// Ball distance under which a target counts as reached, m.
const REACHED: f64 = 1e-9;
/// Orientation error under which a target counts as reached, rad.
const ALIGNED: f64 = 1e-8;
/// A radian of orientation weighs as much as this length, m: about the reach of a stylus and its holder.
const LEVER: f64 = 0.1;
const ITERATIONS: usize = 200;

/// Where the ball shall be.
#[derive(Debug, Clone, Copy)]
pub struct Target {
    /// Ball centre in the part frame, m.
    pub ball: Point3<f64>,
    /// Part from probe mount, where the free axes can turn the probe.
    pub orientation: Option<UnitQuaternion<f64>>,
}

/// Why a target is not reached.
#[derive(Debug, Clone, thiserror::Error)]
pub enum ReachError {
    /// A vector has another length than the chain has axes.
    #[error("{given} positions given for {axes} axes")]
    Length {
        /// Number given.
        given: usize,
        /// Number of axes.
        axes: usize,
    },
    /// A prescribed position is outside the travel.
    #[error(
        "axis `{axis}` cannot stand at {position:.6} (m or rad): its travel is {lower:.6} to {upper:.6}"
    )]
    Travel {
        /// The axis.
        axis: String,
        /// Prescribed, m or rad.
        position: f64,
        /// Lowest, m or rad.
        lower: f64,
        /// Highest, m or rad.
        upper: f64,
    },
    /// No position of the free axes brings the ball there.
    #[error("no position within the travels brings the ball to the target; the nearest is {distance:.6} m away{}", stops(.at_limit))]
    Unreachable {
        /// Remaining distance (m), orientation included at its lever.
        distance: f64,
        /// Axes that stand at the end of their travel there.
        at_limit: Vec<String>,
    },
}

fn stops(axes: &[String]) -> String {
    if axes.is_empty() {
        String::new()
    } else {
        format!(", with {} at the end of travel", axes.join(", "))
    }
}

impl Chain {
    /// Positions of all axes (m or rad) that bring the ball to `target` (m, part frame). `ball` is its centre in the frame of
    /// the probe mount (m), `part_pose` the part frame in the frame of `workpiece`.
    ///
    /// `prescribed` and `start` are in the order of [`Self::axes`]; `None` marks a free axis, whose search begins at
    /// `start`.
    ///
    /// # Errors
    /// [`ReachError`] when a prescribed position is outside the travel or the target cannot be reached.
    pub fn reach(
        &self,
        target: &Target,
        prescribed: &[Option<f64>],
        start: &[f64],
        part_pose: &Isometry3<f64>,
        ball: &Point3<f64>,
    ) -> Result<Vec<f64>, ReachError> {
        self.reach_within(ITERATIONS, target, prescribed, start, part_pose, ball)
    }

    /// [`Self::reach`], given up after some iterations.
    pub(crate) fn reach_within(
        &self,
        iterations: usize,
        target: &Target,
        prescribed: &[Option<f64>],
        start: &[f64],
        part_pose: &Isometry3<f64>,
        ball: &Point3<f64>,
    ) -> Result<Vec<f64>, ReachError> {
        let axes = self.axes().len();
        for given in [prescribed.len(), start.len()] {
            if given != axes {
                return Err(ReachError::Length { given, axes });
            }
        }
        let mut positions = start.to_vec();
        for (index, position) in prescribed.iter().enumerate() {
            if let Some(position) = *position {
                self.check_travel(index, position)?;
                positions[index] = position;
            } else {
                positions[index] = self.clamp(index, positions[index]);
            }
        }
        let free: Vec<usize> = (0..axes)
            .filter(|&index| prescribed[index].is_none())
            .collect();
        let problem = Problem {
            chain: self,
            target,
            part_pose,
            ball,
            free: &free,
        };
        problem.solve(positions, iterations)
    }

    fn check_travel(&self, index: usize, position: f64) -> Result<(), ReachError> {
        let axis = self.axis(index);
        match axis.limits {
            Some((lower, upper)) if !(lower - 1e-9..=upper + 1e-9).contains(&position) => {
                Err(ReachError::Travel {
                    axis: axis.name.clone(),
                    position,
                    lower,
                    upper,
                })
            }
            _ => Ok(()),
        }
    }

    /// Derivatives of the ball's place and, at its lever, of the probe's attitude by the positions of free axes.
    pub(crate) fn free_jacobian(
        &self,
        positions: &[f64],
        free: &[usize],
        part_pose: &Isometry3<f64>,
        ball: &Point3<f64>,
    ) -> DMatrix<f64> {
        let sensitivity = self.sensitivity(positions, part_pose, ball);
        let mut jacobian = DMatrix::zeros(6, free.len());
        for (column, &axis) in free.iter().enumerate() {
            let (place, turn) = (sensitivity.axes[axis], sensitivity.turns[axis] * LEVER);
            jacobian.fixed_view_mut::<3, 1>(0, column).copy_from(&place);
            jacobian.fixed_view_mut::<3, 1>(3, column).copy_from(&turn);
        }
        jacobian
    }

    fn clamp(&self, index: usize, position: f64) -> f64 {
        self.axis(index)
            .limits
            .map_or(position, |(lower, upper)| position.clamp(lower, upper))
    }
}

struct Problem<'a> {
    chain: &'a Chain,
    target: &'a Target,
    part_pose: &'a Isometry3<f64>,
    ball: &'a Point3<f64>,
    free: &'a [usize],
}

impl Problem<'_> {
    fn residual(&self, positions: &[f64]) -> DVector<f64> {
        let mount = self.chain.part_from_mount(positions, self.part_pose);
        let off = mount * self.ball - self.target.ball;
        let mut rows = vec![off.x, off.y, off.z];
        if let Some(wanted) = self.target.orientation {
            rows.extend(
                (mount.rotation * wanted.inverse())
                    .scaled_axis()
                    .iter()
                    .map(|angle| angle * LEVER),
            );
        }
        DVector::from_vec(rows)
    }

    fn jacobian(&self, positions: &[f64], rows: usize) -> DMatrix<f64> {
        let (part_pose, ball) = (self.part_pose, self.ball);
        let all = self
            .chain
            .free_jacobian(positions, self.free, part_pose, ball);
        all.rows(0, rows).into_owned()
    }

    fn solve(&self, mut positions: Vec<f64>, iterations: usize) -> Result<Vec<f64>, ReachError> {
        let mut residual = self.residual(&positions);
        let mut damping = 1e-6;
        for _ in 0..iterations {
            if reached(&residual) {
                return Ok(positions);
            }
            let jacobian = self.jacobian(&positions, residual.len());
            let mut normal = jacobian.tr_mul(&jacobian);
            for index in 0..self.free.len() {
                normal[(index, index)] += damping;
            }
            let Some(step) = normal
                .cholesky()
                .map(|factor| factor.solve(&jacobian.tr_mul(&residual)))
            else {
                damping *= 10.0;
                continue;
            };
            let mut trial = positions.clone();
            for (change, &axis) in step.iter().zip(self.free) {
                trial[axis] = self.chain.clamp(axis, trial[axis] - change);
            }
            let left = self.residual(&trial);
            if left.norm() < residual.norm() {
                positions = trial;
                residual = left;
                damping = (damping * 0.1).max(1e-15);
            } else {
                damping = (damping * 10.0).max(1e-12);
                if damping > 1e6 {
                    break;
                }
            }
        }
        if reached(&residual) {
            return Ok(positions);
        }
        Err(ReachError::Unreachable {
            distance: residual.norm(),
            at_limit: self.at_limit(&positions),
        })
    }

    fn at_limit(&self, positions: &[f64]) -> Vec<String> {
        self.free
            .iter()
            .filter_map(|&axis| {
                let joint = self.chain.axis(axis);
                let (lower, upper) = joint.limits?;
                (positions[axis] <= lower || positions[axis] >= upper).then(|| joint.name.clone())
            })
            .collect()
    }
}

fn reached(residual: &DVector<f64>) -> bool {
    let place = residual.rows(0, 3).norm();
    let turn = if residual.len() > 3 {
        residual.rows(3, 3).norm() / LEVER
    } else {
        0.0
    };
    place <= REACHED && turn <= ALIGNED
}
