//! How axes that a plan leaves free keep the ball in contact where they are more, or others, than three linear ones: those
//! of an arm, whose attitude at each touch is that of the recording. Metres, radians.

use nalgebra::{DMatrix, DVector, Point3};

use super::plant::Plant;
use super::scene::{Reach, Scene, Touch};

/// Rounds in which free axes follow the ball, and in which they are brought into contact first.
const FOLLOWED: usize = 8;
const APPROACHES: usize = 3;
/// Step of an axis for its slope, m or rad.
const STEP: f64 = 1e-6;

impl Plant<'_> {
    /// Positions that put the ball at `centre` in the attitude of a posture near by.
    pub(super) fn followed(&self, reach: &Reach, centre: &Point3<f64>, touch: &Touch) -> Vec<f64> {
        let still = vec![0.0; reach.positions.len()];
        let moment = self.moment(touch, 0, false);
        let mut positions = reach.positions.clone();
        for _ in 0..FOLLOWED {
            let (ball, mount) = self.ball(&positions, &still, &moment);
            let (off, turned) = (centre - ball, reach.attitude * mount.rotation.inverse());
            let turned = turned.scaled_axis();
            let all = DVector::from_iterator(6, off.iter().chain(turned.iter()).copied());
            if all.norm() < 1e-13 {
                break;
            }
            for (position, step) in positions.iter_mut().zip((&reach.follow * all).iter()) {
                *position += step;
            }
        }
        positions
    }

    /// How free axes put the nominal ball into contact in the attitude that it has at `positions`.
    pub(super) fn reach(scene: &Scene, touch: &Touch, positions: &[f64]) -> Reach {
        let plant = Plant::nominal(scene, 1);
        let still = vec![0.0; positions.len()];
        let moment = plant.moment(touch, 0, false);
        let attitude = plant.ball(positions, &still, &moment).1.rotation;
        let names = scene.part_axes.iter().chain(&scene.tool_axes);
        let free: Vec<bool> = names
            .map(|axis| !scene.fixed.contains(&axis.name))
            .collect();
        let mut reach = Reach {
            positions: positions.to_vec(),
            follow: DMatrix::zeros(positions.len(), 6),
            attitude,
        };
        for _ in 0..APPROACHES {
            let mut slopes = DMatrix::zeros(6, positions.len());
            for axis in (0..positions.len()).filter(|&axis| free[axis]) {
                let at = |by: f64| {
                    let mut moved = reach.positions.clone();
                    moved[axis] += by;
                    plant.ball(&moved, &still, &moment)
                };
                let ((high, turned), (low, other)) = (at(STEP), at(-STEP));
                let turn = (turned.rotation * other.rotation.inverse()).scaled_axis();
                let moved = (high - low) / (2.0 * STEP);
                let turn = turn / (2.0 * STEP);
                slopes.fixed_view_mut::<3, 1>(0, axis).copy_from(&moved);
                slopes.fixed_view_mut::<3, 1>(3, axis).copy_from(&turn);
            }
            let Ok(follow) = slopes.pseudo_inverse(1e-9) else {
                break;
            };
            reach.follow = follow;
            let contact = touch.point + touch.normal * scene.ball_radius;
            reach.positions = plant.followed(&reach, &contact, touch);
        }
        reach
    }
}
