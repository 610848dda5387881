//! The path again, for the radius the tool really has.
//!
//! Metres. R_i = R + ΔR_i varies along the height, a rigid axis can only move and lean: the location is shifted outwards
//! by a and leant by b, a + bZ the line nearest the profile over the heights in use. What the profile departs from that
//! line stays on the part. The errors of the machine are not touched here; `machine::Volumetric` is for them.

use nalgebra::{Unit, Vector3};

use super::contact::path_normal;
use super::path::{FlankPath, Location};
use super::profile::RadiusProfile;

/// A path moved so that a tool with a known radius profile leaves what the nominal tool would.
#[derive(Debug, Clone)]
pub struct Regenerated<P> {
    nominal: P,
    offset: f64,
    lean: f64,
}

impl<P: FlankPath> Regenerated<P> {
    /// `profile` as it is used between heights `from` and `to` (m).
    pub fn new(nominal: P, profile: &RadiusProfile, from: f64, to: f64) -> Self {
        let (offset, lean) = profile.line(from, to);
        Self {
            nominal,
            offset,
            lean,
        }
    }

    /// Shift outwards at the tip (m) and lean outwards (rad) of every location.
    pub fn moved(&self) -> (f64, f64) {
        (self.offset, self.lean)
    }
}

impl<P: FlankPath> FlankPath for Regenerated<P> {
    fn domain(&self) -> (f64, f64) {
        self.nominal.domain()
    }

    fn location(&self, u: f64) -> Location {
        let location = self.nominal.location(u);
        // Where the path stands there is no direction to move in.
        let Some(normal) = path_normal(&self.nominal, u) else {
            return location;
        };
        let outward = -normal.into_inner();
        Location {
            point: location.point + outward * self.offset,
            axis: Unit::new_normalize(location.axis.into_inner() + outward * self.lean),
        }
    }

    fn towards_part(&self, u: f64) -> Vector3<f64> {
        self.nominal.towards_part(u)
    }
}
