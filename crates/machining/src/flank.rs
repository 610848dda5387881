//! Accuracy of flank milling: from cutter locations and the radius a tool really has to the surface it leaves.
//!
//! Metres and radians, part frame; deviations along the outward normal, + where material is left.
//! `docs/source_systems.md, E`: contact points of nominal and erring paths
//! ([`contact`], equations (1)–(9)), run-out ([`runout`]), how a planar test finds it
//! ([`RadiusProfile`]), two test parts ([`parts`]), and a path that makes up for it
//! ([`Regenerated`]). The surface that is really left is found apart, from the distance to the moving axis ([`swept`]).
//! Rigid tools: no deflection, no wear.

pub mod contact;
pub mod parts;
mod path;
mod profile;
mod regenerated;
pub mod runout;
pub mod simulated;
pub mod swept;

pub use contact::{contact_point, envelope_error, envelope_normal, normal_error, path_normal};
pub use parts::{ConeFrustum, RuledPart, SPiece};
pub use path::{ErringPath, FlankPath, Location, Mirrored, PathError};
pub use profile::{ProfileError, RadiusProfile};
pub use regenerated::Regenerated;
pub use runout::Runout;
pub use swept::material_left;
