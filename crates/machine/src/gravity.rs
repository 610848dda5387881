//! What weight does to the drives: efforts by which gravity pulls at each axis, from the masses of the robot description.
//!
//! N m for a rotary axis, N for a linear one, positive where gravity drives the axis forwards: the derivative of the
//! potential energy, with its sign turned. Gravity points down the foundation's z axis (REP 103). Masses are those of the
//! links of both branches; what the description gives no mass weighs nothing.

use nalgebra::Vector3;

use crate::chain::{Chain, JointKind, Side};

/// Standard acceleration of gravity, m/s² (CGPM 1901).
pub(crate) const STANDARD_GRAVITY: f64 = 9.806_65;

impl Chain {
    /// Effort of gravity at each axis (N m or N), in the order of [`Self::axes`].
    pub fn gravity_efforts(&self, positions: &[f64]) -> Vec<f64> {
        let mut efforts = vec![0.0; self.axes().len()];
        for side in [Side::Part, Side::Tool] {
            // Mass (kg) and first moment (kg m) of what hangs on a joint, from the end of the branch backwards.
            let (mut mass, mut moment) = (0.0, Vector3::zeros());
            for (place, &index) in self.branch(side).iter().enumerate().rev() {
                let joint = &self.joints()[index];
                // Links that both branches share are counted with the tool's; the part's own carry nothing of the tool.
                if side == Side::Part && !self.carries(index, Side::Part) {
                    continue;
                }
                let pose = self.pose_after(side, place, positions);
                mass += joint.mass;
                moment += (pose * nalgebra::Point3::from(joint.centre_of_mass)).coords * joint.mass;
                let Some(axis) = self.axis_of(index) else {
                    continue;
                };
                let direction = pose.rotation * joint.axis.into_inner();
                let down = Vector3::new(0.0, 0.0, -STANDARD_GRAVITY);
                efforts[axis] += if joint.kind == JointKind::Prismatic {
                    direction.dot(&down) * mass
                } else {
                    let lever = moment - pose.translation.vector * mass;
                    direction.dot(&lever.cross(&down))
                };
            }
        }
        efforts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ARM: &str = include_str!("../../../launch-scripts/robot_arm_turntable.urdf");

    /// Potential energy of all masses, J.
    fn energy(chain: &Chain, positions: &[f64]) -> f64 {
        let mut energy = 0.0;
        for side in [Side::Part, Side::Tool] {
            for (place, &index) in chain.branch(side).iter().enumerate() {
                let joint = &chain.joints()[index];
                let pose = chain.pose_after(side, place, positions);
                let at = pose * nalgebra::Point3::from(joint.centre_of_mass);
                energy += joint.mass * STANDARD_GRAVITY * at.z;
            }
        }
        energy
    }

    #[test]
    fn efforts_are_the_slope_of_the_potential_energy() {
        let chain = Chain::from_urdf(ARM).expect("a machine");
        for positions in [
            [0.0; 7],
            [0.4, 0.3, -1.1, 1.3, -0.5, 0.7, 0.2],
            [-0.9, 2.0, -2.4, -0.8, 2.0, -1.4, 1.0],
        ] {
            let efforts = chain.gravity_efforts(&positions);
            for axis in 0..7 {
                let slope = |step: f64| {
                    let mut at = positions;
                    at[axis] += step;
                    energy(&chain, &at)
                };
                let slope = (slope(1e-5) - slope(-1e-5)) / 2e-5;
                assert!(
                    (efforts[axis] + slope).abs() < 1e-6,
                    "{axis} {efforts:?} {slope}"
                );
            }
        }
    }

    /// An arm stretched out level: the published masses at the published levers, by hand.
    #[test]
    fn a_level_arm_weighs_on_its_shoulder_by_its_masses_at_their_levers() {
        let chain = Chain::from_urdf(ARM).expect("a machine");
        let shoulder = chain.axis_index("A2").expect("A2");
        let effort = chain.gravity_efforts(&[0.0; 7])[shoulder];
        // Centres of mass along x of the base (the arm stretches towards -x), kg and m: upper arm, forearm, wrists and tool.
        let (a2, a3) = (0.6127, 0.57155);
        let levers = 13.051 * (a2 - 0.38)
            + 3.989 * (a2 + a3 - 0.24)
            + (2.1 + 1.98 + 0.615) * (a2 + a3)
            + 6.0 * (a2 + a3 + 0.1 - 0.09);
        assert!(
            (effort.abs() - levers * STANDARD_GRAVITY).abs() < 1e-6,
            "{effort}"
        );
    }
}
