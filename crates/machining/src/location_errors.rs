//! Location errors of a machine's axes from touches of balls that it has not cut.
//!
//! Metres and radians, part frame. A ball stands still in the part while the rotary axes turn both: the apparent
//! displacement of its centre at each indexation shows the errors of the links. With c the centre of the stylus ball by the nominal
//! chain at the latched positions, J the chain's exact derivatives by the links there
//! (`docs/source_systems.md, D.2`), M those by the stylus, each touch obeys |c + J x + M s − b| = R + r + ρ: x the
//! links, b the centre of the ball, s and ρ the errors of the probe where they are estimated. x, b, s, ρ by
//! Gauss-Newton, so that a ball may have been put down anywhere; touches that do not fit go one by one by their
//! externally studentised residual (Cook and Weisberg 1982), with Bonferroni's bound. The uncertainty has the
//! residuals' own scale, widened for few of them (GUM supplement 1, 6.4.9.4). All links are kept, significant or not:
//! they were estimated together, and leaving some out would bias the others. It knows no errors that vary along an
//! axis, no temperature, no table and no limits of corrections.

mod further;
mod solution;

pub use further::Indexation;

use machine::{Chain, LinkError};
use metrology::statistics::coverage_factor;
use nalgebra::{DMatrix, Isometry3, Point3, Vector3};

use solution::{Unknowns, solve};

/// Probability of rejecting any good touch of a measurement.
const FALSE_REJECTION: f64 = 0.01;
/// At most one touch of this many is left out; with more outliers the measurement is refused.
const TOUCHES_PER_OUTLIER: usize = 10;
/// Fewest degrees of freedom from which the residuals give a scale: Student's t has no variance below.
const MIN_DEGREES_OF_FREEDOM: usize = 3;

/// A ball as the plan has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// m, part frame.
    pub centre: Point3<f64>,
    /// m.
    pub radius: f64,
}

/// One touch of a ball.
#[derive(Clone, Debug, PartialEq)]
pub struct BallTouch {
    /// Index of the ball.
    pub ball: usize,
    /// Latched positions in the order of [`Chain::axes`], m and rad.
    pub positions: Vec<f64>,
    /// m; standard uncertainty along the normal, against the others.
    pub uncertainty: f64,
}

/// Errors of the probe that are estimated together with the links.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Probe {
    /// The ball's centre across the mount's z.
    pub stylus_offset: bool,
    /// The ball's centre along the mount's z.
    pub stylus_length: bool,
    /// The effective radius of the ball.
    pub ball_radius: bool,
}

/// Largest standard uncertainty with which a link counts as determined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// m, of components X, Y, Z.
    pub shift: f64,
    /// rad, of components A, B, C.
    pub turn: f64,
}

impl Limits {
    /// The limit of a link, m or rad.
    pub fn of(&self, link: &LinkError) -> f64 {
        if link.turns() { self.turn } else { self.shift }
    }
}

/// Why nothing is estimated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// A touch that cannot be used.
    #[error("touch {0} names no ball, or has a number that is not finite or no uncertainty")]
    Touch(usize),
    /// Too few touches.
    #[error(
        "{touches} touches are too few for {unknowns} unknowns: at least {least} more than unknowns are needed",
        least = MIN_DEGREES_OF_FREEDOM
    )]
    TooFew {
        /// Usable touches.
        touches: usize,
        /// Links, centres of balls, probe.
        unknowns: usize,
    },
    /// More outliers than one touch in ten.
    #[error("more than {left_out} of {touches} touches are outliers")]
    Outliers {
        /// Left out so far.
        left_out: usize,
        /// All of them.
        touches: usize,
    },
    /// No minimum was found.
    #[error("the touches do not lie on balls near those of the plan")]
    NotBalls,
}

/// A machine, its probe, and balls that it touches.
#[derive(Clone, Debug)]
pub struct BallCalibration {
    /// The machine.
    pub chain: Chain,
    /// Workpiece from part.
    pub part_pose: Isometry3<f64>,
    /// Nominal centre of the stylus ball in the probe mount, m.
    pub stylus: Point3<f64>,
    /// Nominal radius of the stylus ball, m.
    pub stylus_radius: f64,
    /// The balls.
    pub balls: Vec<Ball>,
    /// The links to estimate; their values are not used.
    pub links: Vec<LinkError>,
    /// Effects of the probe that are estimated together with them.
    pub probe: Probe,
}

/// The estimated links.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// The links with their errors, m or rad.
    pub links: Vec<LinkError>,
    /// Their covariance; infinite on the diagonal of those that are not determined.
    pub covariance: DMatrix<f64>,
    /// Scatter of the touches against their uncertainties.
    pub scale: f64,
    /// m; root mean square residual of the touches used.
    pub residual: f64,
    /// Outliers left out, by index of the touch.
    pub outliers: Vec<usize>,
}

impl Estimate {
    /// Standard uncertainty of each link, m or rad.
    pub fn uncertainties(&self) -> Vec<f64> {
        (self.covariance.diagonal().iter())
            .map(|variance| variance.sqrt())
            .collect()
    }

    /// Indices of the links that these touches do not determine to within the limits.
    pub fn undetermined(&self, limits: &Limits) -> Vec<usize> {
        let known = self.links.iter().zip(self.uncertainties());
        known
            .enumerate()
            // Written so that NaN is not determined.
            .filter(|(_, (link, u))| !(*u <= limits.of(link)))
            .map(|(index, _)| index)
            .collect()
    }
}

impl BallCalibration {
    /// The links' errors from touches.
    ///
    /// # Errors
    /// Touches that cannot be used, are too few, or do not fit one another.
    pub fn estimate(&self, touches: &[BallTouch]) -> Result<Estimate, CalibrationError> {
        let bad = |touch: &BallTouch| {
            touch.ball >= self.balls.len()
                || touch.positions.len() != self.chain.axes().len()
                || !touch.positions.iter().all(|position| position.is_finite())
                || !(touch.uncertainty.is_finite() && touch.uncertainty > 0.0)
        };
        if let Some(touch) = touches.iter().position(bad) {
            return Err(CalibrationError::Touch(touch));
        }
        let unknowns = Unknowns::of(self, touches);
        let most = (touches.len() / TOUCHES_PER_OUTLIER).max(1);
        let mut used: Vec<usize> = (0..touches.len()).collect();
        let mut outliers = Vec::new();
        loop {
            if used.len() < unknowns.count + MIN_DEGREES_OF_FREEDOM {
                return Err(CalibrationError::TooFew {
                    touches: used.len(),
                    unknowns: unknowns.count,
                });
            }
            let chosen: Vec<&BallTouch> = used.iter().map(|&index| &touches[index]).collect();
            let solution = solve(self, &unknowns, &chosen).ok_or(CalibrationError::NotBalls)?;
            let (worst, size) = solution.worst();
            let degrees_of_freedom = (used.len() - unknowns.count) as f64;
            let chance = FALSE_REJECTION / used.len() as f64;
            // Externally studentised: by the scale of the residuals without the touch itself.
            let others = degrees_of_freedom - 1.0;
            let remaining = (degrees_of_freedom - size * size).max(f64::MIN_POSITIVE);
            if size * (others / remaining).sqrt() > coverage_factor(1.0 - chance, others) {
                if outliers.len() == most {
                    return Err(CalibrationError::Outliers {
                        left_out: most,
                        touches: touches.len(),
                    });
                }
                outliers.push(used.remove(worst));
                continue;
            }
            outliers.sort_unstable();
            return Ok(solution.estimate(self, degrees_of_freedom, outliers));
        }
    }

    /// How far errors of the links (m or rad, in their order) move the tip at positions of the axes: part frame, m, first
    /// order.
    pub fn displacement(&self, values: &[f64], positions: &[f64]) -> Vector3<f64> {
        let columns = self.columns(positions);
        (columns.iter().zip(values))
            .map(|(column, value)| column * *value)
            .sum()
    }

    /// The largest such displacement at the touches, and its standard uncertainty from the covariance of the values, m.
    pub fn largest_displacement(
        &self,
        values: &[f64],
        covariance: &DMatrix<f64>,
        touches: &[BallTouch],
    ) -> (f64, f64) {
        let mut largest = (0.0, 0.0);
        for touch in touches {
            let columns = self.columns(&touch.positions);
            let jacobian = DMatrix::from_fn(3, columns.len(), |row, column| columns[column][row]);
            let moved = self.displacement(values, &touch.positions).norm();
            let spread = &jacobian * covariance * jacobian.transpose();
            // The direction in which it is known worst.
            let uncertainty = spread.symmetric_eigenvalues().max().max(0.0).sqrt();
            if moved >= largest.0 {
                largest.0 = moved;
            }
            largest.1 = uncertainty.max(largest.1);
        }
        largest
    }

    /// Derivatives of the ball's centre by each link, part frame.
    fn columns(&self, positions: &[f64]) -> Vec<Vector3<f64>> {
        let sensitivity = self
            .chain
            .sensitivity(positions, &self.part_pose, &self.stylus);
        (self.links.iter())
            .map(|link| sensitivity.location[link.joint][link.component])
            .collect()
    }
}
