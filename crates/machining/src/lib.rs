//! What a cutter leaves on the part, and what a machine's own cuts and touches say of its errors.
//!
//! ```text
//!   link errors (ISO 230-1) ── mismatch: two cuts that should meet ── step between them
//!                           └─ calibration: touches of balls ──────── link errors, with covariance
//!   tool: radius over height, run-out ── flank: envelope of the path ── deviation of the machined surface
//! ```
//!
//! | question | module | source |
//! |---|---|---|
//! | Which location errors do touches of balls show? | [`calibration`] | ISO 230-1, ISO 10360-3; outliers by studentised residuals |
//! | Which do steps between two cuts show? | [`mismatch`] | `docs/source_systems.md`, D |
//! | How accurate is flank milling with this tool? | [`flank`] | `docs/source_systems.md`, E |
//!
//! Metres and radians, part frame; a deviation is positive where material is left. Chains and their errors come from
//! `machine`. No cutting forces, no messages, no files; random sequences start from a seed that is passed in.
//!
//! A tool that is measured 3 µm too small on both faces of a rib, and how far a set-up offset of 2 µm would mislead the
//! test of one face alone:
//!
//! ```
//! use machining::flank::RadiusProfile;
//!
//! let heights = [5e-3, 15e-3, 25e-3];
//! let (material_left, offset) = (3e-6, 2e-6);
//! let plus = [material_left + offset; 3];
//! let minus = [material_left - offset; 3];
//! let both = RadiusProfile::from_two_faces(&heights, &plus, &minus)?;
//! assert!((both.at(10e-3) + 3e-6).abs() < 1e-12);
//! let one = RadiusProfile::from_one_face(&heights, &plus)?;
//! assert!((one.at(10e-3) + 5e-6).abs() < 1e-12);
//! # Ok::<(), machining::flank::ProfileError>(())
//! ```

pub mod flank;
pub mod location_errors;
pub mod mismatch;
