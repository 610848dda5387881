//! The twin of a cell's geometry: kinematic chain from its robot description, probe, part and contact.
//!
//! Metres and radians. Source of the formulas: interface contract ("Frames and the machine model") and section D.2 of
//! the domain specification. No dynamics and no file or bus access; what drives away from this model is named by
//! `diagnosis`.

pub mod access;
pub mod chain;
pub mod contact;
pub mod deviation;
pub mod head;
pub mod inverse;
pub mod kinematics;
pub mod links;
pub mod models;
pub mod volumetric;

pub use access::{Access, Aim};
pub use chain::{Chain, ChainError, Joint, JointKind, Side};
pub use contact::Surface;
pub use deviation::{DeviationError, Nominal, deviation, touch_positions};
pub use head::{HEAD_AXES, SwivelHead};
pub use inverse::{ReachError, Target};
pub use kinematics::{ChainErrors, NO_TWIST, PositionError, Sensitivity, Twist, displacement};
pub use links::{LinkError, LinkNameError};
pub use volumetric::{Correction, Volumetric};
