//! Metrology as pure mathematics: from measured points to features, verdicts, corrections and uncertainties.
//!
//! Lengths are metres, angles radians, points `nalgebra` vectors in one Cartesian frame of the caller's choice; a
//! deviation is positive where material is left. The crate knows no messages, machine, clock or file; every
//! function is deterministic, random sequences start from a seed that is passed in. Equation numbers of the form
//! "A.3" refer to the system descriptions in each module's documentation.

pub mod statistics;
pub mod uncertainty;

pub mod alignment;
pub mod datum;
pub mod fit;
pub mod solver;

pub mod band;
pub mod conformance;
pub mod decision;

pub mod calibration;
pub mod cut;
pub mod probe;
pub mod size_gap;

pub mod autocorrelation;

pub mod profile;
pub mod separation;
pub mod slip;
