//! Displacements of finite size: errors of the chain through the whole chain instead of through its derivatives.
//!
//! A column holds the derivative at zero error. A part that lies tilted by ε displaces the ball by ½·ε²·lever in addition:
//! 1 µm at 5 mrad and 0.1 m, which is more than the noise. The same holds for the location errors of an arm. Metres,
//! radians; displacements in the part frame.

use machine::{Chain, ChainErrors};
use nalgebra::Vector3;

use crate::observation::Observations;
use crate::variant::{ChainError, Variant};

/// Errors of the chain at definite values.
pub struct FiniteErrors {
    probing: ChainErrors,
    cutting: ChainErrors,
}

impl FiniteErrors {
    /// No error of a chain.
    pub fn none(chain: &Chain) -> Self {
        let none = ChainErrors::none(chain.joints().len());
        Self {
            probing: none.clone(),
            cutting: none,
        }
    }

    /// Adds the parameters of a variant (in their units); false where they are no errors of the chain.
    pub fn add(&mut self, variant: &Variant, values: &[f64]) -> bool {
        for (error, value) in variant.errors.iter().zip(values) {
            match *error {
                ChainError::Part(component) => self.probing.part[component] += value,
                ChainError::Ball(component) => self.probing.ball[component] += value,
                ChainError::Location { joint, component } => {
                    self.probing.location[joint][component] += value;
                    self.cutting.location[joint][component] += value;
                }
            }
        }
        !variant.errors.is_empty()
    }

    /// Displacement of the ball against the part in each row, probing less cutting, m.
    pub fn shifts(&self, observations: &Observations) -> Vec<Vector3<f64>> {
        let (chain, nominal) = (&observations.chain, &observations.nominal);
        let shift = |positions: &[f64], errors: &ChainErrors| {
            let (part, ball) = (&nominal.part_pose, &nominal.ball);
            chain.ball_in_part_with(positions, part, ball, errors)
                - chain.ball_in_part(positions, part, ball)
        };
        let of = |row: &crate::observation::Row| {
            let probing = (row.pose.as_ref()).map(|pose| shift(&pose.latched, &self.probing));
            let cutting = (row.cut.as_ref()).map(|pose| shift(&pose.positions, &self.cutting));
            probing.unwrap_or_default() - cutting.unwrap_or_default()
        };
        observations.rows.iter().map(of).collect()
    }
}
