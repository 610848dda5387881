//! What is known of the part as bodies, the stylus that must not hit them, and whether it passes them on a move.
//!
//! ```text
//!   probe mount o           one line: ball, stem, probe body (shafts with round ends)
//!               |
//!               |   stem
//!              (_)  ball       ___
//!      ________   ____________|   |____    bodies of the part: block with bores, shaft, ball, disc;
//!     |        | |  bore      boss     |   each by a lower bound of the distance from it
//!     |________|_|_____________________|
//! ```
//!
//! There is one model of distances: a [`Body`] bounds the distance of a point from below, a [`Stylus`] the distance of
//! ball and shafts from a body, and a move is clear where that distance, halved again and again on the way
//! (conservative advancement; B. Mirtich, "Impulse-based dynamic simulation of rigid body systems", 1996), is nowhere
//! less than it must be. [`Surroundings`] asks it of moves of the axes, and [`crate::access`] of touches one by one. Bodies come from the touches of a plan: nothing is
//! known beyond them, neither table nor clamps nor the machine itself. Metres, radians, part frame.

mod body;
mod part;
mod passage;
mod stylus;
mod surroundings;

pub use body::{Body, Face, Line};
pub(crate) use part::is_plane;
pub use part::{Contact, bodies};
pub use passage::passes;
pub use stylus::{Stylus, StylusPose};
pub use surroundings::Surroundings;

/// Points within this distance are the same, m.
pub(crate) const SAME: f64 = 1e-6;
