//! Indexations at which further touches of the same balls would determine what the touches made do not.
//!
//! Candidates are multiples of 45° of the rotary axes within their travel, where the linear axes reach the balls. At each
//! a ball is taken as touched from the tool's side: from its end and from four sides. The best one is taken, then the best in addition to it, up to
//! [`MOST`]; what is best lowers the worst uncertainty against its limit. Nothing is said about what stands in the way.

use machine::{JointKind, Target};
use nalgebra::{DMatrix, DVector, Vector3};

use super::solution::Unknowns;
use super::{BallCalibration, BallTouch, Estimate, Limits};

/// Indexations named at most.
const MOST: usize = 3;
/// rad; grid of the candidates.
const GRID: f64 = std::f64::consts::FRAC_PI_4;
/// Share of the best seen direction that every direction is taken to be seen by, so that the unseen can be compared.
const UNSEEN: f64 = 1e-14;

/// A position of the rotary axes, rad, in the order in which they were named.
#[derive(Clone, Debug, PartialEq)]
pub struct Indexation(pub Vec<f64>);

/// One candidate: what its touches would add.
struct Candidate {
    indexation: Indexation,
    information: DMatrix<f64>,
}

impl BallCalibration {
    /// Indexations of the axes `rotary` (indices into [`machine::Chain::axes`]) that would bring every link within its
    /// limit, as few as were found; `None` where no few would: then the links cannot be distinguished from the positions of
    /// the balls or from the probe, or more touches at the same indexations are needed.
    pub fn further(
        &self,
        touches: &[BallTouch],
        estimate: &Estimate,
        limits: &Limits,
        rotary: &[usize],
    ) -> Option<Vec<Indexation>> {
        let unknowns = Unknowns::of(self, touches);
        let uncertainty = estimate.scale.max(f64::MIN_POSITIVE)
            * (touches.iter().map(|touch| touch.uncertainty).sum::<f64>() / touches.len() as f64);
        let mut information = DMatrix::zeros(unknowns.count, unknowns.count);
        for touch in touches {
            let ball = self.balls[touch.ball].centre;
            let centre = self
                .chain
                .ball_in_part(&touch.positions, &self.part_pose, &self.stylus);
            if let Some(normal) = (centre - ball).try_normalize(1e-9) {
                let row = unknowns.row(self, touch.ball, &touch.positions, &normal);
                add(&mut information, &row, uncertainty);
            }
        }
        let candidates = self.candidates(&unknowns, touches, uncertainty, rotary);
        let mut chosen = Vec::new();
        while chosen.len() < MOST {
            let best = candidates
                .iter()
                .map(|one| {
                    let with = &information + &one.information;
                    (self.worst(&with, limits), one)
                })
                .min_by(|a, b| a.0.total_cmp(&b.0))?;
            chosen.push(best.1.indexation.clone());
            if best.0 <= 1.0 {
                return Some(chosen);
            }
            information += &best.1.information;
        }
        None
    }

    /// Largest standard uncertainty of a link over its limit.
    fn worst(&self, information: &DMatrix<f64>, limits: &Limits) -> f64 {
        let scale = DVector::from_fn(information.nrows(), |index, _| {
            let own = information[(index, index)].sqrt();
            if own > 0.0 { own } else { 1.0 }
        });
        let scaled = DMatrix::from_fn(information.nrows(), information.ncols(), |r, c| {
            information[(r, c)] / (scale[r] * scale[c])
        });
        let eigen = scaled.symmetric_eigen();
        let floor = UNSEEN * eigen.eigenvalues.max();
        let of_link = |(index, link): (usize, &machine::LinkError)| {
            let variance: f64 = (0..eigen.eigenvalues.len())
                .map(|k| eigen.eigenvectors[(index, k)].powi(2) / eigen.eigenvalues[k].max(floor))
                .sum();
            variance.sqrt() / scale[index] / limits.of(link)
        };
        self.links
            .iter()
            .enumerate()
            .map(of_link)
            .fold(0.0, f64::max)
    }

    fn candidates(
        &self,
        unknowns: &Unknowns,
        touches: &[BallTouch],
        uncertainty: f64,
        rotary: &[usize],
    ) -> Vec<Candidate> {
        let mut grid = vec![Vec::new()];
        for &axis in rotary {
            let joint = self.chain.axis(axis);
            if joint.kind != JointKind::Revolute {
                return Vec::new();
            }
            let stands = |step: i32| {
                let angle = f64::from(step) * GRID;
                let within = joint
                    .limits
                    .is_none_or(|(lower, upper)| (lower..=upper).contains(&angle));
                within.then_some(angle)
            };
            let angles: Vec<f64> = (-3..=4).filter_map(stands).collect();
            grid = (grid.iter())
                .flat_map(|known: &Vec<f64>| {
                    angles.iter().map(move |&angle| {
                        let mut next = known.clone();
                        next.push(angle);
                        next
                    })
                })
                .collect();
        }
        let touched = |ball: usize| touches.iter().find(|touch| touch.ball == ball);
        let candidate = |angles: Vec<f64>| {
            let mut information = DMatrix::zeros(unknowns.count, unknowns.count);
            for ball in 0..self.balls.len() {
                let Some(near) = touched(ball) else {
                    continue;
                };
                let mut prescribed = vec![None; self.chain.axes().len()];
                for (&axis, &angle) in rotary.iter().zip(&angles) {
                    prescribed[axis] = Some(angle);
                }
                let target = Target {
                    ball: self.balls[ball].centre,
                    orientation: None,
                };
                let positions = self.chain.reach(
                    &target,
                    &prescribed,
                    &near.positions,
                    &self.part_pose,
                    &self.stylus,
                );
                let positions = positions.ok()?;
                let mount = self.chain.part_from_mount(&positions, &self.part_pose);
                let sides = [
                    Vector3::z(),
                    Vector3::x(),
                    -Vector3::x(),
                    Vector3::y(),
                    -Vector3::y(),
                ];
                for side in sides {
                    let row = unknowns.row(self, ball, &positions, &(mount.rotation * side));
                    add(&mut information, &row, uncertainty);
                }
            }
            Some(Candidate {
                indexation: Indexation(angles),
                information,
            })
        };
        grid.into_iter().filter_map(candidate).collect()
    }
}

/// Adds the information of a touch with that row.
fn add(information: &mut DMatrix<f64>, row: &[f64], uncertainty: f64) {
    let row = DVector::from_column_slice(row) / uncertainty;
    *information += &row * row.transpose();
}
