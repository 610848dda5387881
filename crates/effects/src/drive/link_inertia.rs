//! `drive.link_inertia`: inertial parameters of the links other than declared.
//!
//! One family of ten parameters a link, whose sizes shrink towards the description (base parameters: Gautier and Khalil 1990).
//! Those that differ from the description for sure are reported first.

use super::acts_on;
use crate::effect::{Definition, Effect};

pub(super) struct LinkInertia;

impl Effect for LinkInertia {
    fn definition(&self) -> Definition {
        Definition {
            id: "drive.link_inertia",
            name: "masses and inertias of the links other than declared",
            remedy: "write the identified inertial parameters into the robot description",
            parameters: &[
                ("mass", "kg", 10.0),
                ("first_moment", "kg m", 3.0),
                ("inertia", "kg m²", 3.0),
            ],
            acts_on: acts_on(),
        }
    }
}
