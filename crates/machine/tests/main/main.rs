//! Kinematics, geometry and times of machines against forms written out by hand and other programs.
//!
//! - `bad_descriptions`: a robot description that is not a machine is refused in a sentence
//! - `five_axis`: the chain against the closed-form Jacobian and the sensitivity table of the source
//! - `geometry`: distances against a walk along moves in small steps
//! - `link_errors`: link errors, their compensation and the swivel head against forms written out by hand
//! - `motion`: times of profiles against textbook formulas and integration
//! - `nominal_deviation`: deviations of all touches of the development sessions against NumPy
//! - `postures`: inverse kinematics of arms: closed forms, the forward chain and a search against each other

#![allow(clippy::unwrap_used, reason = "a test stops at what should not happen")]

mod bad_descriptions;
mod five_axis;
mod geometry;
mod link_errors;
mod motion;
mod nominal_deviation;
mod postures;
