//! Five-axis validation by surface mismatch: what two rotary positions leave between two halves of one surface.
//!
//! Metres and radians, part frame. `docs/source_systems.md, D`: each pattern (a slot, or a corner step) is cut half
//! at index 1, half at index 2; the step between the halves is m = e_w(2) − e_w(1), e_w the tip's error against the
//! part. Link errors of the axes show in it, the datum of the part does not. A slot, whose halves have the same tool
//! axis in the part, cannot see a turn of the part about that axis ([`MismatchTest::sensitivity`] has lower rank).
//! Cutting forces, tool shape and the reading of the step are one normal noise here.

mod patterns;
mod protocol;

pub use patterns::{LINKS, Pattern, PatternKind, ROTARY, standard_patterns};
pub use protocol::{Identified, Outcome, calibrated, identify};

use machine::{
    Chain, ChainErrors, JointKind, LinkError, PositionError, ReachError, Target, Volumetric,
};
use nalgebra::{DMatrix, Isometry3, Point3};

/// Singular values below this share of the largest count as zero.
const RANK: f64 = 1e-9;

/// Why a test cannot be evaluated.
#[derive(Debug, thiserror::Error)]
pub enum MismatchError {
    /// The machine lacks a rotary axis.
    #[error("pattern axis `{0}` is not an axis of the robot description")]
    Axis(String),
    /// An index has another number of positions than there are rotary axes.
    #[error("pattern `{pattern}` has an index of {given} positions for {axes} rotary axes")]
    Index {
        /// The pattern.
        pattern: String,
        /// Positions given.
        given: usize,
        /// Axes named.
        axes: usize,
    },
    /// The machine cannot cut a half.
    #[error("pattern `{pattern}`: {source}")]
    Reach {
        /// The pattern.
        pattern: String,
        /// What is in the way.
        source: ReachError,
    },
    /// Compensation at an unusable pose.
    #[error(transparent)]
    Position(#[from] PositionError),
    /// Another number of mismatches than the patterns have.
    #[error("{given} mismatches given, the patterns have {expected}")]
    Length {
        /// Given.
        given: usize,
        /// Two per pattern.
        expected: usize,
    },
}

/// Patterns on a machine, with the axis positions that cut each half.
#[derive(Debug, Clone)]
pub struct MismatchTest {
    chain: Chain,
    part_pose: Isometry3<f64>,
    tip: Point3<f64>,
    patterns: Vec<Pattern>,
    poses: Vec<[Vec<f64>; 2]>,
}

impl MismatchTest {
    /// Finds the positions for each half. `rotary` names the axes of the patterns' indices, other rotary axes stand
    /// at 0; `part_pose` is workpiece from part, `tip` the tool tip in the probe mount (m).
    ///
    /// # Errors
    /// [`MismatchError`] names the pattern or axis that does not fit the machine.
    pub fn new(
        chain: Chain,
        part_pose: Isometry3<f64>,
        tip: Point3<f64>,
        rotary: &[&str],
        patterns: Vec<Pattern>,
    ) -> Result<Self, MismatchError> {
        let axes = rotary
            .iter()
            .map(|name| {
                chain
                    .axis_index(name)
                    .ok_or_else(|| MismatchError::Axis((*name).to_owned()))
            })
            .collect::<Result<Vec<_>, _>>()?;
        let pose = |pattern: &Pattern, index: &[f64]| -> Result<Vec<f64>, MismatchError> {
            if index.len() != axes.len() {
                return Err(MismatchError::Index {
                    pattern: pattern.id.clone(),
                    given: index.len(),
                    axes: axes.len(),
                });
            }
            let mut prescribed: Vec<Option<f64>> = (0..chain.axes().len())
                .map(|axis| (chain.axis(axis).kind == JointKind::Revolute).then_some(0.0))
                .collect();
            for (&axis, &position) in axes.iter().zip(index) {
                prescribed[axis] = Some(position);
            }
            let target = Target {
                ball: pattern.point,
                orientation: None,
            };
            let start = vec![0.0; prescribed.len()];
            chain
                .reach(&target, &prescribed, &start, &part_pose, &tip)
                .map_err(|source| MismatchError::Reach {
                    pattern: pattern.id.clone(),
                    source,
                })
        };
        let poses = patterns
            .iter()
            .map(|pattern| {
                let [first, second] = &pattern.indices;
                Ok([pose(pattern, first)?, pose(pattern, second)?])
            })
            .collect::<Result<Vec<_>, MismatchError>>()?;
        Ok(Self {
            chain,
            part_pose,
            tip,
            patterns,
            poses,
        })
    }

    /// The machine.
    pub fn chain(&self) -> &Chain {
        &self.chain
    }

    /// The patterns, in the order of the rows of all results: two rows each.
    pub fn patterns(&self) -> &[Pattern] {
        &self.patterns
    }

    /// Axis positions that cut the halves of pattern `index`, in the order of [`Chain::axes`].
    pub fn poses(&self, index: usize) -> &[Vec<f64>; 2] {
        &self.poses[index]
    }

    /// Names of the rows: pattern and direction, as in `P1a`.
    pub fn row_names(&self) -> Vec<String> {
        let rows = self.patterns.iter();
        rows.flat_map(|pattern| ["a", "b"].map(|row| format!("{}{row}", pattern.id)))
            .collect()
    }

    /// Mismatch (m) of each row for each of `links` at its size (D.3): rows × links, first order.
    pub fn sensitivity(&self, links: &[LinkError]) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(2 * self.patterns.len(), links.len());
        self.each_half(|row, direction, sign, sensitivity| {
            for (column, link) in links.iter().enumerate() {
                let moved = sensitivity.location[link.joint][link.component];
                matrix[(row, column)] += sign * link.value * direction.dot(&moved);
            }
        });
        matrix
    }

    /// Mismatch (m) of each row for tip offsets of `size` (m) along the mount's x, y and z: rows × 3.
    pub fn tip_offsets(&self, size: f64) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(2 * self.patterns.len(), 3);
        self.each_half(|row, direction, sign, sensitivity| {
            for (column, moved) in sensitivity.mount.iter().enumerate() {
                matrix[(row, column)] += sign * size * direction.dot(moved);
            }
        });
        matrix
    }

    fn each_half(
        &self,
        mut add: impl FnMut(usize, &nalgebra::Vector3<f64>, f64, &machine::Sensitivity),
    ) {
        for (place, (pattern, poses)) in self.patterns.iter().zip(&self.poses).enumerate() {
            for (sign, positions) in [-1.0, 1.0].into_iter().zip(poses) {
                let sensitivity = self
                    .chain
                    .sensitivity(positions, &self.part_pose, &self.tip);
                for (side, direction) in pattern.directions.iter().enumerate() {
                    add(2 * place + side, direction, sign, &sensitivity);
                }
            }
        }
    }

    /// Mismatch (m) of each row for finite errors, the commands corrected by `volumetric` where there is one.
    ///
    /// # Errors
    /// A compensation of another machine.
    pub fn exact(
        &self,
        errors: &ChainErrors,
        volumetric: Option<&Volumetric>,
    ) -> Result<Vec<f64>, MismatchError> {
        let mut rows = vec![0.0; 2 * self.patterns.len()];
        for (place, (pattern, poses)) in self.patterns.iter().zip(&self.poses).enumerate() {
            for (sign, positions) in [-1.0, 1.0].into_iter().zip(poses) {
                let mut commanded = positions.clone();
                if let Some(volumetric) = volumetric {
                    let correction = volumetric.first_order(positions)?;
                    for (command, change) in commanded.iter_mut().zip(correction.axes) {
                        *command += change;
                    }
                }
                let (part, tip) = (&self.part_pose, &self.tip);
                let error = self.chain.ball_in_part_with(&commanded, part, tip, errors)
                    - self.chain.ball_in_part(positions, part, tip);
                for (side, direction) in pattern.directions.iter().enumerate() {
                    rows[2 * place + side] += sign * direction.dot(&error);
                }
            }
        }
        Ok(rows)
    }

    /// The compensation that errors identified or calibrated as `links` give on this machine.
    ///
    /// # Errors
    /// None for links of this machine.
    pub fn compensation(&self, links: &[LinkError]) -> Result<Volumetric, MismatchError> {
        Ok(Volumetric::new(
            self.chain.clone(),
            self.part_pose,
            self.tip,
            ChainErrors::of_links(&self.chain, links),
        )?)
    }
}

/// Number of directions a matrix of sensitivities can see.
pub fn rank(matrix: &DMatrix<f64>) -> usize {
    let values = matrix.singular_values();
    let largest = values.max();
    values
        .iter()
        .filter(|&&value| value > RANK * largest && value > 0.0)
        .count()
}

/// Largest over smallest singular value; infinite where a column cannot be seen.
pub fn condition(matrix: &DMatrix<f64>) -> f64 {
    let values = matrix.singular_values();
    if values.is_empty() || matrix.ncols() > matrix.nrows() || rank(matrix) < matrix.ncols() {
        return f64::INFINITY;
    }
    values.max() / values.min()
}
