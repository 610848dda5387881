//! `drive.droop`: a position that hangs behind its command under the weight that the joint carries.
//!
//! A proportional controller without integral part yields by the effort over its stiffness; the effort is that of weight, linear
//! in the masses and first moments of the links, and of what the tip presses on below a height.

use super::acts_on;
use crate::effect::{Definition, Effect};

pub(super) struct Droop;

impl Effect for Droop {
    fn definition(&self) -> Definition {
        Definition {
            id: "drive.droop",
            name: "droop under weight",
            remedy: "give the position controller an integral part or a gravity feed-forward",
            parameters: &[("at_mean_weight", "m or rad", 0.3)],
            acts_on: acts_on(),
        }
    }
}
