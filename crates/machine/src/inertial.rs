//! Mass, centre and inertia of a rigid body, and the ten parameters in which its efforts are linear.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use crate::{chain::joint, description::ChainError, urdf::Robot};

/// Inertial parameters of a body.
pub const PARAMETERS: usize = 10;

/// Least spread of a mass along each axis, m: solvers refuse a body without any.
const THINNEST: f64 = 1e-3;

/// A rigid body in a frame of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertial {
    /// kg
    pub mass: f64,
    /// Centre of mass in the frame, m.
    pub centre: Vector3<f64>,
    /// About the centre of mass, along the axes of the frame, kg m².
    pub inertia: Matrix3<f64>,
}

/// Σ of masses times squared way along the axes, from an inertia, or the inertia from it: ½ tr(I) 1 − I and tr(Σ) 1 − Σ.
fn second_moments(inertia: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::identity() * (0.5 * inertia.trace()) - inertia
}

impl Inertial {
    /// Mass (kg), first moment (kg m) and inertia about the origin of the frame (kg m²): m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz,
    /// Izz (Atkeson, An and Hollerbach 1986).
    pub fn parameters(&self) -> [f64; PARAMETERS] {
        let moment = self.centre * self.mass;
        let about = self.inertia + self.of_centre();
        [
            self.mass,
            moment.x,
            moment.y,
            moment.z,
            about[(0, 0)],
            about[(0, 1)],
            about[(1, 1)],
            about[(0, 2)],
            about[(1, 2)],
            about[(2, 2)],
        ]
    }

    /// Inertia about the origin of the mass at the centre (parallel axes, Steiner).
    fn of_centre(&self) -> Matrix3<f64> {
        let centre = &self.centre;
        (Matrix3::identity() * centre.norm_squared() - centre * centre.transpose()) * self.mass
    }

    /// The body of some parameters, or the nearest that can exist: of no less than `least` kg, whose mass is nowhere negative
    /// (Wensing, Kim and Slotine 2018: the second moments about the centre are positive definite). First moments stay, since they
    /// make the weight.
    pub fn nearest(parameters: &[f64; PARAMETERS], least: f64) -> Self {
        let [mass, x, y, z, xx, xy, yy, xz, yz, zz] = *parameters;
        let mass = mass.max(least);
        let mut body = Self {
            mass,
            centre: Vector3::new(x, y, z) / mass,
            inertia: Matrix3::zeros(),
        };
        let about = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) - body.of_centre();
        let mut spread = SymmetricEigen::new(second_moments(&about));
        for moment in spread.eigenvalues.iter_mut() {
            *moment = moment.max(mass * THINNEST * THINNEST);
        }
        let spread = spread.recompose();
        body.inertia = Matrix3::identity() * spread.trace() - spread;
        body
    }

    /// What a URDF text says of a link; `None` where it has none of that name, all zeros where that has no mass.
    ///
    /// # Errors
    /// [`ChainError`] names what keeps the text from being a robot.
    pub fn of_link(text: &str, link: &str) -> Result<Option<Self>, ChainError> {
        let robot = Robot::read(text)?;
        let Some(found) = robot.links.iter().find(|one| one.name == link) else {
            return Ok(None);
        };
        let Some(raw) = robot.joints.iter().find(|one| one.child == link) else {
            return Ok(None);
        };
        let mut raw = raw.clone();
        raw.mimics = false;
        "fixed".clone_into(&mut raw.kind);
        let read = joint(&raw, found)?;
        Ok(Some(Self {
            mass: read.mass,
            centre: read.centre_of_mass,
            inertia: read.inertia,
        }))
    }
}

/// Declared viscous and dry friction of a joint of a URDF text; `None` where it has none of that name.
///
/// # Errors
/// [`ChainError::Urdf`] where the text is no robot description.
pub fn declared_friction(text: &str, joint: &str) -> Result<Option<[f64; 2]>, ChainError> {
    let robot = Robot::read(text)?;
    let found = robot.joints.iter().find(|one| one.name == joint);
    Ok(found.map(|one| one.friction))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_that_can_exist_stays_and_another_becomes_one() {
        let body = Inertial {
            mass: 2.0,
            centre: Vector3::new(0.1, -0.2, 0.3),
            inertia: Matrix3::new(0.03, 0.002, 0.0, 0.002, 0.04, -0.001, 0.0, -0.001, 0.05),
        };
        let same = Inertial::nearest(&body.parameters(), 0.1);
        assert!((same.inertia - body.inertia).norm() < 1e-12);
        assert!((same.centre - body.centre).norm() < 1e-12);
        // A rod without thickness, and more: its moments across exceed what its length allows.
        let mut parameters = body.parameters();
        parameters[9] += 0.5;
        let made = Inertial::nearest(&parameters, 0.1);
        let mut moments = made.inertia.symmetric_eigenvalues();
        moments.as_mut_slice().sort_by(f64::total_cmp);
        assert!(moments[0] > 0.0 && moments[0] + moments[1] >= moments[2]);
        assert_eq!((made.mass, made.centre), (same.mass, same.centre));
        parameters[0] = -1.0;
        assert_eq!(Inertial::nearest(&parameters, 0.1).mass, 0.1);
    }
}
